"""What a gait on two flat feet is made of, and what it remembers."""

from typing import NamedTuple

import numpy as np

from fbid_gym.motions.gait.slope import Sense, level_moments

STAND, DOUBLE, SWING = 0, 1, 2
"""Phases: on both feet; on the way to the foot that will carry; the other one in the air."""

LONG_AGO = 1e9
"""s since a robot that has not walked yet began to stand: states are finite numbers."""


class FlatFootGait(NamedTuple):
    """How a robot walks; constants, of which `biped_gait` makes those of a robot.

    Attributes:
        sense: of the ground.
        omega: 1/s, rate at which the robot falls, sqrt(gravity / height of the centre of mass).
        single: s in single support.
        double: s in double support.
        settle: s in which a robot that stands shifts its weight.
        agility: (3,) m/s^2, m/s^2 and rad/s^2, greatest rates of the commanded velocity.
        gain: of the centre of pressure on errors of xi, which decay with gain * omega.
        height: m, of the base above the ground below it.
        bend: m/s with which the base is lowered, or raised again.
        width: m between the feet.
        least_apart: m between the feet, sideways.
        most_apart: m between the feet, sideways.
        longest: m between the feet, ahead.
        lift: m that a foot is lifted.
        sink: m/s with which a foot lands.
        load: N on a foot that count as contact.
        sole: (2,) m, half the length and half the width that the centre of pressure may use.
        points: (P, 2) m, of that sole's corners from the foot's reference, ahead and to the left.
        foot_of_point: (P,) int64.
        left: (2,) 1 for the left foot, -1 for the right one.
        level: (2, 3, 3) rotations of the feet when the robot stands with heading 0.
        home: (nq,) of the robot.
    """

    sense: Sense
    omega: float
    single: float
    double: float
    settle: float
    agility: np.ndarray
    gain: float
    height: float
    bend: float
    width: float
    least_apart: float
    most_apart: float
    longest: float
    lift: float
    sink: float
    load: float
    sole: np.ndarray
    points: np.ndarray
    foot_of_point: np.ndarray
    left: np.ndarray
    level: np.ndarray
    home: np.ndarray


class FlatGaitMemory(NamedTuple):
    """What gaits remember from tick to tick, see `standing`.

    Attributes:
        phase: (N,) int64.
        carrier: (N,) int64, the foot that stands in the swing, or will.
        clock: (N,) s since the phase began.
        span: (N,) s that it takes.
        settled: (N,) share to which a robot that stands is held over its feet.
        velocity: (N, 3) m/s, m/s, rad/s: the command as it is followed.
        heading: (N,) rad, integral of the rate that is followed.
        planned: (N, 2) m/s with which the step began.
        rate: (N,) of steps, commanded then.
        progress: (N,) s of the planned swing that have passed.
        hurry: (N,) times as fast as planned that the foot swings.
        xi: (N, 2) m, when the feet that stand last changed.
        begun: (N, 2) m, centre of pressure then.
        pressure: (N, 2) m, that of the last tick: what `Target.com_acceleration` comes of.
        touched: (N, 2, 3) m, where each foot stands or last stood.
        moments: (N, 5) m^2, of these places, see `slope.feel_ground`.
        lifted: (N, 3) m, where the foot in the air left the ground.
        lifted_heading: (N,) rad that it had then.
        lowered: (N,) m by which the base is lower than the gait has it.
    """

    phase: np.ndarray
    carrier: np.ndarray
    clock: np.ndarray
    span: np.ndarray
    settled: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray
    planned: np.ndarray
    rate: np.ndarray
    progress: np.ndarray
    hurry: np.ndarray
    xi: np.ndarray
    begun: np.ndarray
    pressure: np.ndarray
    touched: np.ndarray
    moments: np.ndarray
    lifted: np.ndarray
    lifted_heading: np.ndarray
    lowered: np.ndarray


def standing(heading: np.ndarray, foot_position: np.ndarray) -> FlatGaitMemory:
    """Return the memory of robots that stand, with headings (N,) rad and feet at (N, 2, 3) m.

    The ground below them is taken to be level until they have stood on it for a while.
    """
    count = len(heading)
    flat = np.zeros((5, count, 2))
    return FlatGaitMemory(
        phase=np.full(count, STAND),
        carrier=np.zeros(count, np.int64),
        clock=np.full(count, LONG_AGO),
        span=np.ones(count),
        settled=np.ones(count),
        velocity=np.zeros((count, 3)),
        heading=np.array(heading, dtype=float),
        planned=flat[0],
        rate=np.ones(count),
        progress=np.zeros(count),
        hurry=np.ones(count),
        xi=flat[1],
        begun=flat[2],
        pressure=flat[3],
        touched=np.array(foot_position, dtype=float),
        moments=level_moments(foot_position),
        lifted=np.zeros((count, 3)),
        lifted_heading=np.zeros(count),
        lowered=np.zeros(count),
    )
