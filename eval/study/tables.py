"""The curves and the table of a study, for pages of docs/.

Of an arm its finished cells count. Where none has finished, all count as far as they have come, and
are said to be unfinished. What learns nothing is shown by the episodes that trainings are
evaluated in.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from eval.page.docs import markdown_table
from eval.page.figures import Series, colours_of, panel, sheet
from eval.results import Estimate, greatest_return
from eval.statistics import first_crossing
from eval.study import fresh
from eval.study.cells import curve, exploring
from eval.study.fresh import Played
from eval.study.pace import Pace
from eval.wording import Form, capital, number, over_seeds, percent
from eval.wording import steps as steps_text
from fbid_gym.errors import RunError
from train.runs.study import Arm, Study, arms, environment_name

_MEASURES = {"return_mean": "return", "velocity_error": "velocity error, m/s"}
"""Column of the evaluations -> what its panels are called."""


def drawn(study: Study) -> str:
    """Return the learning curves as SVG: a panel for each environment and measure.

    Thick: the mean over seeds of the policy without noise, its band from the least seed to the
    greatest. Thin, beside returns: with the noise of exploration, which is what PPO climbs.
    Straight: what learns nothing.
    """
    by_env: dict[str, list[Arm]] = {}
    for arm in arms(study):
        by_env.setdefault(arm.env, []).append(arm)
    colour, levels = colours_of(arm.name for arm in arms(study)), fresh.levels(study)
    panels = []
    for env, its in by_env.items():
        pace = Pace.of((arm.name, _most(arm)) for arm in its)
        for column, title in _MEASURES.items():
            own = [item for arm in its for item in _series(arm, column, colour[arm.name])]
            if own:
                series = [pace.scaled(item, column) for item in own]
                until = max(float(np.max(item.x)) for item in series)
                for arm in (arm for arm in its if arm.cells[0].config.folder.name in levels):
                    value = levels[arm.cells[0].config.folder.name].means[column].item()
                    level = Series.constant(arm.name, colour[arm.name], until, Estimate(value))
                    series.append(pace.scaled(level, column, over_steps=False))
                what = capital(f"{pace.titled(title, column)}, {environment_name(env)}")
                panels.append(panel(series, what, pace.steps, x_format=steps_text))
    if not panels:
        raise RunError(f"Study {study.name!r} has not been evaluated yet: python -m train.sweep.")
    return sheet(panels)


def _most(arm: Arm) -> float:
    run = arm.cells[0].config
    return greatest_return(run.env, run.make_args())


def _series(arm: Arm, column: str, colour: int) -> Iterator[Series]:
    steps, values = curve(arm, column)
    if not np.isfinite(values).any():
        return
    several = len(values) > 1
    thin = [exploring(cell.config) for cell in arm.cells] if column == "return_mean" else []
    yield Series(
        arm.name,
        colour,
        steps.tolist(),
        values.mean(axis=0).tolist(),
        values.min(axis=0).tolist() if several else None,
        values.max(axis=0).tolist() if several else None,
        singles=tuple(single for single in thin if single[0]),
        dots=True,
    )


_HEAD = ("Environment", "Arm", "Seeds", "Steps", "Velocity error (m/s)", "Survival", "Return")
_FORMS: dict[str, Form] = {
    "velocity_error": "{:.3f}".format,
    "survival": percent,
    "return_mean": number,
}
"""Columns of the evaluations behind the last three, and how these are written."""
_FRESH: dict[str, tuple[str, Form]] = {
    "return_mean": ("Return", number),
    "velocity_error": ("Velocity error (m/s)", "{:.3f}".format),
    "turning_error": ("Yaw rate error (rad/s)", "{:.3f}".format),
    "slip": ("Slip (m/s)", "{:.3f}".format),
    "cost_of_transport": ("Cost of transport", "{:.2f}".format),
    "survival_pushed": ("Up, every push the greatest", percent),
    "survival_pushed_harder": ("Up, 1.5 times that", percent),
}
"""Columns of fresh episodes: what they are called, and how they are written."""


def table(study: Study) -> str:
    """Return what the arms came to, as Markdown: before -> after, (least to greatest seed)."""
    (played, _), levels = fresh.kept(study), fresh.levels(study)
    head = (*_HEAD, "To the best return without training") if levels else _HEAD
    rows = []
    for arm in arms(study):
        its = levels.get(arm.cells[0].config.folder.name)
        cells = [environment_name(arm.env), arm.name]
        cells += ["no training", "–", *_unlearnt(its)] if arm.policy else _trained(arm)
        if levels:
            cells.append("–" if arm.policy else _reaching(arm, study, levels))
        rows.append(cells)
    return "\n\n".join([markdown_table(head, rows), *_in_fresh_episodes(study, played)])


def _in_fresh_episodes(study: Study, played: Mapping[str, Played]) -> Iterator[str]:
    """Yield a table of the arms in fresh episodes, if they have played any, and what it is."""
    forms = {
        name: (title, form)
        for name, (title, form) in _FRESH.items()
        if any(np.isfinite(its.means[name]).all() for its in played.values())
    }
    rows = []
    for arm in arms(study):
        its = [played[name] for c in arm.cells if (name := c.config.folder.name) in played]
        if not its:
            continue
        cells = [environment_name(arm.env), arm.name, str(len(its)), str(fresh.Falls.of(its))]
        for name, (_, form) in forms.items():
            values = np.concatenate([one.means[name] for one in its])
            cells.append(over_seeds(values, form) if np.isfinite(values).all() else "–")
        rows.append(cells)
    if rows:
        head = ("Environment", "Arm", "Runs", "Falls", *(title for title, _ in forms.values()))
        yield "In fresh episodes:"
        yield markdown_table(head, rows)


def _trained(arm: Arm) -> list[str]:
    """Write seeds, steps, and what they came to."""
    curves = {name: curve(arm, name) for name in _FORMS}
    finished, seeds = len(arm.finished()), str(len(arm.cells))
    if finished < len(arm.cells):
        seeds = f"{finished} of {seeds} finished"
    until = curves["return_mean"].steps[-1:]
    steps = steps_text(until[0]) if len(until) else "none"
    return [seeds, steps, *(_change(curves[name].values, form) for name, form in _FORMS.items())]


def _reaching(arm: Arm, study: Study, levels: Mapping[str, Played]) -> str:
    """Write when the return first reaches that of the best that learns nothing, medians of seeds.

    In steps, minutes of the machine that trained, and falls in training.
    """
    shares = [
        levels[other.cells[0].config.folder.name].means["return_mean"].item() / _most(other)
        for other in arms(study)
        if other.env == arm.env and other.cells[0].config.folder.name in levels
    ]
    steps, returns = curve(arm, "return_mean")
    if not shares or not returns.size:
        return "–"
    each = {"steps": np.broadcast_to(steps, returns.shape)}
    each |= {name: curve(arm, name).values for name in ("wall_seconds", "fallen")}
    until = {
        name: [
            first_crossing(x, its / _most(arm), max(shares))
            for x, its in zip(own, returns, strict=True)
        ]
        for name, own in each.items()
    }
    reached, median = np.isfinite(until["steps"]).sum(), np.median(until["steps"])
    if median == 0.0:
        return "from the start"
    if not np.isfinite(median):
        return f"never ({reached} of {len(returns)})" if reached else "never"
    words = [steps_text(median), f"{np.median(until['wall_seconds']) / 60:.1f} min"]
    if np.isfinite(fell := np.median(until["fallen"])):
        words.append(f"{fell:.0f} falls")
    return ", ".join(words) + (f" ({reached} of {len(returns)})" if reached < len(returns) else "")


def _unlearnt(its: Played | None) -> list[str]:
    """Write the same of what learns nothing; there is no before and after."""
    values = {name: np.nan if its is None else its.means[name].item() for name in _FORMS}
    return [form(values[n]) if np.isfinite(values[n]) else "–" for n, form in _FORMS.items()]


def _change(values: np.ndarray, form: Form) -> str:
    """Write the mean over seeds before and after, and the range of the latter."""
    if not values.size or not np.isfinite(values).any():
        return "–"
    return f"{form(values[:, 0].mean())} → {over_seeds(values[:, -1], form)}"
