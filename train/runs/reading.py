"""Run folders, and exported policies, as whoever evaluates them sees them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fbid_gym.errors import RunError
from fbid_gym.policy import Policy, place_of
from fbid_gym.robots import Robot
from train.runs.environment import load_policy
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.robots import learnt_with, of_policy
from train.runs.tables import read_rows

LAYER_ARGS = ("action_layer", "layer_options")


@dataclass(frozen=True)
class LearningCurve:
    """Periodic evaluations of one run, (K,) each."""

    steps: np.ndarray  # environment steps of all robots together
    wall_seconds: np.ndarray  # time since training began, s
    returns: np.ndarray  # mean return
    spread: np.ndarray  # standard deviation of the return over episodes
    episodes: np.ndarray  # number of episodes it is the mean of


@dataclass(frozen=True)
class Run:
    """A trained run, or only its exported policy."""

    path: Path
    seed: int | None  # None for an exported policy, which does not know it
    policy: Policy
    config: dict[str, Any] | None  # as resolved by the training script; None for an exported policy
    # Of Python and packages, the commit and the platform, as far as they are known.
    versions: dict[str, Any]
    curve: LearningCurve | None  # None for an exported policy
    robot: Robot | None = None  # to be played on; None for the one that the policy's arguments name
    robots: tuple[str, ...] = ()  # several to be played on, such as those that it learnt with

    @property
    def layer(self) -> str:
        """Action layer with its options, in words, and what learnt through it if not PPO."""
        learnt = "" if self.policy.algorithm == "ppo" else f", {self.policy.algorithm.upper()}"
        return layer_name(self.policy.env_args) + learnt

    @property
    def make_args(self) -> dict[str, Any]:
        """Arguments of the environment, with its robots where these are several."""
        return {**self.policy.env_args, **({"robots": list(self.robots)} if self.robots else {})}

    @property
    def env_args(self) -> dict[str, Any]:
        """Arguments of the environment other than the layer."""
        return {k: v for k, v in self.make_args.items() if k not in LAYER_ARGS}


def load(path: Path, robot: Robot | None = None, robots: Sequence[str] = ()) -> Run:
    """Load a run folder, or an exported policy.

    Args:
        path: the folder, on the disk or packed; a file of a policy; or `shipped:NAME`.
        robot: to be played on instead of that, or those, that it was trained on.
        robots: several instead of one.

    Raises:
        RunError: a file of the run is missing, unreadable or incomplete, or so is the robot.
        PolicyFileError: the policy is, or neither is there.
        UnknownOptionError: no policy of that name is shipped.
    """
    path = place_of(path)
    folder = RunFolder.of(path)
    several = tuple(robots) if robots or robot is not None else learnt_with(path)
    if not folder.config.is_file():
        policy = load_policy(path)
        on = of_policy(path, policy.env_args, robot), several
        return Run(path, None, policy, None, dict(policy.versions), None, *on)
    for file in (folder.versions, folder.evaluations):
        if not file.is_file():
            raise RunError(
                f"{path}: {file.name} is missing: the run has not got that far, or was not "
                "evaluated."
            )
    config = read_json(folder.config)
    for key, kind in (("env_id", str), ("seed", int), ("total_steps", int)):
        if not isinstance(value := config.get(key), kind) or isinstance(value, bool):
            raise RunError(f"{folder.config}: {key} is {value!r}. Expected {kind.__name__}.")
    policy = load_policy(path)
    if policy.env_id != config["env_id"].rpartition(":")[2]:
        raise RunError(
            f"{path}: {folder.config.name} says {config['env_id']}, the policy in it was trained "
            f"in {policy.env_id}."
        )
    curve = _read_curve(folder.evaluations)
    if curve.steps[-1] < config["total_steps"]:
        raise RunError(
            f"{path}: trained for {curve.steps[-1]:.0f} of {config['total_steps']} steps. "
            "Resume it, or leave it out."
        )
    on = of_policy(path, policy.env_args, robot), several
    return Run(path, config["seed"], policy, config, read_json(folder.versions), curve, *on)


def _read_curve(path: Path) -> LearningCurve:
    names = ("steps", "wall_seconds", "return_mean", "return_std", "episodes")
    columns = read_columns(path, names)
    if not columns:
        raise RunError(f"{path}: holds no evaluation, so no curve. Compare its policy.safetensors.")
    return LearningCurve(*columns.values())


def read_columns(path: Path, names: Iterable[str] | None = None) -> dict[str, np.ndarray]:
    """Return evaluations by column, (K,) each: all, or these; empty where there are none.

    Raises:
        RunError: a column that is not there, a value that is no number, or steps that do not
            increase.
    """
    rows, found = read_rows(path), dict[str, np.ndarray]()
    for name in dict.fromkeys(("steps", *(names or rows[0]))) if rows else ():
        if name not in rows[0]:
            raise RunError(f"{path}: column {name!r} is missing.")
        try:
            found[name] = np.array([float(row[name]) for row in rows])
        except (TypeError, ValueError) as error:
            raise RunError(f"{path}: column {name!r} holds more than numbers ({error}).") from error
    if rows and (np.diff(found["steps"]) <= 0).any():
        raise RunError(f"{path}: the steps do not increase from row to row.")
    return found


def layer_name(env_args: Mapping[str, Any]) -> str:
    """Return the action layer in an environment's arguments, with its options, in words."""
    name = str(env_args.get("action_layer", "default layer")).replace("_", " ")
    options = env_args.get("layer_options") or {}
    if not options:
        return name
    described = ", ".join(
        f"{key.replace('_', ' ')}: {value}" for key, value in sorted(options.items())
    )
    return f"{name} ({described})"
