"""A training, whatever learns: `train.ppo` and `train.sac` are its command lines.

Started again with the same options it continues where it was, killed or not, and the numbers are
those of a training that was never interrupted.
"""

import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from rich.console import Console
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from fbid_gym import make_sb3
from fbid_gym.errors import RunError
from fbid_gym.exit_status import exit_status
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot
from train import checkpoint, replay
from train.algorithms import ALGORITHMS
from train.environments import make_envs
from train.evaluation import evaluate
from train.learner import MakeEnv, build, export, seeds
from train.progress import progress, say
from train.runs.command_line import parse
from train.runs.config import TrainConfig
from train.runs.files import check_folder
from train.runs.folder import RunFolder
from train.runs.interrupt import stop_requests
from train.runs.opening import OpenRun, continued, open_run
from train.runs.robots import check_trainable, chosen, is_built_in, with_robot, with_robots
from train.runs.tables import EVALUATIONS, PROGRESS, TableWriter, check_kept
from train.runs.versions import package_versions
from train.tensorboard import TensorBoardLog
from train.tracking import TrackedLog


def main(config: TrainConfig, make_env: MakeEnv = make_sb3) -> Path:
    """Train, or continue training, and return the run folder.

    Args:
        config: the run.
        make_env: makes the robots that it learns from.

    Raises:
        FbidError: an invalid configuration, or a run folder that does not fit it. Nothing of the
            run is written then. Or a full disk: the last checkpoint stands.
        KeyboardInterrupt: after SIGINT or SIGTERM, once the state is saved.
    """
    check_folder(config.folder.parent, "out", str(config.folder))
    with _room_for(config.folder), ExitStack() as stack:
        config = with_robots(continued(config))
        args = {**config.make_args(), "num_threads": config.threads}
        if (robot := chosen(config.robot, config.feet)) is not None:
            args["robot"] = robot
        seed = seeds(config.seed)["robots"]
        robots = stack.enter_context(
            closing(
                make_env(
                    config.env, num_envs=config.num_envs, seed=seed, stagger=config.stagger, **args
                )
            )
        )
        # Whoever makes the environments may have brought a robot, too.
        brought = () if robot is None else (robot,)
        trained_on: tuple[Robot, ...] = getattr(robots, "robots", brought)
        check_trainable([robot.name for robot in trained_on])
        if len(trained_on) == 1:
            robot = trained_on[0].as_loaded
        own = None if robot is None or is_built_in(robot) else robot
        if robot is not None and (own is not None or config.robot is not None):
            args["robot"] = robot
            config = with_robot(config, robot)
        evaluated = None
        if config.eval.every:
            evaluated = stack.enter_context(
                closing(make_envs(config.env, args, config.eval.episodes))
            )
        learner = build(config, robots)
        run = stack.enter_context(open_run(config, own))
        training = _Training(config, run, learner, evaluated, stack)
        with stop_requests(training.announce_stop) as stop:
            training.until_done(stop)
    return config.folder


@contextmanager
def _room_for(path: Path) -> Iterator[None]:
    """Report in one line that a run could not be written, as on a full disk, and what is left."""
    try:
        yield
    except BrokenPipeError:  # of who listens, not of the folder
        raise
    except OSError as error:
        kept = RunFolder.to_write(path).checkpoint.exists()
        raise RunError(
            f"{path}: cannot be written ({error.strerror or error}). "
            f"{'Its last checkpoint stands' if kept else 'It has no checkpoint yet'}; the same "
            "command continues it once that is mended."
        ) from error


class _Training:
    """A run in progress: the learner and everything that is written about it."""

    def __init__(
        self,
        config: TrainConfig,
        run: OpenRun,
        learner: BaseAlgorithm,
        evaluated: VectorEnv | None,
        stack: ExitStack,
    ) -> None:
        self.config, self.run, self.learner, self.evaluated = config, run, learner, evaluated
        self.folder = folder = run.folder
        self.algorithm = ALGORITHMS[config.algorithm]
        columns = {"progress": (*PROGRESS, *self.algorithm.metrics), "evaluations": EVALUATIONS}
        # Resets the robots and prepares the buffers; a checkpoint then replaces their state.
        _, self.callback = learner._setup_learn(config.total_steps, self._count_falls)
        assert isinstance(self.callback, BaseCallback)
        self.seconds, self.best_return, self.falls = 0.0, -math.inf, 0
        tables = {"progress": folder.progress, "evaluations": folder.evaluations}
        sizes: dict[str, int] = {}
        self.replay_files: list[replay.File] = []
        if run.resumes:
            counters = checkpoint.restore(folder.checkpoint, config.algorithm, learner)
            self.seconds, self.falls = counters["wall_seconds"], counters["falls"]
            if counters["best_return"] is not None:
                self.best_return = counters["best_return"]
            sizes = counters["bytes"]
            for name, path in tables.items():
                check_kept(path, columns[name], sizes[name])
            if (buffer := self.algorithm.replay(learner)) is not None:
                self.replay_files = counters.get("replay", [])
                replay.restore(folder.replay, buffer, self.rows, self.replay_files)
        opened = stack.enter_context
        tracked: list[TensorBoardLog | TrackedLog] = []
        if config.track:
            log = TrackedLog(folder.path.resolve().name, config.to_json())
            tracked.append(opened(closing(log)))
        # All that can be refused has been.
        run.begin()
        self.saved_steps = self.steps if run.resumes else -1
        self.progress, self.evaluations = (
            opened(closing(TableWriter(path, columns[name], sizes.get(name))))
            for name, path in tables.items()
        )
        self.curves = [opened(closing(TensorBoardLog(folder.tensorboard, self.steps))), *tracked]
        self.console = Console(stderr=sys.stderr.isatty())
        self.tell = opened(progress(self.console, folder.path.name, every=2.0, start=self.steps))
        self.tell(self.steps, config.total_steps, "")

    @property
    def steps(self) -> int:
        return self.learner.num_timesteps

    @property
    def rows(self) -> int:
        """Steps of all robots."""
        return self.steps // self.config.num_envs

    @property
    def done(self) -> bool:
        return self.steps >= self.config.total_steps

    def until_done(self, stop: Callable[[], bool]) -> None:
        config = self.config
        if self.run.resumes:
            self.note(
                f"already trained for {self.steps} steps"
                if self.done
                else f"continues at step {self.steps}"
            )
            if self.run.changes and not self.done:
                self.note(f"not to the bit: {', '.join(self.run.changes)}")
        elif config.eval.every:
            self.evaluate()
        while not self.done and not stop():
            self.iterate()
            if config.eval.every and (self.done or self._crossed(config.eval.every)):
                self.evaluate()
            if config.checkpoint_every and self._crossed(config.checkpoint_every):
                self.checkpoint()
        if self.saved_steps != self.steps:
            self.checkpoint()
        if not self.done:
            self.note(
                f"stopped at step {self.steps} of {config.total_steps}, saved in "
                f"{self.folder.path}. The same command continues it."
            )
            raise KeyboardInterrupt

    def iterate(self) -> None:
        """One iteration: act, learn, log."""
        learner, began = self.learner, time.perf_counter()
        try:
            metrics = self.algorithm.iterate(learner, self.config, self.callback)
        except ValueError as error:
            # torch's distributions refuse the NaN of a diverged network, at length
            if self._finite():
                raise
            raise self._diverged() from error
        if not self._finite():
            raise self._diverged()
        # Evaluations and saving do not count: how often they happen is not the learner's doing.
        seconds = time.perf_counter() - began
        self.seconds += seconds
        learner.logger.dump(self.steps)
        episodes = list(learner.ep_info_buffer or ())
        row = {
            "steps": self.steps,
            "wall_seconds": round(self.seconds, 3),
            "fps": round(self.config.iteration_steps / seconds, 1),
            "falls": self.falls,
            "return_mean": _mean([float(e["r"]) for e in episodes]),
            "length_mean": _mean([float(e["l"]) for e in episodes]),
            **{name: float(metrics.get(name, math.nan)) for name in self.algorithm.metrics},
        }
        self.progress.append(row)
        for curve in self.curves:
            curve.append("train", row)
        told = f"{_episodes(row)}, {row['fps']:.0f} steps/s"
        self.tell(self.steps, self.config.total_steps, told)

    def _count_falls(self, told: dict[str, Any], rest: dict[str, Any]) -> bool:
        """Count the episodes that end by themselves; called after each step of all robots."""
        ended = np.flatnonzero(told["dones"])
        self.falls += sum(not told["infos"][robot].get("TimeLimit.truncated") for robot in ended)
        return True

    def evaluate(self) -> None:
        """Evaluate the exported policy, not the learner, so that the stored policy is measured."""
        assert self.evaluated is not None
        policy = self.export_policy()
        result = evaluate(policy, self.evaluated, self.config.eval.seed)
        row = {"steps": self.steps, "wall_seconds": round(self.seconds, 3), **result}
        # Write the policy before its row, so that readers of the last row find it.
        if row["return_mean"] > self.best_return:
            self.best_return = row["return_mean"]
            policy.save(self.folder.best_policy)
        self.evaluations.append(row)
        for curve in self.curves:
            curve.append("eval", row)
        self.note(
            f"step {self.steps}: evaluation return {row['return_mean']:.1f} "
            f"± {row['return_std']:.1f}, survival {row['survival']:.0%}"
        )

    def export_policy(self) -> Policy:
        """Write the policy as it is now, and return it."""
        policy = export(self.learner, self.config, package_versions())
        policy.save(self.folder.policy)
        return policy

    def checkpoint(self) -> None:
        """Save the state and its policy, after the rows that the state says are on the disk."""
        self.export_policy()
        for log in (self.progress, self.evaluations, *self.curves):
            log.sync()
        buffer = self.algorithm.replay(self.learner)
        if buffer is not None:
            self.replay_files = replay.append(
                self.folder.replay, buffer, self.rows, self.replay_files
            )
        checkpoint.save(
            self.folder.checkpoint,
            self.config.algorithm,
            self.learner,
            {
                "wall_seconds": self.seconds,
                "falls": self.falls,
                "best_return": self.best_return if math.isfinite(self.best_return) else None,
                "bytes": {"progress": self.progress.size, "evaluations": self.evaluations.size},
                "replay": self.replay_files,
            },
        )
        if buffer is not None:
            replay.forget(self.folder.replay, self.replay_files)
        self.saved_steps = self.steps

    def note(self, text: str) -> None:
        say(self.console, f"{self.folder.path.name}: {text}")

    def announce_stop(self) -> None:
        self.note("stops after this iteration; once more to stop at once")

    def _finite(self) -> bool:
        return all(bool(p.isfinite().all()) for p in self.learner.policy.parameters())

    def _diverged(self) -> RunError:
        kept = (
            f"The checkpoint of step {self.saved_steps} is kept"
            if self.saved_steps > 0
            else "There is no checkpoint yet"
        )
        return RunError(
            f"{self.folder.path}: training diverged by step {self.steps}: the network holds NaN or "
            f"infinity. {kept}; try a smaller --{self.config.algorithm}.learning-rate in another "
            "--out."
        )

    def _crossed(self, every: int) -> bool:
        """Whether the last iteration passed a multiple of `every`."""
        return self.steps // every > (self.steps - self.config.iteration_steps) // every


def _episodes(row: Mapping[str, float]) -> str:
    """Describe the last episodes; where robots do not fall, the first end late."""
    if math.isnan(row["return_mean"]):
        return "no episode over yet"
    return f"return {row['return_mean']:.1f}, length {row['length_mean']:.0f}"


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else math.nan


def command_line(algorithm: str) -> int:
    """Run `main` on the command line of an algorithm and return the exit status."""
    return exit_status(lambda: print(main(parse(algorithm=algorithm))))
