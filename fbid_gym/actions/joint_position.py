"""Layer `joint_position`: the action moves the target of a joint PD controller."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.joint_gains import (
    SERVO,
    JointGains,
    as_quick_as_steps,
    at_joints,
    closed_in_drives,
    damped_enough,
    fed_drag,
    feedback,
    holding_torque,
    missing_damping,
    servo_fault,
    servos_carry,
)
from fbid_gym.actions.joint_motion import JointMotion, JointTarget, LegJoints, find_joints
from fbid_gym.actions.layer import GetTerms, Memoryless
from fbid_gym.actions.pendulum import Pendulum, carry
from fbid_gym.actions.ranges import DampingRatio, Hertz, LoopDelay, TargetScale
from fbid_gym.compiled import kernel
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind, home_target
from fbid_gym.options import Choice, checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot

_DAMPING_RATIO = 1.0


@dataclass(frozen=True, eq=False)
class JointPosition(Memoryless):
    """tau = tau_home + K_P (q_t + scale * action - q) + K_D (qdot_t - qdot) + d qdot_t."""

    robot: Robot  # whose joints
    motion: JointMotion  # of the joints that are followed
    home: Target | None  # the home posture, followed instead; None where it is not
    # (n,) N·m that keep the home stance in equilibrium: the zero action rests there.
    hold: np.ndarray
    carries: Pendulum | None  # as which the legs carry the robot instead; None where `hold` does
    gains: JointGains  # of the joints
    scale: float  # rad (m for slides) at action 1
    in_drives: bool  # whether the motors' drives close the loop

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
        pendulum: bool | None = None,
        leg_weight: bool = True,
        loop_delay: LoopDelay = 0.0,
        in_drives: bool | None = None,
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
                the robot on half of its feet; else 3.4 times that at which it falls, see `Falling`,
                carried as a pendulum on soles 2.5 times, and 3.5 times in a brisk walk of strong
                legs that `control_hz` lets damp. Stiffer joints take harder pushes untrained, but
                turn exploration noise into falls.
            damping_ratio: zeta; of servos their own.
            scale: rad (m for slides) at action 1.
            pendulum: whether legs carry the weight along the line from the target's centre of
                pressure to the centre of mass, and stiff ankles yield to it; else by the torques of
                the home stance. Default: where feet leave the ground.
            leg_weight: whether a pendulum's legs also hold their own weight, as in the home pose;
                else, as in older runs, points hold nothing, soles the home stance's least torques.
            loop_delay: s from the state to the torque that answers it, for which gains are steady.
            in_drives: whether the motors' drives close the PD loop, as on most legged robots: they
                answer their joints at once, and what waits for a delay is their targets. Default:
                unless the layer is told of a `loop_delay`.

        Raises:
            InvalidValueError: out of range, beyond what any joint can be held with, a pendulum
                where the home posture is followed, or a delay of drives.
        """
        in_drives = closed_in_drives(in_drives, loop_delay)
        at_home = reference == "home"
        followed = kind._replace(gait=kind.gait and not at_home)
        if pendulum and at_home:
            expected = "False or None where the home posture is followed"
            raise InvalidValueError("pendulum", pendulum, expected)
        falls = kind.steps and not at_home if pendulum is None else pendulum
        servos = natural_frequency is None and servos_carry(robot)
        servos = servos and not servo_fault(robot, control_hz, loop_delay)
        if servos or natural_frequency == SERVO:
            if damping_ratio != _DAMPING_RATIO:
                expected = f"{_DAMPING_RATIO:g} beside the gains of the file's servos, which have "
                expected += "their own damping; or a natural_frequency in Hz"
                raise InvalidValueError("damping_ratio", damping_ratio, expected)
            gains = JointGains.of_servos(robot, control_hz, loop_delay)
        else:
            walks = kind._replace(gait=falls)
            frequency: Any = natural_frequency
            frequency = frequency or as_quick_as_steps(walks, robot, control_hz, loop_delay)
            gains = JointGains.of(robot, control_hz, frequency, damping_ratio, loop_delay)
        if falls and robot.has_soles:
            # Beside servos many files have all damping in the joints.
            damping = gains.damping + np.isinf(gains.natural_frequency) * robot.joint_damping
            most = damped_enough(gains.stiffness, damping, Stance.of(robot).standing_inertia)
            gains = gains._replace(stiffness=most)
        motion = JointMotion.of(
            robot, followed, default_gains(robot, kind), aware=False, calm=missing_damping(gains)
        )
        home, hold = home_target(robot) if at_home else None, holding_torque(robot)
        carries = Pendulum.of(robot, kind, leg_weight=leg_weight) if falls else None
        return cls(robot, motion, home, hold, carries, fed_drag(robot, gains), scale, in_drives)

    @property
    def natural_frequency(self) -> float | str:
        """Hz, of the response that the gains give; or "servo"."""
        return self.gains.natural_frequency if np.isfinite(self.gains.natural_frequency) else SERVO

    @property
    def pendulum(self) -> bool:
        """Whether its legs carry the robot as a pendulum."""
        return self.carries is not None

    @property
    def action_names(self) -> tuple[str, ...]:
        """One target a joint."""
        return tuple(
            f"target of {joint} from its reference (x {self.scale:g} rad)"
            for joint in self.robot.joint_names
        )

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        held = self.hold[None] if self.carries is None else carry(self.carries, target, terms())
        added = self.scale * action
        if self.motion.legs is not None:
            return _place_feet(self.motion.legs, self.gains, added, held, state, target, terms())
        still, followed = np.zeros((1, len(self.hold))), JointTarget.of(self.home or target)
        return feedback(self.gains, added, still, held, state, followed)

    def drive_torque(self, state: RobotState) -> np.ndarray | None:
        """See `ActionLayer`."""
        return at_joints(self.gains, state) if self.in_drives else None


@kernel
def _place_feet(
    legs: LegJoints,
    gains: JointGains,
    added: np.ndarray,
    held: np.ndarray,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
) -> np.ndarray:
    """Return the torques (N, n) N·m of `feedback` to the joints that place the feet of a gait."""
    still, followed = np.zeros((1, added.shape[1])), find_joints(legs, target, state, terms)
    return feedback(gains, added, still, held, state, followed)
