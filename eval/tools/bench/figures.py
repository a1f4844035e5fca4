"""Measured figures: ratios with their spread, limits, tables."""

from dataclasses import dataclass

import numpy as np

from eval.page.docs import markdown_table


@dataclass(frozen=True)
class Limit:
    """Limit of a figure: at most (or at least) `value`."""

    value: float
    at_least: bool = False

    def __str__(self) -> str:
        """Return the limit as a table shows it."""
        return f"{'≥' if self.at_least else '≤'} {self.value:g}"

    def met_by(self, value: float) -> bool:
        """Return whether `value` keeps to the limit."""
        return value >= self.value if self.at_least else value <= self.value


@dataclass(frozen=True)
class Figure:
    """One measured figure."""

    what: str
    cost: str  # its absolute size on this machine, with the unit
    value: float  # the figure the limit speaks of: the median over rounds
    low: float  # lower quartile of it over rounds
    high: float  # upper quartile
    limit: Limit | None = None  # what it should keep to, if anything

    @classmethod
    def of(cls, what: str, cost: str, rounds: np.ndarray, limit: Limit | None = None) -> "Figure":
        """Summarise the figure's values over rounds."""
        low, value, high = (float(x) for x in np.percentile(rounds, [25, 50, 75]))
        return cls(what, cost, value, low, high, limit)


@dataclass(frozen=True)
class FigureTable:
    """A table of figures."""

    title: str
    note: str  # what was done, and the unit of the figures
    unit: str  # column heading of the figures
    figures: tuple[Figure, ...]

    def markdown(self) -> str:
        """Return heading, note and table."""
        head = ["", "cost", self.unit, "quartiles", "limit"]
        rows = []
        for figure in self.figures:
            low, high, limit = figure.low, figure.high, figure.limit
            quartiles = "" if low == high else f"{short(low)} – {short(high)}"
            missed = limit is not None and not limit.met_by(figure.value)
            verdict = f"{limit or ''}{' (missed)' if missed else ''}"
            cells = (figure.what, figure.cost, f"**{short(figure.value)}**", quartiles, verdict)
            rows.append(cells)
        return f"**{self.title}.** {self.note}\n\n{markdown_table(head, rows)}"


def short(value: float) -> str:
    """Return a number with three significant digits, without an exponent."""
    decimals = max(0, 2 - int(np.floor(np.log10(abs(value))))) if value else 0
    return f"{value:.{min(decimals, 3)}f}"
