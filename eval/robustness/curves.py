"""Every arm along every factor: what is played, and what the episodes say."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from eval import statistics as st
from eval.results import Estimate
from eval.robustness.arms import Arm, environment
from eval.robustness.factors import FACTORS, Factor, changed
from eval.rollout import Player, play_player
from fbid_gym.envs.config import EnvConfig
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from fbid_gym.reading import read_object
from train.episodes import METRICS, Episodes
from train.progress import Tell

CONFIDENCE, SAMPLES = 0.95, 2000
"""Of the intervals: percentiles of a stratified bootstrap of that many samples."""

_METRICS = {metric.name: metric for metric in METRICS}
_FACTORS = {factor.name for factor in FACTORS}


class Budget(NamedTuple):
    """How much is played.

    Attributes:
        episodes: of every run at every value: robots side by side, each for one episode.
        seed: robot i starts from seed + i, whatever the arm and the value.
    """

    episodes: int
    seed: int


@dataclass(frozen=True)
class Curve:
    """A measure of an arm along a factor."""

    points: list[Estimate]
    """At each value."""
    summary: Estimate
    """Area under the curve over the length of its axis, which is the mean along the factor; of
    stages, the change from the first to the last."""


@dataclass(frozen=True)
class Along:
    """All arms along one factor."""

    name: str
    values: list[float]
    curves: dict[str, dict[str, Curve]]
    """By measure and arm."""
    nominal: float | None = None
    """Value at which nothing differs from training; None: there is none, or it is not known."""


@dataclass(frozen=True)
class Robustness:
    """What was found."""

    env_id: str
    env_args: dict[str, Any]
    """Of the first arm."""
    budget: Budget
    measures: tuple[str, str]
    """Columns of `Episodes`: "survived", and the velocity error where a velocity is commanded, else
    the return."""
    arms: dict[str, str]
    """Name of an arm -> its action layer, in words."""
    runs: dict[str, tuple[str, ...]]
    """Name of an arm -> its runs; none for a zero action."""
    along: list[Along]
    left_out: dict[str, str]
    """Name of a factor -> why it is not there."""
    warnings: list[str] = field(default_factory=list)
    versions: dict[str, Any] = field(default_factory=dict)
    robot: str = ""
    """Its name; empty in files that were written before it was told."""
    policies: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Name of an arm -> digests of its policies, in the order of its runs; empty in files that were
    written before there were any."""

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {**asdict(self), "budget": self.budget._asdict(), "confidence": CONFIDENCE}


def digest(policy: Policy) -> str:
    """Return the SHA-256 of the numbers that a policy acts by: trained on, it has another."""
    found = hashlib.sha256()
    for array in (policy.mean, policy.variance, *policy.weights, *policy.biases):
        found.update(np.asarray(array, dtype=float).tobytes())
    return found.hexdigest()


def read(path: Path) -> Robustness:
    """Read what `to_dict` gave from a JSON file.

    Raises:
        RunError: it cannot be read, or is something else.
    """
    data = read_object(path, RunError)
    try:
        return Robustness(
            env_id=str(data["env_id"]),
            env_args=dict(data["env_args"]),
            budget=Budget(int(data["budget"]["episodes"]), int(data["budget"]["seed"])),
            measures=(str(data["measures"][0]), str(data["measures"][1])),
            arms={str(arm): str(layer) for arm, layer in data["arms"].items()},
            runs={str(arm): tuple(map(str, runs)) for arm, runs in data["runs"].items()},
            along=[_read_along(one, data["measures"], data["arms"]) for one in data["along"]],
            left_out={str(name): str(reason) for name, reason in data["left_out"].items()},
            warnings=list(map(str, data["warnings"])),
            versions=dict(data["versions"]),
            robot=str(data.get("robot", "")),
            policies={
                str(arm): tuple(map(str, its)) for arm, its in data.get("policies", {}).items()
            },
        )
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise RunError(f"{path}: not the numbers of eval.robustness, or corrupt.") from error


def _read_along(data: dict[str, Any], measures: list[str], arms: dict[str, str]) -> Along:
    values = list(map(float, data["values"]))
    if data["name"] not in _FACTORS or not set(measures) <= _METRICS.keys():
        raise ValueError("a factor or measure that there is not")
    curves: dict[str, dict[str, Curve]] = {measure: {} for measure in measures}
    for measure, its in curves.items():
        for arm in arms:
            found = data["curves"][measure][arm]
            points, summary = list(map(_estimate, found["points"])), _estimate(found["summary"])
            if len(points) != len(values) or len({point.low is None for point in points}) != 1:
                raise ValueError("points that are not those of the values")
            its[arm] = Curve(points, summary)
    nominal = data.get("nominal")
    return Along(str(data["name"]), values, curves, None if nominal is None else float(nominal))


def _estimate(data: dict[str, Any]) -> Estimate:
    low, high = (None if data[end] is None else float(data[end]) for end in ("low", "high"))
    return Estimate(float("nan") if data["value"] is None else float(data["value"]), low, high)


def measure(
    arms: Sequence[Arm],
    factors: Sequence[Factor],
    budget: Budget,
    tell: Tell = lambda done, total, what: None,
) -> Robustness:
    """Play every arm along every factor.

    What is the same at two values, such as the nominal ones of all factors, is played once.

    Args:
        arms: all of one environment.
        factors: those that the environment does not have are left out.
        budget: how much is played.
        tell: told how far it is.

    Raises:
        FbidError: arguments of an environment that are not valid, or a policy that does not fit;
            nothing has been played.
    """
    config = [environment(player) for arm in arms for player in arm.players][0]
    left_out = {factor.name: _reason(factor, arms, config) for factor in factors}
    there = [factor for factor in factors if not left_out[factor.name]]
    plan = {
        (arm.name, factor.name, value): [_at(player, factor, value) for player in arm.players]
        for arm in arms
        for factor in there
        for value in factor.values_in(config)
    }
    every = {one.key: one for conditions in plan.values() for one in conditions}
    played: dict[str, Episodes] = {}
    for key, one in every.items():
        tell(len(played), len(every), one.player.name)
        played[key] = play_player(one.player, budget.episodes, budget.seed, budget.episodes)
    walks = all(np.isfinite(episodes.velocity_error).all() for episodes in played.values())
    measures = "survived", "velocity_error" if walks else "returned"

    trained = {id(player): _key(player, player) for arm in arms for player in arm.players}

    def nominal(factor: Factor) -> float | None:
        """Where training itself randomises the quantity, there is none."""
        value = factor.nominal
        if value is None or value not in factor.values_in(config):
            return None
        same = all(
            one.key == trained[id(player)]
            for arm in arms
            for player, one in zip(arm.players, plan[arm.name, factor.name, value], strict=True)
        )
        return value if same else None

    def curve(arm: Arm, factor: Factor, name: str) -> Curve:
        values = factor.values_in(config)
        table = np.array(
            [
                [getattr(played[one.key], name) for one in plan[arm.name, factor.name, value]]
                for value in values
            ]
        )
        return estimated(table, values, bool(factor.stages), np.random.default_rng(budget.seed))

    return Robustness(
        env_id=arms[0].players[0].env_id,
        env_args=dict(arms[0].players[0].env_args),
        budget=budget,
        measures=measures,
        arms={arm.name: arm.layer for arm in arms},
        runs={arm.name: arm.runs for arm in arms},
        along=[
            Along(
                factor.name,
                list(factor.values_in(config)),
                {name: {arm.name: curve(arm, factor, name) for arm in arms} for name in measures},
                nominal(factor),
            )
            for factor in there
        ],
        left_out={name: reason for name, reason in left_out.items() if reason},
        robot=config.load_robot().name,
        policies={
            arm.name: tuple(digest(each.policy) for each in arm.players if each.policy is not None)
            for arm in arms
        },
    )


def estimated(
    table: np.ndarray, values: Sequence[float], staged: bool, rng: np.random.Generator
) -> Curve:
    """Return a curve with its intervals.

    The unit of chance is the run, whose episodes are averaged first; of one run, or one zero
    action, it is the episode: then the interval says how well that one is known.

    Args:
        table: (V, R, E) of values, runs and episodes.
        values: (V,) positions, increasing.
        staged: whether these are stages rather than quantities.
        rng: of the bootstrap.
    """
    several = table.shape[1] > 1
    units = (table.mean(axis=2) if several else table[:, 0]).T
    summary = units[:, -1] - units[:, 0] if staged else area(units, values)
    every = np.column_stack([units, summary])
    statistic = st.interquartile_mean if several else np.mean
    found = statistic(every, axis=0)
    if len(every) < 2:
        estimates = [Estimate(float(value)) for value in found]
    else:
        draws = st.bootstrap(every[:, None], rng, statistic, SAMPLES)
        bounds = st.percentile_interval(draws, CONFIDENCE)
        estimates = [Estimate(*map(float, each)) for each in zip(found, *bounds, strict=True)]
    return Curve(estimates[:-1], estimates[-1])


def area(curves: np.ndarray, positions: Sequence[float]) -> np.ndarray:
    """Return the areas under curves (U, V), by the trapezoidal rule, over the axis's length: (U,).

    An axis of one point has none; there it is the value.
    """
    if len(positions) == 1:
        return curves[:, 0]
    return np.trapezoid(curves, positions, axis=1) / (positions[-1] - positions[0])


class _Condition(NamedTuple):
    """A player in one environment; those with the same key play the same episodes."""

    player: Player
    key: str


def _at(player: Player, factor: Factor, value: float) -> _Condition:
    own = meant(player)
    there = replace(player, env_args=changed(player.env_args, factor.changes(value, own)))
    return _Condition(there, _key(player, there))


def _key(player: Player, there: Player) -> str:
    return f"{id(player)} {json.dumps(meant(there).resolved(), sort_keys=True)}"


def meant(player: Player) -> EnvConfig:
    """Return the environment that a player's arguments make."""
    return EnvConfig.of({**gym.spec(player.env_id).kwargs, **player.make_args})


def _reason(factor: Factor, arms: Sequence[Arm], config: EnvConfig) -> str:
    if factor.for_policies and all(player.policy is None for arm in arms for player in arm.players):
        return "a zero action is the same, however late it comes"
    return factor.missing(config)
