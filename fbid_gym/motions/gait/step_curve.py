"""How a flat foot moves from where it lifts to where it lands: continuous in acceleration."""

from fbid_gym.compiled import compiled

Motion = tuple[float, float, float]
"""A value, its rate per s and its acceleration per s^2."""


@compiled
def rise(share: float, span: float) -> Motion:
    """Return the quintic from 0 to 1, at rest at both ends, at a share of its span (s)."""
    s = min(max(share, 0.0), 1.0)
    return (
        s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
        30.0 * s**2 * (1.0 - s) ** 2 / span,
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / span**2,
    )


@compiled
def lift_and_land(
    clock: float, span: float, start: float, apex: float, ground: float, sink: float
) -> Motion:
    """Return a foot's height (m), up in the first half of its span and down in the second.

    It arrives with a speed, so that it lands when it is told to, and goes on down with it if the
    ground is not where it was expected.

    Args:
        clock: s since it lifted.
        span: s that the step shall take.
        start: m, height at which it lifted.
        apex: m, highest.
        ground: m, height of the ground where it lands.
        sink: m/s with which it lands.
    """
    half = 0.5 * span
    if clock < half:
        value, rate, acceleration = rise(clock / half, half)
        height = apex - start
        return start + height * value, height * rate, height * acceleration
    if clock >= span:
        return ground - sink * (clock - span), -sink, 0.0
    s = clock / half - 1.0
    value, rate, acceleration = rise(s, half)
    drop = ground - apex
    # The quintic with all ends zero but the last rate, which is 1 per span.
    return (
        apex + drop * value - sink * half * s**3 * (-4.0 + 7.0 * s - 3.0 * s**2),
        drop * rate - sink * s**2 * (-12.0 + 28.0 * s - 15.0 * s**2),
        drop * acceleration - sink / half * s * (-24.0 + 84.0 * s - 60.0 * s**2),
    )
