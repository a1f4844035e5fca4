"""How good a policy is: whole episodes on an environment of its own."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from stable_baselines3.common.vec_env import VecEnv


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One finished episode per robot."""

    returns: np.ndarray
    """(N,) sum of the rewards."""
    lengths: np.ndarray
    """(N,) policy steps."""
    survived: np.ndarray
    """(N,) bool: the episode ended at its time limit, not before."""

    def summary(self) -> dict[str, float]:
        """Return one row of `evaluations.csv`, without the columns of the training."""
        low, high = np.quantile(self.returns, (0.25, 0.75))
        return {
            "episodes": self.returns.size,
            "return_mean": float(self.returns.mean()),
            "return_std": float(self.returns.std()),
            "return_q25": float(low),
            "return_q75": float(high),
            "length_mean": float(self.lengths.mean()),
            "survival": float(self.survived.mean()),
        }


def evaluate(policy: Callable[[np.ndarray], np.ndarray], env: VecEnv, seed: int) -> Evaluation:
    """Run one episode per robot.

    It is each robot's first after seeding, so short episodes do not count more often than long
    ones. Draws from no generator but the environment's own.

    Args:
        policy: observations (N, O) to actions (N, A).
        env: N robots whose episodes end, at the latest at a time limit.
        seed: robot i starts from seed + i.
    """
    env.seed(seed)
    observation = env.reset()
    count = env.num_envs
    returns, lengths = np.zeros(count), np.zeros(count, dtype=np.int64)
    survived, running = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    while running.any():
        observation, reward, done, infos = env.step(policy(np.asarray(observation)))
        returns[running] += reward[running]
        lengths += running
        for i in np.flatnonzero(done & running):
            survived[i] = infos[i].get("TimeLimit.truncated", False)
        running &= ~done
    return Evaluation(returns, lengths, survived)
