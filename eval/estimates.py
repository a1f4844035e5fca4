"""Measure the errors of robots' state estimates while they walk: `python -m eval.estimates`.

The zero action walks with each preset of sensors and each filter; the picture has the errors of the
first filter over time, median and the middle 80 % of the robots.
"""

import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np

from eval.page.figures import Series, panel, sheet
from eval.zero_actions.measures import play
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.estimation import PRESETS
from fbid_gym.estimation.sensors import ESTIMATORS, LIKE
from fbid_gym.options import Choice, Each, Number
from fbid_gym.runtime.config import EnvConfig
from train.command import run_command
from train.runs.files import check_output, write

SHOWN = {
    "estimate_velocity_error": ("velocity of the base, m/s", 1.0),
    "estimate_tilt_error": ("tilt, degrees", 180.0 / np.pi),
}
"""Entry of the info -> title of its panel, and the factor on its values."""


@dataclass(frozen=True)
class EstimatesConfig:
    """Options of the command."""

    out: Path | None = None
    """The picture, an SVG. Default: none."""
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


def errors_over_time(
    env: str, preset: str, estimator: str, config: EstimatesConfig
) -> dict[str, np.ndarray]:
    """Return the errors of robots that walk by the zero action, (T, N) by name; NaN once fallen."""
    sensors = {LIKE: preset, "estimator": estimator}
    own = {"episode_seconds": config.seconds, "sensors": sensors, "action_layer": config.layer}
    batch = EnvBatch(EnvConfig.of(ENVIRONMENTS[env] | own), config.episodes)
    played = play(batch, 0, told=tuple(SHOWN))
    return {name: np.where(played["up"], played[name], np.nan) for name in SHOWN}


def run(config: EstimatesConfig) -> None:
    """Play, print the root mean squares, draw."""
    check_output(config.out, "out", (".svg",))
    panels = []
    for env in config.envs:
        hz = EnvConfig.of(ENVIRONMENTS[env]).policy_hz
        every = list(product(ESTIMATORS, PRESETS))
        played = {one: errors_over_time(env, one[1], one[0], config) for one in every}
        for name, (title, factor) in SHOWN.items():
            series = []
            for colour, (estimator, preset) in enumerate(every):
                values = factor * played[estimator, preset][name]
                values = values[:, ~np.isnan(values).all(axis=0)]
                size = np.sqrt(np.nanmean(np.square(values)))
                said = f"{env} {preset} {estimator}: {title}, root mean square {size:.3g}"
                print(said, flush=True)
                if estimator == ESTIMATORS[0]:
                    low, middle, high = np.nanquantile(values, (0.1, 0.5, 0.9), axis=1)
                    seconds = np.arange(1, len(values) + 1) / hz
                    series.append(Series(preset, colour, seconds, middle, low, high))
            short = env.removeprefix("fbid_gym/").removesuffix("-v0")
            panels.append(panel(series, f"{short}: {title}", "s"))
    if config.out is not None:
        write(config.out, sheet(panels))


if __name__ == "__main__":
    sys.exit(run_command("eval.estimates", EstimatesConfig, run, about=__doc__))
