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

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.vectors import Rotation
from fbid_gym.estimation.legs import Mounting

R, V, P, BG, BA, D = 0, 3, 6, 9, 12, 15
"""Where in (xi, zeta) the parts begin; d_i stands at D + 3 i."""


class Filter(NamedTuple):
    """Constants of the filter.

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
    leaning: float  # rad^2, of the vertical that one reading shows; of the linear filter only
    mounting: Mounting  # of the unit
    foot_of_point: np.ndarray  # (P,) int64
    points: np.ndarray  # (F,) float, number of points of each foot


class Belief(NamedTuple):
    """Belief of the filter about N robots: mean and covariance."""

    quaternion: np.ndarray  # (N, 4) wxyz, of R
    velocity: np.ndarray  # (N, 3) m/s
    position: np.ndarray  # (N, 3) m, from `origin`
    gyroscope_bias: np.ndarray  # (N, 3) rad/s
    accelerometer_bias: np.ndarray  # (N, 3) m/s^2
    foot: np.ndarray  # (N, F, 3) m, places of the feet that stand
    standing: np.ndarray  # (N, F) bool
    covariance: np.ndarray  # (N, 15 + 3F, 15 + 3F) of (xi, zeta); see also `linear_filter`
    felt: np.ndarray  # (N, 3) m/s^2, mean specific force
    origin: np.ndarray  # (N, 3) m, world, where the episode began
    lost: np.ndarray  # (N,) bool, begins anew
    slipped: np.ndarray  # (N,) int64, corrections for which all standing feet have slipped
    age: np.ndarray  # (N,) int64, ticks since the last correction
    refused: np.ndarray  # (N,) int64, measurements of feet that were refused since the start
    restarts: np.ndarray  # (N,) int64, how often it has begun anew since the start

    @classmethod
    def none(cls, count: int, feet: int, size: int) -> "Belief":
        """Belief about robots of which nothing is known; `size` that of the covariance."""
        vectors = "velocity", "position", "gyroscope_bias", "accelerometer_bias", "felt", "origin"
        return cls(
            quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            foot=np.zeros((count, feet, 3)),
            standing=np.zeros((count, feet), bool),
            covariance=np.zeros((count, size, size)),
            lost=np.ones(count, bool),
            **{name: np.zeros((count, 3)) for name in vectors},
            **{n: np.zeros(count, np.int64) for n in ("slipped", "age", "refused", "restarts")},
        )


@compiled
def store_quaternion(rows: Rotation, quaternion: np.ndarray, i: int, first: int) -> None:
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
