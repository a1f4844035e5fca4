"""Footholds of point feet that keep the commanded velocity.

A robot over a point foot falls like a linear inverted pendulum: with the centre of mass c at height
h and the foot at p, cdd = omega^2 (c - p), omega = sqrt(g / h), and c + cd / omega, the capture
point, runs away from p. A foot that stands for a time T and is put

    p = c + cd / omega - v T / (exp(omega T) - 1)

brings the capture point of the next landing to where the gait that goes on with mean velocity v has
it, whatever cd is (M. H. Raibert, Legged Robots That Balance, 1986, in its spirit; J. Pratt et al.,
Humanoids 2006; J. Englsberger, C. Ott, A. Albu-Schäffer, IEEE T-RO 31(2), 2015). In that gait the
foot lands v T / 2 ahead, Raibert's neutral point: the robot passes over it half-way.
"""

import math
from typing import NamedTuple

from fbid_gym.compiled import compiled
from fbid_gym.motions.gait.heading import Pair


class Leap(NamedTuple):
    """Constants of the planning of footholds."""

    omega: float  # 1/s, rate at which the robot falls
    stance: float  # s that the foot will stand
    capture: float  # share of an error of velocity that one step takes away


@compiled
def point_ahead(leap: Leap, velocity: float, commanded: float) -> float:
    """Return how far ahead of its place below the robot a foot lands, m; along one axis.

    The centre of mass has a velocity (m/s) when it lands, and another one is commanded.
    """
    neutral = 0.5 * commanded * leap.stance
    captured = velocity / leap.omega
    captured -= commanded * leap.stance / math.expm1(leap.omega * leap.stance)
    return neutral + leap.capture * (captured - neutral)


@compiled
def within_reach(hip: Pair, radius: float, x: float, y: float) -> tuple[float, float, bool]:
    """Return the place nearest to (x, y) within a radius of a hip, and whether it is another."""
    away_x, away_y = x - hip[0], y - hip[1]
    distance = math.hypot(away_x, away_y)
    if distance <= radius:
        return x, y, False
    share = radius / distance
    return hip[0] + share * away_x, hip[1] + share * away_y, True
