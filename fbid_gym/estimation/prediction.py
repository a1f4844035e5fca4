"""Prediction: what the inertial unit read, integrated over a tick, and how errors grow in it."""

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at
from fbid_gym.dynamics.vectors import (
    Rotation,
    Vector,
    add,
    cross,
    product,
    scale,
    store,
    subtract,
    turn,
    vector,
)
from fbid_gym.estimation.invariant_filter import (
    BA,
    BG,
    Belief,
    D,
    Filter,
    P,
    R,
    V,
    turn_quaternion,
)
from fbid_gym.estimation.legs import turning
from fbid_gym.estimation.sensing import Readings


@kernel
def predict(own: Filter, readings: Readings, which: np.ndarray, belief: Belief) -> None:
    """Integrate what the inertial unit read over a tick, and how errors grow in it.

    Args:
        own: constants.
        readings: of the robots.
        which: (N,) bool, robots to go on with.
        belief: updated.
    """
    line = np.empty(belief.covariance.shape[1])
    for i in range(len(which)):
        if which[i] and not belief.lost[i]:
            _predict(own, readings, belief, line, i)


@compiled
def _predict(own: Filter, readings: Readings, belief: Belief, line: np.ndarray, i: int) -> None:
    """Go on with one robot; `line` is a buffer."""
    middle = midway(own, readings, belief, i)
    belief.age[i] += 1
    if belief.age[i] >= own.every:
        _spread(own, middle, belief, line, i)
    integrate(own, readings, belief, middle, i)


@compiled
def midway(own: Filter, readings: Readings, belief: Belief, i: int) -> Rotation:
    """Return the unit's rotation in the middle of the tick: force and rotation are those there."""
    spin = subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    return product(rotation_at(belief.quaternion, i, 0), turning(scale(0.5 * own.tick, spin)))


@compiled
def integrate(own: Filter, readings: Readings, belief: Belief, middle: Rotation, i: int) -> None:
    """Integrate over a tick what the unit of a robot read; `middle` as of `midway`."""
    dt = own.tick
    spin = subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    force = subtract(vector(readings.accelerometer, (i,)), vector(belief.accelerometer_bias, (i,)))
    for axis in range(3):
        read = readings.accelerometer[i, axis]
        belief.felt[i, axis] += own.settle * (read - belief.felt[i, axis])
    push = turn(middle, force)
    change = scale(dt, (push[0], push[1], push[2] - own.gravity))
    velocity, position = vector(belief.velocity, (i,)), vector(belief.position, (i,))
    store(add(velocity, change), belief.velocity, (i,))
    way = scale(dt, add(velocity, scale(0.5, change)))
    store(add(position, way), belief.position, (i,))
    turn_quaternion(belief.quaternion, i, turn(middle, scale(dt, spin)))


@compiled
def _spread(own: Filter, middle: Rotation, belief: Belief, line: np.ndarray, i: int) -> None:
    """Take the covariance P to the next correction: Phi P Phi^T + Q, see the equations above.

    P is symmetric, and of feet in the air there are but zeros. First each row becomes that of
    (Phi P)^T, then each column that of Phi (Phi P)^T, down to the diagonal; the rest mirrors it.
    """
    covariance, dt = belief.covariance[i], own.every * own.tick
    size, standing, still = len(line), belief.standing[i], (0.0, 0.0, 0.0)
    for k in range(size):
        if k < D or standing[(k - D) // 3]:
            for j in range(size):
                line[j] = covariance[k, j]
            _flow(own, middle, still, belief, line, size, i)
            for j in range(size):
                covariance[k, j] = line[j]
    for k in range(size):
        if k < D or standing[(k - D) // 3]:
            for j in range(size):
                line[j] = covariance[j, k]
            # The gyroscope's noise comes in as its bias does, but is no part of it.
            noise = scale(own.turning, _turned(belief, i, k))
            _flow(own, middle, noise, belief, line, k + 1, i)
            for j in range(k + 1):
                covariance[j, k], covariance[k, j] = line[j], line[j]
    for axis in range(3):
        covariance[V + axis, V + axis] += own.pushing
        covariance[V + axis, P + axis] += 0.5 * dt * own.pushing
        covariance[P + axis, V + axis] += 0.5 * dt * own.pushing
        covariance[P + axis, P + axis] += dt * dt / 3.0 * own.pushing
        covariance[BG + axis, BG + axis] += own.gyroscope_drift
        covariance[BA + axis, BA + axis] += own.accelerometer_drift
        for foot in range(len(standing)):
            if standing[foot]:
                place = D + 3 * foot + axis
                covariance[place, place] += own.slipping


@compiled
def _turned(belief: Belief, i: int, k: int) -> Vector:
    """What a turn of the unit takes from error k, per rad: row k of -(1, [v], [p], [d])."""
    foot, axis = (k - D) // 3, k % 3
    own = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
    if k < V:
        return scale(-1.0, own)
    if k < BG:
        return cross(vector(belief.velocity if k < P else belief.position, (i,)), own)
    if k >= D and belief.standing[i, foot]:
        return cross(vector(belief.foot, (i, foot)), own)
    return (0.0, 0.0, 0.0)


@compiled
def _flow(
    own: Filter,
    middle: Rotation,
    noise: Vector,
    belief: Belief,
    line: np.ndarray,
    count: int,
    i: int,
) -> None:
    """Apply Phi to a vector of errors `line`, of which no more than `count` entries are wanted.

    `noise` is added to what the gyroscope's bias turns.
    """
    dt = own.every * own.tick
    turned, moved = vector(line, (), R), vector(line, (), V)
    bias = add(scale(dt, turn(middle, vector(line, (), BG))), noise)
    store(subtract(turned, bias), line, (), R)
    if count <= V:
        return
    pushed = scale(dt, turn(middle, vector(line, (), BA)))
    # [g] xi with g = (0, 0, -gravity).
    fall = (own.gravity * turned[1], -own.gravity * turned[0], 0.0)
    place = add(vector(line, (), P), scale(dt, moved))
    place = subtract(add(place, scale(0.5 * dt * dt, fall)), scale(0.5 * dt, pushed))
    store(subtract(place, cross(vector(belief.position, (i,)), bias)), line, (), P)
    moved = subtract(add(moved, scale(dt, fall)), pushed)
    store(subtract(moved, cross(vector(belief.velocity, (i,)), bias)), line, (), V)
    for foot in range((count - D + 2) // 3):
        if belief.standing[i, foot]:
            row = D + 3 * foot
            held = cross(vector(belief.foot, (i, foot)), bias)
            store(subtract(vector(line, (), row), held), line, (), row)
