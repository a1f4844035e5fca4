"""A linear Kalman filter of leg odometry, beside an observer of the attitude: the simpler filter.

In two steps, as Bledt et al. 2018, "MIT Cheetah 3: design and control of a robust, dynamic
quadruped robot", IROS. The attitude is the gyroscope's, pulled to where the accelerometer has the
vertical (Mahony, Hamel and Pflimlin 2008, "Nonlinear complementary filters on the special
orthogonal group", IEEE TAC 53(5)). With xi_R and zeta_g as in `invariant_filter`,

    xi_R' = -R zeta_g     e_3 × u = xi_R + noise,   u the direction of R f - omega × v

but for the heading. The observer's gains are those of the Kalman filter for one axis; a reading
counts the less the more its size differs from gravity's. omega × v is what a robot that turns needs
of the force. The attitude being known then, the rest is linear,

    v' = R f + g     p' = v     d_i' = 0     R h_i = d_i - p + noise

with noise taken to be alike along all axes, so that one covariance of 2 + F numbers serves three
filters. What the attitude and the accelerometer err by is noise of v': their errors are not known
from the legs, as they are in the invariant filter. Biases of the accelerometer are not estimated.
Contacts, slipping feet and restarts are the invariant filter's.
"""

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at, turn_quaternion
from fbid_gym.dynamics.vectors import (
    Rotation,
    Vector,
    add,
    cross,
    dot,
    scale,
    store,
    subtract,
    transposed,
    turn,
    vector,
)
from fbid_gym.estimation.correction import add_foot, drop, roll, write_state
from fbid_gym.estimation.invariant_filter import Belief, Filter
from fbid_gym.estimation.legs import Legs, place_foot
from fbid_gym.estimation.prediction import integrate, midway
from fbid_gym.estimation.restart import begin_upright, has_gone_wrong
from fbid_gym.estimation.sensing import Readings
from fbid_gym.quantities import RobotState

R, BG, V, P, D = 0, 1, 2, 3, 4
"""Where in the covariance of one axis the parts begin; d_i stands at D + i."""


@compiled
def _predict(own: Filter, readings: Readings, belief: Belief, i: int) -> None:
    """Integrate what the inertial unit read over a tick, and observe the attitude by it."""
    middle = midway(own, readings, belief, i)
    integrate(own, readings, belief, middle, i)
    _observe(own, readings, belief, middle, i)
    belief.age[i] += 1
    if belief.age[i] >= own.every:
        _spread(own, belief, i)


@compiled
def _observe(own: Filter, readings: Readings, belief: Belief, middle: Rotation, i: int) -> None:
    """Pull the attitude to the vertical that the accelerometer shows."""
    covariance, dt = belief.covariance[i], own.tick
    tilt, shared, bias = covariance[R, R], covariance[R, BG], covariance[BG, BG]
    tilt += dt * (dt * bias - 2.0 * shared) + own.turning / own.every
    shared -= dt * bias
    bias += own.gyroscope_drift / own.every
    spin = subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    turned = cross(turn(middle, spin), vector(belief.velocity, (i,)))
    up = subtract(turn(middle, vector(readings.accelerometer, (i,))), turned)
    size = np.sqrt(dot(up, up))
    trust = 1.0 - abs(size / own.gravity - 1.0)
    if trust > 0.0:
        variance = tilt + own.leaning / trust
        seen = (-up[1] / size, up[0] / size, 0.0)
        turn_quaternion(belief.quaternion, i, 0, scale(-tilt / variance, seen))
        change = turn(transposed(middle), scale(shared / variance, seen))
        store(subtract(vector(belief.gyroscope_bias, (i,)), change), belief.gyroscope_bias, (i,))
        bias -= shared * shared / variance
        shared -= shared * tilt / variance
        tilt -= tilt * tilt / variance
    covariance[R, R], covariance[BG, BG] = tilt, bias
    covariance[R, BG], covariance[BG, R] = shared, shared


@compiled
def _spread(own: Filter, belief: Belief, i: int) -> None:
    """Take the covariance of velocity, place and feet to the next correction."""
    covariance, dt = belief.covariance[i], own.every * own.tick
    for k in range(V, len(covariance)):
        covariance[P, k] += dt * covariance[V, k]
    for k in range(V, len(covariance)):
        covariance[k, P] += dt * covariance[k, V]
    covariance[V, V] += own.pushing
    covariance[V, P] += 0.5 * dt * own.pushing
    covariance[P, V] += 0.5 * dt * own.pushing
    covariance[P, P] += dt * dt / 3.0 * own.pushing
    for foot in range(belief.standing.shape[1]):
        if belief.standing[i, foot]:
            covariance[D + foot, D + foot] += own.slipping


@kernel
def update_linear(
    own: Filter, legs: Legs, readings: Readings, which: np.ndarray, belief: Belief, seen: RobotState
) -> None:
    """Go on with the estimate by a tick, see `correction.update`.

    The belief's covariance (N, 4 + F, 4 + F) is that of one axis.
    """
    joints, feet = legs.joint.shape[1], legs.joint.shape[0]
    axis, arm, away = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((feet, 3))
    column, noise = np.empty(D + feet), np.empty((feet, 1, 1))
    fresh = np.empty(feet, np.bool_)
    for i in range(len(which)):
        if which[i]:
            if not belief.lost[i]:
                _predict(own, readings, belief, i)
            _correct(own, legs, readings, belief, axis, arm, away, column, noise, fresh, i)
            write_state(own, readings, belief, seen, i)


@compiled
def _correct(
    own: Filter,
    legs: Legs,
    readings: Readings,
    belief: Belief,
    axis: np.ndarray,
    arm: np.ndarray,
    away: np.ndarray,
    column: np.ndarray,
    noise: np.ndarray,
    fresh: np.ndarray,
    i: int,
) -> None:
    """Correct one robot; the arrays from `axis` to `fresh` are buffers."""
    if belief.lost[i] or has_gone_wrong(own, belief, belief.covariance[i, V, V], i):
        _begin(own, belief, i)
    elif belief.age[i] < own.every:
        return
    seconds, belief.age[i] = own.tick * belief.age[i], 0
    rotation = rotation_at(belief.quaternion, i, 0)
    rate = subtract(vector(readings.gyroscope, (i,)), vector(belief.gyroscope_bias, (i,)))
    stood, slipped = 0, 0
    for foot in range(len(fresh)):
        loaded, stands = readings.load[i, foot] > own.threshold, belief.standing[i, foot]
        fresh[foot] = loaded and not stands
        if stands and not loaded:
            drop(belief, i, foot, D, 1)
        elif loaded:
            centre, spin = place_foot(legs, foot, readings.angle[i], readings.rate[i], axis, arm)
            seen = turn(rotation, centre)
            store((seen[0], seen[1], seen[2] - legs.radius[foot]), away, (foot,))
            noise[foot, 0, 0] = own.placing
            for k in range(len(arm)):
                if legs.joint[foot, k] >= 0:
                    square = dot(vector(arm, (k,)), vector(arm, (k,)))
                    noise[foot, 0, 0] += own.encoder / 3.0 * square
            if stands:
                roll(legs, turn(rotation, add(rate, spin)), seconds, belief, i, foot)
            if stands and readings.fresh[i]:
                stood += 1
                told = vector(away, (foot,))
                if not _measure(own, told, noise[foot, 0, 0], column, belief, i, foot):
                    slipped += 1
                    fresh[foot] = True
    belief.slipped[i] = belief.slipped[i] + 1 if stood > 0 and slipped == stood else 0
    belief.refused[i] += slipped
    for foot in range(len(fresh)):
        if fresh[foot]:
            add_foot(vector(away, (foot,)), noise[foot], belief, i, foot, P, D)


@compiled
def _begin(own: Filter, belief: Belief, i: int) -> None:
    """Begin with an estimate anew."""
    begin_upright(own, belief, i)
    covariance = belief.covariance[i]
    covariance[R, R] = own.tilt_variance
    covariance[BG, BG] = own.gyroscope_variance
    covariance[V, V] = own.velocity_variance


@compiled
def _measure(
    own: Filter, away: Vector, noise: float, column: np.ndarray, belief: Belief, i: int, foot: int
) -> bool:
    """Learn from a standing foot, H = (… 1 at p … -1 at d …); False if it has slipped."""
    covariance, row = belief.covariance[i], D + foot
    for k in range(V, len(column)):
        column[k] = covariance[k, P] - covariance[k, row]
    variance = column[P] - column[row] + noise
    told = subtract(add(away, vector(belief.position, (i,))), vector(belief.foot, (i, foot)))
    if not dot(told, told) / variance < own.gate:
        return False
    weighed = scale(1.0 / variance, told)
    velocity = subtract(vector(belief.velocity, (i,)), scale(column[V], weighed))
    store(velocity, belief.velocity, (i,))
    position = subtract(vector(belief.position, (i,)), scale(column[P], weighed))
    store(position, belief.position, (i,))
    for other in range(belief.standing.shape[1]):
        moved = subtract(vector(belief.foot, (i, other)), scale(column[D + other], weighed))
        store(moved, belief.foot, (i, other))
    for j in range(V, len(column)):
        for k in range(V, len(column)):
            covariance[j, k] -= column[j] * column[k] / variance
    return True
