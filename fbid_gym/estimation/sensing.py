"""Readings of the sensors of N robots at a control tick, compiled; see `sensors` for their errors.

The accelerometer reads the change of the unit's velocity since its last reading, less gravity's,
over the time between, seen from the middle of that time: a mean, as the filter of such a chip makes
it; contacts of one physics step would else be read far too large, or missed.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at
from fbid_gym.dynamics.vectors import (
    add,
    cross,
    matrix,
    product,
    scale,
    store,
    subtract,
    transposed,
    turn,
    vector,
)
from fbid_gym.estimation.legs import Mounting, turning
from fbid_gym.estimation.random_numbers import normal, uniform
from fbid_gym.estimation.sensors import UNITS, Sensors
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot

_WRONG = 0.02  # s that a wrong contact lasts, on average


class Inertial(NamedTuple):
    """Errors of a gyroscope or an accelerometer."""

    noise: float  # standard deviation of a reading
    drift: float  # of its bias, in a tick
    limit: float  # the most it reads


class Instruments(NamedTuple):
    """The sensors of a robot at its control rate; constants."""

    mounting: Mounting
    tick: float  # s, of the control
    gravity: float  # m/s^2
    gyroscope: Inertial
    accelerometer: Inertial
    resolution: float  # rad, of an encoder
    noise: float  # rad, of a position
    follow: float  # share of the way to the newest velocity that the low pass goes at a reading
    load_noise: float  # N
    threshold: float  # N, of a foot that counts as on the ground
    goes_wrong: float  # probability that the sensor of a foot begins to tell the wrong thing
    recovers: float  # and that it stops, in a tick
    every: np.ndarray  # (3,) int64, ticks from one reading to the next: unit, encoders, feet
    foot_of_point: np.ndarray  # (P,) int64


class Wear(NamedTuple):
    """Individual errors and memory of the sensors of N robots."""

    generator: np.ndarray  # (N, 2) int64, see `random_numbers`
    gyroscope_bias: np.ndarray  # (N, 3) rad/s, now
    accelerometer_bias: np.ndarray  # (N, 3) m/s^2, now
    gyroscope_scale: np.ndarray  # (N, 3)
    accelerometer_scale: np.ndarray  # (N, 3)
    mounted: np.ndarray  # (N, 3, 3), the unit's axes from those where it should sit
    latency: np.ndarray  # (N, 3) int64 ticks: unit, encoders, feet
    begun: np.ndarray  # (N,) bool, whether there was a reading before
    moved: np.ndarray  # (N, 3) m/s, world, of the unit at its last reading
    wrong: np.ndarray  # (N, F) bool, feet whose sensor tells the wrong thing
    history: np.ndarray  # (N, L, S) readings, newest first; see `Readings`


class Readings(NamedTuple):
    """Readings of N robots that have arrived; n joints."""

    gyroscope: np.ndarray  # (N, 3) rad/s, in the unit's frame
    accelerometer: np.ndarray  # (N, 3) m/s^2, specific force
    angle: np.ndarray  # (N, n) rad
    rate: np.ndarray  # (N, n) rad/s
    load: np.ndarray  # (N, F) N
    fresh: np.ndarray  # (N,) bool, whether the joints' are new

    @classmethod
    def none(cls, count: int, joints: int, feet: int) -> "Readings":
        """Before the first."""
        unit = np.zeros((2, count, 3))
        own = np.zeros((2, count, joints))
        return cls(unit[0], unit[1], own[0], own[1], np.zeros((count, feet)), np.zeros(count, bool))


def instruments_of(
    sensors: Sensors, mounting: Mounting, foot_of_point: np.ndarray, hz: int, robot: Robot
) -> Instruments:
    """Return the sensors of a robot at its control rate, Hz."""
    own, tick = sensors.scaled, 1.0 / hz
    every = [sensors.every(name, hz) for name in ("imu", "encoder", "contact")]
    share, recovers = own.contact_errors, min(tick / _WRONG, 0.5)
    units = {}
    for unit in UNITS:
        noise, drift, limit = (getattr(own, f"{unit}_{x}") for x in ("noise", "drift", "range"))
        units[unit] = Inertial(noise * np.sqrt(hz / every[0]), drift * np.sqrt(tick), limit)
    return Instruments(
        mounting=mounting,
        tick=tick,
        gravity=robot.gravity,
        **units,
        resolution=own.encoder_resolution,
        noise=own.encoder_noise,
        follow=own.follow(hz),
        load_noise=own.contact_noise * robot.weight,
        threshold=own.contact_threshold * robot.weight,
        goes_wrong=recovers * share / (1.0 - share),
        recovers=recovers,
        every=np.array(every, np.int64),
        foot_of_point=foot_of_point,
    )


@kernel
def sense(
    own: Instruments, state: RobotState, which: np.ndarray, wear: Wear, readings: Readings
) -> None:
    """Read the sensors of robots `which` (N,) bool, and hand over what has arrived by now.

    The state is the robots' own. Their wear is updated, their readings are written.
    """
    for i in range(len(which)):
        if which[i]:
            _remember(wear, i)
            _read_unit(own, state, wear, i)
            _read_joints(own, state, wear, i)
            _read_feet(own, state, wear, i)
            if not wear.begun[i]:
                for age in range(1, wear.history.shape[1]):
                    for k in range(wear.history.shape[2]):
                        wear.history[i, age, k] = wear.history[i, 0, k]
            wear.begun[i] = True
            _hand_over(wear, readings, i)


@compiled
def _remember(wear: Wear, i: int) -> None:
    """Make room for new readings; those that are not due stay what they were."""
    ages, size = wear.history.shape[1], wear.history.shape[2]
    for back in range(1, ages):
        age = ages - back
        for k in range(size):
            wear.history[i, age, k] = wear.history[i, age - 1, k]
    wear.history[i, 0, size - 1] = 0.0


@compiled
def _read_unit(own: Instruments, state: RobotState, wear: Wear, i: int) -> None:
    """Read gyroscope and accelerometer: columns 0 to 5."""
    mounting, generator = own.mounting, wear.generator[i]
    base = rotation_at(state.qpos, i, 3)
    spin = vector(state.qvel, (i,), 3)
    arm = cross(spin, vector(mounting.place, ()))
    moved = add(vector(state.qvel, (i,)), turn(base, arm))
    for axis in range(3):
        if own.gyroscope.drift > 0.0 or own.accelerometer.drift > 0.0:
            wear.gyroscope_bias[i, axis] += own.gyroscope.drift * normal(generator)
            wear.accelerometer_bias[i, axis] += own.accelerometer.drift * normal(generator)
    if state.tick[i] % own.every[0] != 0 and wear.begun[i]:
        return
    to_unit = matrix(mounting.base_from_imu, ())
    rate = turn(transposed(to_unit), spin)
    seconds = own.tick * own.every[0]
    push = (0.0, 0.0, own.gravity)
    if wear.begun[i]:
        push = add(push, scale(1.0 / seconds, subtract(moved, vector(wear.moved, (i,)))))
    force = turn(transposed(product(base, to_unit)), push)
    force = turn(turning(scale(0.5 * seconds, rate)), force)
    store(moved, wear.moved, (i,))
    mounted = matrix(wear.mounted, (i,))
    read = turn(mounted, rate)
    for axis in range(3):
        value = (1.0 + wear.gyroscope_scale[i, axis]) * read[axis] + wear.gyroscope_bias[i, axis]
        value += own.gyroscope.noise * normal(generator)
        wear.history[i, 0, axis] = _within(value, own.gyroscope.limit)
    read = turn(mounted, force)
    for axis in range(3):
        value = (1.0 + wear.accelerometer_scale[i, axis]) * read[axis]
        value += wear.accelerometer_bias[i, axis] + own.accelerometer.noise * normal(generator)
        wear.history[i, 0, 3 + axis] = _within(value, own.accelerometer.limit)


@compiled
def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


@compiled
def _read_joints(own: Instruments, state: RobotState, wear: Wear, i: int) -> None:
    """Read the encoders: positions from column 6 on, then velocities; last, that they are new."""
    if state.tick[i] % own.every[1] != 0 and wear.begun[i]:
        return
    joints, generator = state.qpos.shape[1] - 7, wear.generator[i]
    seconds = own.tick * own.every[1]
    for j in range(joints):
        value = state.qpos[i, 7 + j]
        if own.noise > 0.0:
            value += own.noise * normal(generator)
        if own.resolution > 0.0:
            value = own.resolution * np.floor(value / own.resolution + 0.5)
        if wear.begun[i]:
            rate = wear.history[i, 0, 6 + joints + j]
            new = (value - wear.history[i, 0, 6 + j]) / seconds
            wear.history[i, 0, 6 + joints + j] = rate + own.follow * (new - rate)
        else:
            wear.history[i, 0, 6 + joints + j] = state.qvel[i, 6 + j]
        wear.history[i, 0, 6 + j] = value
    wear.history[i, 0, wear.history.shape[2] - 1] = 1.0


@compiled
def _read_feet(own: Instruments, state: RobotState, wear: Wear, i: int) -> None:
    """Read the force on each foot."""
    feet, generator = wear.wrong.shape[1], wear.generator[i]
    if own.goes_wrong > 0.0:
        for foot in range(feet):
            chance = own.recovers if wear.wrong[i, foot] else own.goes_wrong
            if uniform(generator) < chance:
                wear.wrong[i, foot] = not wear.wrong[i, foot]
    if state.tick[i] % own.every[2] != 0 and wear.begun[i]:
        return
    first = wear.history.shape[2] - 1 - feet
    for foot in range(feet):
        wear.history[i, 0, first + foot] = 0.0
    for point in range(len(own.foot_of_point)):
        column = first + own.foot_of_point[point]
        wear.history[i, 0, column] += state.contact_force[i, point, 2]
    for foot in range(feet):
        load = wear.history[i, 0, first + foot]
        if own.load_noise > 0.0:
            load += own.load_noise * normal(generator)
        if wear.wrong[i, foot]:
            load = 0.0 if load > own.threshold else 2.0 * own.threshold
        wear.history[i, 0, first + foot] = load


@compiled
def _hand_over(wear: Wear, readings: Readings, i: int) -> None:
    """Write what has arrived, by the latency of each kind of sensor."""
    joints, feet, size = readings.angle.shape[1], wear.wrong.shape[1], wear.history.shape[2]
    for axis in range(3):
        readings.gyroscope[i, axis] = wear.history[i, wear.latency[i, 0], axis]
        readings.accelerometer[i, axis] = wear.history[i, wear.latency[i, 0], 3 + axis]
    age = wear.latency[i, 1]
    for j in range(joints):
        readings.angle[i, j] = wear.history[i, age, 6 + j]
        readings.rate[i, j] = wear.history[i, age, 6 + joints + j]
    readings.fresh[i] = wear.history[i, age, size - 1] > 0.0
    age = wear.latency[i, 2]
    for foot in range(feet):
        readings.load[i, foot] = wear.history[i, age, size - 1 - feet + foot]
