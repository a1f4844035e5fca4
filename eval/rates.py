"""Whether walking depends on how often law and physics run: `python -m eval.rates`.

The environments' own rates, which are cheap, beside the papers'; same starts, commands and pushes.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from eval.pages import RATES_PAGE, tell_rows
from eval.walking import Push, Seconds, Trial, Walked, WalkingConfig, gaits, loaded, walk
from fbid_gym.actions import LAYERS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.options import Choice, Each, check_fields
from train.command import run_command

EXACT: dict[str, Any] = {
    "physics_hz": 1000,
    "control_hz": 500,
    "friction_cone": "elliptic",
    "solver_iterations": None,
}
"""How the papers' experiments run."""

SETTINGS: dict[str, dict[str, Any]] = {
    "as in the papers": EXACT,
    "law at 250 Hz": EXACT | {"control_hz": 250},
    "law and physics at 250 Hz": EXACT | {"control_hz": 250, "physics_hz": 250},
    "and pyramids": {"solver_iterations": None},
    "and 20 iterations: the environment's own": {},
}
"""Name -> arguments that differ from the environment's, from the dearest to the cheapest."""

WITHIN = 0.1
"""Share by which survival and error of velocity may differ."""


@dataclass(frozen=True)
class RatesConfig:
    """Walk without a policy at several rates, and tell what they change."""

    robots: tuple[str, ...] = ("go1", "biped", "humanoid")
    """Built-in robots or your own, each with its first gait."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = (
        "base_acceleration",
        "joint_position",
    )
    """Action layers."""
    episodes: Annotated[int, NUM_ENVS] = 32
    """Robots that walk side by side, environment i with seed i."""
    seconds: Seconds = 20.0
    """Length of an episode."""
    push: Push = 0.0
    """N, of pushes of 0.15 s every 1.5 to 3 s in a random direction."""
    steps: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Also the settings between the dearest and the cheapest: which of them makes a difference."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the table into docs/rates.md."""


def settings(config: RatesConfig) -> dict[str, dict[str, Any]]:
    """Return what is compared, the dearest first."""
    names = list(SETTINGS)
    return {name: SETTINGS[name] for name in (names if config.steps else [names[0], names[-1]])}


def apart(one: Walked, other: Walked) -> tuple[float, float]:
    """Return by which share of `other` survival and error of velocity are greater in `one`."""
    return _greater(one.survival, other.survival), _greater(
        one.velocity_error, other.velocity_error
    )


def _greater(one: float, other: float) -> float:
    if one == other:
        return 0.0
    return one / other - 1.0 if other else math.inf


def _shares(one: Walked, other: Walked) -> list[str]:
    """Say by which shares they differ; the errors of robots that all fall say nothing."""
    up, error = apart(one, other)
    told = [
        f"{100 * share:+.0f} %{'' if abs(share) <= WITHIN else ' (missed)'}"
        for share in (up, error)
    ]
    return told if one.survival or other.survival else [told[0], "nobody walks"]


_HEAD = ("Robot", "Layer", "Setting", "Up", "Velocity error (m/s)", "Up, apart",
         "Velocity error, apart")  # fmt: skip


def rows(config: RatesConfig) -> Iterator[str]:
    """Yield the lines of the table, each when it is there."""
    walking = WalkingConfig(episodes=config.episodes, seconds=config.seconds, push=config.push)
    yield f"| {' | '.join(_HEAD)} |"
    yield f"|{' --- |' * len(_HEAD)}"
    for robot, gait in [(robot, gaits(robot)[0]) for robot in loaded(config.robots)]:
        for layer in config.layers:
            trial, exact = Trial(robot, gait, layer), None
            for name, arguments in settings(config).items():
                walked = walk(trial, walking, **arguments)
                exact = exact or walked
                up = f"{round(walked.survival * config.episodes)} of {config.episodes}"
                cells = [robot.name, f"`{layer}`", name, up, f"{walked.velocity_error:.3f}"]
                cells += ["", ""] if walked is exact else _shares(walked, exact)
                yield f"| {' | '.join(cells)} |"


def main(config: RatesConfig) -> None:
    """Walk, print, write; what can be refused is refused before."""
    check_fields(config)
    said = f"{config.episodes} robots each, {config.seconds:g} s, pushes of {config.push:g} N."
    tell_rows(rows(config), said, RATES_PAGE if config.write_docs else None)


if __name__ == "__main__":
    sys.exit(run_command("eval.rates", RatesConfig, main))
