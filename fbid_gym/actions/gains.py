"""The one table of default gains: how firmly each layer holds robots to their target."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from fbid_gym.actions.ranges import DampingRatio, LoopDelay, Priority, Response, in_hertz
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Choice, Number, check_fields
from fbid_gym.quantities import BodyGains, Memory
from fbid_gym.robots import Robot

PARTS = ("balance", "height", "rotation", "posture", "swing")
"""What has a frequency of its own, by the names of `BodyGains`."""

PRIORITY_ACTION = "priority of the moment (x 4 at 1, / 4 at -1)"
"""Name of the entry of an action that changes it."""

_PRIORITY_RANGE = 4.0

_SMALL = 0.03  # of sqrt(gravity times height); where greater ones count as more, robots slip sooner
_OF_SOLE = 0.25  # likewise on soles, where less: of how far the pressure can shift, per height

# In units of the rate at which the robot falls, to the power of the unit. On points a robot has no
# ankles: what it does with its joints is all in its feet and its body, but where it has joints to
# spare. A gait on soles balances by its centre of pressure. Gaits damp velocities of the base.
_PLANNED = BodyGains(4.84, 6.6, 4, 6, 4, 6, 2.89, 5.1, 26, 10, 5, 0, _SMALL, 1e-3)
_GAIT = BodyGains(1, 4, 4.4, 3.4, 5.9, 4.3, 0, 0.34, 26, 10, 5, 4, _SMALL, 1e-2, of_base=1)
_ON_SOLES = BodyGains(0, 0, 7.84, 5.6, 6.25, 5, 4.84, 4.4, 49, 14, 2.9, 2, _SMALL, 1e-2, of_base=1)
_POWERS = BodyGains(2, 1, 2, 1, 2, 1, 2, 1, 2, 1, 1, 1, -1, 0)


def default_gains(robot: Robot, kind: MotionKind) -> BodyGains:
    """Return the gains that a robot has unless told otherwise."""
    table = _PLANNED if not kind.gait else _ON_SOLES if robot.has_soles else _GAIT
    if table is _GAIT and robot.num_joints > 3 * robot.num_feet:
        # It can move while its feet and its base stay where they are: a leg turns about its ends,
        # unless it is held as firmly as a foot in the air.
        table = table._replace(posture=table.swing, posture_damping=table.swing_damping)
    scaled = (gain * kind.omega**power for gain, power in zip(table, _POWERS, strict=True))
    gains, stance = BodyGains(*map(float, scaled)), Stance.of(robot)
    within = _OF_SOLE * float(stance.margin.min() / stance.home_com[2]) / kind.omega
    small = min(gains.small_error, within) if table is _ON_SOLES else gains.small_error
    return gains._replace(small_error=small * robot.gravity)


@dataclass(frozen=True)
class BodyOptions:
    """Options of the layers that command the body. None: by `default_gains`."""

    balance_frequency: Response | None = None
    """Hz, of the centre of mass's horizontal return to its target. This and the next four may be a
    pair, stiffness (1/s^2) and damping (1/s), but for the papers' balancers."""
    height_frequency: Response | None = None
    """Hz, of the vertical return: of the base, by the papers' balancers of the centre of mass."""
    rotation_frequency: Response | None = None
    """Hz, of the base's orientation."""
    posture_frequency: Response | None = None
    """Hz, of the joints; by the papers' balancers of those whose foot stands, or that have none."""
    swing_frequency: Response | None = None
    """Hz, of feet in the air; by the papers' balancers of their leg's joints."""
    damping_ratio: DampingRatio | None = None
    """zeta, of all five; of the papers' balancers 1.5 unless given."""
    moment_priority: Priority | None = None
    """Weight of squared errors of the moment on the base (per weight and mean distance of the
    contact points) beside one for the force (per weight), where the contacts cannot deliver both,
    as on two diagonal point feet. Less of it follows velocities more closely, and falls sooner when
    pushed."""
    velocity_gain: Annotated[float, Number(0.0, 100.0)] | None = None
    """By how much more small errors of the horizontal velocity are damped than large ones, in units
    of the rate at which the robot falls; None: on gaits 4 on points, 2 on soles. Small: to 0.03 of
    sqrt(gravity times height), less on short soles. Not for the papers' balancers."""
    velocity_of: Annotated[str, Choice(("com", "base"))] | None = None
    """Whose horizontal velocity is damped: the centre of mass's, as by the papers' balancers, or
    the base's, against which legs that swing move it, and which commands are about. None: the
    base's on a gait. With the other one `velocity_gain` is 0, `moment_priority` 0.05 on soles."""
    priority_action: bool = False
    """Whether one more entry of the action, after those of the body, multiplies `moment_priority`:
    by 4 at action 1, by a quarter at -1. Not for the papers' balancers, nor without limits of the
    contact forces."""
    loop_delay: LoopDelay = 0.0
    """s from a state to the torque that answers it: the law then acts on where the robot will be.
    Not for the papers' balancers."""
    action_units: Annotated[str, Choice(("contacts", "robot"))] = "contacts"
    """What 1 in the action means: "contacts", as much as the home stance can do; "robot", the same
    on all robots in their own units, for a policy of many: accelerations of half of gravity and of
    2 g / h, or half of the weight and of weight times h, h the height of the centre of mass."""

    def __post_init__(self) -> None:
        """Check them."""
        check_fields(self)

    @property
    def frequencies(self) -> dict[str, Any]:
        """What is given of each part, None among it."""
        return {part: getattr(self, f"{part}_frequency") for part in PARTS}

    def gains(self, robot: Robot, kind: MotionKind) -> BodyGains:
        """Return the gains that they ask for."""
        gains = default_gains(robot, kind)
        if self.velocity_of is not None and (self.velocity_of == "base") != (gains.of_base > 0.0):
            gains = gains._replace(small_errors=0.0, of_base=1.0 - gains.of_base)
        if self.velocity_gain is not None:
            gains = gains._replace(small_errors=self.velocity_gain * kind.omega)
        ratio = 1.0 if self.damping_ratio is None else self.damping_ratio
        for part, given in self.frequencies.items():
            stiffness, damping = getattr(gains, part), getattr(gains, f"{part}_damping")
            hertz = in_hertz(robot, given)
            if isinstance(hertz, tuple):
                stiffness, damping = hertz
            elif hertz is not None:
                stiffness = (2.0 * np.pi * hertz) ** 2
                damping = 2.0 * ratio * np.sqrt(stiffness)
            elif self.damping_ratio is not None and stiffness > 0.0:
                damping = 2.0 * ratio * np.sqrt(stiffness)
            gains = gains._replace(**{part: float(stiffness), f"{part}_damping": float(damping)})
        return gains

    def check_priority_action(self, possible: bool) -> None:
        """Raise InvalidValueError where the action shall change a priority that nothing has."""
        if self.priority_action and not possible:
            expected = 'False, or contact_limits "friction" and balancer "inverse_dynamics"'
            raise InvalidValueError("priority_action", True, expected)

    def priority(self, robot: Robot, kind: MotionKind) -> float | tuple[float, float]:
        """Return the weight of moments beside forces, or the two of them, see `BodyLaw.of`.

        By default a moment weighs on soles like the force that moves the centre of pressure as far;
        on points, where a robot has little of it to give away, much more.
        """
        if self.moment_priority is not None:
            return self.moment_priority
        if not kind.gait or not robot.has_soles:
            return 1.0 / 0.3**2 if kind.gait else 0.2
        stance, of_com = Stance.of(robot), self.velocity_of == "com"
        return 0.05 if of_com else 1.5 * float(stance.length / stance.home_com[2]) ** 2


BODY_DEFAULTS = BodyOptions()


def set_priority(action: np.ndarray, memory: Memory) -> None:
    """Have the law weigh moments as the seventh entry of actions (N, A), if any, asks for."""
    if action.shape[1] > 6:
        # Errors are squared.
        memory["priority"][:] = _PRIORITY_RANGE ** (0.5 * action[:, 6])


def meant(gains: BodyGains, kind: MotionKind) -> dict[str, Any]:
    """Return what options of the body layers say the same as gains for a kind of motion."""
    told = {f"{x}_frequency": (getattr(gains, x), getattr(gains, f"{x}_damping")) for x in PARTS}
    of = "base" if gains.of_base > 0.0 else "com"
    small = {"velocity_gain": gains.small_errors / kind.omega, "velocity_of": of}
    return {**told, **small, "damping_ratio": 1.0}


def in_hz(stiffness: float) -> float:
    """Return the natural frequency (Hz) of a stiffness, 1/s^2."""
    return float(np.sqrt(stiffness)) / (2.0 * np.pi)
