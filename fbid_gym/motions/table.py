"""A motion as a table: one row per control tick, checked when it is made."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fbid_gym.checks import check_finite
from fbid_gym.compiled import compiled, kernel
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.quantities import Reference
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
    rows: Reference
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

    def reference(self, tick: np.ndarray, speed: np.ndarray | None = None) -> Reference:
        """Return what N robots shall do.

        Args:
            tick: (N,) int control ticks since the motion began, not negative.
            speed: not used: this motion takes no command.
        """
        ticks = np.ascontiguousarray(tick)
        return _look_up(self._numbers, self.own_rows, ticks, self.periodic)

    @cached_property
    def own_rows(self) -> Reference:
        """The rows as compiled code takes them: in arrays that are not read-only."""
        names = Reference._fields[:-1]
        return self.rows._replace(**{name: getattr(self.rows, name).copy() for name in names})

    @cached_property
    def _numbers(self) -> np.ndarray:
        return side_by_side(self.rows)


def side_by_side(rows: Reference) -> np.ndarray:
    """Return the numbers of a reference side by side, in its order: (T, D)."""
    return np.concatenate(rows[:6], axis=1)


@kernel
def _look_up(numbers: np.ndarray, rows: Reference, tick: np.ndarray, periodic: bool) -> Reference:
    """Return the rows of N robots at ticks (N,) since the motion began.

    Where it is not periodic it rests when it is over.
    """
    count = len(tick)
    found = empty_reference(rows, count)
    for i in range(count):
        over = not periodic and tick[i] >= len(numbers)
        row = len(numbers) - 1 if over else tick[i] % len(numbers)
        first = 0
        for part, is_rate in (
            (found.qpos, False),
            (found.qvel, True),
            (found.qacc, True),
            (found.com_in_support, False),
            (found.com_velocity_in_support, True),
            (found.com_acceleration_in_support, True),
        ):
            for k in range(part.shape[1]):
                part[i, k] = 0.0 if over and is_rate else numbers[row, first + k]
            first += part.shape[1]
        found.planted[i] = rows.planted[row]
    return found


@compiled
def empty_reference(rows: Reference, count: int) -> Reference:
    """A reference of N robots to write to, of the same robot as `rows`."""
    return Reference(
        np.empty((count, rows.qpos.shape[1])),
        np.empty((count, rows.qvel.shape[1])),
        np.empty((count, rows.qacc.shape[1])),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, rows.planted.shape[1]), np.bool_),
        rows.stepping,
    )


def _check_shapes(motion: MotionTable) -> None:
    robot, steps = motion.robot, len(motion.rows.qpos)
    for name, array, width, text in (
        ("qpos", motion.rows.qpos, robot.nq, f"(T, {robot.nq}): {robot.name} has nq = {robot.nq}"),
        ("qvel", motion.rows.qvel, robot.nv, f"({steps}, {robot.nv}), one row per row of qpos"),
        ("qacc", motion.rows.qacc, robot.nv, f"({steps}, {robot.nv}), one row per row of qpos"),
        ("com_in_support", motion.rows.com_in_support, 3, f"({steps}, 3)"),
        ("com_velocity_in_support", motion.rows.com_velocity_in_support, 3, f"({steps}, 3)"),
        (
            "com_acceleration_in_support",
            motion.rows.com_acceleration_in_support,
            3,
            f"({steps}, 3)",
        ),
    ):
        if array.shape != (steps, width) or steps == 0:
            raise ShapeError(f"{name} of the motion", array.shape, text)
        check_finite(f"{name} of the motion", array)
    planted = motion.rows.planted
    if planted.shape != (steps, robot.num_feet):
        raise ShapeError(
            "planted", planted.shape, f"({steps}, {robot.num_feet}), one column per foot"
        )
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
        following = following.copy()
        following[0] = False
    step = 1.0 / motion.hz
    for name, values, rates, most in (
        (
            "qvel",
            motion.rows.qpos[:, 7:],
            motion.rows.qvel[:, 6:],
            np.abs(motion.rows.qvel[:, 6:]).max(),
        ),
        (
            "qacc",
            motion.rows.qvel[:, 6:],
            motion.rows.qacc[:, 6:],
            np.abs(motion.rows.qacc[:, 6:]).max(),
        ),
    ):
        # The trapezoidal rule, from the row before.
        made = step * 0.5 * (rates + np.roll(rates, 1, axis=0))
        error = np.abs(values - np.roll(values, 1, axis=0) - made)[following]
        if error.size and error.max() > _RATE_TOLERANCE * step * most + 1e-12:
            row, joint = np.unravel_index(error.argmax(), error.shape)
            tick = int(np.flatnonzero(following)[row])
            raise InvalidValueError(
                f"{name} of the motion",
                f"{rates[tick, joint]:g} for joint {motion.robot.joint_names[joint]!r} "
                f"at tick {tick}",
                "the rate of change from tick to tick",
            )
