"""A motion as a table: one row per control tick, checked when it is made."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.errors import InvalidValueError, NonFiniteError, ShapeError
from fbid_gym.motions.reference import Reference, empty_parts
from fbid_gym.robots import Robot

_RANGE_TOLERANCE = 1e-9  # rad
# Between two rows the joints shall move as their rates say, to these shares of the step that the
# largest rate (acceleration) of the motion makes.
_RATE_TOLERANCE = 0.02
_UNIT_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class MotionTable:
    """A motion of one robot, tabulated at a control rate; T ticks, F feet.

    Attributes:
        robot: whose motion it is.
        qpos: (T, nq) and
        qvel: (T, nv) and
        qacc: (T, nv) and
        com: (T, 3) and
        com_velocity: (T, 3) and
        com_acceleration: (T, 3), as in `Reference`.
        planted: (T, F) bool, which feet are planned to stand; None for all of them.
        hz: ticks per second.
        periodic: whether the first row follows the last one. Else the last posture is held.
        jumps: (T,) bool, rows whose posture does not continue that of the row before: instant
            changes of joint offsets, as in [M10] IV.D. None for none.
    """

    robot: Robot
    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    com_acceleration: np.ndarray
    planted: np.ndarray | None
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
        _check_ranges(self.robot, self.qpos)
        _check_rates(self)
        for array in vars(self).values():
            if isinstance(array, np.ndarray):
                array.setflags(write=False)

    @property
    def period(self) -> int:
        """Length in ticks: of one period, or of the whole motion."""
        return len(self.qpos)

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
        numbers, feet = self._rows
        parts = empty_parts(len(tick), self.robot)
        _look_up(numbers, feet, np.ascontiguousarray(tick), self.periodic, *parts)
        reference = Reference(*parts)
        return reference._replace(planted=None) if self.planted is None else reference

    @cached_property
    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """The numbers of `Reference` side by side, in its order, (T, D); and `planted`, (T, F)."""
        parts = [getattr(self, name) for name in Reference._fields[:6]]
        every = np.ones((self.period, self.robot.num_feet), bool)
        planted = every if self.planted is None else self.planted
        return np.concatenate(parts, axis=1), np.array(planted, order="C")


@kernel
def _look_up(
    numbers: np.ndarray,
    feet: np.ndarray,
    tick: np.ndarray,
    periodic: bool,
    qpos: np.ndarray,
    qvel: np.ndarray,
    qacc: np.ndarray,
    com: np.ndarray,
    com_velocity: np.ndarray,
    com_acceleration: np.ndarray,
    planted: np.ndarray,
) -> None:
    """Fill a `Reference` of N robots.

    Args:
        numbers: (T, D) those of all ticks, side by side in the order of `Reference`.
        feet: (T, F) planted feet.
        tick: (N,) since the motion began.
        periodic: whether it begins again; else it rests when it is over.
        qpos: (N, nq), and the rest: see `Reference`.
        qvel: see there.
        qacc: see there.
        com: see there.
        com_velocity: see there.
        com_acceleration: see there.
        planted: see there.
    """
    for i in range(len(tick)):
        over = not periodic and tick[i] >= len(numbers)
        row = len(numbers) - 1 if over else tick[i] % len(numbers)
        first = 0
        for part, is_rate in (
            (qpos, False),
            (qvel, True),
            (qacc, True),
            (com, False),
            (com_velocity, True),
            (com_acceleration, True),
        ):
            for k in range(part.shape[1]):
                part[i, k] = 0.0 if over and is_rate else numbers[row, first + k]
            first += part.shape[1]
        for foot in range(feet.shape[1]):
            planted[i, foot] = feet[row, foot]


def _check_shapes(motion: MotionTable) -> None:
    robot, steps = motion.robot, len(motion.qpos)
    for name, array, width, text in (
        ("qpos", motion.qpos, robot.nq, f"(T, {robot.nq}): {robot.name} has nq = {robot.nq}"),
        ("qvel", motion.qvel, robot.nv, f"({steps}, {robot.nv}), one row per row of qpos"),
        ("qacc", motion.qacc, robot.nv, f"({steps}, {robot.nv}), one row per row of qpos"),
        ("com", motion.com, 3, f"({steps}, 3)"),
        ("com_velocity", motion.com_velocity, 3, f"({steps}, 3)"),
        ("com_acceleration", motion.com_acceleration, 3, f"({steps}, 3)"),
    ):
        if array.shape != (steps, width) or steps == 0:
            raise ShapeError(f"{name} of the motion", array.shape, text)
        if not np.isfinite(array).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise NonFiniteError(f"{name} of the motion", where)
    if motion.planted is not None and motion.planted.shape != (steps, robot.num_feet):
        raise ShapeError(
            "planted", motion.planted.shape, f"({steps}, {robot.num_feet}), one column per foot"
        )
    if motion.jumps is not None and motion.jumps.shape != (steps,):
        raise ShapeError("jumps", motion.jumps.shape, f"({steps},)")
    length = np.linalg.norm(motion.qpos[:, 3:7], axis=1)
    if np.abs(length - 1.0).max() > _UNIT_TOLERANCE:
        tick = int(np.abs(length - 1.0).argmax())
        raise InvalidValueError(
            f"base quaternion of the motion at tick {tick}",
            motion.qpos[tick, 3:7].tolist(),
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
        ("qvel", motion.qpos[:, 7:], motion.qvel[:, 6:], np.abs(motion.qvel[:, 6:]).max()),
        ("qacc", motion.qvel[:, 6:], motion.qacc[:, 6:], np.abs(motion.qacc[:, 6:]).max()),
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
