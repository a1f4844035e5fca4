"""Evaluate a policy during its training: one whole episode of each robot."""

import numpy as np
from gymnasium.vector import VectorEnv

from train.environments import step_seconds
from train.episodes import Actor, Episodes, play

_OF_EPISODES = ("velocity_error", "turning_error", "slip", "cost_of_transport")


def evaluate(actor: Actor, envs: VectorEnv, seed: int) -> dict[str, float]:
    """Play the first episode of every robot after seeding, and summarise them.

    Draws from no generator but the environments' own.

    Args:
        actor: the policy.
        envs: robots whose episodes end, at the latest at a time limit.
        seed: robot i starts from seed + i.
    """
    return summary(play(envs, actor, envs.num_envs, seed, step_seconds(envs)))


def summary(episodes: Episodes) -> dict[str, float]:
    """Return one row of `evaluations.csv`, without the columns of the training.

    What the environments do not tell, such as the velocity error where no velocity is commanded, is
    NaN.
    """
    low, high = np.quantile(episodes.returned, (0.25, 0.75))
    return {
        "episodes": len(episodes),
        "return_mean": float(episodes.returned.mean()),
        "return_std": float(episodes.returned.std()),
        "return_q25": float(low),
        "return_q75": float(high),
        "length_mean": float(episodes.length.mean()),
        "survival": float(episodes.survived.mean()),
        **{name: float(getattr(episodes, name).mean()) for name in _OF_EPISODES},
    }
