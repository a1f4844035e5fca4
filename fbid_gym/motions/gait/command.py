"""Commands to a gait, by task and policy."""

from typing import Any, NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.motions.gait.heading import along, axes_of, turned_on
from fbid_gym.quantities import DynamicsTerms

_TRIM = 0.1  # of sqrt(gravity times height)


class Steering(NamedTuple):
    """The policy's changes to a gait."""

    shift: np.ndarray  # (N, F, 2) m ahead and to the left, by which each next foothold is moved
    rate: np.ndarray  # (N,) positive, cycles of the gait per planned cycle


class GaitCommand(NamedTuple):
    """Commanded velocities of the robots."""

    velocity: np.ndarray  # (N, 3) m/s ahead, m/s to the left, rad/s to the left; all zero: stand
    shift: np.ndarray  # (N, F, 2) m ahead and to the left that each next foothold is moved by
    rate: np.ndarray  # (N,) cycles per planned cycle, positive; 1 for the planned frequency
    # (N or 1, F) m, height of the ground at the next foothold of each foot; NaN where it is not
    # known, for that of the plane on which the feet last stood.
    ground: np.ndarray
    lowered: np.ndarray  # (N,) m by which the base shall be lower than the gait has it


class Trim(NamedTuple):
    """Integral action against a lasting error of the velocity; constants."""

    rate: float  # 1/s, inverse of the integral time; 0: it is not
    # m/s ahead, or to the left, that the integral comes to at most; a greater error is none that
    # lasts, but a push.
    most: float

    @classmethod
    def of(cls, integral_time: float, omega: float, gravity: float) -> "Trim":
        """Derive it from a time in units of 1 / omega (0: errors last), from 1/s and m/s^2."""
        return cls(omega / integral_time if integral_time else 0.0, _TRIM * gravity / omega)


@compiled
def approached(now: float, asked: float, most: float) -> float:
    """Return a number moved towards another one, by no more than `most`."""
    return now + min(max(asked - now, -most), most)


@compiled
def follow(
    agility: np.ndarray,
    trim: Trim,
    command: GaitCommand,
    terms: DynamicsTerms,
    tick: float,
    memory: Any,
    i: int,
) -> None:
    """Bring the velocity that is followed nearer to the command, and turn the heading with it.

    To a command to move it adds the integral of the error ahead and to the left, which grows while
    the velocity that is followed has reached that: what a robot is short of on its way to a new
    command is no lasting error.

    The velocity changes at rates of up to `agility`, (3,) m/s^2, m/s^2 and rad/s^2; the tick of the
    control is in s. Updates the memory of a gait, on points or on soles.
    """
    moves, lasting = False, trim.rate > 0.0
    for axis in range(3):
        moves = moves or command.velocity[i, axis] != 0.0
    for axis in range(3):
        now, asked = memory.velocity[i, axis], command.velocity[i, axis]
        if moves and axis < 2:
            asked += memory.trim[i, axis]
        lasting = lasting and abs(asked - now) <= agility[axis] * tick
        memory.velocity[i, axis] = approached(now, asked, agility[axis] * tick)
    if moves and lasting:
        x, y = terms.com_velocity[i, 0], terms.com_velocity[i, 1]
        ahead, left = along(axes_of(memory.heading[i]), x, y)
        for axis in range(2):
            error = command.velocity[i, axis] - (ahead if axis == 0 else left)
            if abs(error) < trim.most:
                grown = memory.trim[i, axis] + trim.rate * tick * error
                memory.trim[i, axis] = approached(0.0, grown, trim.most)
    turn = memory.velocity[i, 2] * tick
    memory.heading[i] = turned_on(memory.heading[i], turn, terms.world_from_trunk[i])


def no_command(num_robots: int, num_feet: int) -> GaitCommand:
    """Return the command to stand, with no wish about the footholds."""
    feet = num_robots, num_feet
    return GaitCommand(
        velocity=np.zeros((num_robots, 3)),
        shift=np.zeros((*feet, 2)),
        rate=np.ones(num_robots),
        ground=np.full(feet, np.nan),
        lowered=np.zeros(num_robots),
    )
