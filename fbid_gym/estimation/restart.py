"""Beginnings of an estimate: of an episode, and after it was lost."""

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.rotations import rotation_at
from fbid_gym.dynamics.vectors import Rotation, add, cross, dot, scale, subtract, turn, vector
from fbid_gym.estimation.invariant_filter import BA, BG, Belief, Filter, R, V, store_quaternion


@compiled
def has_gone_wrong(own: Filter, belief: Belief, vague: float, i: int) -> bool:
    """Tell whether an estimate is no longer to be trusted; it begins anew, which `restarts` count.

    The variance of the velocity is `vague`, m^2/s^2.
    """
    velocity = vector(belief.velocity, (i,))
    square = dot(velocity, velocity)
    for axis in range(3):
        square += 0.0 * belief.position[i, axis] * belief.quaternion[i, axis]
    sound = square < own.fastest * own.fastest and vague < own.vaguest
    if sound and belief.slipped[i] <= own.patience:
        return False
    belief.restarts[i] += 1
    return True


@compiled
def begin_upright(own: Filter, belief: Belief, i: int) -> Rotation:
    """Begin with the heading and place of before, upright as the accelerometer has it, at rest.

    No foot stands yet, nothing is known of biases, and no error correlates with another.

    Returns:
        The rotation.
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
    store_quaternion(rows, belief.quaternion, i, 0)
    covariance = belief.covariance[i]
    for j in range(len(covariance)):
        for k in range(len(covariance)):
            covariance[j, k] = 0.0
    for axis in range(3):
        belief.velocity[i, axis] = 0.0
        belief.gyroscope_bias[i, axis], belief.accelerometer_bias[i, axis] = 0.0, 0.0
    for foot in range(belief.standing.shape[1]):
        belief.standing[i, foot] = False
    belief.lost[i], belief.slipped[i], belief.age[i] = False, 0, 0
    return rows


@compiled
def begin_anew(own: Filter, belief: Belief, i: int) -> None:
    """Begin as `begin_upright` does, and with how the errors of the invariant filter correlate.

    A bias of the accelerometer tilts it: R_estimated (f + bias) is vertical, hence
    xi_R = e_3 × R zeta_a / g, and heading and place are known by definition.
    """
    rows, covariance = begin_upright(own, belief, i), belief.covariance[i]
    for axis in range(3):
        covariance[V + axis, V + axis] = own.velocity_variance
        covariance[BG + axis, BG + axis] = own.gyroscope_variance
        covariance[BA + axis, BA + axis] = own.accelerometer_variance
    tilt = own.accelerometer_variance / (own.gravity * own.gravity) + own.tilt_variance
    covariance[R, R], covariance[R + 1, R + 1] = tilt, tilt
    for axis in range(3):
        # R zeta_a has the covariance of zeta_a, alike along all axes; e_3 × (x, y, z) = (-y, x, 0).
        first = -rows[1][axis] * own.accelerometer_variance / own.gravity
        second = rows[0][axis] * own.accelerometer_variance / own.gravity
        covariance[R, BA + axis], covariance[BA + axis, R] = first, first
        covariance[R + 1, BA + axis], covariance[BA + axis, R + 1] = second, second
