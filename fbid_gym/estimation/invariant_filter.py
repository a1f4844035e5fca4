"""A contact-aided invariant extended Kalman filter for a robot's state.

Hartley, Ghaffari, Eustice and Grizzle 2020, "Contact-aided invariant extended Kalman filtering for
robot state estimation", IJRR 39(4).

The state of a robot is X = (R, v, p, d_1 … d_F) in SE_{2+F}(3), and two biases: rotation, velocity
and place of the inertial unit in the world, and the places of the feet that stand. Its error is the
right-invariant one, X_estimated = Exp(xi) X, and bias_estimated = bias + zeta. Then xi obeys a
linear equation that does not depend on the state (all of it, but for the biases):

    xi_R' = -R zeta_g               xi_v' = [g] xi_R - [v] R zeta_g - R zeta_a
    xi_p' = xi_v - [p] R zeta_g     xi_d' = -[d] R zeta_g

and what the legs measure, where a foot is seen from the unit, h = R^T (d - p), makes an innovation
that does not depend on it either:

    R_estimated h_measured - (d - p)_estimated = xi_p - xi_d + R noise.

Neither heading nor place can be told from these sensors: nothing here depends on them, and they
drift. A foot that comes down is added to the state where it is, one that lifts is taken out. Feet
that are measured too far from where they should be, by a chi-square test, are taken to have
slipped: they tell nothing, and stand where they are from then on. A spherical foot rolls without
slipping, and its point of contact with it.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at
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
from fbid_gym.estimation.legs import Legs, Mounting, place_foot, turning
from fbid_gym.estimation.sensing import Readings
from fbid_gym.quantities import RobotState

_R, _V, _P, _BG, _BA, _D = 0, 3, 6, 9, 12, 15
"""Where in xi the parts begin; d_i stands at _D + 3 i."""


class Filter(NamedTuple):
    """What the filter assumes; constants.

    Variances are of the time between two corrections, unless said otherwise.
    """

    tick: float  # s
    every: int  # ticks from one correction to the next: between them it only integrates
    gravity: float  # m/s^2
    turning: float  # rad^2, of the rotation
    pushing: float  # m^2/s^2, of the velocity
    gyroscope_drift: float  # rad^2/s^2, of the bias
    accelerometer_drift: float  # m^2/s^4, of the bias
    slipping: float  # m^2, of a foot that stands
    placing: float  # m^2, of where a foot is seen, at each reading
    encoder: float  # rad^2, of a joint's position
    threshold: float  # N, on a foot that stands
    gate: float  # of chi-square with three degrees of freedom, beyond which a foot has slipped
    tilt_variance: float  # rad^2, at the start, beside that from the accelerometer's bias
    velocity_variance: float  # m^2/s^2, at the start
    gyroscope_variance: float  # rad^2/s^2, of the bias at the start
    accelerometer_variance: float  # m^2/s^4, of the bias at the start
    fastest: float  # m/s that is believed
    vaguest: float  # m^2/s^2, variance of the velocity beyond which it begins anew
    patience: int  # corrections for which all feet may slip before it begins anew
    settle: float  # share of the newest reading in the mean specific force
    mounting: Mounting  # of the unit
    foot_of_point: np.ndarray  # (P,) int64
    points: np.ndarray  # (F,) float, number of points of each foot


class Belief(NamedTuple):
    """What the filter believes of N robots."""

    quaternion: np.ndarray  # (N, 4) wxyz, of R
    velocity: np.ndarray  # (N, 3) m/s
    position: np.ndarray  # (N, 3) m, from `origin`
    gyroscope_bias: np.ndarray  # (N, 3) rad/s
    accelerometer_bias: np.ndarray  # (N, 3) m/s^2
    foot: np.ndarray  # (N, F, 3) m, places of the feet that stand
    standing: np.ndarray  # (N, F) bool
    covariance: np.ndarray  # (N, 15 + 3F, 15 + 3F) of (xi, zeta)
    felt: np.ndarray  # (N, 3) m/s^2, mean specific force
    origin: np.ndarray  # (N, 3) m, world, where the episode began
    lost: np.ndarray  # (N,) bool, begins anew
    slipped: np.ndarray  # (N,) int64, corrections for which all standing feet have slipped
    age: np.ndarray  # (N,) int64, ticks since the last correction
    refused: np.ndarray  # (N,) int64, measurements of feet that were refused since the start
    restarts: np.ndarray  # (N,) int64, how often it has begun anew since the start

    @classmethod
    def none(cls, count: int, feet: int) -> "Belief":
        """Of robots of which nothing is known."""
        size = _D + 3 * feet
        vectors = np.zeros((6, count, 3))
        quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
        return cls(
            quaternion,
            *(vectors[k].copy() for k in range(4)),
            np.zeros((count, feet, 3)),
            np.zeros((count, feet), bool),
            np.zeros((count, size, size)),
            vectors[4].copy(),
            vectors[5].copy(),
            np.ones(count, bool),
            *np.zeros((4, count), np.int64),
        )


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
    dt = own.tick
    spin = subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    force = subtract(vector(readings.accelerometer, (i,)), vector(belief.accelerometer_bias, (i,)))
    for axis in range(3):
        read = readings.accelerometer[i, axis]
        belief.felt[i, axis] += own.settle * (read - belief.felt[i, axis])
    # Force and rotation are those of the middle of the tick.
    middle = product(rotation_at(belief.quaternion, i, 0), turning(scale(0.5 * dt, spin)))
    push = turn(middle, force)
    push = push[0], push[1], push[2] - own.gravity
    velocity, position = vector(belief.velocity, (i,)), vector(belief.position, (i,))
    belief.age[i] += 1
    if belief.age[i] >= own.every:
        _spread(own, middle, velocity, position, belief, i)
    change = scale(dt, push)
    store(add(velocity, change), belief.velocity, (i,))
    way = scale(dt, add(velocity, scale(0.5, change)))
    store(add(position, way), belief.position, (i,))
    _turn_quaternion(belief.quaternion, i, turn(middle, scale(dt, spin)))


@compiled
def _spread(
    own: Filter, middle: Rotation, velocity: Vector, position: Vector, belief: Belief, i: int
) -> None:
    """Take the covariance to the next correction: Phi P Phi^T + Q, see the equations above."""
    covariance, dt = belief.covariance[i], own.every * own.tick
    size = len(covariance)
    for k in range(size):
        _flow(own, middle, velocity, position, belief.foot[i], belief.standing[i], covariance, k)
    for k in range(size):
        for j in range(k):
            # The rows are done: the same for the columns, by way of the transposed.
            covariance[k, j], covariance[j, k] = covariance[j, k], covariance[k, j]
    for k in range(size):
        _flow(own, middle, velocity, position, belief.foot[i], belief.standing[i], covariance, k)
    # The gyroscope's noise comes in as its bias does: by 1, [v], [p], [d].
    feet = belief.foot.shape[1]
    for one in range(3 + feet):
        first = _lever(one, velocity, position, belief, i)
        if one < 3 or belief.standing[i, one - 3]:
            for other in range(one + 1):
                if other < 3 or belief.standing[i, other - 3]:
                    second = _lever(other, velocity, position, belief, i)
                    _add_turning(own.turning, one, other, first, second, covariance)
    for axis in range(3):
        covariance[_V + axis, _V + axis] += own.pushing
        covariance[_V + axis, _P + axis] += 0.5 * dt * own.pushing
        covariance[_P + axis, _V + axis] += 0.5 * dt * own.pushing
        covariance[_P + axis, _P + axis] += dt * dt / 3.0 * own.pushing
        covariance[_BG + axis, _BG + axis] += own.gyroscope_drift
        covariance[_BA + axis, _BA + axis] += own.accelerometer_drift
        for foot in range(feet):
            if belief.standing[i, foot]:
                place = _D + 3 * foot + axis
                covariance[place, place] += own.slipping


@compiled
def _row(part: int) -> int:
    """Where a part begins: rotation, velocity, place, then the feet."""
    return 3 * part if part < 3 else _D + 3 * (part - 3)


@compiled
def _lever(part: int, velocity: Vector, position: Vector, belief: Belief, i: int) -> Vector:
    """By which a turn of the world moves a part; that of the rotation is not used."""
    if part < 2:
        return velocity
    return position if part == 2 else vector(belief.foot, (i, part - 3))


@compiled
def _add_turning(
    variance: float,
    one: int,
    other: int,
    first: Vector,
    second: Vector,
    covariance: np.ndarray,
) -> None:
    """Add the part of the gyroscope's noise that two parts share, `other` not after `one`.

    [a][b]^T = a.b - b a^T.
    """
    inner, a, b = dot(first, second), _row(one), _row(other)
    for j in range(3):
        for k in range(3):
            if one == 0:
                value = 1.0 if j == k else 0.0
            elif other == 0:
                value = _skew(first, j, k)
            else:
                value = (inner if j == k else 0.0) - second[j] * first[k]
            covariance[a + j, b + k] += variance * value
            if one != other:
                covariance[b + k, a + j] += variance * value


@compiled
def _skew(a: Vector, j: int, k: int) -> float:
    """Entry j, k of the matrix [a] with [a] b = a × b."""
    if j == k:
        return 0.0
    return a[3 - j - k] if (j + 1) % 3 != k else -a[3 - j - k]


@compiled
def _flow(
    own: Filter,
    middle: Rotation,
    velocity: Vector,
    position: Vector,
    foot: np.ndarray,
    standing: np.ndarray,
    covariance: np.ndarray,
    k: int,
) -> None:
    """Apply Phi to column k of a matrix."""
    dt = own.every * own.tick
    turned = _column(covariance, _R, k)
    bias = scale(dt, turn(middle, _column(covariance, _BG, k)))
    pushed = scale(dt, turn(middle, _column(covariance, _BA, k)))
    moved = _column(covariance, _V, k)
    # [g] xi with g = (0, 0, -gravity).
    fall = (own.gravity * turned[1], -own.gravity * turned[0], 0.0)
    place = add(_column(covariance, _P, k), scale(dt, moved))
    place = add(place, scale(0.5 * dt * dt, fall))
    place = subtract(place, scale(0.5 * dt, pushed))
    _store_column(subtract(place, cross(position, bias)), covariance, _P, k)
    moved = subtract(add(moved, scale(dt, fall)), pushed)
    _store_column(subtract(moved, cross(velocity, bias)), covariance, _V, k)
    _store_column(subtract(turned, bias), covariance, _R, k)
    for one in range(len(standing)):
        if standing[one]:
            row = _D + 3 * one
            held = subtract(_column(covariance, row, k), cross(vector(foot, (one,)), bias))
            _store_column(held, covariance, row, k)


@compiled
def _column(values: np.ndarray, row: int, k: int) -> Vector:
    return values[row, k], values[row + 1, k], values[row + 2, k]


@compiled
def _store_column(a: Vector, values: np.ndarray, row: int, k: int) -> None:
    values[row, k], values[row + 1, k], values[row + 2, k] = a


@compiled
def _turn_quaternion(quaternion: np.ndarray, i: int, by: Vector) -> None:
    """Turn quaternion[i] by a rotation vector (rad, world axes)."""
    angle = np.sqrt(dot(by, by))
    half = 0.5 * angle
    sine = 0.5 if angle < 1e-8 else np.sin(half) / angle
    w, (x, y, z) = np.cos(half), scale(sine, by)
    a, b = quaternion[i, 0], quaternion[i, 1]
    c, d = quaternion[i, 2], quaternion[i, 3]
    e, f = w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c
    g, h = w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a
    size = np.sqrt(e * e + f * f + g * g + h * h)
    quaternion[i, 0], quaternion[i, 1] = e / size, f / size
    quaternion[i, 2], quaternion[i, 3] = g / size, h / size


@kernel
def correct(
    own: Filter,
    legs: Legs,
    readings: Readings,
    which: np.ndarray,
    belief: Belief,
    seen: RobotState,
) -> None:
    """Correct the estimate by where the standing feet are seen, and write it as a robot's state.

    Args:
        own: constants.
        legs: of the robots.
        readings: of the robots.
        which: (N,) bool, robots to go on with.
        belief: updated.
        seen: the state that it means, without the tick; written.
    """
    joints, feet = legs.joint.shape[1], legs.joint.shape[0]
    size = _D + 3 * feet
    axis, arm = np.empty((joints, 3)), np.empty((joints, 3))
    away, noise = np.empty((feet, 3)), np.empty((feet, 3, 3))
    column, gain, error = np.empty((size, 3)), np.empty((size, 3)), np.empty(size)
    fresh = np.empty(feet, np.bool_)
    for i in range(len(which)):
        if which[i]:
            _correct(
                own, legs, readings, belief, axis, arm, away, noise, column, gain, error, fresh, i
            )
            _write(own, readings, belief, seen, i)


@compiled
def _correct(
    own: Filter,
    legs: Legs,
    readings: Readings,
    belief: Belief,
    axis: np.ndarray,
    arm: np.ndarray,
    away: np.ndarray,
    noise: np.ndarray,
    column: np.ndarray,
    gain: np.ndarray,
    error: np.ndarray,
    fresh: np.ndarray,
    i: int,
) -> None:
    """Correct one robot; the arrays from `axis` to `fresh` are buffers."""
    if belief.lost[i] or _has_gone_wrong(own, belief, i):
        _begin(own, belief, i)
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
        centre, spin = place_foot(legs, foot, readings.angle[i], readings.rate[i], axis, arm)
        _see(own, legs, rotation, foot, centre, arm, away, noise)
        loaded = readings.load[i, foot] > own.threshold
        fresh[foot] = loaded and not belief.standing[i, foot]
        if belief.standing[i, foot]:
            # The point of contact of a sphere moves on as it rolls.
            turning_rate = turn(rotation, add(rate, spin))
            rolled = scale(seconds, cross(turning_rate, (0.0, 0.0, legs.radius[foot])))
            store(add(vector(belief.foot, (i, foot)), rolled), belief.foot, (i, foot))
            if not loaded:
                _drop(belief, i, foot)
            elif readings.fresh[i]:
                stood += 1
                if not _measure(own, away, noise, column, gain, error, belief, i, foot):
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
            _see(own, legs, rotation, foot, centre, arm, away, noise)
            _add(away, noise, belief, i, foot)


@compiled
def _see(
    own: Filter,
    legs: Legs,
    rotation: Rotation,
    foot: int,
    centre: Vector,
    arm: np.ndarray,
    away: np.ndarray,
    noise: np.ndarray,
) -> None:
    """Write where a foot is seen from the unit, world axes, and the covariance of that."""
    seen = turn(rotation, centre)
    store((seen[0], seen[1], seen[2] - legs.radius[foot]), away, (foot,))
    for j in range(3):
        for k in range(3):
            noise[foot, j, k] = own.placing if j == k else 0.0
    for one in range(legs.joint.shape[1]):
        if legs.joint[foot, one] >= 0:
            along = turn(rotation, vector(arm, (one,)))
            for j in range(3):
                for k in range(3):
                    noise[foot, j, k] += own.encoder * along[j] * along[k]


@compiled
def _measure(
    own: Filter,
    away: np.ndarray,
    noise: np.ndarray,
    column: np.ndarray,
    gain: np.ndarray,
    error: np.ndarray,
    belief: Belief,
    i: int,
    foot: int,
) -> bool:
    """Learn from a standing foot, H = (… 1 at p … -1 at d …); False if it has slipped.

    The estimate moves when all feet have told: until then `error` sums up what is known of xi.
    """
    covariance, row = belief.covariance[i], _D + 3 * foot
    size = len(covariance)
    for k in range(size):
        for axis in range(3):
            column[k, axis] = covariance[k, _P + axis] - covariance[k, row + axis]
    a = (
        _innovation(column, noise, row, foot, 0, 0),
        _innovation(column, noise, row, foot, 0, 1),
        _innovation(column, noise, row, foot, 0, 2),
    )
    b = (
        _innovation(column, noise, row, foot, 1, 0),
        _innovation(column, noise, row, foot, 1, 1),
        _innovation(column, noise, row, foot, 1, 2),
    )
    c = (
        _innovation(column, noise, row, foot, 2, 0),
        _innovation(column, noise, row, foot, 2, 1),
        _innovation(column, noise, row, foot, 2, 2),
    )
    # The inverse of a symmetric matrix with rows a, b, c.
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    size_of_it = dot(a, bc)
    z = subtract(
        add(vector(away, (foot,)), vector(belief.position, (i,))), vector(belief.foot, (i, foot))
    )
    told = (
        z[0] - error[_P] + error[row],
        z[1] - error[_P + 1] + error[row + 1],
        z[2] - error[_P + 2] + error[row + 2],
    )
    weighed = (
        dot((bc[0], ca[0], ab[0]), told) / size_of_it,
        dot((bc[1], ca[1], ab[1]), told) / size_of_it,
        dot((bc[2], ca[2], ab[2]), told) / size_of_it,
    )
    if not dot(told, weighed) < own.gate:
        return False
    for k in range(size):
        own_row = vector(column, (k,))
        gain[k, 0] = dot(own_row, bc) / size_of_it
        gain[k, 1] = dot(own_row, ca) / size_of_it
        gain[k, 2] = dot(own_row, ab) / size_of_it
        error[k] += dot(own_row, weighed)
    for k in range(size):
        own_row = vector(gain, (k,))
        for j in range(k + 1):
            value = covariance[k, j] - dot(own_row, vector(column, (j,)))
            covariance[k, j] = value
            covariance[j, k] = value
    return True


@compiled
def _innovation(
    column: np.ndarray, noise: np.ndarray, row: int, foot: int, j: int, k: int
) -> float:
    """Entry j, k of H P H^T + N."""
    return column[_P + j, k] - column[row + j, k] + noise[foot, j, k]


@compiled
def _apply(error: np.ndarray, belief: Belief, i: int) -> None:
    """Take a known error out of the estimate: X = Exp(-xi) X, bias = bias - zeta."""
    by = (-error[0], -error[1], -error[2])
    turned = turning(by)
    _move(error, _V, by, turned, belief.velocity, (i,))
    _move(error, _P, by, turned, belief.position, (i,))
    for foot in range(belief.foot.shape[1]):
        if belief.standing[i, foot]:
            _move(error, _D + 3 * foot, by, turned, belief.foot, (i, foot))
    _turn_quaternion(belief.quaternion, i, by)
    for axis in range(3):
        belief.gyroscope_bias[i, axis] -= error[_BG + axis]
        belief.accelerometer_bias[i, axis] -= error[_BA + axis]


@compiled
def _move(
    error: np.ndarray,
    first: int,
    by: Vector,
    turned: Rotation,
    values: np.ndarray,
    row: tuple[int, ...],
) -> None:
    """Apply Exp(-xi) to a column of X: turned, and shifted by the left Jacobian of SO(3)."""
    angle = np.sqrt(dot(by, by))
    shift = (-error[first], -error[first + 1], -error[first + 2])
    if angle < 1e-6:
        versine, rest = 0.5, 1.0 / 6.0
    else:
        versine = (1.0 - np.cos(angle)) / (angle * angle)
        rest = (angle - np.sin(angle)) / (angle * angle * angle)
    once = cross(by, shift)
    shift = add(shift, add(scale(versine, once), scale(rest, cross(by, once))))
    store(add(turn(turned, vector(values, row)), shift), values, row)


@compiled
def _drop(belief: Belief, i: int, foot: int) -> None:
    """Take a foot out of the state."""
    belief.standing[i, foot] = False
    covariance, row = belief.covariance[i], _D + 3 * foot
    for k in range(len(covariance)):
        for axis in range(3):
            covariance[k, row + axis], covariance[row + axis, k] = 0.0, 0.0


@compiled
def _add(away: np.ndarray, noise: np.ndarray, belief: Belief, i: int, foot: int) -> None:
    """Add a foot where it is seen: xi_d = xi_p + R noise."""
    belief.standing[i, foot] = True
    store(add(vector(belief.position, (i,)), vector(away, (foot,))), belief.foot, (i, foot))
    covariance, row = belief.covariance[i], _D + 3 * foot
    for k in range(len(covariance)):
        for axis in range(3):
            covariance[row + axis, k] = covariance[_P + axis, k]
    for k in range(len(covariance)):
        for axis in range(3):
            covariance[k, row + axis] = covariance[k, _P + axis]
    for j in range(3):
        for k in range(3):
            covariance[row + j, row + k] = covariance[_P + j, _P + k] + noise[foot, j, k]


@compiled
def _has_gone_wrong(own: Filter, belief: Belief, i: int) -> bool:
    """Whether an estimate can no longer be trusted; then it begins anew, and counts that."""
    velocity = vector(belief.velocity, (i,))
    square, vague = dot(velocity, velocity), 0.0
    for axis in range(3):
        vague = max(vague, belief.covariance[i, _V + axis, _V + axis])
        square += 0.0 * belief.position[i, axis] * belief.quaternion[i, axis]
    sound = square < own.fastest * own.fastest and vague < own.vaguest
    if sound and belief.slipped[i] <= own.patience:
        return False
    belief.restarts[i] += 1
    return True


@compiled
def _begin(own: Filter, belief: Belief, i: int) -> None:
    """Begin with the heading and place of before, upright as the accelerometer has it, at rest.

    A bias of the accelerometer tilts it: R_estimated (f + bias) is vertical, hence
    xi_R = e_3 × R zeta_a / g, and heading and place are known by definition.
    """
    rotation = rotation_at(belief.quaternion, i, 0)
    known = 0.0
    facing = turn(rotation, vector(own.mounting.ahead, ()))
    for axis in range(3):
        known += belief.position[i, axis] * 0.0 + facing[axis] * 0.0
    ahead = (facing[0], facing[1]) if known == 0.0 else (1.0, 0.0)
    if known != 0.0:
        for axis in range(3):
            belief.position[i, axis] = 0.0
    felt = vector(belief.felt, (i,))
    size = np.sqrt(dot(felt, felt))
    up = scale(1.0 / size, felt) if size > 0.1 * own.gravity else (0.0, 0.0, 1.0)
    # The trunk's direction ahead, levelled, points as before.
    left = cross(up, vector(own.mounting.ahead, ()))
    left = scale(1.0 / np.sqrt(dot(left, left) + 1e-12), left)
    front = cross(left, up)
    length = np.sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1]) + 1e-12
    cosine, sine = ahead[0] / length, ahead[1] / length
    rows = (
        subtract(scale(cosine, front), scale(sine, left)),
        add(scale(sine, front), scale(cosine, left)),
        up,
    )
    _store_quaternion(rows, belief.quaternion, i, 0)
    covariance = belief.covariance[i]
    for j in range(len(covariance)):
        for k in range(len(covariance)):
            covariance[j, k] = 0.0
    for axis in range(3):
        belief.velocity[i, axis] = 0.0
        belief.gyroscope_bias[i, axis], belief.accelerometer_bias[i, axis] = 0.0, 0.0
        covariance[_V + axis, _V + axis] = own.velocity_variance
        covariance[_BG + axis, _BG + axis] = own.gyroscope_variance
        covariance[_BA + axis, _BA + axis] = own.accelerometer_variance
    tilt = own.accelerometer_variance / (own.gravity * own.gravity) + own.tilt_variance
    covariance[_R, _R], covariance[_R + 1, _R + 1] = tilt, tilt
    for axis in range(3):
        # R zeta_a has the covariance of zeta_a, alike along all axes; e_3 × (x, y, z) = (-y, x, 0).
        first = -rows[1][axis] * own.accelerometer_variance / own.gravity
        second = rows[0][axis] * own.accelerometer_variance / own.gravity
        covariance[_R, _BA + axis], covariance[_BA + axis, _R] = first, first
        covariance[_R + 1, _BA + axis], covariance[_BA + axis, _R + 1] = second, second
    for foot in range(belief.standing.shape[1]):
        belief.standing[i, foot] = False
    belief.lost[i], belief.slipped[i], belief.age[i] = False, 0, 0


@compiled
def _store_quaternion(rows: Rotation, quaternion: np.ndarray, i: int, first: int) -> None:
    """Write the quaternion of a rotation to quaternion[i, first : first + 4], wxyz (Shepperd)."""
    (a, b, c), (d, e, f), (g, h, k) = rows
    if a + e + k > 0.0:
        w, x, y, z = 1.0 + a + e + k, h - f, c - g, d - b
    elif a > e and a > k:
        w, x, y, z = h - f, 1.0 + a - e - k, b + d, c + g
    elif e > k:
        w, x, y, z = c - g, b + d, 1.0 - a + e - k, f + h
    else:
        w, x, y, z = d - b, c + g, f + h, 1.0 - a - e + k
    size = np.sqrt(w * w + x * x + y * y + z * z)
    quaternion[i, first], quaternion[i, first + 1] = w / size, x / size
    quaternion[i, first + 2], quaternion[i, first + 3] = y / size, z / size


@compiled
def _write(own: Filter, readings: Readings, belief: Belief, seen: RobotState, i: int) -> None:
    """Write the state of the robot's base, joints and feet."""
    to_base = matrix(own.mounting.base_from_imu, ())
    base = product(rotation_at(belief.quaternion, i, 0), transposed(to_base))
    _store_quaternion(base, seen.qpos, i, 3)
    place = vector(own.mounting.place, ())
    spin = turn(
        to_base,
        subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,))),
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
