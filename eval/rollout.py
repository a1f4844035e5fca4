r"""Play a policy, or the zero action, for many episodes and print what the robot did.

python -m eval.rollout runs/my_run --episodes 50 --video out.mp4
python -m eval.rollout --env fbid_gym/BipedBalance-v0 --action-layer base_acceleration \
    --zero-action --episodes 100 --env-args '{"push_force": [100, 100]}'
python -m eval.rollout --env fbid_gym/QuadrupedWalk-v0 --action-layer base_acceleration \
    --policy proportional:24
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from eval.comparable import changed
from eval.video import Clip, record
from fbid_gym.bundles import SUFFIX
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.envs.fitting import check_fits
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number, Whole
from fbid_gym.policy import Policy, place_of
from fbid_gym.robots import Robot
from train.command import run_command
from train.environments import make_env, make_envs, parse_env_args, register, step_seconds
from train.episodes import METRICS, Actor, Episodes, play
from train.progress import progress
from train.runs.environment import load_policy
from train.runs.files import check_output, to_json, write
from train.runs.proportional import LAW, ZERO, gain_of, proportional
from train.runs.reading import Run, load
from train.runs.robots import chosen, learnt_with, named, of_policy
from train.runs.study import Cell
from train.runs.tables import to_csv


@dataclass(frozen=True)
class Player:
    """A policy and its environment."""

    name: str  # for tables and captions
    env_id: str  # Gymnasium id
    env_args: dict[str, Any]  # keyword arguments of the environment, the action layer among them
    policy: Policy | None  # None: the zero action, which asks the layer to hold the home posture
    robot: Robot | None = None  # None: the one that the arguments name

    @classmethod
    def of(cls, run: Run, *, trained: bool = True, **env_args: Any) -> "Player":
        """Return the player of a run, or of the zero action in its environment.

        Further arguments replace those that the policy was trained with.
        """
        policy = run.policy
        arguments = {**run.make_args, **env_args}
        return cls(run.layer, policy.env_id, arguments, policy if trained else None, run.robot)

    @classmethod
    def unlearnt(
        cls, policy: str, env_id: str, env_args: Mapping[str, Any], robot: Robot | None = None
    ) -> "Player":
        """Return the player of a policy that learns nothing: "zero", or `proportional:GAIN`.

        The robot replaces the one that the environment's arguments name.

        Raises:
            FbidError: no such policy, or one that cannot act there.
        """
        arguments = dict(env_args) if robot is None else {**env_args, "robot": named(robot)}
        player = cls("zero action", env_id, arguments, None, robot)
        if policy == ZERO:
            return player
        return lawful(player, gain_of(policy))

    @classmethod
    def of_cell(cls, cell: Cell, robot: Robot | None = None, **env_args: Any) -> "Player":
        """Return the player of a cell of a study; other arguments replace those of its arm."""
        run = cell.config
        if not cell.policy:
            return cls.of(load(run.folder, robot), **env_args)
        robot = robot or chosen(run.robot, run.feet)
        return cls.unlearnt(cell.policy, run.env, {**run.make_args(), **env_args}, robot)

    @property
    def make_args(self) -> dict[str, Any]:
        """Arguments of the environment, with the robot itself."""
        return self.env_args if self.robot is None else {**self.env_args, "robot": self.robot}

    def actor(self, observations: gym.Space[Any], actions: gym.Space[Any]) -> Actor:
        """Map observations (N, O) to actions (N, A); PolicyFileError where that does not fit."""
        boxes = [space for space in (observations, actions) if isinstance(space, gym.spaces.Box)]
        if [len(space.shape) for space in boxes] != [1, 1]:
            expected = "an environment whose observations and actions are boxes of one axis"
            raise InvalidValueError("env", self.env_id, expected)
        (observation_size,), (action_size,) = (space.shape for space in boxes)
        if self.policy is None:
            return lambda observation: np.zeros((len(observation), action_size), dtype=np.float32)
        if self.robot is None:
            self.policy.check(observation_size=observation_size, action_size=action_size)
        else:
            check_fits(self.policy, self.robot, observation_size, action_size)
        return self.policy


def play_player(
    player: Player,
    episodes: int,
    seed: int,
    num_envs: int | None = None,
    on_episode: Any = lambda finished: None,
) -> Episodes:
    """Play whole episodes of a player in its own environment, the i-th of which has seed + i.

    By default there are as many environments as episodes, up to 128, so that episode i always
    starts from seed + i. `on_episode` is called with the number of finished episodes.

    Raises:
        PolicyFileError: the policy does not fit its environment.
    """
    if episodes < 1:
        raise InvalidValueError("episodes", episodes, "a positive number")
    if num_envs is not None and num_envs < 1:
        raise InvalidValueError("num_envs", num_envs, "a positive number")
    robots = len(player.make_args.get("robots") or [None])
    if episodes < robots:
        raise InvalidValueError("episodes", episodes, f"at least the {robots} robots that act")
    envs = make_envs(player.env_id, player.make_args, min(episodes, num_envs or 128))
    try:
        actor = player.actor(envs.single_observation_space, envs.single_action_space)
        return play(envs, actor, episodes, seed, step_seconds(envs), on_episode)
    finally:
        envs.close()


def filmed(player: Player, seed: int, seconds: float, title: str, fps: float = 25.0) -> Clip:
    """Record the first episode of a player; see `eval.video.record`."""
    env = make_env(player.env_id, player.make_args)
    try:
        actor = player.actor(env.observation_space, env.action_space)
        return record(env, actor, seed, seconds, title, fps)
    finally:
        env.close()


def load_player(source: Path, env_args: Mapping[str, Any], robot: Robot | None = None) -> Player:
    """Load a run folder, the file of a policy, or `shipped:NAME`.

    Arguments and robot, or `robots` among the arguments, replace those that it was trained with.
    """
    source = place_of(source)
    policy = load_policy(source)
    if robot is not None and "robots" in env_args:
        raise InvalidValueError("robots in --env-args", env_args["robots"], "none beside a robot")
    if robot is None and (on := learnt_with(source)):
        env_args = {"robots": list(on), **env_args}
    robot = of_policy(source, policy.env_args, robot)
    name = source.name.removesuffix(SUFFIX)
    player = Player(name, policy.env_id, {**policy.env_args, **env_args}, policy, robot)
    if policy.algorithm != LAW or (robot is None and not env_args):
        return player
    return lawful(player, gain_of(policy.source))


def lawful(player: Player, gain: float) -> Player:
    """Return the player of the proportional law where another plays, for its robot."""
    law = proportional(player.env_id, player.make_args, gain)
    return replace(player, name=law.source, policy=replace(law, env_args=player.env_args))


@dataclass(frozen=True)
class RolloutConfig:
    """Play a policy, or the zero action, for many episodes and print what the robot did."""

    source: Annotated[Path | None, tyro.conf.Positional] = None
    """Run folder, exported policy, `shipped:NAME`, or `proportional:GAIN/ENVIRONMENT/LAYER`."""
    env: str | None = None
    """Environment id, with --zero-action or --policy."""
    action_layer: str | None = None
    """Action layer, with --zero-action or --policy."""
    policy: str | None = None
    """Without learning: "zero", or `proportional:GAIN`, which asks the body for GAIN (1/s) times
    what its horizontal velocity is short of the command, through the action layer."""
    robot: str | None = None
    """Instead of the environment's or the policy's: a built-in robot, or your own: an MJCF, a URDF,
    a robot.toml or a robot.zip."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    robots: tuple[str, ...] = ()
    """Instead of one, with as many episodes of each: built-in ones, files, "zoo:quadruped:0-15"."""
    zero_action: bool = False
    """Play the zero action instead of a policy."""
    register: tuple[str, ...] = ()
    """Modules to import first, which register environments of yours."""
    env_args: str = "{}"
    """Further environment arguments as a JSON object; they replace those of the run."""
    episodes: Annotated[int, Whole(1, 1_000_000)] = 50
    """How many episodes, each played to its end."""
    num_envs: Annotated[int, NUM_ENVS] | None = None
    """How many at a time. Default: all, up to 128."""
    seed: Annotated[int, Whole(0, 2**63)] = 0
    """Environment i starts from seed + i."""
    out: Path | None = None
    """Write the metrics: .json (summary and episodes) or .csv (one row per episode)."""
    video: Path | None = None
    """Write the first episode as an .mp4."""
    video_seconds: Annotated[float, Number(0.01, 600.0, "s")] = 10.0
    """Longest video, s."""


def player_of(config: RolloutConfig) -> Player:
    """Decide who plays; InvalidValueError if the command line says too much or too little."""
    env_args = parse_env_args(config.env_args)
    name = env_args.pop("robot", config.robot)
    if not isinstance(name, str | None) or config.robot not in (None, name):
        raise InvalidValueError("robot in --env-args", name, "none; name it by --robot")
    if "robots" in env_args:
        raise InvalidValueError("robots in --env-args", env_args["robots"], "none; see --robots")
    env_args |= {"robots": list(config.robots)} if config.robots else {}
    robot = chosen(name, config.feet, config.robots)
    if config.source is not None and (config.env, config.action_layer) != (None, None):
        raise InvalidValueError(
            "--env and --action-layer",
            (config.env, config.action_layer),
            "neither beside a policy, which brings its own",
        )
    if config.policy is not None and (config.zero_action or config.source is not None):
        raise InvalidValueError("--policy", config.policy, "none beside another policy")
    policy = ZERO if config.zero_action else config.policy
    if policy is None:
        if config.source is None:
            raise InvalidValueError("source", None, "a run folder or policy, or --zero-action")
        return load_player(config.source, env_args, robot)
    if config.source is not None:
        trained = load_player(config.source, env_args, robot)
        return replace(trained, name=f"{trained.name}, zero action", policy=None)
    if config.env is None:
        expected = "an environment id, with --zero-action or --policy"
        raise InvalidValueError("--env", None, expected)
    if config.action_layer is not None:
        env_args["action_layer"] = config.action_layer
    return Player.unlearnt(policy, config.env, env_args, robot)


def table(player: Player, episodes: Episodes) -> Table:
    """Mean and spread of every metric over the episodes."""
    title = f"{player.name} in {player.env_id}, {len(episodes)} episodes"
    result = Table(title=escape(title), title_justify="left")
    result.add_column("metric")
    for heading in ("mean", "standard deviation", "worst 1 in 20"):
        result.add_column(heading, justify="right")
    result.add_column("unit")
    for metric in METRICS:
        values = getattr(episodes, metric.name)
        if np.isnan(values).any():
            continue
        worst = metric.better * np.quantile(metric.better * values, 0.05)
        tail = f"{worst:.4g}" if metric.better else ""
        result.add_row(
            metric.label, f"{values.mean():.4g}", f"{values.std():.4g}", tail, metric.unit
        )
    for reason in sorted(set(episodes.termination) - {""}):
        count = episodes.termination.count(reason)
        result.add_row(escape(f"ended by {reason}"), str(count), "", "", "episodes")
    return result


def metrics_json(player: Player, episodes: Episodes, seed: int) -> str:
    """Write everything the table shows, and each episode, as JSON."""
    return to_json(
        {
            "name": player.name,
            "env_id": player.env_id,
            "env_args": player.env_args,
            "zero_action": player.policy is None,
            "seed": seed,
            "summary": {
                metric.name: {
                    "mean": float(np.mean(getattr(episodes, metric.name))),
                    "std": float(np.std(getattr(episodes, metric.name))),
                    "unit": metric.unit,
                }
                for metric in METRICS
            },
            "episodes": episodes.rows(),
        }
    )


def run(config: RolloutConfig) -> None:
    """Do what the command line asks."""
    console = Console()
    register(config.register)
    check_output(config.out, "out", (".json", ".csv"))
    check_output(config.video, "video", (".mp4",))
    player = player_of(config)
    path = None if config.source is None else place_of(config.source)
    for warning in changed(path, player.env_args, player.robot) if path is not None else ():
        console.print(warning, style="yellow", markup=False, highlight=False, soft_wrap=True)
    with progress(console, "episodes") as tell:
        episodes = play_player(
            player,
            config.episodes,
            config.seed,
            config.num_envs,
            lambda finished: tell(finished, config.episodes, ""),
        )
    console.print(table(player, episodes))
    if config.out is not None:
        rows, as_csv = episodes.rows(), config.out.suffix.lower() == ".csv"
        text = to_csv([*rows[0]], rows) if as_csv else metrics_json(player, episodes, config.seed)
        write(config.out, text)
        console.print(f"wrote {config.out}", markup=False, highlight=False)
    if config.video is not None:
        clip = filmed(player, config.seed, config.video_seconds, player.name, fps=50.0)
        write(config.video, clip.mp4())
        console.print(f"wrote {config.video}", markup=False, highlight=False)


main = partial(run_command, "eval.rollout", RolloutConfig, run, about=__doc__)


if __name__ == "__main__":
    sys.exit(main())
