"""Constants and memory of a gait on point feet."""

from typing import NamedTuple

import numpy as np

from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.schedule import Schedule
from fbid_gym.motions.gait.slope import Sense, level_moments
from fbid_gym.motions.gait.touchdown import STANCE


class PointFootGait(NamedTuple):
    """How a robot walks; constants, of which `quadruped_gait` makes those of a robot. F feet."""

    schedule: Schedule  # of the feet
    sense: Sense  # of the ground
    omega: float  # 1/s, rate at which the robot falls, sqrt(gravity / height of the centre of mass)
    capture: float  # share of an error of velocity that one step takes away
    agility: np.ndarray  # (3,) m/s^2, m/s^2 and rad/s^2, greatest rates of the commanded velocity
    trim: Trim  # of the velocity
    rest: float  # m/s below which a robot is at rest
    astray: float  # m between feet and their places below which a robot may stand still
    # m, distance of the capture point from the middle of the feet at which a robot that stands has
    # to step.
    margin: float
    height: float  # m, of the base above the ground below it
    bend: float  # m/s with which the base is lowered, or raised again
    lift: float  # m that a foot is lifted above the higher end of its step
    sink: float  # m/s with which a foot reaches for the ground
    touch: float  # N on a foot that count as contact
    unload: float  # s in which a foot gives up its load, or takes it
    # (F, 2) m, of each foot from the base, ahead and to the left: as at home, but with the middle
    # of the feet below the centre of mass.
    place: np.ndarray
    hip: np.ndarray  # (F, 3) m, of each hip from the base at home, ahead, to the left and up
    reach: np.ndarray  # (F,) m, greatest distance of a foothold from its hip
    foot_of_point: np.ndarray  # (P,) int64
    home: np.ndarray  # (nq,) of the robot


class PointGaitMemory(NamedTuple):
    """Memory of gaits from tick to tick, see `standing`."""

    phase: np.ndarray  # (N,) of the schedule
    walking: np.ndarray  # (N,) bool, whether feet may lift
    settled: np.ndarray  # (N,) share to which a robot that stands is held over its feet
    velocity: np.ndarray  # (N, 3) m/s, m/s, rad/s: the command as it is followed
    trim: np.ndarray  # (N, 2) m/s, integral of the error, added to the command
    heading: np.ndarray  # (N,) rad, integral of the rate that is followed
    touched: np.ndarray  # (N, F, 3) m, where each foot stands or last stood
    moments: np.ndarray  # (N, 5) m^2, of these places, see `slope.feel_ground`
    mode: np.ndarray  # (N, F) int64, of each foot: `STANCE`, `SWING` or `REACH`
    clock: np.ndarray  # (N, F) s since a foot has begun to reach
    begun: np.ndarray  # (N, F, 3) m, where a foot lifted, or began to reach
    load: np.ndarray  # (N, F) share of its greatest force that a foot may take
    lowered: np.ndarray  # (N,) m by which the base is lower than the gait has it


def standing(heading: np.ndarray, foot_position: np.ndarray) -> PointGaitMemory:
    """Return the memory of robots that stand, with headings (N,) rad and feet at (N, F, 3) m.

    The ground below them is taken to be level until they have stood on it for a while.
    """
    feet = foot_position.shape[:2]
    return PointGaitMemory(
        phase=np.zeros(len(heading)),
        walking=np.zeros(len(heading), bool),
        settled=np.ones(len(heading)),
        velocity=np.zeros((len(heading), 3)),
        trim=np.zeros((len(heading), 2)),
        heading=np.array(heading, dtype=float),
        touched=np.array(foot_position, dtype=float),
        moments=level_moments(foot_position),
        mode=np.full(feet, STANCE),
        clock=np.zeros(feet),
        begun=np.array(foot_position, dtype=float),
        load=np.ones(feet),
        lowered=np.zeros(len(heading)),
    )
