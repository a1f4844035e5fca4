"""What moves the base beside the joints: [M10] eqs. (19)-(20)."""

from dataclasses import dataclass

import numpy as np

from eval.papers.trial import Memory
from fbid_gym.control import operational_space_acceleration, task_acceleration
from fbid_gym.dynamics.contacts import ReducedContacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class BaseTask:
    """Eqs. (19) and (20): the contacts stay, the base's x and y return to the reference's.

    What is left is at rest: the acceleration of least norm, in which the reference has no part.
    The memory gets "base" and "base_target", (N, 2) m in the frame of the feet.

    Attributes:
        support: of the robot.
        stiffness: K_P, 1/s^2.
        damping: K_D, 1/s.
    """

    support: Support
    stiffness: float
    damping: float

    @classmethod
    def of(cls, robot: Robot, hertz: float) -> "BaseTask":
        """Critically damped, of this natural frequency."""
        omega = 2.0 * np.pi * hertz
        return cls(Support.of(robot), omega**2, 2.0 * omega)

    def __call__(
        self,
        state: RobotState,
        terms: DynamicsTerms,
        reference: Reference,
        contacts: ReducedContacts,
        memory: Memory,
    ) -> np.ndarray:
        """See `Motive`."""
        frame = self.support.frame(terms)
        base = np.vecmat(terms.base_position - frame.centre, frame.rotation)
        memory["base"], memory["base_target"] = base[:, :2], reference.qpos[:, :2]
        there = frame.centre + np.matvec(frame.rotation, reference.qpos[:, :3])
        task = task_acceleration(
            there[:, :2],
            terms.base_position[:, :2],
            state.qvel[:, :2],
            self.stiffness,
            self.damping,
        )
        xy = np.eye(state.qvel.shape[1])[:2]
        found = operational_space_acceleration(contacts.jacobian, contacts.bias, xy, None, task)
        return np.asarray(found.motion)
