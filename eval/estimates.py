"""How far robots' estimates of their state are off while they walk: `python -m eval.estimates`.

The zero action walks with each preset of sensors; the picture has the errors over time, median and
the middle 80 % of the robots.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from eval.files import check_output, write
from eval.page.figures import Series, panel, sheet
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.estimation import PRESETS
from fbid_gym.options import Choice, Each, Number, check_fields
from fbid_gym.runtime.config import EnvConfig
from train.command import run_command

SHOWN = {
    "estimate_velocity_error": ("velocity of the base, m/s", 1.0),
    "estimate_tilt_error": ("tilt, degrees", 180.0 / np.pi),
}
"""Entry of the info -> title of its panel, and the factor on its values."""


@dataclass(frozen=True)
class EstimatesConfig:
    """What is drawn."""

    out: Path
    """The picture, an SVG."""
    envs: Annotated[tuple[str, ...], Each(Choice(ENVIRONMENTS))] = (
        "fbid_gym/QuadrupedWalk-v0",
        "fbid_gym/BipedWalk-v0",
    )
    """Ids of the environments."""
    layer: Annotated[str, Choice(LAYERS, "action layer")] = "base_acceleration"
    """The action layer."""
    episodes: Annotated[int, NUM_ENVS] = 32
    """Robots side by side."""
    seconds: Annotated[float, Number(0.1, 1000.0, "s")] = 10.0
    """Length of an episode."""


def errors_over_time(env: str, preset: str, config: EstimatesConfig) -> dict[str, np.ndarray]:
    """Return the errors of robots that walk by the zero action, (T, N) by name; NaN once fallen."""
    own = {"episode_seconds": config.seconds, "sensors": preset, "action_layer": config.layer}
    batch = EnvBatch(EnvConfig.of(ENVIRONMENTS[env] | own), config.episodes)
    for robot in range(config.episodes):
        batch.seed(robot, np.random.default_rng(robot))
    batch.reset(np.arange(config.episodes))
    zero, up = np.zeros((config.episodes, len(batch.action_names))), np.ones(config.episodes, bool)
    found: dict[str, list[np.ndarray]] = {name: [] for name in SHOWN}
    for _ in range(batch.num_steps):
        step = batch.step(zero)
        up = up & ~step.terminated
        for name, values in found.items():
            values.append(np.where(up, step.info[name], np.nan))
    return {name: np.array(values) for name, values in found.items()}


def run(config: EstimatesConfig) -> None:
    """Play, print the root mean squares, draw."""
    check_fields(config)
    check_output(config.out, "out", (".svg",))
    panels = []
    for env in config.envs:
        hz = EnvConfig.of(ENVIRONMENTS[env]).policy_hz
        played = {preset: errors_over_time(env, preset, config) for preset in PRESETS}
        for name, (title, factor) in SHOWN.items():
            series = []
            for colour, preset in enumerate(PRESETS):
                values = factor * played[preset][name]
                values = values[:, ~np.isnan(values).all(axis=0)]
                low, middle, high = np.nanquantile(values, (0.1, 0.5, 0.9), axis=1)
                time = np.arange(1, len(values) + 1) / hz
                series.append(Series(preset, colour, time, middle, low, high))
                size = np.sqrt(np.nanmean(np.square(values)))
                print(f"{env} {preset}: {title}, root mean square {size:.3g}", flush=True)
            short = env.removeprefix("fbid_gym/").removesuffix("-v0")
            panels.append(panel(series, f"{short}: {title}", "s"))
    write(config.out, sheet(panels))


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line."""
    given = sys.argv[1:] if arguments is None else arguments
    return run_command("eval.estimates", EstimatesConfig, run, given, __doc__ or "")


if __name__ == "__main__":
    sys.exit(main())
