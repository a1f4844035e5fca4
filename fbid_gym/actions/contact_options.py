"""Assumptions of the model-based layers about contacts: the options that they share.

Which points are in contact, how a torque goes from one set of contacts to the next, and what the
contact forces can be.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.control.contact_forces import ContactLimits
from fbid_gym.control.grip import FIRST, LEAST
from fbid_gym.dynamics.passive_joints import PassiveJoints
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Choice, Number, check_fields
from fbid_gym.quantities import Memory, RobotState, Target
from fbid_gym.robots import Robot
from fbid_gym.robots.home_check import ASSUMED_FRICTION, contact_of_feet

ContactBelief = Callable[[RobotState, Target], np.ndarray]
"""Returns which points are in contact: (N, P) bool."""

Schedule = Sequence[tuple[float, Sequence[str]]]

CONTACTS = ("planned", "all", "measured", "a schedule [(seconds, feet), ...]")

LONGEST_SCHEDULE = 100_000
"""Control ticks of a schedule; all of them are kept."""

MEASURED_LOAD = 0.005  # of the weight: a point that carries more counts as measured contact

_UNKNOWN = -1


def contact_belief(contacts: str | Schedule, robot: Robot, control_hz: int) -> ContactBelief:
    """Build a contact belief.

    Args:
        contacts: "planned", those of the feet that shall stand; "all"; "measured", the
            points that carried weight on the last physics step; or a schedule [(seconds, names of
            the feet on the ground), ...], repeated for ever.
        robot: whose feet.
        control_hz: control ticks per second.

    Raises:
        FbidError: not one of these, a foot that does not exist, or a phase without duration.
    """
    points = robot.num_points
    if isinstance(contacts, str):
        if contacts == "all":
            return lambda state, target: np.ones((len(state.tick), points), bool)
        if contacts == "planned":
            foot = np.repeat(np.arange(robot.num_feet), [len(foot.points) for foot in robot.feet])
            return lambda state, target: target.planted.take(foot, axis=1)
        if contacts == "measured":
            least = (MEASURED_LOAD * robot.weight) ** 2
            return lambda state, _: np.vecdot(state.contact_force, state.contact_force) > least
        raise UnknownOptionError("contacts", contacts, CONTACTS)
    table = _schedule_table(contacts, robot, control_hz)
    return lambda state, target: table[state.tick % len(table)]


def _schedule_table(schedule: Schedule, robot: Robot, control_hz: int) -> np.ndarray:
    """Points in contact at each control tick of one period: (T, P) bool."""
    longest = LONGEST_SCHEDULE / control_hz
    expected = f"phases (seconds >= {1 / control_hz:g}, feet on the ground), {longest:g} s in all"
    seconds = Number(0.0, longest)
    if not isinstance(schedule, Sequence):
        raise InvalidValueError("contacts", schedule, expected)
    phases, ticks = [], 0
    for phase in schedule:
        if not isinstance(phase, Sequence) or len(phase) != 2 or not seconds.holds(phase[0]):
            raise InvalidValueError("contacts", schedule, expected)
        feet = phase[1]
        if not isinstance(feet, Collection) or isinstance(feet, str):
            raise InvalidValueError("contacts", schedule, expected)
        for foot in feet:
            Choice(robot.foot_names).check("foot in contacts", foot)
        down = [np.full(len(foot.points), foot.name in feet) for foot in robot.feet]
        lasting = round(phase[0] * control_hz)
        ticks += lasting
        if lasting < 1 or ticks > LONGEST_SCHEDULE:
            raise InvalidValueError("contacts", schedule, expected)
        phases.append(np.tile(np.concatenate(down), (lasting, 1)))
    if not phases:
        raise InvalidValueError("contacts", schedule, "at least one phase (seconds, feet)")
    return np.concatenate(phases)


@dataclass(frozen=True)
class ContactRamp:
    """Leads the torque of a layer from one set of contacts to the next.

    When contacts switch, the law's torque jumps by some d from the last tick to this. The ramp adds
    -d, and takes it away again linearly in time. So the torque goes on from where it was, feedback
    acts through the new contacts at once, and the load of a foot fades in or out. A switch during a
    ramp adds its own difference to what is left.
    """

    ticks: int  # control ticks of a ramp

    def memory(self, num_robots: int, num_points: int, num_joints: int) -> Memory:
        """Return what is remembered of robots that have not moved yet."""
        return {
            "ramp_contacts": np.full((num_robots, num_points), _UNKNOWN, np.int64),
            "ramp_ticks": np.zeros(num_robots, np.int64),
            "ramp_torque": np.zeros((num_robots, num_joints)),
            "ramp_law": np.zeros((num_robots, num_joints)),
        }

    def torque(self, torque: np.ndarray, active: np.ndarray, memory: Memory) -> np.ndarray:
        """Return the torques (N, n) to apply; updates the memory.

        The law's are `torque` (N, n), with the contacts `active` (N, P) bool.
        """
        own = _Ramp(*(memory[f"ramp_{name}"] for name in _Ramp._fields))
        return _fade(torque, active, self.ticks, own)


class _Ramp(NamedTuple):
    """The memory of N robots; it is updated in place."""

    contacts: np.ndarray  # (N, P) int64, which points were in contact a tick ago, or `_UNKNOWN`
    ticks: np.ndarray  # (N,) int64, left of the ramp
    torque: np.ndarray  # (N, n) N·m, what the ramp adds
    law: np.ndarray  # (N, n) N·m, of the law a tick ago


@kernel
def _fade(torque: np.ndarray, active: np.ndarray, ticks: int, ramp: _Ramp) -> np.ndarray:
    """Go on with the ramps by a tick, begin others where contacts have switched, and add them.

    See `ContactRamp.torque`. Unknown contacts become the present ones.
    """
    contacts, left, added, before = ramp
    result = np.empty(torque.shape)
    for i in range(len(torque)):
        unknown, switched = contacts[i, 0] == _UNKNOWN, False
        for j in range(active.shape[1]):
            switched |= contacts[i, j] != active[i, j]
            contacts[i, j] = active[i, j]
        share = 0.0
        if left[i] > 0:
            left[i] -= 1
            share = left[i] / (left[i] + 1.0)
        for j in range(torque.shape[1]):
            added[i, j] *= share
            if switched and not unknown:
                added[i, j] += before[i, j] - torque[i, j]
            before[i, j] = torque[i, j]
            result[i, j] = torque[i, j] + added[i, j]
        if switched and not unknown:
            left[i] = ticks
    return result


CONTACT_LIMITS = ("friction", "none")

_RAMP_ON_SOLES = 0.14  # pendulum times
_CAREFUL = 0.9


@dataclass(frozen=True)
class ContactOptions:
    """Options of every model-based layer, beside its own. None: what robot and task suggest."""

    contacts: str | Schedule = "planned"
    """Which points are taken to be on the ground: "planned", those of the feet that shall stand;
    "all"; "measured"; or a schedule [(seconds, feet on the ground), ...]."""
    contact_limits: Annotated[str, Choice(CONTACT_LIMITS)] = "friction"
    """"friction" limits the contact forces; "none" is the papers' form."""
    contact_ramp: Annotated[float, Number(0.0, 10.0, "s")] | None = None
    """s that the torque takes to what a switch of contacts makes of it; at 0 it jumps, as in [M10]
    IV.D. None: 0, but for gaits on soles 0.14 of the time in which the robot falls."""
    friction: Annotated[float, Number(0.0, 10.0)] | None = None
    """Coefficient assumed of every contact. None: 0.6, or nine tenths of what the model's feet have
    on its ground, if that is less."""
    notice_slip: bool = True
    """Count on less friction while feet slip, and at first: `control/grip.py`."""
    initial_grip: Annotated[float, Number(LEAST, 1.0)] | None = None
    """Share of the friction that is counted on at first. None: half on points, or as much as the
    gait needs to carry the robot if that is more; all on soles, and where slip is not noticed."""
    contact_time: Annotated[float, Number(0.0, 1.0, "s")] | None = None
    """s, time constant of the feet's contacts, the first number of MuJoCo's `solref`: so long feet
    may move on when they land before they count as slipping. None: that of the model's feet."""
    min_normal_force: Annotated[float, Number(0.0, 100.0)] = 0.0
    """Least normal force of a point in contact, share of the weight."""
    max_normal_force: Annotated[float, Number(0.0, np.inf)] = np.inf
    """Greatest, share of the weight."""
    compensate_damping: bool = True
    """Add the torque that the joints' viscous damping takes away. What springs take always is."""
    compensate_friction: bool = False
    """Add the torque that the joints' dry friction takes away while they move."""

    def __post_init__(self) -> None:
        """Check them."""
        check_fields(self)

    def on(self, robot: Robot, kind: MotionKind) -> "ContactOptions":
        """Return what they mean for a robot and a kind of motion: None is filled in."""
        # On points a ramp is behind its time: of 12 ms (go1) it brought the largest torque jumps
        # from 0.26 to 0.14 of a limit, and the velocity error from 0.084 to 0.094 m/s.
        ramp = _RAMP_ON_SOLES / kind.omega if kind.gait and robot.has_soles else 0.0
        contact = contact_of_feet(robot.at_home, robot.feet)
        usual = min(ASSUMED_FRICTION, _CAREFUL * contact.friction)
        friction = usual if self.friction is None else self.friction
        # On soles less at first prevents no fall.
        careful = self.notice_slip and not robot.has_soles and kind.friction < friction
        grip = max(FIRST, kind.friction / friction) if careful else 1.0
        return replace(
            self,
            initial_grip=grip if self.initial_grip is None else self.initial_grip,
            contact_ramp=ramp if self.contact_ramp is None else self.contact_ramp,
            friction=friction,
            contact_time=contact.time if self.contact_time is None else self.contact_time,
        )

    @property
    def coefficient(self) -> float:
        """Of friction, once it has been filled in."""
        return ASSUMED_FRICTION if self.friction is None else self.friction

    def limits(self, robot: Robot) -> ContactLimits | None:
        """Return the limits of the contact forces; None for none."""
        least, most = self.min_normal_force, self.max_normal_force
        limits = ContactLimits(self.coefficient, least * robot.weight, most * robot.weight)
        return limits if self.contact_limits == "friction" else None

    def passive(self, robot: Robot) -> PassiveJoints:
        """Return what the joints take of their torques, as far as it is given back."""
        return PassiveJoints.of(
            robot, damping=self.compensate_damping, friction=self.compensate_friction
        )

    def ramp(self, control_hz: int) -> ContactRamp | None:
        """Return what smooths the switches; None if they are instantaneous."""
        ticks = round((self.contact_ramp or 0.0) * control_hz)
        return ContactRamp(ticks) if ticks > 0 else None


CONTACT_DEFAULTS = ContactOptions()
