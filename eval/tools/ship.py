r"""Ship the policy of a finished run: into `assets/policies`, with a card of what it does.

python -m eval.tools.ship runs/my_run --as QuadrupedWalk-v0/base_acceleration
python -m eval.tools.ship runs/bodies --as QuadrupedWalk-v1/any-quadruped \
    --unseen zoo:quadruped:1000-1029 go1
"""

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from scipy import stats

from eval.comparable import check_unseen
from eval.rollout import Player, play_player
from eval.statistics import Chance
from fbid_gym.bundles import SUFFIX
from fbid_gym.envs.registered import resolved_arguments
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.options import Number, Whole, check_fields
from fbid_gym.policy import Card, Measured, OnRobot, Policy, Shipped
from fbid_gym.policy.policy_file import PREFIX
from fbid_gym.robots import several
from train.command import run_command
from train.episodes import METRICS, Episodes
from train.runs.archive import found
from train.runs.command_line import command_again
from train.runs.environment import changed_meaning
from train.runs.files import check_folder
from train.runs.folder import RunFolder
from train.runs.reading import Run, load
from train.runs.robots import learnt_with
from train.runs.study import environment_name
from train.runs.versions import versions

POLICIES = Path(__file__).resolve().parents[2] / "assets" / "policies"
MOST_BYTES = 190_000
"""Of the numbers of a shipped policy: with its card its file then has no more than 200 KB."""

_MEASURED = (
    "returned", "survived", "velocity_error", "turning_error", "height_error", "slip",
    "cost_of_transport", "foothold_error",
)  # fmt: skip
_BOOTSTRAP = 5000
_PLAIN = re.compile(r"[A-Za-z0-9_.-]*[A-Za-z0-9]")


@dataclass(frozen=True)
class ShipConfig:
    """Ship the policy of a finished run, with a card of what it does."""

    run: tyro.conf.Positional[Path]
    """Run folder. The policy is that of its evaluation with the highest return."""
    name: Annotated[str, tyro.conf.arg(name="as")]
    """Name of the environment and of the arm: QuadrupedWalk-v0/base_acceleration."""
    episodes: Annotated[int, Whole(20, 10_000)] = 100
    """For the card's metrics, each in an environment of its own."""
    seed: Annotated[int, Whole(0, 2**31)] = 30_000
    """Of the first of them; none that training evaluates on."""
    confidence: Annotated[float, Number(0.5, 0.9999)] = 0.95
    """Of the intervals."""
    unseen: tuple[str, ...] = ()
    """Robots that it never saw: "zoo:quadruped:1000-1029". The card says how it does on each."""
    unseen_episodes: Annotated[int, Whole(1, 10_000)] = 16
    """On each of them."""
    out: Path = POLICIES
    """Folder of the shipped policies."""


def ship(config: ShipConfig) -> Shipped:
    """Write the policy with its card.

    Raises:
        FbidError: a name that is not valid, or a run that is unfinished, of an environment that
            changed, or of a robot that is not built in; or a policy that is too large. Nothing is
            written then.
    """
    check_fields(config)
    check_folder(config.out, "out")
    run = load(config.run)
    policy, evaluation = _best(run)
    _check_name(config.name, policy.env_id)
    if (changed := changed_meaning(run.path)) is not None:
        raise RunError(f"{changed} Train it again.")
    if isinstance(policy.env_args.get("robot"), Mapping):
        raise RunError(f"{run.path}: of a robot of yours. Expected one that is built in.")
    arrays = (policy.mean, policy.variance, *policy.weights, *policy.biases)
    size = sum(array.nbytes for array in arrays)
    if size > MOST_BYTES:
        raise RunError(f"{run.path}: its policy has {size:,} bytes. Expected at most 190 KB.")
    assert run.config is not None and run.curve is not None  # or there would be no best one
    check_unseen(config.seed, config.episodes, run.config, run.path)
    player = Player(config.name, policy.env_id, dict(policy.env_args), policy)
    robots = learnt_with(run.path)
    unseen = _unseen(config, player, robots)
    episodes = play_player(player, config.episodes, config.seed, config.episodes)
    card = Card(
        environment=resolved_arguments(policy.env_id, policy.env_args) or {},
        seed=run.config["seed"],
        total_steps=run.config["total_steps"],
        evaluations=len(run.curve.steps),
        best_return=float(run.curve.returns[evaluation]),
        command=command_again(run.config, run.path),
        wall_seconds=float(run.curve.wall_seconds[evaluation]),
        trained_with=run.versions,
        measured_with=versions(),
        episodes=config.episodes,
        first_seed=config.seed,
        confidence=config.confidence,
        metrics=measured(episodes, config.confidence),
        robots=robots,
        unseen=unseen,
        unseen_episodes=config.unseen_episodes if unseen else 0,
    )
    file, policy = config.out / f"{config.name}{SUFFIX}", replace(policy, card=card)
    policy.save(file)
    return Shipped(config.name, file, policy, card)


def _unseen(config: ShipConfig, player: Player, seen: tuple[str, ...]) -> tuple[OnRobot, ...]:
    """Play a policy and the zero action on robots that it never saw, from the same seeds."""
    robots, found = several(config.unseen) if config.unseen else (), list[OnRobot]()
    for robot in robots:
        if robot.name in seen:
            raise InvalidValueError("unseen", robot.name, "robots that it did not learn with")
    for robot in robots:
        there = replace(player, robot=robot)
        both = [play_player(each, config.unseen_episodes, config.seed)
                for each in (there, replace(there, policy=None))]  # fmt: skip
        means = [float(np.mean(x)) for each in both for x in (each.returned, each.survived)]
        found.append(OnRobot(robot.name, robot.mass, robot.num_joints, *means))
    return tuple(found)


def _best(run: Run) -> tuple[Policy, int]:
    """Return the policy of a run's best evaluation, and which that was.

    Raises:
        RunError: only a policy, not a run; or its best policy is another's.
    """
    if run.config is None or run.curve is None:
        raise RunError(f"{run.path}: a policy alone. Expected a run folder, which knows its past.")
    best, evaluation = RunFolder.of(run.path).best_policy, run.curve.returns.argmax()
    kept = best.exists()  # archives hold the last policy alone
    policy = Policy.load(best if kept else found(run.path))
    if policy.trained_steps != run.curve.steps[evaluation]:
        raise RunError(
            f"{run.path}: its {'best' if kept else 'only'} policy is that of step "
            f"{policy.trained_steps}. Expected "
            f"{run.curve.steps[evaluation]:.0f}, of the evaluation with the highest return."
        )
    return policy, int(evaluation)


def _check_name(name: str, env_id: str) -> None:
    env, _, arm = name.partition("/")
    if env != environment_name(env_id) or not _PLAIN.fullmatch(arm):
        expected = f"{environment_name(env_id)}/ARM, of letters, digits, '_', '.' and '-'"
        raise InvalidValueError("as", name, expected)


def measured(episodes: Episodes, confidence: float) -> dict[str, Measured]:
    """Return what the episodes say of each metric that they have, with its interval.

    Of a share the interval is Wilson's, of all else that of a bootstrap over the episodes.
    """
    found = {}
    for metric in (metric for metric in METRICS if metric.name in _MEASURED):
        values = np.asarray(getattr(episodes, metric.name), dtype=float)
        if not np.isfinite(values).all():
            continue
        mean, count = float(values.mean()), len(values)
        if metric.unit == "share":
            test = stats.binomtest(round(mean * count), count)
            low, high = map(float, test.proportion_ci(confidence, "wilson"))
        else:
            chance = Chance(np.random.default_rng(count), _BOOTSTRAP, confidence)
            low, high = map(float, chance.interval([values], np.mean))
        found[metric.name] = Measured(mean, low, high, metric.unit)
    return found


def run(config: ShipConfig) -> None:
    """Ship it, and print its card."""
    done = ship(config)
    print("\n".join([f"{PREFIX}{done.name}", *done.lines()]))
    print(f"wrote {done.path}; python -m eval.tools.policies --write-docs tells its page")


main = partial(run_command, "eval.tools.ship", ShipConfig, run, about=__doc__)


if __name__ == "__main__":
    sys.exit(main())
