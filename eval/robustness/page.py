"""The findings as one self-contained HTML page, and the figures of all factors as one sheet."""

import shlex
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from eval.page.figures import Marks, Series, colours_of, panel, sheet
from eval.page.html import render
from eval.robustness.curves import CONFIDENCE, SAMPLES, Along, Robustness, Trend
from eval.robustness.factors import BY_NAME, Factor
from eval.robustness.tables import heading, means
from eval.robustness.wording import headline, lede
from eval.wording import METRIC, form_of, interval, percent

Table = tuple[list[str], list[list[str]]]  # heads and rows


def page(found: Robustness, command: Sequence[str] = ()) -> str:
    """Lay out the page; it shows the command line that made it."""
    return render(
        "robustness.html",
        title=f"Robustness in {found.env_id.rpartition('/')[2]}",
        found=found,
        headline=headline(found),
        lede=lede(found),
        seconds=float(found.env_args.get("episode_seconds") or 0.0),
        areas=means(found),
        factors=factors(found),
        level=percent(CONFIDENCE),
        samples=SAMPLES,
        command=shlex.join(command),
    )


def drawn(found: Robustness) -> str:
    """Return the figures of all factors as SVG, a row for each."""
    return sheet([one for _, _, charts, _ in factors(found) for one in charts])


def factors(
    found: Robustness, colours: Mapping[str, int] | None = None
) -> list[tuple[Factor, Along, list[Markup], list[Table]]]:
    """Return each factor with what was found along it, its figure, and the same as tables.

    Colours are those of the arms' layers unless they are given.
    """
    if colours is None:
        of_layers = colours_of(dict.fromkeys(found.arms.values()))
        colours = {arm: of_layers[layer] for arm, layer in found.arms.items()}
    return [
        (BY_NAME[along.name], along, _panels(found, along, colours), _tables(found, along))
        for along in found.along
    ]


def _panels(found: Robustness, along: Along, colours: Mapping[str, int]) -> list[Markup]:
    """Return a panel for each measure, all arms in it."""
    factor, ends = BY_NAME[along.name], (along.values[0], along.values[-1])
    return [
        panel(
            _series(found, along.values, along.curves[measure], colours),
            f"{heading(measure)}: {factor.title}",
            factor.axis,
            factor.written,
            form_of(METRIC[measure]),
            ends if len(along.values) > 1 else None,
            (0.0, 1.04) if measure == "survived" else None,
            Marks(upright=along.nominal),
        )
        for measure in found.measures
    ]


def _series(
    found: Robustness, values: Sequence[float], curves: dict[str, Trend], colours: Mapping[str, int]
) -> list[Series]:
    """A line for each arm; the zero action of a layer that was trained is dashed beside it."""
    zeros, series = found.dashed, []
    for arm, layer in found.arms.items():
        if arm in zeros.values():
            continue
        dashed = [point.value for point in curves[zeros[layer]].points] if layer in zeros else None
        points = curves[arm].points
        low = [point.low for point in points if point.low is not None] or None
        high = [point.high for point in points if point.high is not None] or None
        value = [point.value for point in points]
        series.append(Series(arm, colours[arm], values, value, low, high, dashed=dashed, dots=True))
    return series


def _tables(found: Robustness, along: Along) -> list[Table]:
    """Return heads and rows of the points of every measure."""
    factor, forms = BY_NAME[along.name], {name: form_of(METRIC[name]) for name in found.measures}
    heads = [*map(factor.written, along.values), "change" if factor.stages else "area"]
    return [
        (
            [heading(measure), *heads],
            [
                [arm, *(interval(x, forms[measure]) for x in [*curve.points, curve.summary])]
                for arm, curve in along.curves[measure].items()
            ],
        )
        for measure in found.measures
    ]
