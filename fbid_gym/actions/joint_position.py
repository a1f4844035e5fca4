"""Layer `joint_position`: the action moves the target of a joint PD controller."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.joint_gains import (
    SERVO,
    JointGains,
    fed_drag,
    feedback,
    holding_torque,
    missing_damping,
    servo_fault,
    servos_carry,
)
from fbid_gym.actions.joint_motion import JointMotion
from fbid_gym.actions.ranges import DampingRatio, Falling, Hertz, TargetScale
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind, home_target
from fbid_gym.options import Choice, checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot

_FREQUENCY = Falling(3.4)
_DAMPING_RATIO = 1.0


@dataclass(frozen=True, eq=False)
class JointPosition:
    """tau = tau_home + K_P (q_t + scale * action - q) + K_D (qdot_t - qdot) + d qdot_t.

    Attributes:
        robot: whose joints.
        motion: of the joints that are followed.
        home: the home posture, followed instead; None where it is not.
        hold: (n,) N·m that keep the home stance in equilibrium: the zero action rests there.
        gains: of the joints.
        scale: rad (m for slides) at action 1.
    """

    robot: Robot
    motion: JointMotion
    home: Target | None
    hold: np.ndarray
    gains: JointGains
    scale: float

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        kind: MotionKind,
        *,
        reference: Annotated[str, Choice(("gait", "home"))] = "gait",
        natural_frequency: Annotated[float | str, Hertz(also=(SERVO,))] | None = None,
        damping_ratio: DampingRatio = _DAMPING_RATIO,
        scale: TargetScale = 0.3,
    ) -> "JointPosition":
        """Derive the gains from a second-order response of the home stance.

        See `JointGains`.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            reference: "gait", the task's target is followed; or "home", the home posture is.
            natural_frequency: f in Hz; or "servo", the gains that the file's servos had. Default:
                theirs, if they are steady at `control_hz` and 2.5 times as stiff as what carries
                the robot on half of its feet; else 3.4 times that at which it falls, see `Falling`.
                Stiffer joints take harder pushes untrained, but turn exploration noise into falls.
            damping_ratio: zeta; of servos their own.
            scale: rad (m for slides) at action 1.

        Raises:
            InvalidValueError: out of range, or beyond what any joint can be held with.
        """
        gains = _gains(robot, control_hz, natural_frequency, damping_ratio)
        at_home = reference == "home"
        followed = kind._replace(gait=kind.gait and not at_home)
        motion = JointMotion.of(
            robot, followed, default_gains(robot, kind), aware=False, calm=missing_damping(gains)
        )
        home = home_target(robot) if at_home else None
        return cls(robot, motion, home, holding_torque(robot), fed_drag(robot, gains), scale)

    @property
    def natural_frequency(self) -> float | str:
        """Hz, of the response that the gains give; or "servo"."""
        return self.gains.natural_frequency if np.isfinite(self.gains.natural_frequency) else SERVO

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
        target: Target,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        followed = self.home
        if followed is None:
            followed = self.motion.target(state, target, terms())
        rest = np.zeros((1, len(self.hold)))
        return self.hold + feedback(self.gains, self.scale * action, rest, state, followed)


def _gains(
    robot: Robot, control_hz: int, natural_frequency: Any, damping_ratio: float
) -> JointGains:
    carried = natural_frequency is None and servos_carry(robot)
    if carried and not servo_fault(robot, control_hz):
        natural_frequency = SERVO
    if natural_frequency == SERVO:
        if damping_ratio != _DAMPING_RATIO:
            expected = f"{_DAMPING_RATIO:g} beside the gains of the file's servos, which have their"
            expected += " own damping; or a natural_frequency in Hz"
            raise InvalidValueError("damping_ratio", damping_ratio, expected)
        return JointGains.of_servos(robot, control_hz)
    frequency = _FREQUENCY if natural_frequency is None else natural_frequency
    return JointGains.of(robot, control_hz, frequency, damping_ratio)
