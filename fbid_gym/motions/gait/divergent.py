"""Steps of a linear inverted pendulum: where it falls, and where a foot has to be to catch it.

With the centre of mass c at a constant height h and the ground's force through the centre of
pressure p, cdd = omega^2 (c - p), omega = sqrt(g / h). Of its two modes one decays: c goes to the
divergent component of motion xi = c + cd / omega. The other one falls: xid = omega (xi - p)
(T. Takenaka et al., IROS 2009; J. Englsberger, C. Ott, A. Albu-Schäffer, IEEE T-RO 31(2), 2015).

A step begins with a double support, in which p goes evenly from the foot behind to the foot ahead,
and goes on with a single support on that foot, where p stays or rolls evenly from heel to toe. All
lengths are along one horizontal axis.
"""

import math
from typing import NamedTuple

from fbid_gym.compiled import compiled


class StepTiming(NamedTuple):
    """Timing of a step."""

    omega: float  # 1/s, rate at which the pendulum falls
    double: float  # s in double support, positive
    single: float  # s in single support, positive


@compiled
def fall(omega: float, xi: float, pressure: float, pressure_end: float, span: float) -> float:
    """Return xi (m) after a span (s) in which p goes evenly from `pressure` to `pressure_end` (m).

    Omega is in 1/s.
    """
    passed = omega * span
    spread = math.expm1(passed) / passed if passed > 0.0 else 1.0
    return pressure_end + (xi - pressure) * math.exp(passed) - (pressure_end - pressure) * spread


@compiled
def offset_ahead(timing: StepTiming, stride: float, roll: float) -> float:
    """Return how far xi is ahead of the foot (m) at the end of each double support.

    That of the gait that repeats itself with every step `stride` (m) ahead of the last, p going
    from `roll` (m) behind a foot to as far ahead of it while it stands alone.
    """
    # Linear in the offset that a step begins with; this is the rest.
    landing = fall(timing.omega, 0.0, -roll, roll, timing.single)
    rest = fall(timing.omega, landing - stride, roll - stride, -roll, timing.double)
    return -rest / math.expm1(timing.omega * (timing.double + timing.single))


@compiled
def offset_inward(timing: StepTiming, width: float) -> float:
    """Return how far xi is from the foot towards the other at the end of each double support, m.

    That of the gait that repeats itself with every second step, feet `width` (m) apart.
    """
    rest = fall(timing.omega, -width, -width, 0.0, timing.double)
    return -rest / (math.exp(timing.omega * (timing.double + timing.single)) + 1.0)


@compiled
def stride_to_catch(timing: StepTiming, landing: float, offset: float, roll: float) -> float:
    """Return where to put the foot so that the double support ends with xi where it shall be.

    All is in m: xi will be at `landing` from the standing foot when the other one lands, p at
    `roll`, and xi shall be at `offset` from the landed foot at the end of the double support, p at
    -`roll`. The result is from the standing foot.
    """
    decay = math.exp(-timing.omega * timing.double)
    way = (landing - roll - (offset + roll) * decay) / (1.0 - decay)
    return 2.0 * roll + way * timing.omega * timing.double


@compiled
def error_to_come(omega: float, gain: float, error: float, reach: float, left: float) -> float:
    """Return the rest of an error of xi (m) after `left` s of p = p_plan + (1 + gain) error.

    The feedback has errors decay with gain * omega (1/s), but p can depart from its plan by no more
    than `reach` (m). Errors beyond that grow, whatever p does.
    """
    held = abs(error) * math.exp(-gain * omega * left)
    lost = reach + (abs(error) - reach) * math.exp(omega * left)
    return math.copysign(max(held, lost), error)


@compiled
def transfer(
    omega: float, xi: float, pressure: float, xi_end: float, pressure_end: float, span: float,
    clock: float,
) -> tuple[float, float]:  # fmt: skip
    """Return xi and the centre of pressure (m) on the way from one support to the next.

    The cubic that begins and ends as given: both are continuous, and consistent with each other.

    It takes a span (s), of which `clock` s have passed. Omega is in 1/s, all else in m.
    """
    s = min(max(clock / span, 0.0), 1.0)
    rate, rate_end = omega * (xi - pressure) * span, omega * (xi_end - pressure_end) * span
    way = xi_end - xi
    # xi + rate s + a s^2 + b s^3.
    a, b = 3.0 * way - 2.0 * rate - rate_end, rate + rate_end - 2.0 * way
    value = xi + s * (rate + s * (a + s * b))
    slope = (rate + s * (2.0 * a + 3.0 * s * b)) / span
    return value, value - slope / omega
