"""A chart of something that depends on a direction, as inline SVG."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from eval.plots import ticks
from eval.wording import number

_WIDTH, _HEIGHT = 400.0, 330.0
_CENTRE = (185.0, 178.0)
_RADIUS = 128.0


@dataclass(frozen=True)
class Ring:
    """One closed curve.

    Attributes:
        name: what it is.
        colour: of the page.
        value: (K,) at K directions.
    """

    name: str
    colour: int
    value: Sequence[float]


def polar(
    degrees: Sequence[float],
    rings: Sequence[Ring],
    title: str,
    unit: str,
    labels: dict[float, str],
    mark: tuple[float, float, str] | None = None,
) -> str:
    """Closed curves about a centre; 0 degrees points up, angles go anticlockwise.

    Args:
        degrees: (K,) directions, all the way round.
        rings: what to draw.
        title: what is shown.
        unit: of the values.
        labels: degrees -> name of a direction, written outside.
        mark: (degrees, value, name) of one point to compare with.
    """
    largest = max(float(np.max(ring.value)) for ring in rings)
    steps = [value for value in ticks(0.0, largest, 4) if value > 0.0]
    scale = _RADIUS / max(largest, steps[-1])

    def at(angle: float, value: float) -> tuple[float, float]:
        turn = np.radians(angle)
        size = scale * value
        return _CENTRE[0] - size * np.sin(turn), _CENTRE[1] - size * np.cos(turn)

    parts = [f'<text class="title" x="0" y="12">{escape(title)}</text>']
    for value in steps:
        x, y, r = *_CENTRE, scale * value
        parts.append(
            f'<path class="grid" d="M{x - r:.1f} {y:.1f}a{r:.1f} {r:.1f} 0 1 0 {2 * r:.1f} 0'
            f'a{r:.1f} {r:.1f} 0 1 0 {-2 * r:.1f} 0"/>'
        )
        x, y = at(-22.5, value)
        parts.append(
            f'<text class="note" x="{x:.1f}" y="{y + 4:.1f}" text-anchor="middle">'
            f"{number(value)}{' ' + escape(unit) if value == steps[-1] else ''}</text>"
        )
    for angle, label in labels.items():
        x, y = at(angle, (_RADIUS + 14.0) / scale)
        side = "middle" if abs(x - _CENTRE[0]) < 20 else "start" if x > _CENTRE[0] else "end"
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{y + 4:.1f}" text-anchor="{side}">'
            f"{escape(label)}</text>"
        )
    for row, ring in enumerate(rings):
        points = [at(a, v) for a, v in zip(degrees, ring.value, strict=True)]
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + "Z"
        dots = "".join(
            f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="3"><title>{escape(ring.name)}, '
            f"{angle:g}°: {number(value)} {escape(unit)}</title></circle>"
            for (x, y), angle, value in zip(points, degrees, ring.value, strict=True)
        )
        parts.append(
            f'<g class="c{ring.colour}"><path class="line" d="{path}"/>{dots}'
            f'<text class="name" x="0" y="{_HEIGHT - 6 - 15 * (len(rings) - 1 - row):.0f}">'
            f"{escape(ring.name)}</text></g>"
        )
    if mark is not None:
        x, y = at(mark[0], mark[1])
        parts.append(
            f'<g class="c7"><circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="4.5"><title>'
            f'{escape(mark[2])}</title></circle><text class="note" x="{x + 8:.1f}" y="{y + 4:.1f}">'
            f"{escape(mark[2])}</text></g>"
        )
    label = f"{title}: {', '.join(ring.name for ring in rings)}"
    return (
        f'<svg viewBox="0 0 {_WIDTH:.0f} {_HEIGHT:.0f}" role="img" '
        f'aria-label="{escape(label)}">{"".join(parts)}</svg>'
    )
