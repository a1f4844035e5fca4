"""Correction: where standing feet are seen tells of all errors; and the state it comes to."""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at, turn_quaternion
from fbid_gym.dynamics.vectors import (
    Rotation,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    scale,
    store,
    subtract,
    transposed,
    turn,
    vector,
)
from fbid_gym.estimation.invariant_filter import BA, BG, Belief, D, Filter, P, V, store_quaternion
from fbid_gym.estimation.legs import Legs, place_foot, turning
from fbid_gym.estimation.prediction import predict
from fbid_gym.estimation.restart import begin_anew, has_gone_wrong
from fbid_gym.estimation.sensing import Readings
from fbid_gym.quantities import RobotState

_Turn = tuple[Rotation, Vector, float, float]  # and its vector, versine and rest, see `_move`


class _Work(NamedTuple):
    """Buffers for the correction of one robot, whose legs have at most K joints."""

    axis: np.ndarray  # (K, 3) axes of a leg's joints
    arm: np.ndarray  # (K, 3) columns of the Jacobian of its foot's centre
    noise: np.ndarray  # (3, 3) m^2, covariance of where that is seen
    column: np.ndarray  # (3, 15 + 3F), H P
    error: np.ndarray  # (15 + 3F,), what is known of (xi, zeta)
    fresh: np.ndarray  # (F,) bool, feet to be added


@kernel
def update(
    own: Filter, legs: Legs, readings: Readings, which: np.ndarray, belief: Belief, seen: RobotState
) -> None:
    """Go on with the estimate of robots `which` (N,) bool by a tick, and write it as their state.

    It is predicted, but for robots that are lost, and corrected by where standing feet are seen.
    The belief is updated; `seen`, the state that it means, is written without the tick.
    """
    predict(own, readings, which, belief)
    joints, feet = legs.joint.shape[1], legs.joint.shape[0]
    size = D + 3 * feet
    axis, arm = np.empty((joints, 3)), np.empty((joints, 3))
    noise, column, error = np.empty((3, 3)), np.empty((3, size)), np.empty(size)
    work = _Work(axis, arm, noise, column, error, np.empty(feet, np.bool_))
    for i in range(len(which)):
        if which[i]:
            _correct(own, legs, readings, belief, work, i)
            write_state(own, readings, belief, seen, i)


@compiled
def _correct(
    own: Filter, legs: Legs, readings: Readings, belief: Belief, work: _Work, i: int
) -> None:
    """Correct one robot."""
    axis, arm, _, _, error, fresh = work
    doubt = 0.0
    for k in range(V, V + 3):
        doubt = max(doubt, belief.covariance[i, k, k])
    if belief.lost[i] or has_gone_wrong(own, belief, doubt, i):
        begin_anew(own, belief, i)
    elif belief.age[i] < own.every:
        return
    seconds, belief.age[i] = own.tick * belief.age[i], 0
    feet = len(fresh)
    rotation = rotation_at(belief.quaternion, i, 0)
    rate = subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    for k in range(len(error)):
        error[k] = 0.0
    stood, slipped = 0, 0
    for foot in range(feet):
        loaded, stands = readings.load[i, foot] > own.threshold, belief.standing[i, foot]
        fresh[foot] = loaded and not stands
        if stands and not loaded:
            drop(belief, i, foot, D, 3)
        elif stands:
            centre, spin = place_foot(legs, foot, readings.angle[i], readings.rate[i], axis, arm)
            roll(legs, turn(rotation, add(rate, spin)), seconds, belief, i, foot)
            if readings.fresh[i]:
                stood += 1
                away = _see(own, legs, rotation, foot, centre, work)
                if not _measure(own, away, work, belief, i, foot):
                    slipped += 1
                    fresh[foot] = True
    belief.slipped[i] = belief.slipped[i] + 1 if stood > 0 and slipped == stood else 0
    belief.refused[i] += slipped
    if stood > slipped:
        _apply(error, belief, i)
        rotation = rotation_at(belief.quaternion, i, 0)
    for foot in range(feet):
        if fresh[foot]:
            centre, _ = place_foot(legs, foot, readings.angle[i], readings.rate[i], axis, arm)
            away = _see(own, legs, rotation, foot, centre, work)
            add_foot(away, work.noise, belief, i, foot, P, D)


@compiled
def roll(legs: Legs, spin: Vector, seconds: float, belief: Belief, i: int, foot: int) -> None:
    """Move the point of contact of a spherical foot on as it rolls; spin in world axes, rad/s."""
    rolled = scale(seconds, cross(spin, (0.0, 0.0, legs.radius[foot])))
    store(add(vector(belief.foot, (i, foot)), rolled), belief.foot, (i, foot))


@compiled
def _see(
    own: Filter, legs: Legs, rotation: Rotation, foot: int, centre: Vector, work: _Work
) -> Vector:
    """Return where a foot is seen from the unit, world axes; writes the covariance of that."""
    arm, noise = work.arm, work.noise
    for j in range(3):
        for k in range(3):
            noise[j, k] = own.placing if j == k else 0.0
    for one in range(legs.joint.shape[1]):
        if legs.joint[foot, one] >= 0:
            along = turn(rotation, vector(arm, (one,)))
            for j in range(3):
                for k in range(3):
                    noise[j, k] += own.encoder * along[j] * along[k]
    seen = turn(rotation, centre)
    return seen[0], seen[1], seen[2] - legs.radius[foot]


@compiled
def _measure(own: Filter, away: Vector, work: _Work, belief: Belief, i: int, foot: int) -> bool:
    """Learn from a standing foot, H = (… 1 at p … -1 at d …); False if it has slipped.

    With S = H P H^T + N = L L^T and W = L^-1 H P, the covariance loses W^T W. The estimate moves
    when all feet have told: until then `error` sums up what is known of xi.
    """
    covariance, row = belief.covariance[i], D + 3 * foot
    size, noise, column, error = len(covariance), work.noise, work.column, work.error
    for axis in range(3):
        for k in range(size):
            column[axis, k] = covariance[P + axis, k] - covariance[row + axis, k]
    a = _innovation(column, noise, row, 0)
    b = _innovation(column, noise, row, 1)
    c = _innovation(column, noise, row, 2)
    first = 1.0 / np.sqrt(a[0])
    ba, ca = a[1] * first, a[2] * first
    second = 1.0 / np.sqrt(b[1] - ba * ba)
    cb = (b[2] - ba * ca) * second
    third = 1.0 / np.sqrt(c[2] - ca * ca - cb * cb)
    told = subtract(add(away, vector(belief.position, (i,))), vector(belief.foot, (i, foot)))
    told = add(subtract(told, vector(error, (), P)), vector(error, (), row))
    x = told[0] * first
    y = (told[1] - ba * x) * second
    z = (told[2] - ca * x - cb * y) * third
    if not x * x + y * y + z * z < own.gate:
        return False
    for k in range(size):
        u = column[0, k] * first
        v = (column[1, k] - ba * u) * second
        w = (column[2, k] - ca * u - cb * v) * third
        column[0, k], column[1, k], column[2, k] = u, v, w
        error[k] += u * x + v * y + w * z
    for k in range(size):
        u, v, w = column[0, k], column[1, k], column[2, k]
        if u == 0.0 and v == 0.0 and w == 0.0:
            continue  # of a foot in the air, which correlates with nothing
        for j in range(size):
            covariance[k, j] -= u * column[0, j] + v * column[1, j] + w * column[2, j]
    return True


@compiled
def _innovation(column: np.ndarray, noise: np.ndarray, row: int, j: int) -> Vector:
    """Row j of H P H^T + N."""
    seen = subtract(vector(column, (j,), P), vector(column, (j,), row))
    return add(seen, vector(noise, (j,)))


@compiled
def _apply(error: np.ndarray, belief: Belief, i: int) -> None:
    """Take a known error out of the estimate: X = Exp(-xi) X, bias = bias - zeta."""
    by = (-error[0], -error[1], -error[2])
    angle = np.sqrt(dot(by, by))
    if angle < 1e-6:
        versine, rest = 0.5, 1.0 / 6.0
    else:
        versine = (1.0 - np.cos(angle)) / (angle * angle)
        rest = (angle - np.sin(angle)) / (angle * angle * angle)
    how = turning(by), by, versine, rest
    _move(error, V, how, belief.velocity, (i,))
    _move(error, P, how, belief.position, (i,))
    for foot in range(belief.foot.shape[1]):
        if belief.standing[i, foot]:
            _move(error, D + 3 * foot, how, belief.foot, (i, foot))
    turn_quaternion(belief.quaternion, i, 0, by)
    for axis in range(3):
        belief.gyroscope_bias[i, axis] -= error[BG + axis]
        belief.accelerometer_bias[i, axis] -= error[BA + axis]


@compiled
def _move(
    error: np.ndarray, first: int, how: _Turn, values: np.ndarray, row: tuple[int, ...]
) -> None:
    """Apply Exp(-xi) to a column of X: turned, and shifted by the left Jacobian of SO(3).

    With t the vector `by`, that is 1 + versine [t] + rest [t]^2.
    """
    turned, by, versine, rest = how
    shift = (-error[first], -error[first + 1], -error[first + 2])
    once = cross(by, shift)
    shift = add(shift, add(scale(versine, once), scale(rest, cross(by, once))))
    store(add(turn(turned, vector(values, row)), shift), values, row)


@compiled
def drop(belief: Belief, i: int, foot: int, d: int, axes: int) -> None:
    """Take a foot out of the state; in the covariance there are `axes` rows each, from d on."""
    belief.standing[i, foot] = False
    covariance, row = belief.covariance[i], d + axes * foot
    for k in range(len(covariance)):
        for axis in range(axes):
            covariance[k, row + axis], covariance[row + axis, k] = 0.0, 0.0


@compiled
def add_foot(
    away: Vector, noise: np.ndarray, belief: Belief, i: int, foot: int, p: int, d: int
) -> None:
    """Add a foot where it is seen: xi_d = xi_p + R noise; these have their rows from d, p on."""
    belief.standing[i, foot] = True
    store(add(vector(belief.position, (i,)), away), belief.foot, (i, foot))
    covariance, axes = belief.covariance[i], len(noise)
    row = d + axes * foot
    for k in range(len(covariance)):
        for axis in range(axes):
            covariance[row + axis, k] = covariance[p + axis, k]
    for k in range(len(covariance)):
        for axis in range(axes):
            covariance[k, row + axis] = covariance[k, p + axis]
    for j in range(axes):
        for k in range(axes):
            covariance[row + j, row + k] = covariance[p + j, p + k] + noise[j, k]


@compiled
def write_state(own: Filter, readings: Readings, belief: Belief, seen: RobotState, i: int) -> None:
    """Write the state of the robot's base, joints and feet."""
    to_base = matrix(own.mounting.base_from_imu, ())
    base = product(rotation_at(belief.quaternion, i, 0), transposed(to_base))
    store_quaternion(base, seen.qpos, i, 3)
    place = vector(own.mounting.place, ())
    spin = turn(
        to_base, subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    )
    middle = add(vector(belief.origin, (i,)), vector(belief.position, (i,)))
    store(subtract(middle, turn(base, place)), seen.qpos, (i,))
    moved = subtract(vector(belief.velocity, (i,)), turn(base, cross(spin, place)))
    store(moved, seen.qvel, (i,))
    store(spin, seen.qvel, (i,), 3)
    for j in range(readings.angle.shape[1]):
        seen.qpos[i, 7 + j], seen.qvel[i, 6 + j] = readings.angle[i, j], readings.rate[i, j]
    for point in range(len(own.foot_of_point)):
        foot = own.foot_of_point[point]
        load = readings.load[i, foot] / own.points[foot]
        standing = readings.load[i, foot] > own.threshold
        store((0.0, 0.0, load if standing else 0.0), seen.contact_force, (i, point))
