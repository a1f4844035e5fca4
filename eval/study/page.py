"""The report of a study as one self-contained HTML page."""

import json
from collections.abc import Mapping
from html import escape

from eval.clips import STARTS
from eval.document import document
from eval.papers.parts import folded, table, text
from eval.robustness.curves import Robustness
from eval.study.parts import coloured, latest, named, probability, titled, told
from eval.study.results import FALLS, JUDGED, MEASURES, Findings
from eval.study.section import Clips, environment
from eval.study.wording import lede, standing
from eval.wording import capital, count, duration, interval, steps
from train.runs.study import environment_name

_STYLE = """
h3 { font: 600 .92rem system-ui, sans-serif; margin: 2.2rem 0 .4rem; }
th:first-child { position: sticky; left: 0; background: var(--paper); padding-right: 1rem; }
tbody th:first-child { white-space: normal; min-width: 8.2rem; max-width: 12rem; }
td .low, td .state { display: block; }
img { max-width: 100%; height: auto; }
.state, .far { color: var(--soft); font-size: .92em; }
.failed { color: var(--c5); }
nav { font: .86rem/1.9 system-ui, sans-serif; margin-top: 1.2rem; }
nav a { margin-right: 1.2rem; white-space: nowrap; }
"""


def page(
    found: Findings,
    clips: Clips | None = None,
    robustness: Mapping[str, Robustness] | None = None,
    command: str = "",
) -> str:
    """Lay out the page.

    Args:
        found: what the runs say.
        clips: of the arms that have one.
        robustness: by environment, where it was measured.
        command: the command line that made it, to be shown.
    """
    clips, robustness = clips or {}, robustness or {}
    sections = [
        environment(found, env_id, clips, robustness.get(env_id)) for env_id in found.environments()
    ]
    parts = [_opening(found), *sections, _across(found), _cells(found), _methods(found)]
    body = "\n".join([*filter(None, parts), _reproduction(found, command)])
    return document(found.title, body, style=_STYLE, script=STARTS if clips else "")


def _opening(found: Findings) -> str:
    cells = [cell for arm in found.arms for cell in arm.cells]
    environments = found.environments()
    eyebrow = (
        f"{count(len(environments), 'environment')} · "
        f"{count(len({arm.name for arm in found.arms}), 'arm')} · {count(len(cells), 'training')}"
    )
    links = " ".join(
        f'<a href="#{escape(environment_name(env_id))}">{escape(environment_name(env_id))}</a>'
        for env_id in environments
    )
    parts = [
        f'<p class="eyebrow">{escape(eyebrow)}</p>',
        f"<h1>{escape(found.title)}</h1>",
        f'<div class="lede">{text(*map(escape, [standing(found), *lede(found)]))}</div>',
        f"<nav>{links}</nav>" if len(environments) > 1 else "",
    ]
    missing = [
        f"<li>{escape(environment_name(arm.env_id))}, <b>{escape(arm.name)}</b>, seed "
        f"{cell.seed}: {told(cell.state)}{escape(f', {cell.note}' if cell.note else '')}</li>"
        for arm in found.arms
        for cell in arm.cells
        if cell.state != "done"
    ]
    if missing:
        listed = f"<ul>{''.join(missing)}</ul>"
        parts.append(
            '<div class="callout"><b>Not finished.</b> Numbers of an arm are of its trainings that '
            "are done; where none is, they are of those begun, as far as all of them are."
            f"{folded(f'{len(missing)} of {len(cells)} trainings', listed)}"
            "</div>"
        )
    if found.warnings:
        items = "".join(f"<li>{escape(warning)}</li>" for warning in found.warnings)
        warned = folded(count(len(found.warnings), "warning"), f"<ul>{items}</ul>")
        parts.append(f'<div class="callout warning"><b>Before comparing.</b> {warned}</div>')
    return "\n".join(parts)


def _across(found: Findings) -> str:
    if not found.across:
        return ""
    shown = [m for m in JUDGED if any(m.name in arm.probability for arm in found.across)]
    rows = []
    for arm in found.across:
        named = coloured(found, arm.name)
        where = ", ".join(environment_name(env_id) for env_id in arm.env_ids)
        judged = [
            probability(arm.probability[m.name]) if m.name in arm.probability else "–"
            for m in shown
        ]
        share = interval(arm.share, lambda one: f"{one:.3f}")
        rows.append([named, escape(where), escape(share), *judged])
    heads = ["", "environments", "Share of the greatest return"]
    heads += [f"{capital(measure.label)}: does better" for measure in shown]
    return (
        "<h2>Over all environments</h2>"
        + text(
            "Arms that stand beside the reference in more than one environment. The share is the "
            "mean over environments of the interquartile means of return over the most that can be "
            "earned; the probabilities of doing better than the reference are means over "
            "environments. Runs are resampled within each environment."
        )
        + table(heads, rows)
    )


def _cells(found: Findings) -> str:
    shown = [m for m in MEASURES if any(arm.has(m) for arm in found.arms)]
    rows = []
    for arm in found.arms:
        for cell in arm.cells:
            last = cell.steps[-1] if cell.begun else 0.0
            values = [latest(cell, m) for m in shown]
            rows.append(
                [
                    f"{escape(environment_name(arm.env_id))}, {named(found, arm)}",
                    str(cell.seed),
                    told(cell.state),
                    steps(last) if cell.begun else "–",
                    duration(cell.wall[-1]) if cell.begun else "–",
                    *values,
                ]
            )
    heads = ["", "seed", "state", "steps", "wall-clock", *(capital(titled(m)) for m in shown)]
    return "<h2>Every training</h2>" + folded(f"{len(rows)} trainings", table(heads, rows))


def _methods(found: Findings) -> str:
    return "<h2>How it was measured</h2>" + text(
        "Arms of an environment differ in what their names say, and in the settings at the end of "
        "this page; reward, observation, resets, limits and rates are the same unless an arm says "
        "otherwise. One training from one seed is one observation: the episodes of its latest "
        "evaluation are averaged, and intervals are over trainings. These are the last policies, "
        "not the best; evaluations play the same episodes for every training, on seeds that none "
        "of them learns from, without noise.",
        f"Intervals are percentiles of {found.settings.samples:,} stratified bootstrap resamples "
        "of the interquartile mean; with fewer than four runs that is the mean. With five runs "
        "such an interval holds the true median at most 94 % of the time, with three at most "
        f"75 %. The permutation test is Mann and Whitney's. The first evaluation of a training is "
        f"the zero action. {capital(FALLS.label)} are episodes that end before their time.",
    )


def _reproduction(found: Findings, command: str) -> str:
    commands = [cell.command for arm in found.arms for cell in arm.cells]
    blocks = {
        "Commands": "\n".join([*commands, command]),
        "Versions": json.dumps(found.versions, indent=1) if found.versions else "",
    }
    return "\n".join(
        folded(name, f"<pre>{escape(content)}</pre>") for name, content in blocks.items() if content
    )
