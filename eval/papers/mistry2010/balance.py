"""What moves the base beside the joints: [M10] eqs. (19)-(20), and a stabiliser of ours."""

from dataclasses import dataclass

import numpy as np

from eval.papers.trial import Memory
from fbid_gym.control import operational_space_acceleration, task_acceleration
from fbid_gym.dynamics.contacts import ReducedContacts
from fbid_gym.dynamics.frames import quaternion_to_matrix, rotation_vector
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


@dataclass(frozen=True, eq=False)
class Stabiliser:
    """Not in the paper: the centre of mass, the height and tilt of the trunk, and the joints.

    All return to the reference with it as feedforward, each critically damped. With limited contact
    forces this drives the centre of pressure to the edge of the soles as soon as a push demands it,
    which is the best that feet which stay in place can do.

    Attributes:
        support: of the robot.
        com: rad/s, of the centre of mass's x and y.
        height: rad/s, of the base's height.
        tilt: rad/s, of the base's orientation.
        posture: rad/s, of the joints.
    """

    support: Support
    com: float
    height: float
    tilt: float
    posture: float

    @classmethod
    def of(
        cls,
        robot: Robot,
        com: float = 2.0,
        height: float = 1.2,
        tilt: float = 1.2,
        posture: float = 1.0,
    ) -> "Stabiliser":
        """From frequencies in Hz."""
        omega = 2.0 * np.pi * np.array([com, height, tilt, posture])
        return cls(Support.of(robot), *omega.tolist())

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
        turn = frame.rotation

        def seen(vector: np.ndarray) -> np.ndarray:
            return np.vecmat(vector, turn)

        base = seen(terms.base_position - frame.centre)
        memory["base"], memory["base_target"] = base[:, :2], reference.qpos[:, :2]
        linear = reference.com_acceleration + _returning(
            self.com,
            reference.com - seen(terms.com - frame.centre),
            reference.com_velocity - seen(terms.com_velocity),
        )
        linear[:, 2] = reference.qacc[:, 2] + _returning(
            self.height,
            reference.qpos[:, 2] - base[:, 2],
            reference.qvel[:, 2] - seen(state.qvel[:, :3])[:, 2],
        )
        upright = turn @ quaternion_to_matrix(reference.qpos[:, 3:7])
        error = rotation_vector(terms.base_rotation.swapaxes(1, 2) @ upright)
        acceleration = reference.qacc.copy()
        acceleration[:, :3] = np.matvec(turn, linear)
        acceleration[:, 3:6] += _returning(
            self.tilt, error, reference.qvel[:, 3:6] - state.qvel[:, 3:6]
        )
        acceleration[:, 6:] += _returning(
            self.posture,
            reference.qpos[:, 7:] - state.qpos[:, 7:],
            reference.qvel[:, 6:] - state.qvel[:, 6:],
        )
        return acceleration


def _returning(omega: float, error: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Critically damped return of an error."""
    return omega**2 * error + 2.0 * omega * rate
