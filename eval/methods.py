"""The end of the report: how it was measured, and what it takes to do it again."""

import json
import shlex
from collections.abc import Sequence
from html import escape

from eval.results import Comparison, Layer


def methods(c: Comparison) -> str:
    """Say how everything was measured."""
    platform = str(c.versions.get("platform", "an unknown machine"))
    cores = f" with {c.versions['cpu_count']} cores" if c.versions.get("cpu_count") else ""
    return (
        "<h2>How it was measured</h2>"
        "<p>Robot, task, reward, observation, torque limits, training algorithm and its "
        "hyperparameters are the same for every layer; the layer that turns actions into torques "
        "is the difference. One run, trained from one seed, is one observation: its episodes are "
        "averaged before anything else, and intervals are over runs. They are percentile intervals "
        f"of {c.settings.samples:,} stratified bootstrap resamples of the interquartile mean; with "
        "fewer than four runs the interquartile mean is the mean. The permutation test is Mann and "
        "Whitney's, exact up to 20,000 splits.</p>"
        "<p>Every environment plays a number of episodes that is fixed beforehand, each to its "
        "end, so that short episodes are not favoured. Episodes start from seeds that training "
        "does not evaluate on.</p>"
        "<p>Wall-clock is the time training spent on simulation, the layer and the network, "
        f"without its periodic evaluations, on {escape(platform)}{cores}. It depends on the "
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
    lines = [_training_command(c, layer, run.seed) for layer in c.layers for run in layer.runs
             if run.seed is not None]  # fmt: skip
    if command:
        lines.append(shlex.join(command))
    if lines:
        text = escape("\n".join(lines))
        parts.append(f"<details><summary>Commands</summary><pre>{text}</pre></details>")
    return "\n".join(parts)


def _training_command(c: Comparison, layer: Layer, seed: int) -> str:
    args = ["python", "-m", "train.ppo", "--env", c.env_id, "--seed", str(seed)]
    args += ["--action-layer", str(layer.env_args.get("action_layer"))]
    if layer.env_args.get("layer_options"):
        args += ["--layer-options", json.dumps(layer.env_args["layer_options"])]
    if c.env_args:
        args += ["--env-args", json.dumps(c.env_args)]
    for name in ("total_steps", "num_envs"):
        if name in c.shared:
            args += [f"--{name.replace('_', '-')}", str(c.shared[name])]
    return shlex.join(args)
