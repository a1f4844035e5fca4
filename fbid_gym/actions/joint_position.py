"""Layer `joint_position`: the action moves the target of a joint PD controller."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.joint_gains import JointGains
from fbid_gym.actions.layer import Memory
from fbid_gym.actions.options import positive
from fbid_gym.actions.stance import holding_torque
from fbid_gym.compiled import kernel
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

_STIFFER_THAN_FALLING = 3.4


@dataclass(frozen=True, eq=False)
class JointPosition:
    """tau = tau_home + K_P (q_ref + scale * action - q) + K_D (qdot_ref - qdot).

    Attributes:
        robot: whose joints.
        hold: (n,) N·m that keep the home stance in equilibrium: the zero action rests there.
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad.
        natural_frequency: Hz, of the response that the gains give.
        scale: rad (m for slides) at action 1.
    """

    robot: Robot
    hold: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    natural_frequency: float
    scale: float

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        natural_frequency: float | None = None,
        damping_ratio: float = 1.0,
        scale: float = 0.3,
    ) -> "JointPosition":
        """Derive the gains from a second-order response of the home stance.

        See `JointGains`.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            natural_frequency: f in Hz. Default: 3.4 times that of the robot falling over, the
                pendulum frequency sqrt(g / height of the centre of mass) / (2 pi), or the largest
                that `control_hz` allows, if that is less. Stiffer joints take harder pushes
                untrained, but turn exploration noise into falls.
            damping_ratio: zeta.
            scale: rad (m for slides) at action 1.

        Raises:
            InvalidValueError: not positive, or so stiff that the sampled controller oscillates.
        """
        positive(scale=scale)
        gains = JointGains.of(
            robot, control_hz, natural_frequency, damping_ratio, _STIFFER_THAN_FALLING
        )
        return cls(robot, holding_torque(robot), *gains, scale=scale)

    @property
    def action_names(self) -> tuple[str, ...]:
        """One target a joint."""
        return tuple(
            f"target of {joint} from its reference (x {self.scale:g} rad)"
            for joint in self.robot.joint_names
        )

    diagnostics: tuple[str, ...] = ()

    def memory(self, num_robots: int) -> Memory:
        """Nothing to remember."""
        return {}

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        qpos, qvel = map(np.ascontiguousarray, state[:2])
        to_qpos, to_qvel = map(np.ascontiguousarray, reference[:2])
        torque = np.empty((len(qpos), len(self.hold)))
        _feedback(
            *(action, self.scale, self.hold, self.stiffness, self.damping),
            *(qpos, qvel, to_qpos, to_qvel, torque),
        )
        return torque


@kernel
def _feedback(
    action: np.ndarray,
    scale: float,
    hold: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    qpos: np.ndarray,
    qvel: np.ndarray,
    wanted_qpos: np.ndarray,
    wanted_qvel: np.ndarray,
    torque: np.ndarray,
) -> None:
    """Write torque (N, n); arguments of the layer, its state and its reference (N rows or one)."""
    for i in range(len(torque)):
        row = min(i, len(wanted_qpos) - 1)
        for j in range(len(hold)):
            error = wanted_qpos[row, 7 + j] + scale * action[i, j] - qpos[i, 7 + j]
            rate = wanted_qvel[row, 6 + j] - qvel[i, 6 + j]
            torque[i, j] = hold[j] + stiffness[j] * error + damping[j] * rate
