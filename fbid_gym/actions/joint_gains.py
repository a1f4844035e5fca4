"""Joint PD controllers: gains from a response of the home stance, or those of a file's servos."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.linalg

from fbid_gym.actions.joint_motion import JointTarget
from fbid_gym.actions.ranges import Falling, in_hertz
from fbid_gym.compiled import kernel
from fbid_gym.dynamics.contacts import point_jacobian
from fbid_gym.dynamics.passive_joints import PassiveJoints, give_back
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import WALK_CYCLE, MotionKind
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot

SERVO = "servo"
"""In place of a natural frequency: the gains of the file's servos."""

_NEAR_GROWTH = 0.75
_MOSTLY, _CALMED, _FIRM = 0.5, 0.4, 2.5
_FELT = 0.1  # of the controller's damping
_LEAST_RATIO = 0.2  # of the damping, where ankles are to yield
_USUAL, _WALKING_ON_SOLES = Falling(3.4), Falling(2.5)

_RANK = 1e-9


class JointGains(NamedTuple):
    """K_P = I (2 pi f)^2 and K_D = 2 zeta I (2 pi f), of every joint, as far as sampling allows.

    I is the inertia that the joint moves while its foot stands (`Stance.standing_inertia`); in the
    air it moves far less, a foot above all. So both are limited: joint by joint to the dead-beat
    gains of what it moves in the air, with which one joint comes to rest in two ticks; and together
    to three quarters of those limits with which the robot in the air would begin to oscillate.
    With a delay of the loop, the tick that these limits are of is longer by twice the delay: the
    age of a torque while it acts is half a tick, and the delay.

    Attributes:
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad.
        drag: (n,) N·m·s/rad, what the joints' own damping takes of the target's rates.
        natural_frequency: f, Hz; infinite for gains that come from elsewhere.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    drag: np.ndarray
    natural_frequency: float

    @classmethod
    def of_servos(cls, robot: Robot, control_hz: int, loop_delay: float = 0.0) -> "JointGains":
        """Take the gains of the file's servos.

        Raises:
            InvalidValueError: see `servo_fault`.
        """
        servos, fault = robot.servo_gains, servo_fault(robot, control_hz, loop_delay)
        if servos is None or fault:
            raise InvalidValueError("natural_frequency", SERVO, f"a number in Hz: {fault}")
        none = np.zeros(robot.num_joints)
        return cls(servos.stiffness.copy(), servos.damping.copy(), none, np.inf)

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        natural_frequency: float | Falling,
        damping_ratio: float,
        loop_delay: float = 0.0,
    ) -> "JointGains":
        """Derive the gains of a natural frequency, in Hz or in units of falling, and a zeta.

        Torques answer the state after a `loop_delay` (s).

        Raises:
            InvalidValueError: beyond what any joint can be held with.
        """
        frequency = in_hertz(robot, natural_frequency)
        inertia, omega = Stance.of(robot).standing_inertia, 2.0 * np.pi * frequency
        damping, none = 2.0 * damping_ratio * omega * inertia, np.zeros(robot.num_joints)
        wanted = cls(inertia * omega**2, damping, none, float(frequency))
        gains = _steady(robot, control_hz, wanted, loop_delay)
        if np.all(gains.stiffness < wanted.stiffness):
            most = np.sqrt((gains.stiffness / inertia).max()) / (2.0 * np.pi)
            late = f" and {loop_delay:g} s of delay" if loop_delay else ""
            raise InvalidValueError(
                "natural_frequency",
                frequency,
                f"at most {most:.3g} Hz at {control_hz} control ticks per second{late}: beyond, no "
                f"joint of {robot.name} can be held so firmly without oscillating in the air",
            )
        return gains


@kernel
def feedback(
    gains: JointGains,
    added: np.ndarray,
    added_rate: np.ndarray,
    held: np.ndarray,
    state: RobotState,
    target: JointTarget,
) -> np.ndarray:
    """Return held + K_P (q_t + added - q) + K_D (qdot_t + added_rate - qdot) + d qdot_t: (N, n).

    `added` is (N, n) rad (m for slides), `added_rate` (N or 1, n) per s, `held` (N or 1, n) N·m.
    The target has one row for each robot or one for all.
    """
    torque = np.empty(added.shape)
    for i in range(len(torque)):
        row, own = min(i, len(target.qpos) - 1), min(i, len(added_rate) - 1)
        base = min(i, len(held) - 1)
        for j in range(len(gains.stiffness)):
            error = target.qpos[row, 7 + j] + added[i, j] - state.qpos[i, 7 + j]
            rate = target.qvel[row, 6 + j] + added_rate[own, j] - state.qvel[i, 6 + j]
            torque[i, j] = held[base, j] + gains.stiffness[j] * error + gains.damping[j] * rate
            torque[i, j] += gains.drag[j] * target.qvel[row, 6 + j]
    return torque


def at_joints(gains: JointGains, state: RobotState) -> np.ndarray:
    """Return the part of `feedback` that drives make of their own joints: -K_P q - K_D qdot."""
    return -gains.stiffness * state.qpos[:, 7:] - gains.damping * state.qvel[:, 6:]


def closed_in_drives(in_drives: bool | None, loop_delay: float) -> bool:
    """Return whether drives close a loop: as told, or where the layer knows of no delay.

    Raises:
        InvalidValueError: drives that answer after a delay.
    """
    if in_drives and loop_delay:
        expected = "0 with in_drives=True: drives answer their joints without delay"
        raise InvalidValueError("loop_delay", loop_delay, expected)
    return not loop_delay if in_drives is None else in_drives


def servo_fault(robot: Robot, control_hz: int, loop_delay: float = 0.0) -> str:
    """Say why the gains of the file's servos do not serve; an empty string if they do.

    They do where they hold every joint and let every mode decay in the air, sampled, with the help
    of the joints' own damping.
    """
    servos = robot.servo_gains
    if servos is None or not np.all(servos.stiffness > 0.0):
        return f"{robot.name} came without position servos on all joints"
    damping = servos.damping + robot.joint_damping
    if sampled_growth(robot, servos.stiffness, damping, control_hz, loop_delay) >= 1.0:
        late = f" {loop_delay:g} s late" if loop_delay else ""
        return f"sampled at {control_hz} Hz{late}, the servos of {robot.name} oscillate in the air"
    return ""


def servos_carry(robot: Robot) -> bool:
    """Return whether the file's servos are stiff enough to carry the robot through a gait.

    On half of its feet, that is, and firmly: by twice the pull of its weight a Go1 falls.
    """
    if robot.servo_gains is None:
        return False
    stance, standing = Stance.of(robot), max(robot.num_feet // 2, 1)
    needed = _FIRM * robot.weight * float(stance.home_com[2]) / standing
    return bool(np.all(robot.servo_gains.stiffness[stance.legs.any(axis=0)] >= needed))


def fed_drag(robot: Robot, gains: JointGains) -> JointGains:
    """Return gains that make up for the joints' own damping of the target's rates.

    Where it is little beside that of the controller they do not: there it only adds to that. On
    soles it is left to hold the ankles.
    """
    damping = robot.joint_damping * (not robot.has_soles)
    return gains._replace(drag=np.where(damping > _FELT * gains.damping, damping, 0.0))


def missing_damping(gains: JointGains) -> float:
    """Return two fifths of what damping lacks to be critical, as a time beside stiffness, s.

    Light legs, that is, joints without armature, can be damped by little at the rate of control.
    Where that is most of it, the base, which is heavy, can be damped instead. Servos lack none.
    """
    if np.isinf(gains.natural_frequency):
        return 0.0
    omega = 2.0 * np.pi * gains.natural_frequency
    wanted = 2.0 / omega
    lacking = float(np.median(wanted - gains.damping / gains.stiffness))
    return _CALMED * lacking if lacking > _MOSTLY * wanted else 0.0


def _steady(robot: Robot, control_hz: int, wanted: JointGains, loop_delay: float) -> JointGains:
    """Limit gains, see `JointGains`."""
    # One joint of inertia I, sampled every T, comes to rest in two ticks with K_P = I / T^2 and
    # K_D = 1.5 I / T.
    rate = control_hz / (1.0 + 2.0 * loop_delay * control_hz)
    most = rate / np.diag(_mobility(robot))

    def limited(share: float) -> JointGains:
        stiffness = np.minimum(wanted.stiffness, share * rate * most)
        return wanted._replace(
            stiffness=stiffness, damping=np.minimum(wanted.damping, 1.5 * share * most)
        )

    def steady(share: float) -> bool:
        gains = limited(share)
        growth = sampled_growth(robot, gains.stiffness, gains.damping, control_hz, loop_delay)
        return growth < 1.0

    return limited(greatest_share(steady))


def greatest_share(steady: Callable[[float], bool]) -> float:
    """Return three quarters of the greatest share of gains, up to 4/3, that is steady."""
    low, high = 0.0, 1.0 / _NEAR_GROWTH
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        if steady(middle):
            low = middle
        else:
            high = middle
    return _NEAR_GROWTH * low


def damped_enough(stiffness: np.ndarray, damping: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Return stiffness (n,), as much of it as is damped with a fifth of the critical damping.

    Ankles can be as stiff as the body above asks for, but in the air they carry a light foot, which
    sampling lets damp by little. Where a pendulum's force balances the body, they need not be.
    """
    most: np.ndarray = damping**2 / (4.0 * _LEAST_RATIO**2 * inertia)
    return np.minimum(stiffness, most)


def default_frequency(kind: MotionKind, robot: Robot) -> Falling:
    """Return the natural frequency of joints unless told otherwise.

    On soles a gait balances by its centre of pressure: stiff legs fight it.
    """
    return _WALKING_ON_SOLES if kind.gait and robot.has_soles else _USUAL


def as_quick_as_steps(
    kind: MotionKind, robot: Robot, control_hz: int, loop_delay: float = 0.0
) -> Falling:
    """Return the natural frequency of joints that follow the feet, unless told otherwise.

    On a gait on soles it is as much above `default_frequency` as steps are quicker than in a slow
    walk; but only where some joint of the legs can be damped critically then. Legs that sampling
    lets swing do better without.
    """
    usual = default_frequency(kind, robot)
    quick = Falling(usual.times * WALK_CYCLE / kind.cycle)
    if not (kind.gait and robot.has_soles) or quick <= usual:
        return usual
    try:
        gains = JointGains.of(robot, control_hz, quick, 1.0, loop_delay)
    except InvalidValueError:
        return usual
    stance = Stance.of(robot)
    critical = 2.0 * np.sqrt(gains.stiffness * stance.standing_inertia)
    calm = gains.damping > (1.0 - _RANK) * critical
    return quick if np.any(calm & stance.legs.any(axis=0)) else usual


def _mobility(robot: Robot) -> np.ndarray:
    """Inverse inertia (n, n) of the joints of a robot that hangs in the air at home."""
    return np.linalg.inv(Stance.of(robot).terms.mass_matrix[0])[6:, 6:]


def holding_torque(robot: Robot) -> np.ndarray:
    """Return the torques that keep the home stance in equilibrium: (n,) N·m.

    With what the springs of the joints do, they are the least that do, or that come closest:
    [M10] eq. (15) once more, because for one robot at rest its law is not worth compiling.
    """
    stance = Stance.of(robot)
    mass_matrix, bias = stance.terms.mass_matrix[0], stance.terms.bias[0]
    jacobian, _ = point_jacobian(stance.geometry, stance.terms)
    free = scipy.linalg.null_space(jacobian[0], rcond=_RANK)  # what the contacts let move
    yields = free @ np.linalg.solve(free.T @ mass_matrix @ free, free.T)  # how much, by a force
    torque, *_ = np.linalg.lstsq(yields[:, 6:], yields @ bias, rcond=_RANK)
    rest = np.zeros((1, robot.nv))
    return give_back(PassiveJoints.of(robot), torque[None], robot.home_qpos[None], rest)[0]


def sampled_growth(
    robot: Robot,
    stiffness: np.ndarray,
    damping: np.ndarray,
    control_hz: int,
    loop_delay: float = 0.0,
) -> float:
    """Return how much a joint PD controller's motion grows from tick to tick, at worst.

    The robot hangs in the air in its home posture, and torques are held for a tick: the spectral
    radius of that linear system, below 1 if every mode decays. Torques that wait are part of its
    state; one that arrives within a tick acts as the mean of the old and the new one.

    Stiffness is (n,) N·m/rad, or a matrix (n, n), damping (n,) N·m·s/rad, `loop_delay` s from the
    state to the torque that answers it.
    """
    mobility = _mobility(robot)
    stiff = mobility * stiffness if stiffness.ndim == 1 else mobility @ stiffness
    return growth(stiff, mobility * damping, control_hz, loop_delay)


def growth(stiff: np.ndarray, damped: np.ndarray, control_hz: int, loop_delay: float) -> float:
    """Return the growth of motion in a tick where torques answer it as `sampled_growth` says.

    `stiff` (k, k) 1/s^2 are the accelerations back for each displacement, `damped` (k, k) 1/s
    those for each velocity.
    """
    tick, size = 1.0 / control_hz, len(stiff)
    ticks = round(loop_delay * control_hz, 6)
    whole, waiting = int(ticks), int(np.ceil(ticks))
    width = (2 + waiting) * size
    none = np.zeros((size, waiting * size))
    # Accelerations that are asked for now, and were one, two, ... ticks ago, of the state.
    asked = [np.hstack([-stiff, -damped, none])]
    asked += [np.eye(size, width, (2 + age) * size) for age in range(waiting)]
    rest = ticks - whole
    acting = (1.0 - rest) * asked[whole] + rest * asked[min(whole + 1, waiting)]
    place = np.eye(size, width) + tick * np.eye(size, width, size) + tick**2 / 2 * acting
    rate = np.eye(size, width, size) + tick * acting
    step = np.vstack([place, rate, *asked[:waiting]])
    return float(np.abs(np.linalg.eigvals(step)).max())
