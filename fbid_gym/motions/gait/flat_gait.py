"""Constants and memory of a gait on two flat feet."""

from typing import NamedTuple

import numpy as np

from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.slope import Sense, level_moments

STAND, DOUBLE, SWING = 0, 1, 2
"""Phases: on both feet; on the way to the foot that will carry; the other one in the air."""

LONG_AGO = 1e9
"""s since a robot that has not walked yet began to stand: states are finite numbers."""


class FlatFootGait(NamedTuple):
    """How a robot walks; constants, of which `biped_gait` makes those of a robot."""

    sense: Sense  # of the ground
    omega: float  # 1/s, rate at which the robot falls, sqrt(gravity / height of the centre of mass)
    single: float  # s in single support
    double: float  # s in double support
    top: float  # m/s ahead, greatest that it follows
    start: float  # m/s ahead, greatest that the first step is planned for
    moment: np.ndarray  # (3,) `Target.moment`; exact where base and trunk share axes, in any order
    settle: float  # s in which a robot that stands shifts its weight
    agility: np.ndarray  # (3,) m/s^2, m/s^2 and rad/s^2, greatest rates of the commanded velocity
    trim: Trim  # of the velocity
    gain: float  # of the centre of pressure on errors of xi, which decay with gain * omega
    height: float  # m, of the base above the ground below it
    crouch: float  # m by which it begins higher
    bend: float  # m/s with which the base is lowered, or raised again
    width: float  # m between the feet
    least_apart: float  # m between the feet, sideways
    most_apart: float  # m between the feet, sideways
    longest: float  # m between the feet, ahead
    lift: float  # m that a foot is lifted
    sink: float  # m/s with which a foot lands
    trail: float  # share of its planned level velocity that a foot in the air is damped towards
    load: float  # N on a foot that count as contact
    sole: np.ndarray  # (2,) m, half the length and half the width for the centre of pressure
    points: np.ndarray  # (P, 2) m, of that sole's corners from the foot's reference, ahead, left
    foot_of_point: np.ndarray  # (P,) int64
    left: np.ndarray  # (2,) 1 for the left foot, -1 for the right one
    level: np.ndarray  # (2, 3, 3) rotations of the feet when the robot stands with heading 0
    home: np.ndarray  # (nq,) of the robot


class FlatGaitMemory(NamedTuple):
    """Memory of gaits from tick to tick, see `standing`."""

    phase: np.ndarray  # (N,) int64
    carrier: np.ndarray  # (N,) int64, the foot that stands in the swing, or will
    clock: np.ndarray  # (N,) s since the phase began
    span: np.ndarray  # (N,) s that it takes
    settled: np.ndarray  # (N,) share to which a robot that stands is held over its feet
    velocity: np.ndarray  # (N, 3) m/s, m/s, rad/s: the command as it is followed
    trim: np.ndarray  # (N, 2) m/s, integral of the error, added to the command
    heading: np.ndarray  # (N,) rad, integral of the rate that is followed
    planned: np.ndarray  # (N, 2) m/s with which the step began
    rate: np.ndarray  # (N,) of steps, commanded then
    progress: np.ndarray  # (N,) s of the planned swing that have passed
    hurry: np.ndarray  # (N,) times as fast as planned that the foot swings
    xi: np.ndarray  # (N, 2) m, when the feet that stand last changed
    begun: np.ndarray  # (N, 2) m, centre of pressure then
    pressure: np.ndarray  # (N, 2) m, that of the last tick: what `Target.com_acceleration` comes of
    touched: np.ndarray  # (N, 2, 3) m, where each foot stands or last stood
    moments: np.ndarray  # (N, 5) m^2, of these places, see `slope.feel_ground`
    lifted: np.ndarray  # (N, 3) m, where the foot in the air left the ground
    lifted_heading: np.ndarray  # (N,) rad that it had then
    lowered: np.ndarray  # (N,) m by which the base is lower than the gait has it


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
        trim=np.zeros((count, 2)),
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
