"""Cost of whole action layers on the tasks they are for, relative to the physics they drive."""

import time
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from eval.benchmark.figures import Figure, Limit, Section
from eval.benchmark.physics import TimedBatch
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch

STEPS = 25
"""Policy steps of a round, from a reset."""


class Case(NamedTuple):
    """A layer on an environment."""

    env: str
    layer: str
    limit: Limit | None = None


CASES = (
    Case("fbid_gym/BipedStep-v0", "joint_position_feedforward", Limit(1.0)),
    Case("fbid_gym/BipedStep-v0", "base_acceleration"),
    Case("fbid_gym/QuadrupedCrawl-v0", "joint_position_feedforward"),
    Case("fbid_gym/QuadrupedCrawl-v0", "base_acceleration"),
    Case("fbid_gym/HumanoidBalance-v0", "com_wrench", Limit(1.0)),
    Case("fbid_gym/HumanoidBalance-v0", "base_acceleration"),
)


def on_their_tasks(num_robots: int, rounds: int) -> Section:
    """Time layers, terms and reference included, in closed loop beside the physics."""
    running = {case: _Closed(case, num_robots) for case in CASES}
    ratios = {case: np.empty(rounds) for case in CASES}
    for index in range(-1, rounds):
        for case in CASES[:: -1 if index % 2 else 1]:
            ratio = running[case].round()
            if index >= 0:
                ratios[case][index] = ratio
    figures = tuple(
        Figure.of(
            f"{case.env.rpartition('/')[2]}, `{case.layer}`",
            f"beside {running[case].physics:.1f} µs of physics",
            ratios[case],
            case.limit,
        )
        for case in CASES
    )
    return Section(
        f"Controllers on their tasks (N = {num_robots}, one thread)",
        "CPU time of the layer with the terms it asks for, on zero action and the task's default "
        "pushes, in half a second from a reset. Figure: relative to the physics steps it drives.",
        "x physics",
        figures,
    )


class _Closed:
    """Environments whose layer and physics are timed apart."""

    def __init__(self, case: Case, num_robots: int) -> None:
        config = EnvConfig.of({**ENVIRONMENTS[case.env], "action_layer": case.layer})
        self.batch = EnvBatch(config, num_robots)
        self.timed = TimedBatch.inside(self.batch.simulation)
        self.layer = _TimedLayer(self.batch.layer)
        self.batch.layer = self.layer
        self.action = np.zeros((num_robots, len(self.layer.action_names)))
        self.physics = 0.0

    def round(self) -> float:
        """Step from a reset; return the layer's time relative to the physics'."""
        count = self.batch.num_envs
        for env in range(count):
            self.batch.seed(env, gym.utils.seeding.np_random(env)[0])
        self.batch.reset(np.arange(count))
        self.timed.seconds = self.layer.seconds = 0.0
        for _ in range(STEPS):
            self.batch.step(self.action)
        self.physics = self.timed.seconds / (STEPS * self.batch.rates.ticks * count) * 1e6
        return self.layer.seconds / self.timed.seconds


class _TimedLayer:
    """Stands in for a layer and adds up the CPU seconds of `torque`."""

    def __init__(self, layer: Any) -> None:
        self._layer = layer
        self.seconds = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._layer, name)

    def torque(self, *args: Any) -> np.ndarray:
        start = time.process_time()
        torque = self._layer.torque(*args)
        self.seconds += time.process_time() - start
        return torque
