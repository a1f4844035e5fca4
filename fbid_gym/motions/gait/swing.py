"""Motion of a foot through the air: to its foothold, and below it if there is no ground.

Level it goes by a quintic; up, to a height above the higher one of both ends, and down by two of
them. So position, velocity and acceleration are continuous, and at rest with respect to the ground
at both ends and, upwards, at the top.
"""

from typing import NamedTuple

from fbid_gym.compiled import compiled


class Moving(NamedTuple):
    """A value, its rate per s and its acceleration per s^2."""

    value: float
    rate: float
    acceleration: float


@compiled
def rise(share: float, span: float) -> Moving:
    """Return the quintic from 0 to 1, at rest at both ends, at a share of its span (s)."""
    s = min(max(share, 0.0), 1.0)
    return Moving(
        s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
        30.0 * s**2 * (1.0 - s) ** 2 / span,
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / span**2,
    )


@compiled
def across(share: float, span: float, start: float, end: float) -> Moving:
    """Return the way from start to end (m) at a share of its span (s)."""
    value, rate, acceleration = rise(share, span)
    way = end - start
    # From the nearer end, so that both are met to rounding.
    place = start + way * value if share < 0.5 else end - way * (1.0 - value)
    return Moving(place, way * rate, way * acceleration)


@compiled
def over(share: float, span: float, start: float, end: float, lift: float) -> Moving:
    """Return the height (m) from start to end, by way of `lift` (m) above the higher one."""
    top = max(start, end) + lift
    if share < 0.5:
        return across(2.0 * share, 0.5 * span, start, top)
    return across(2.0 * share - 1.0, 0.5 * span, top, end)


@compiled
def below(clock: float, ramp: float, speed: float) -> Moving:
    """Return how far (m) a foot has reached below its foothold after `clock` s.

    It comes from rest to `speed` (m/s) within `ramp` (s), and goes on with it.
    """
    s = min(clock / ramp, 1.0)
    way = speed * (ramp * (s**3 - 0.5 * s**4) + max(clock - ramp, 0.0))
    return Moving(way, speed * s**2 * (3.0 - 2.0 * s), 6.0 * speed * s * (1.0 - s) / ramp)


@compiled
def lift_and_land(
    clock: float, span: float, start: float, apex: float, ground: float, sink: float
) -> Moving:
    """Return a foot's height (m), up in the first half of its span and down in the second.

    It arrives with a speed, so that it lands when it is told to, and goes on down with it if the
    ground is not where it was expected.

    It lifts from `start` (m), rises to the apex (m) and lands on the ground (m) with a speed of
    `sink` (m/s). The step takes a span (s), of which `clock` s have passed.
    """
    half = 0.5 * span
    if clock < half:
        value, rate, acceleration = rise(clock / half, half)
        height = apex - start
        return Moving(start + height * value, height * rate, height * acceleration)
    if clock >= span:
        return Moving(ground - sink * (clock - span), -sink, 0.0)
    s = clock / half - 1.0
    value, rate, acceleration = rise(s, half)
    drop = ground - apex
    # The quintic with all ends zero but the last rate, which is 1 per span.
    return Moving(
        apex + drop * value - sink * half * s**3 * (-4.0 + 7.0 * s - 3.0 * s**2),
        drop * rate - sink * s**2 * (-12.0 + 28.0 * s - 15.0 * s**2),
        drop * acceleration - sink / half * s * (-24.0 + 84.0 * s - 60.0 * s**2),
    )
