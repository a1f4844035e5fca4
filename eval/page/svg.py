"""Matplotlib's drawings as SVG that takes colours and fonts from the page it stands in."""

import hashlib
import html
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from typing import Any

import matplotlib
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter, MaxNLocator

from eval.wording import Form

_NAMES = ("paper", "ink", "soft", "faint", "rule", "wash", *(f"c{k}" for k in range(10)))
COLOUR = {name: f"#0a0b{k:02x}" for k, name in enumerate(_NAMES)}
"""Matplotlib knows no variables of CSS: it draws with these, which are then replaced."""

_STYLE: Any = {
    "svg.fonttype": "none", "svg.hashsalt": "fbid_gym", "path.simplify_threshold": 0.5,
    "axes.axisbelow": True, "axes.edgecolor": COLOUR["faint"], "axes.facecolor": "none",
    "axes.grid": True, "axes.spines.left": False, "axes.spines.right": False,
    "axes.spines.top": False, "font.size": 11, "grid.color": COLOUR["rule"], "grid.linewidth": 1,
    "lines.linewidth": 2.2, "lines.solid_capstyle": "round",
    "text.color": COLOUR["soft"], "text.parse_math": False, "xtick.color": COLOUR["faint"],
    "xtick.labelcolor": COLOUR["soft"], "ytick.labelcolor": COLOUR["soft"],
    "ytick.left": False,
}  # fmt: skip


@contextmanager
def axes_of(
    width: float,
    height: float,
    title: str,
    names: Sequence[str],
    edges: tuple[float, float, float, float],
    projection: str | None = None,
) -> Iterator[tuple[Axes, list[Markup]]]:
    """Yield axes with room to the left, right, above and below, and a list: the SVG, once drawn."""
    left, right, top, bottom = edges
    inner = (left / width, bottom / height, 1 - (left + right) / width, 1 - (top + bottom) / height)
    drawn: list[Markup] = []
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width / 72.0, height / 72.0))
        figure.text(0.0, 1.0 - 8.0 / height, title, color=COLOUR["ink"], size=12.5, weight="bold",
                    va="center_baseline")  # fmt: skip
        yield figure.add_axes(inner, projection=projection), drawn
        file = StringIO()
        nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure.savefig(file, format="svg", transparent=True, metadata=nothing)
    drawn.append(_inlined(file.getvalue(), f"{title}: {', '.join(names)}"))


def _inlined(svg: str, label: str) -> Markup:
    """Return what matplotlib wrote as part of a page: its colours and fonts, no ids, few digits."""
    view, body = re.search(r'viewBox="[^"]*"', svg), svg[svg.index("<defs>") :]
    own = "x" + hashlib.sha256(body.encode()).hexdigest()[:6]
    for pattern, text in (
        (r"(?s)<style.*?</style>|<!--.*?-->", ""),
        (r'<g id="told ([^"]*)">', r"<g><title>\1</title>"),
        (r'<g id="[^"]*"', "<g"),
        (r'(id="|#)([mp][0-9a-f]{10})', rf"\1\2{own}"),  # of this figure alone
        (r'font-family: [^;"]*;? ?|<g> *</g>', ""),
        (r"\s*\n\s*", " "),
    ):
        body = re.sub(pattern, text, body)
    few = r"(?<=\d)\.(\d)\d+"
    numbers = r' (?:d|x|y|transform)="[^"]*"'
    body = re.sub(numbers, lambda found: re.sub(few, r".\1", found[0]), body)
    for name, stand_in in COLOUR.items():
        body = body.replace(stand_in, f"var(--{name})")
    assert view is not None
    opening = f'<svg {view[0]} role="img" aria-label="{html.escape(label)}">'
    return Markup(opening + body)


def tooltip(text: str) -> str:
    """Return the id by which an artist gets a tooltip."""
    return f"told {text}"


def round_ticks(most: int, **options: Any) -> MaxNLocator:
    """Ticks at round numbers, at most so many spaces apart."""
    return MaxNLocator(most, steps=[1, 2, 2.5, 5, 10], **options)


class TickLabels(Formatter):
    """Ticks without zeros at the end of decimals, with more digits where two look alike."""

    def __init__(self, form: Form) -> None:
        """Write values by a function."""
        self._form = form

    def __call__(self, value: float, pos: int | None = None) -> str:
        """Write one."""
        text = self._form(value)
        return text.rstrip("0").rstrip(".") if "." in text else text

    def format_ticks(self, values: Sequence[float]) -> list[str]:
        """Write all of an axis."""
        texts = [self(value) for value in values]
        return texts if len(set(texts)) == len(texts) else [f"{value:.8g}" for value in values]
