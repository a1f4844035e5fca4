"""Which contact points a model-based layer takes to be on the ground."""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.options import Choice, Number
from fbid_gym.quantities import RobotState, Target
from fbid_gym.robots import Robot

ContactBelief = Callable[[RobotState, Target], np.ndarray]
"""Returns which points are in contact: (N, P) bool."""

Schedule = Sequence[tuple[float, Sequence[str]]]

CONTACTS = ("planned", "all", "measured", "a schedule [(seconds, feet), ...]")

LONGEST_SCHEDULE = 100_000
"""Control ticks of a schedule; all of them are kept."""

MEASURED_LOAD = 0.005
"""Share of the robot's weight that a point must carry to count as measured contact."""


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
            least = MEASURED_LOAD * robot.weight
            return lambda state, target: _loaded(state.contact_force, least)
        raise UnknownOptionError("contacts", contacts, CONTACTS)
    table = _schedule_table(contacts, robot, control_hz)
    return lambda state, target: table[state.tick % len(table)]


def _loaded(force: np.ndarray, least: float) -> np.ndarray:
    """Points that carry more than `least` N."""
    return np.vecdot(force, force) > least**2


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
