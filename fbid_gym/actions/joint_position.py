"""Layer `joint_position`: the action moves the target of a joint PD controller."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.layer import Memory
from fbid_gym.actions.options import positive
from fbid_gym.actions.stance import (
    holding_torque,
    own_inertia,
    sampled_growth,
    stance_inertia,
)
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.errors import InvalidValueError
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
        scale: rad (m for slides) at action 1.
        natural_frequency: Hz, of the response that the gains give.
    """

    robot: Robot
    hold: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    scale: float
    natural_frequency: float

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

        K_P = I (2 pi f)^2 and K_D = 2 zeta I (2 pi f) with I the inertia that the joint moves while
        its foot stands (`stance_inertia`). K_D stays below the inertia that the joint moves in the
        air times the control rate, beyond which sampled damping itself oscillates.

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
        positive(damping_ratio=damping_ratio)
        most = _steady_frequency(robot, control_hz, damping_ratio)
        if natural_frequency is None:
            pendulum = np.sqrt(robot.weight / robot.mass / Support.of(robot).home_com[2])
            natural_frequency = min(_STIFFER_THAN_FALLING * pendulum / (2.0 * np.pi), most)
        positive(natural_frequency=natural_frequency, damping_ratio=damping_ratio, scale=scale)
        if natural_frequency > most:
            raise InvalidValueError(
                "natural_frequency",
                natural_frequency,
                f"at most {most:.3g} Hz at {control_hz} control ticks per second: beyond, "
                f"{robot.name} oscillates in the air",
            )
        stiffness, damping = _gains(robot, control_hz, natural_frequency, damping_ratio)
        return cls(
            robot,
            hold=holding_torque(robot),
            stiffness=stiffness,
            damping=damping,
            scale=scale,
            natural_frequency=natural_frequency,
        )

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
        error = reference.qpos[:, 7:] + self.scale * action - state.qpos[:, 7:]
        rate = reference.qvel[:, 6:] - state.qvel[:, 6:]
        return self.hold + self.stiffness * error + self.damping * rate


def _gains(
    robot: Robot, control_hz: int, natural_frequency: float, damping_ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    """K_P and K_D (n,), see `JointPosition.of`."""
    inertia, omega = stance_inertia(robot), 2.0 * np.pi * natural_frequency
    damping = 2.0 * damping_ratio * omega * inertia
    return inertia * omega**2, np.minimum(damping, own_inertia(robot) * control_hz)


def _steady_frequency(robot: Robot, control_hz: int, damping_ratio: float) -> float:
    """Largest natural frequency (Hz) whose gains, sampled, let every mode decay in the air.

    Gains of the stance are high for what a joint moves in the air, the foot above all.
    """
    low, high = 0.0, float(control_hz)
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        gains = _gains(robot, control_hz, middle, damping_ratio)
        if sampled_growth(robot, *gains, control_hz) < 1.0:
            low = middle
        else:
            high = middle
    return low
