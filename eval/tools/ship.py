"""Ship the policy of a finished run: into `assets/policies`, with a card of what it does.

python -m eval.tools.ship runs/my_run --as QuadrupedWalk-v0/base_acceleration
"""

import re
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from scipy import stats

from eval.files import check_folder, read_json, to_json, write
from eval.rollout import Player, play_player
from eval.statistics import Chance
from eval.unseen import check_unseen
from fbid_gym.bundles import present_bundle
from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.options import Number, Whole, check_fields
from fbid_gym.policy import Card, Measured, Policy
from fbid_gym.policy.shipping import CARD, PREFIX
from train.command import run_command
from train.episodes import METRICS, Episodes
from train.runs.command_line import command_again
from train.runs.config import algorithm_of
from train.runs.environment import changed_meaning
from train.runs.folder import RunFolder
from train.runs.reading import Run, load
from train.runs.study import environment_name
from train.runs.versions import versions

POLICIES = Path(__file__).resolve().parents[2] / "assets" / "policies"
MOST_BYTES = 200_000
"""Of the files of a shipped policy."""

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
    out: Path = POLICIES
    """Folder of the shipped policies."""


def ship(config: ShipConfig) -> Path:
    """Write the policy and its card, and return their folder.

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
    size = _bytes(policy)
    if size > MOST_BYTES:
        raise RunError(f"{run.path}: its policy has {size:,} bytes. Expected at most 200 KB.")
    assert run.config is not None and run.curve is not None  # or there would be no best one
    check_unseen(config.seed, config.episodes, run.config, run.path)
    player = Player(config.name, policy.env_id, dict(policy.env_args), policy)
    episodes = play_player(player, config.episodes, config.seed, config.episodes)
    place = config.out / config.name
    policy.save(place / "policy")
    digest = read_json(place / "policy" / "policy.json")["sha256"]
    card = Card(
        env_id=policy.env_id,
        env_args=policy.env_args,
        environment=resolved_arguments(policy.env_id, policy.env_args) or {},
        algorithm=algorithm_of(run.config),
        seed=run.config["seed"],
        steps=policy.trained_steps,
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
        sha256=digest,
    )
    write(place / CARD, to_json(card.to_json()))
    return place


def _best(run: Run) -> tuple[Policy, int]:
    """Return the policy of a run's best evaluation, and which that was.

    Raises:
        RunError: only a policy, not a run; or its best policy is another's.
    """
    if run.config is None or run.curve is None:
        raise RunError(f"{run.path}: a policy alone. Expected a run folder, which knows its past.")
    folder, evaluation = RunFolder.of(run.path), run.curve.returns.argmax()
    kept = present_bundle(folder.best_policy).exists()  # archives hold the last policy alone
    policy = Policy.load(folder.best_policy if kept else folder.policy)
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


def _bytes(policy: Policy) -> int:
    with tempfile.TemporaryDirectory() as folder:
        policy.save(Path(folder, "policy"))
        return sum(file.stat().st_size for file in Path(folder, "policy").iterdir())


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
            low, high = test.proportion_ci(confidence, "wilson")
        else:
            chance = Chance(np.random.default_rng(count), _BOOTSTRAP, confidence)
            low, high = map(float, chance.interval([values], np.mean))
        found[metric.name] = Measured(mean, low, high, metric.unit)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Command line."""

    def work(config: ShipConfig) -> None:
        place = ship(config)
        print("\n".join([f"{PREFIX}{config.name}", *Card.read(place / CARD).lines()]))
        print(f"wrote {place}; python -m eval.tools.policies --write-docs tells its page")

    return run_command("eval.tools.ship", ShipConfig, work, arguments, __doc__)


if __name__ == "__main__":
    sys.exit(main())
