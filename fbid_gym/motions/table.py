"""A motion as a table: one row per control tick, checked when it is made."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fbid_gym.checks import check_finite
from fbid_gym.compiled import kernel
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.motions.target import NUMBERS, empty_target
from fbid_gym.quantities import Target
from fbid_gym.robots import Robot

_RANGE_TOLERANCE = 1e-9  # rad
# Between two rows the joints shall move as their rates say, to these shares of the step that the
# largest rate (acceleration) of the motion makes.
_RATE_TOLERANCE = 0.02
_UNIT_TOLERANCE = 1e-9


MOST_TICKS = 100_000
"""Rows that a table may have; all of them are planned beforehand."""


def table_ticks(name: str, value: float, seconds: float, hz: int) -> int:
    """Return how many ticks a motion of so many seconds has.

    Raises:
        InvalidValueError: more than a table may have; it names the value that makes it so long.
    """
    if not seconds * hz <= MOST_TICKS:
        expected = f"what makes a motion of at most {MOST_TICKS / hz:g} s at {hz} ticks per second"
        raise InvalidValueError(name, value, expected)
    return round(seconds * hz)


@dataclass(frozen=True, eq=False)
class MotionTable:
    """A motion of one robot, tabulated at a control rate; T ticks, F feet.

    Attributes:
        robot: whose motion it is.
        rows: T of them.
        hz: ticks per second.
        periodic: whether the first row follows the last one. Else the last posture is held.
        jumps: (T,) bool, rows whose posture does not continue that of the row before: instant
            changes of joint offsets, as in [M10] IV.D. None for none.
    """

    robot: Robot
    rows: Target
    hz: int
    periodic: bool
    jumps: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check the motion and protect its arrays.

        Raises:
            ShapeError: an array has another shape.
            NonFiniteError: NaN or infinity.
            InvalidValueError: a joint leaves its range, or the rates are not those of the postures.
        """
        _check_shapes(self)
        _check_ranges(self.robot, self.rows.qpos)
        _check_rates(self)
        for array in (*self.rows, self.jumps):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)

    @property
    def period(self) -> int:
        """Length in ticks: of one period, or of the whole motion."""
        return len(self.rows.qpos)

    @property
    def seconds(self) -> float:
        """Length in seconds."""
        return self.period / self.hz

    def reference(self, tick: np.ndarray, speed: np.ndarray | None = None) -> Target:
        """Return the desired motion of N robots, in the support frame of their feet.

        Args:
            tick: (N,) int control ticks since the motion began, not negative.
            speed: not used: this motion takes no command.
        """
        ticks, share = np.ascontiguousarray(tick), np.zeros(len(tick))
        return look_up(self._numbers, self.planted, ticks, share, self.periodic)

    @cached_property
    def _numbers(self) -> np.ndarray:
        return side_by_side(self.rows)[:, None]

    @cached_property
    def planted(self) -> np.ndarray:
        """(T, F) bool, of the rows, for compiled code: it takes no array that is read-only."""
        return self.rows.planted.copy()


def side_by_side(rows: Target) -> np.ndarray:
    """Return the `NUMBERS` of planned instants side by side: (T, D)."""
    parts = [getattr(rows, name) for name in NUMBERS]
    return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)


@kernel
def look_up(
    numbers: np.ndarray, planted: np.ndarray, tick: np.ndarray, share: np.ndarray, periodic: bool
) -> Target:
    """Return the rows of N robots at ticks (N,) since a motion began.

    Args:
        numbers: (T, K, D) coefficients of 1, u, u^2, ... of what `side_by_side` returns.
        planted: (T, F) bool.
        tick: (N,) since the motion began.
        share: (N,) u of each robot.
        periodic: whether the first row follows the last one; else a motion rests when it is over.
    """
    count, feet, ticks = len(tick), planted.shape[1], len(numbers)
    size = (numbers.shape[2] - 24 * feet - 10) // 3
    found, flat = empty_target(count, feet, size), np.empty(numbers.shape[2])
    for i in range(count):
        over, power = not periodic and tick[i] >= ticks, 1.0
        row = ticks - 1 if over else tick[i] % ticks
        flat[:] = 0.0
        for degree in range(numbers.shape[1]):
            for k in range(len(flat)):
                flat[k] += power * numbers[row, degree, k]
            power *= share[i]
        first = 0
        for part, is_rate in (
            (found.foot_position[i].reshape(3 * feet), False),
            (found.world_from_foot[i].reshape(9 * feet), False),
            (found.foot_velocity[i].reshape(6 * feet), True),
            (found.foot_acceleration[i].reshape(6 * feet), True),
            (found.com[i], False),
            (found.com_velocity[i], True),
            (found.com_acceleration[i], True),
            (found.qpos[i], False),
            (found.qvel[i], True),
            (found.qacc[i], True),
        ):
            for k in range(len(part)):
                part[k] = 0.0 if over and is_rate else flat[first + k]
            first += len(part)
        length = 0.0
        for k in range(3, 7):
            length += found.qpos[i, k] ** 2
        for k in range(3, 7):
            found.qpos[i, k] /= np.sqrt(length)
        for foot in range(feet):
            found.planted[i, foot] = planted[row, foot]
            found.load[i, foot] = 1.0 if planted[row, foot] else 0.0
            for axis in range(3):
                found.foothold[i, foot, axis] = found.foot_position[i, foot, axis]
        found.cycle[i] = row / ticks
    return found


def _check_shapes(motion: MotionTable) -> None:
    robot, steps = motion.robot, len(motion.rows.qpos)
    feet = (steps, robot.num_feet)
    shapes: dict[str, tuple[int, ...]]
    shapes = {"qpos": (steps, robot.nq), "qvel": (steps, robot.nv), "qacc": (steps, robot.nv)}
    shapes |= {name: (steps, 3) for name in ("com", "com_velocity", "com_acceleration")}
    shapes |= {"foot_position": (*feet, 3), "world_from_foot": (*feet, 3, 3)}
    shapes |= {"foot_velocity": (*feet, 6), "foot_acceleration": (*feet, 6), "planted": feet}
    for name, shape in shapes.items():
        array = getattr(motion.rows, name)
        if array.shape != shape or steps == 0:
            text = f"{shape}: T rows of {robot.name}, T of at least 1"
            raise ShapeError(f"{name} of the motion", array.shape, text)
        check_finite(f"{name} of the motion", array)
    if motion.jumps is not None and motion.jumps.shape != (steps,):
        raise ShapeError("jumps", motion.jumps.shape, f"({steps},)")
    length = np.linalg.norm(motion.rows.qpos[:, 3:7], axis=1)
    if np.abs(length - 1.0).max() > _UNIT_TOLERANCE:
        tick = int(np.abs(length - 1.0).argmax())
        raise InvalidValueError(
            f"base quaternion of the motion at tick {tick}",
            motion.rows.qpos[tick, 3:7].tolist(),
            "unit length",
        )


def _check_ranges(robot: Robot, qpos: np.ndarray) -> None:
    low, high = robot.joint_range.T
    beyond = np.maximum(low - qpos[:, 7:], qpos[:, 7:] - high)
    if beyond.max() <= _RANGE_TOLERANCE:
        return
    tick, joint = np.unravel_index(beyond.argmax(), beyond.shape)
    raise InvalidValueError(
        f"motion of joint {robot.joint_names[joint]!r}",
        round(float(qpos[tick, 7 + joint]), 6),
        f"angles in its range [{low[joint]:g}, {high[joint]:g}] (it is left at tick {tick})",
    )


def _check_rates(motion: MotionTable) -> None:
    """Hold the joints' rates against their postures.

    The base is not compared: it is seen from feet that may move, so its rates are not those of its
    coordinates.
    """
    following = np.ones(motion.period, bool) if motion.jumps is None else ~motion.jumps
    if not motion.periodic:
        following[0] = False
    step, rows = 1.0 / motion.hz, motion.rows
    velocity, acceleration = rows.qvel[:, 6:], rows.qacc[:, 6:]
    for name, values, rates in (
        ("qvel", rows.qpos[:, 7:], velocity),
        ("qacc", velocity, acceleration),
    ):
        # The trapezoidal rule, from the row before.
        made = step * 0.5 * (rates + np.roll(rates, 1, axis=0))
        error = np.abs(values - np.roll(values, 1, axis=0) - made)[following]
        if error.size and error.max() > _RATE_TOLERANCE * step * np.abs(rates).max() + 1e-12:
            row, joint = np.unravel_index(error.argmax(), error.shape)
            tick = int(np.flatnonzero(following)[row])
            raise InvalidValueError(
                f"{name} of the motion",
                f"{rates[tick, joint]:g} for joint {motion.robot.joint_names[joint]!r} "
                f"at tick {tick}",
                "the rate of change from tick to tick",
            )
