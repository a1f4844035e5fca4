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
    for i in range(len(which)):
        if which[i] and not belief.lost[i]:
            _predict(own, readings, belief, i)


@compiled
def _predict(own: Filter, readings: Readings, belief: Belief, i: int) -> None:
    middle = midway(own, readings, belief, i)
    belief.age[i] += 1
    if belief.age[i] >= own.every:
        velocity, position = vector(belief.velocity, (i,)), vector(belief.position, (i,))
        _spread(own, middle, velocity, position, belief, i)
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
def _spread(
    own: Filter, middle: Rotation, velocity: Vector, position: Vector, belief: Belief, i: int
) -> None:
    """Take the covariance to the next correction: Phi P Phi^T + Q, see the equations above."""
    covariance, dt = belief.covariance[i], own.every * own.tick
    size, foot, standing = len(covariance), belief.foot[i], belief.standing[i]
    still = (0.0, 0.0, 0.0)
    for k in range(size):
        _flow(own, middle, velocity, position, foot, standing, still, covariance, k)
    for k in range(size):
        for j in range(k):
            # The rows are done: the same for the columns, by way of the transposed.
            covariance[k, j], covariance[j, k] = covariance[j, k], covariance[k, j]
    for k in range(size):
        # The gyroscope's noise comes in as its bias does, but is no part of it.
        noise = scale(own.turning, _turned(velocity, position, foot, standing, k))
        _flow(own, middle, velocity, position, foot, standing, noise, covariance, k)
    for axis in range(3):
        covariance[V + axis, V + axis] += own.pushing
        covariance[V + axis, P + axis] += 0.5 * dt * own.pushing
        covariance[P + axis, V + axis] += 0.5 * dt * own.pushing
        covariance[P + axis, P + axis] += dt * dt / 3.0 * own.pushing
        covariance[BG + axis, BG + axis] += own.gyroscope_drift
        covariance[BA + axis, BA + axis] += own.accelerometer_drift
        for one in range(len(standing)):
            if standing[one]:
                place = D + 3 * one + axis
                covariance[place, place] += own.slipping


@compiled
def _turned(
    velocity: Vector, position: Vector, foot: np.ndarray, standing: np.ndarray, k: int
) -> Vector:
    """What a turn of the unit takes from error k, per rad: row k of -(1, [v], [p], [d])."""
    part, axis = k // 3, k % 3
    own = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
    if k < V:
        return scale(-1.0, own)
    if k < BG:
        return cross(velocity if k < P else position, own)
    one = part - D // 3
    if one >= 0 and standing[one]:
        return cross(vector(foot, (one,)), own)
    return (0.0, 0.0, 0.0)


@compiled
def _flow(
    own: Filter,
    middle: Rotation,
    velocity: Vector,
    position: Vector,
    foot: np.ndarray,
    standing: np.ndarray,
    noise: Vector,
    covariance: np.ndarray,
    k: int,
) -> None:
    """Apply Phi to column k of a matrix; `noise` is added to what the gyroscope's bias turns."""
    dt = own.every * own.tick
    turned = _column(covariance, R, k)
    bias = add(scale(dt, turn(middle, _column(covariance, BG, k))), noise)
    pushed = scale(dt, turn(middle, _column(covariance, BA, k)))
    moved = _column(covariance, V, k)
    # [g] xi with g = (0, 0, -gravity).
    fall = (own.gravity * turned[1], -own.gravity * turned[0], 0.0)
    place = add(_column(covariance, P, k), scale(dt, moved))
    place = add(place, scale(0.5 * dt * dt, fall))
    place = subtract(place, scale(0.5 * dt, pushed))
    _store_column(subtract(place, cross(position, bias)), covariance, P, k)
    moved = subtract(add(moved, scale(dt, fall)), pushed)
    _store_column(subtract(moved, cross(velocity, bias)), covariance, V, k)
    _store_column(subtract(turned, bias), covariance, R, k)
    for one in range(len(standing)):
        if standing[one]:
            row = D + 3 * one
            held = subtract(_column(covariance, row, k), cross(vector(foot, (one,)), bias))
            _store_column(held, covariance, row, k)


@compiled
def _column(values: np.ndarray, row: int, k: int) -> Vector:
    return values[row, k], values[row + 1, k], values[row + 2, k]


@compiled
def _store_column(a: Vector, values: np.ndarray, row: int, k: int) -> None:
    values[row, k], values[row + 1, k], values[row + 2, k] = a
