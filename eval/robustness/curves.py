"""Every arm along every factor: what is played, and what the episodes say."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np

from eval.results import Estimate
from eval.robustness.arms import PlayedArm, environment
from eval.robustness.factors import BY_NAME, Factor, changed
from eval.rollout import Player, play_player
from eval.statistics import Chance, interquartile_mean
from eval.wording import METRIC
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from fbid_gym.reading import read_object
from fbid_gym.runtime.config import EnvConfig
from train.environments import first_alone
from train.episodes import Episodes
from train.progress import Tell

CONFIDENCE, SAMPLES = 0.95, 2000
"""Of the intervals: percentiles of a stratified bootstrap of that many samples."""


@dataclass(frozen=True)
class Budget:
    """Number and length of the episodes."""

    episodes: int  # of every run at every value: robots side by side, each for one episode
    seed: int  # robot i starts from seed + i, whatever the arm and the value


@dataclass(frozen=True)
class Trend:
    """A measure of an arm along a factor."""

    points: list[Estimate]  # at each value
    summary: Estimate
    """Area under the curve over the length of its axis, which is the mean along the factor; of
    stages, the change from the first to the last."""


@dataclass(frozen=True)
class Along:
    """All arms along one factor."""

    name: str
    values: list[float]
    curves: dict[str, dict[str, Trend]]  # by measure and arm
    nominal: float | None = None
    """Value at which nothing differs from training; None: there is none, or it is not known."""

    def __post_init__(self) -> None:
        """Refuse a factor that there is not, and curves that are not of the values."""
        for curve in (curve for its in self.curves.values() for curve in its.values()):
            known = {point.low is None for point in curve.points}
            if len(curve.points) != len(self.values) or len(known) > 1:
                raise ValueError("points that are not those of the values")
        if self.name not in BY_NAME:
            raise ValueError(f"no factor {self.name!r}")


@dataclass(frozen=True)
class Robustness:
    """Results of a robustness test."""

    env_id: str
    env_args: dict[str, Any]  # of the first arm
    budget: Budget
    measures: tuple[str, str]
    """Columns of `Episodes`: "survived", and the velocity error where a velocity is commanded, else
    the return."""
    arms: dict[str, str]  # name of an arm -> its action layer, in words
    runs: dict[str, tuple[str, ...]]  # name of an arm -> its runs; none for a zero action
    along: list[Along]
    left_out: dict[str, str]  # name of a factor -> why it is not there
    warnings: list[str] = field(default_factory=list)
    versions: dict[str, Any] = field(default_factory=dict)
    robot: str = ""  # its name; empty in files that were written before it was told
    policies: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Name of an arm -> digests of its policies, in the order of its runs; empty in files that were
    written before there were any."""

    def __post_init__(self) -> None:
        """Refuse measures that there are not, and a factor without one of the arms."""
        for along in self.along:
            for measure in self.measures:
                its = along.curves.get(measure, {})
                if measure not in METRIC or its.keys() != self.arms.keys():
                    raise ValueError(f"{measure} is not of the arms {', '.join(self.arms)}")

    @property
    def dashed(self) -> dict[str, str]:
        """Layer -> the arm that is its zero action, of layers of which something else is tried."""
        trained = {layer for arm, layer in self.arms.items() if self.runs[arm]}
        zeros = {layer: arm for arm, layer in self.arms.items() if not self.runs[arm]}
        return {layer: arm for layer, arm in zeros.items() if layer in trained}

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {**asdict(self), "confidence": CONFIDENCE}


def digest(policy: Policy) -> str:
    """Return the SHA-256 of the numbers that a policy acts by: trained on, it has another."""
    found = hashlib.sha256()
    for array in (policy.mean, policy.variance, *policy.weights, *policy.biases):
        found.update(np.asarray(array, dtype=float).tobytes())
    return found.hexdigest()


def read(path: Path) -> Robustness:
    """Read what `to_dict` gave from a JSON file; RunError for anything else."""
    data = read_object(path, RunError)
    try:
        return msgspec.convert(data, Robustness)
    except msgspec.ValidationError as error:
        wrong = f"{path}: not the numbers of eval.robustness, or corrupt ({error})."
        raise RunError(wrong) from error


def measure(
    arms: Sequence[PlayedArm],
    factors: Sequence[Factor],
    budget: Budget,
    tell: Tell = lambda done, total, what: None,
) -> Robustness:
    """Play every arm along every factor.

    Equal conditions, such as the nominal values of all factors, are played once; factors that the
    environment of the arms does not have are left out.

    Raises:
        FbidError: arguments of an environment that are not valid, or a policy that does not fit;
            nothing has been played.
    """
    config = [environment(player) for arm in arms for player in arm.players][0]
    learnt = any(player.policy is not None for arm in arms for player in arm.players)
    several = any("robots" in player.make_args for arm in arms for player in arm.players)
    same = "a zero action is the same, however late it comes"
    left_out = {f.name: f.missing(config) for f in factors}
    left_out |= {f.name: same for f in factors if f.for_policies and not learnt}
    left_out |= {f.name: "the robots differ in height" for f in factors if f.for_one and several}
    there = [factor for factor in factors if not left_out[factor.name]]
    plan = {
        (arm.name, factor.name, value): {
            _key(player, one): one for player in arm.players for one in [at(player, factor, value)]
        }
        for arm in arms
        for factor in there
        for value in factor.values_in(config)
    }
    every = {key: one for conditions in plan.values() for key, one in conditions.items()}
    played: dict[str, Episodes] = {}
    for key, one in every.items():
        tell(len(played), len(every), one.name)
        played[key] = play_player(one, budget.episodes, budget.seed, budget.episodes)
    walks = all(np.isfinite(episodes.velocity_error).all() for episodes in played.values())
    measures = "survived", "velocity_error" if walks else "returned"

    trained = {id(player): _key(player, player) for arm in arms for player in arm.players}

    def nominal(factor: Factor) -> float | None:
        """The value of training; None where training itself randomises the quantity."""
        value = factor.nominal
        if value is None or value not in factor.values_in(config):
            return None
        same = all(
            key == trained[id(player)]
            for arm in arms
            for player, key in zip(arm.players, plan[arm.name, factor.name, value], strict=True)
        )
        return value if same else None

    def curve(arm: PlayedArm, factor: Factor, name: str) -> Trend:
        values = factor.values_in(config)
        keys = [plan[arm.name, factor.name, value] for value in values]
        table = np.array([[getattr(played[key], name) for key in its] for its in keys])
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
) -> Trend:
    """Return a curve with its intervals, from (V, R, E) of values, runs and episodes.

    The unit of chance is the run, whose episodes are averaged first; of one run, or one zero
    action, it is the episode: then the interval says how well that one is known.
    """
    several = table.shape[1] > 1
    units = (table.mean(axis=2) if several else table[:, 0]).T
    summary = units[:, -1] - units[:, 0] if staged else area(units, values)
    every = np.column_stack([units, summary])
    statistic = interquartile_mean if several else np.mean
    found = statistic(every, axis=0)
    bounds = [(None, None)] * len(found)
    if len(every) > 1:
        bounds = Chance(rng, SAMPLES, CONFIDENCE).interval([every], statistic).T.tolist()
    *points, last = (
        Estimate(float(value), *ends) for value, ends in zip(found, bounds, strict=True)
    )
    return Trend(points, last)


def area(curves: np.ndarray, positions: Sequence[float]) -> np.ndarray:
    """Return the areas under curves (U, V), by the trapezoidal rule, over the axis's length: (U,).

    An axis of one point has none; there it is the value.
    """
    if len(positions) == 1:
        return curves[:, 0]
    return np.trapezoid(curves, positions, axis=1) / (positions[-1] - positions[0])


def at(player: Player, factor: Factor, value: float) -> Player:
    """Return a player where one thing is otherwise."""
    changes = factor.changes(value, meant(player))
    return replace(player, env_args=changed(player.env_args, changes))


def _key(player: Player, there: Player) -> str:
    """Return what is the same where a player plays the same episodes in another environment."""
    return f"{id(player)} {json.dumps(meant(there).resolved(), sort_keys=True)}"


def meant(player: Player) -> EnvConfig:
    """Return the environment that a player's arguments make, of the first of several robots."""
    return EnvConfig.of({**gym.spec(player.env_id).kwargs, **first_alone(player.make_args)})
