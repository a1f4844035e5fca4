"""The end of the report: how it was measured, and what it takes to do it again."""

import json
import shlex
from collections.abc import Sequence
from html import escape

from eval.results import Comparison


def methods(c: Comparison) -> str:
    """Say how everything was measured."""
    platform = str(c.versions.get("platform", "an unknown machine"))
    cores = c.versions.get("cpu_count")
    machine = f"{platform} with {cores} cores" if cores else platform
    return (
        "<h2>How it was measured</h2>"
        "<p>Robot, task, reward, observation and torque limits are the same for every layer, and "
        "so are the training algorithm and its hyperparameters unless this page says otherwise; "
        "the layer that turns actions into torques is the difference. One run, trained from one "
        "seed, is one observation: its episodes are averaged before anything else, and intervals "
        "are over runs. They are percentile intervals "
        f"of {c.settings.samples:,} stratified bootstrap resamples of the interquartile mean; with "
        "fewer than four runs the interquartile mean is the mean. The permutation test is Mann and "
        "Whitney's, exact up to 20,000 splits.</p>"
        "<p>Every environment plays a number of episodes that is fixed beforehand, each to its "
        "end, so that short episodes are not favoured. Episodes start from seeds that training "
        "does not evaluate on.</p>"
        "<p>Wall-clock is the time training spent on simulation, the layer and the network, "
        f"without its periodic evaluations, on {escape(machine)}. It depends on the "
        "machine and on what else ran there; steps do not.</p>"
    )


def reproduction(c: Comparison, command: Sequence[str]) -> str:
    """Settings, versions and commands, folded away."""
    parts = ["<details><summary>Settings shared by all runs</summary>"]
    shared = {"env_id": c.env_id, "env_args": c.env_args, **c.shared}
    parts.append(f"<pre>{escape(json.dumps(shared, indent=1))}</pre></details>")
    if c.versions:
        parts.append("<details><summary>Versions</summary>")
        parts.append(f"<pre>{escape(json.dumps(c.versions, indent=1))}</pre></details>")
    lines = [run.command for layer in c.layers for run in layer.runs if run.command]
    if command:
        lines.append(shlex.join(command))
    if lines:
        text = escape("\n".join(lines))
        parts.append(f"<details><summary>Commands</summary><pre>{text}</pre></details>")
    return "\n".join(parts)
