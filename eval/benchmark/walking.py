"""Cost of all but the physics where robots walk, relative to the physics: what a training pays."""

import time
from typing import NamedTuple

import gymnasium as gym
import numpy as np

from eval.benchmark.environments import zero_action
from eval.benchmark.figures import Figure, Limit, Section
from eval.benchmark.physics import TimedBatch
from fbid_gym.envs.vector_env import RobotVectorEnv

STEPS = 60
"""Policy steps of a round; robots walk on from round to round."""


class Case(NamedTuple):
    """A layer on an environment."""

    env: str
    layer: str
    limit: Limit | None = None


CASES = (
    Case("QuadrupedWalk-v0", "torque"),
    Case("QuadrupedWalk-v0", "joint_position", Limit(0.4)),
    Case("QuadrupedWalk-v0", "base_acceleration", Limit(0.8)),
    Case("QuadrupedWalk-v0", "com_wrench", Limit(1.0)),
    Case("BipedWalk-v0", "base_acceleration", Limit(0.5)),
    Case("HumanoidWalk-v0", "base_acceleration", Limit(0.4)),
)


def beside_physics(num_envs: int, rounds: int) -> Section:
    """Time steps of vector environments on one thread, and the physics in them."""
    running = [_Walking(case, num_envs) for case in CASES]
    ratios = np.array([[walking.round() for walking in running] for _ in range(rounds + 1)])[1:]
    figures = (
        Figure.of(
            f"{case.env}, `{case.layer}`",
            f"beside {walking.physics:.1f} µs of physics",
            values,
            case.limit,
        )
        for case, walking, values in zip(CASES, running, ratios.T, strict=True)
    )
    return Section(
        f"Walking (N = {num_envs}, one thread)",
        "CPU time of `gym.make_vec(...).step` on zero action: gait, layer, observation, reward, "
        "`info`, resets. Figure: all but the physics, relative to it; cost per robot and control "
        "tick.",
        "x physics",
        tuple(figures),
    )


class _Walking:
    """Robots that walk, with their physics timed apart."""

    def __init__(self, case: Case, num_envs: int) -> None:
        name, count = f"fbid_gym/{case.env}", num_envs
        made = gym.make_vec(name, num_envs=count, action_layer=case.layer, num_threads=1).unwrapped
        assert isinstance(made, RobotVectorEnv)
        self.envs, self.action = made, zero_action(made.action_space)
        batches = made.chunks.batches
        self.timed = [TimedBatch.inside(b.simulation, time.thread_time) for b in batches]
        self.ticks = STEPS * batches[0].rates.ticks * num_envs
        self.physics = 0.0
        self.envs.reset(seed=0)

    def round(self) -> float:
        """Step; return the time of all but the physics relative to the physics'."""
        for timed in self.timed:
            timed.seconds = 0.0
        start = time.thread_time()
        for _ in range(STEPS):
            self.envs.step(self.action)
        total, physics = time.thread_time() - start, sum(timed.seconds for timed in self.timed)
        self.physics = physics / self.ticks * 1e6
        return (total - physics) / physics
