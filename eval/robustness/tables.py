"""The findings as numbers: for files, for a terminal and for a page of docs."""

import json
from collections.abc import Iterator
from dataclasses import replace

from rich.markup import escape
from rich.table import Table

from eval.page.docs import markdown_table
from eval.results import Estimate
from eval.robustness.curves import Along, Robustness, Trend
from eval.robustness.factors import BY_NAME
from eval.wording import METRIC, capital, form_of, interval, number, titled
from fbid_gym.errors import RunError
from train.runs.tables import to_csv

_COLUMNS = ("factor", "value", "arm", "measure", "estimate", "low", "high")


def heading(measure: str) -> str:
    """Return the name of a measure, with its unit."""
    return capital(titled(METRIC[measure]))


def areas(found: Robustness) -> list[Along]:
    """Return the factors that are quantities."""
    return [along for along in found.along if not BY_NAME[along.name].stages]


def numbers(found: Robustness) -> str:
    """Return every point, area and change as CSV; "area" and "change" stand in place of a value."""
    rows = []
    for along in found.along:
        stages = BY_NAME[along.name].stages
        for measure, curves in along.curves.items():
            for arm, curve in curves.items():
                values = [*(stages or along.values), "change" if stages else "area"]
                for value, one in zip(values, [*curve.points, curve.summary], strict=True):
                    known = {"factor": along.name, "value": value, "arm": arm, "measure": measure}
                    bounds = {"low": one.low, "high": one.high}
                    rows.append({**known, "estimate": one.value, **bounds})
    return to_csv(_COLUMNS, rows)


def with_kept(found: Robustness, rows: list[dict[str, str]]) -> Robustness:
    """Return it with the factors that were not tried, as `numbers` wrote them before.

    Raises:
        RunError: those rows are of other arms.
    """
    every = {along.name: along for along in found.along}
    for name in dict.fromkeys(row["factor"] for row in rows if row["factor"] not in every):
        every[name] = _kept(name, [row for row in rows if row["factor"] == name])
    try:
        return replace(found, along=[every[name] for name in BY_NAME if name in every])
    except ValueError as error:
        raise RunError(f"The numbers that were kept do not fit: {error}.") from error


def _kept(name: str, rows: list[dict[str, str]]) -> Along:
    """One factor of `with_kept`."""
    factor, curves = BY_NAME[name], dict[str, dict[str, Trend]]()
    for measure, arm in dict.fromkeys((row["measure"], row["arm"]) for row in rows):
        own = [row for row in rows if (row["measure"], row["arm"]) == (measure, arm)]
        ends = [tuple(float(row[end]) for end in ("estimate", "low", "high")) for row in own]
        *points, last = (Estimate(*end) for end in ends)
        curves.setdefault(measure, {})[arm] = Trend(points, last)
        values = [row["value"] for row in own[:-1]]
    numbered = [float(k if factor.stages else value) for k, value in enumerate(values)]
    nominal = factor.nominal if factor.nominal in numbered else None
    return Along(name, numbered, curves, nominal)


def means(found: Robustness) -> list[tuple[str, bool, list[str], list[list[str]]]]:
    """Return of each measure its heading, whether more is better, and the table of its means.

    That is heads, and rows of areas; the changes last, which say so.
    """
    tables, heads = [], ["along", *(arm.replace("_", " ") for arm in found.arms)]
    for measure in found.measures:
        rows, metric = list[list[str]](), METRIC[measure]
        for along in found.along:
            name = f"{along.name}, change" if BY_NAME[along.name].stages else along.name
            curves = along.curves[measure].values()
            rows.append([name, *(interval(curve.summary, form_of(metric)) for curve in curves)])
        tables.append((heading(measure), metric.better > 0, heads, rows))
    return tables


def shown(found: Robustness) -> Iterator[Table]:
    """Yield the areas as tables for a terminal."""
    for measured, more, heads, rows in means(found):
        title = f"{measured}: mean along each factor ({'more' if more else 'less'} is better)"
        table = Table(title=title, title_justify="left")
        table.add_column(heads[0])
        for head in heads[1:]:
            table.add_column(escape(head), justify="right")
        for row in rows:
            table.add_row(*row)
        yield table


def said(found: Robustness) -> str:
    """Say of what the tables are: where, who, how much."""
    known = ("robot", "action_layer", "layer_options", "episode_seconds")
    others = {name: value for name, value in found.env_args.items() if name not in known}
    seconds = float(found.env_args.get("episode_seconds") or 0.0)
    return (
        f"`{found.env_id}`{f' with `{json.dumps(others)}`' if others else ''}, robot "
        f"{found.robot}: {found.budget.episodes} episodes of {number(seconds)} s at every value, "
        f"from seed {found.budget.seed} on, by"
    )


def markdown(found: Robustness) -> str:
    """Return the areas as Markdown."""
    return "\n\n".join(
        f"{measured}:\n\n{markdown_table(heads, rows, left=1)}"
        for measured, _, heads, rows in means(found)
    )
