"""The comparison as one self-contained page: its figures, and what is said of them."""

import math
import shlex
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from eval.clips import legend
from eval.comparison import Clips
from eval.page.colours import colours_of
from eval.page.figures import Marks, Series, Strip, panel, strips
from eval.page.html import STARTS, render
from eval.results import Comparison, Layer, greatest_return
from eval.statistics import coverage_ceiling
from eval.wording import METRIC, capital, count, form_of, number, percent, steps
from train.episodes import METRICS, Metric

_SHOWN = (
    "returned", "survived", "velocity_error", "turning_error", "height_error", "torque", "power",
    "slip", "cost_of_transport", "foothold_error",
)  # fmt: skip


def page(c: Comparison, clips: Clips | None, command: Sequence[str] = ()) -> str:
    """Lay out the whole report; it shows the command line that made it."""
    colours = colours_of(layer.name for layer in c.layers)
    known = [metric for metric in METRICS if _known(c, metric)]
    shown = [metric for metric in known if metric.name in _SHOWN]
    runs = [run for layer in c.layers for run in layer.runs]
    commands = [run.command for run in runs if run.command]
    return render(
        "compare.html",
        title=f"{c.env_id.rpartition('/')[2]}: {' against '.join(x.name for x in c.layers)}",
        script="" if clips is None else STARTS,
        c=c,
        headline=headline(c),
        most=greatest_return(c.env_id, c.env_args),
        seeds=sorted({layer.seeds for layer in c.layers}),
        ceiling=coverage_ceiling,
        splits=lambda seeds: math.comb(2 * seeds, seeds),
        colours=colours,
        curves=_curves(c, colours),
        clips=clips,
        drawn_over=legend(c.env_id),
        names=[layer.name for layer in c.layers],
        zeros=[f"{layer.name}, zero action" for layer in c.layers],
        pushes=[f"{number(push)} N" for push in c.sweep],
        known=known,
        shown=shown,
        # The last one alone in a row of three is in the table below anyway.
        strips=[
            _strips(c, metric, colours) for metric in shown[: len(shown) - (len(shown) % 3 == 1)]
        ],
        sweep=_sweep(c, colours) if c.sweep else None,
        commands="\n".join([*commands, shlex.join(command)]).strip(),
    )


def _known(c: Comparison, metric: Metric) -> bool:
    """Whether the task reports it."""
    return all(math.isfinite(layer.metrics[metric.name].value) for layer in c.layers)


def _curves(c: Comparison, colours: dict[str, int]) -> list[Markup]:
    drawn = [layer for layer in c.layers if layer.by_steps and layer.by_wall]
    if not drawn:
        return []
    slowest = max(layer.by_wall.grid[-1] for layer in drawn if layer.by_wall)
    scale, unit = (60.0, "min") if slowest > 180 else (1.0, "s")
    panels = []
    for axis, per, title, x_title, form in (
        ("steps", 1.0, "Return over training steps", "steps", steps),
        ("wall", scale, "Return over time", f"wall-clock, {unit}", number),
    ):
        series = []
        for layer in drawn:
            band = getattr(layer, f"by_{axis}")
            singles = [(getattr(run, axis), run.returns) for run in layer.runs]
            zero, colour = layer.zero_action["returned"], colours[layer.name]
            series.append(Series.learnt(layer.name, colour, band, singles, per, zero))
        panels.append(panel(series, title, x_title, form, marks=Marks(threshold=c.threshold)))
    return panels


def _strips(c: Comparison, metric: Metric, colours: dict[str, int]) -> Markup:
    name = metric.name
    return strips([
        Strip(layer.name, colours[layer.name], layer.values(name), layer.metrics[name],
              layer.zero_action[name])
        for layer in c.layers
    ], metric)  # fmt: skip


def _sweep(c: Comparison, colours: dict[str, int]) -> Markup:
    series = [
        Series.through(layer.name, colours[layer.name], c.sweep, layer.sweep, layer.zero_sweep)
        for layer in c.layers
    ]
    title, below = "Episodes survived", "size of every push, N"
    marks = Marks(shaded_to=c.hardest_push)
    return panel(series, title, below, number, percent, y_range=(0.0, 1.04), marks=marks)


def headline(c: Comparison) -> str:
    """State in one sentence who did better, how sure that is, and by how much where it counts."""
    first = c.layers[0]
    if not c.pairs:
        return f"{capital(first.name)} over {count(first.seeds, 'seed')}: {_numbers(c, [first])}."
    second, pair = c.layers[1], c.pairs[0]
    one, other = capital(first.name), second.name
    if min(first.seeds, second.seeds) < 2:
        said = f"{one} ended above {other}, but one run cannot say whether the next would"
    elif pair.difference.low is None or pair.difference.low <= 0:  # zero is in the interval
        said = f"No clear difference in return between {first.name} and {other}"
    elif pair.p_value <= 1 - c.settings.confidence:
        said = f"{one} returns more than {other} (p = {number(pair.p_value, 2)})"
    else:
        said = f"{one} returned more than {other}"
        if pair.probability.value == 1:
            said = f"Every seed of {first.name} returns more than every seed of {other}"
        said += (
            f", but {count(first.seeds, 'seed')} against "
            f"{count(second.seeds, 'seed').split()[0]} cannot rule out chance"
        )
    return f"{said}: {_numbers(c, [first, second])}."


def _numbers(c: Comparison, layers: Sequence[Layer]) -> str:
    """Say what the layers come to in the units of the task, "against" one another."""
    parts = []
    known = [m for m in ("velocity_error", "returned") if _known(c, METRIC[m])]
    metric = METRIC[known[0]] if known else METRICS[0]
    values = [form_of(metric)(layer.metrics[metric.name].value) for layer in layers]
    parts.append(f"{metric.label} {' against '.join(values)} {metric.unit}".strip())
    if c.sweep:
        shares = np.array([[point.value for point in layer.sweep] for layer in layers])
        at = int(np.argmax(np.ptp(shares, axis=0))) if len(layers) > 1 else len(c.sweep) - 1
        up = " against ".join(percent(share) for share in shares[:, at])
        most = ", where they differ most" if len(layers) > 1 and len(c.sweep) > 1 else ""
        parts.append(f"{up} stay up under pushes of {number(c.sweep[at])} N{most}")
    return "; ".join(parts)
