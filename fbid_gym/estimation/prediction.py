"""Prediction: what the inertial unit read, integrated over a tick, and how errors grow in it."""

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at, turn_quaternion
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
from fbid_gym.estimation.invariant_filter import BA, BG, Belief, D, Filter, P, R, V
from fbid_gym.estimation.legs import turning
from fbid_gym.estimation.sensing import Readings


@kernel
def predict(own: Filter, readings: Readings, which: np.ndarray, belief: Belief) -> None:
    """Integrate what the inertial unit read over a tick, and how errors grow in it.

    Updates the belief of robots `which` (N,) bool, unless they are lost.
    """
    for i in range(len(which)):
        if which[i] and not belief.lost[i]:
            middle = midway(own, readings, belief, i)
            belief.age[i] += 1
            if belief.age[i] >= own.every:
                _spread(own, middle, belief, i)
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
    turn_quaternion(belief.quaternion, i, 0, turn(middle, scale(dt, spin)))


@compiled
def _spread(own: Filter, middle: Rotation, belief: Belief, i: int) -> None:
    """Take the covariance P to the next correction: Phi P Phi^T + Q, see the equations above.

    P is symmetric, and of feet in the air there are but zeros. First each row becomes that of
    (Phi P)^T, then each column that of Phi (Phi P)^T, down to the diagonal; the rest mirrors it.
    """
    covariance, dt = belief.covariance[i], own.every * own.tick
    size, standing, feet = len(covariance), belief.standing[i], belief.foot[i]
    velocity, position = vector(belief.velocity, (i,)), vector(belief.position, (i,))
    middle = scale(dt, middle[0]), scale(dt, middle[1]), scale(dt, middle[2])
    for k in range(size):
        if k < D or standing[(k - D) // 3]:
            bias = turn(middle, vector(covariance, (k,), BG))
            pushed = turn(middle, vector(covariance, (k,), BA))
            turned, moved = vector(covariance, (k,), R), vector(covariance, (k,), V)
            rows = turned, moved, vector(covariance, (k,), P)
            turned, moved, place = _flow(own, velocity, position, bias, pushed, rows)
            store(turned, covariance, (k,), R)
            store(moved, covariance, (k,), V)
            store(place, covariance, (k,), P)
            for foot in range(len(standing)):
                if standing[foot]:
                    row = D + 3 * foot
                    held = cross(vector(feet, (foot,)), bias)
                    store(subtract(vector(covariance, (k,), row), held), covariance, (k,), row)
    for k in range(size):
        if k < D or standing[(k - D) // 3]:
            # The gyroscope's noise comes in as its bias does, but is no part of it.
            noise = scale(own.turning, _turned(velocity, position, feet, k))
            bias = add(turn(middle, _column(covariance, BG, k)), noise)
            pushed = turn(middle, _column(covariance, BA, k))
            rows = _column(covariance, R, k), _column(covariance, V, k), _column(covariance, P, k)
            turned, moved, place = _flow(own, velocity, position, bias, pushed, rows)
            _store_both(turned, covariance, R, k)
            _store_both(moved, covariance, V, k)
            _store_both(place, covariance, P, k)
            for foot in range((k - D + 3) // 3):
                if standing[foot]:
                    row = D + 3 * foot
                    held = cross(vector(feet, (foot,)), bias)
                    _store_both(subtract(_column(covariance, row, k), held), covariance, row, k)
            for row in range(BG, min(k, D)):
                covariance[k, row] = covariance[row, k]
    for axis in range(3):
        covariance[V + axis, V + axis] += own.pushing
        covariance[V + axis, P + axis] += 0.5 * dt * own.pushing
        covariance[P + axis, V + axis] += 0.5 * dt * own.pushing
        covariance[P + axis, P + axis] += dt * dt / 3.0 * own.pushing
        covariance[BG + axis, BG + axis] += own.gyroscope_drift
        covariance[BA + axis, BA + axis] += own.accelerometer_drift
        for foot in range(len(standing)):
            if standing[foot]:
                row = D + 3 * foot + axis
                covariance[row, row] += own.slipping


@compiled
def _turned(velocity: Vector, position: Vector, feet: np.ndarray, k: int) -> Vector:
    """Return the change of error k by a turn of the unit, per rad: row k of -(1, [v], [p], [d])."""
    axis = k % 3
    own = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
    if k < V:
        return scale(-1.0, own)
    if k < BG:
        return cross(velocity if k < P else position, own)
    if k >= D:
        return cross(vector(feet, ((k - D) // 3,)), own)
    return (0.0, 0.0, 0.0)


@compiled
def _flow(
    own: Filter, velocity: Vector, position: Vector, bias: Vector, pushed: Vector, before: Rotation
) -> Rotation:
    """Apply Phi to the errors of rotation, velocity and place, three vectors.

    `bias` and `pushed` are what the biases of gyroscope and accelerometer come to in that time.
    """
    (turned, moved, place), dt = before, own.every * own.tick
    # [g] xi with g = (0, 0, -gravity).
    fall = (own.gravity * turned[1], -own.gravity * turned[0], 0.0)
    place = add(add(place, scale(dt, moved)), scale(0.5 * dt * dt, fall))
    place = subtract(subtract(place, scale(0.5 * dt, pushed)), cross(position, bias))
    moved = subtract(subtract(add(moved, scale(dt, fall)), pushed), cross(velocity, bias))
    return subtract(turned, bias), moved, place


@compiled
def _column(values: np.ndarray, row: int, k: int) -> Vector:
    return values[row, k], values[row + 1, k], values[row + 2, k]


@compiled
def _store_both(a: Vector, values: np.ndarray, row: int, k: int) -> None:
    """Write to column k of a symmetric matrix, down to the diagonal, and to row k."""
    for axis in range(3):
        if row + axis <= k:
            values[row + axis, k], values[k, row + axis] = a[axis], a[axis]
