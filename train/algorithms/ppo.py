"""PPO: learns from the latest rollouts, then discards them."""

from typing import cast

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from fbid_gym.runtime.observer import POLICY
from train.algorithms.algorithm import (
    ACTIVATIONS,
    Algorithm,
    begin_at_zero,
    expected_return,
    learning_rate,
    linear,
    torch_threads,
)
from train.algorithms.asymmetric import AsymmetricPolicy, is_for_robots
from train.algorithms.symmetric import BothSides, make_symmetric, mirror_of_environments
from train.runs.config import PPOConfig, TrainConfig

_METRICS = {
    "policy_loss": "train/policy_gradient_loss",
    "value_loss": "train/value_loss",
    "entropy_loss": "train/entropy_loss",
    "approx_kl": "train/approx_kl",
    "clip_fraction": "train/clip_fraction",
    "explained_variance": "train/explained_variance",
    "action_std": "train/std",
}


def _build(config: TrainConfig, env: VecNormalize) -> PPO:
    own = config.hyperparameters
    assert isinstance(own, PPOConfig)
    for_actor = _entries_of_actor(config, env)
    learner = PPO(
        AsymmetricPolicy if for_actor else "MlpPolicy",
        env,
        **config.as_they_are,
        batch_size=config.batch_size,
        learning_rate=learning_rate(own),
        device="cpu",
        policy_kwargs={
            "net_arch": list(own.hidden),
            "activation_fn": ACTIVATIONS[own.activation],
            "log_std_init": own.log_std_init,
            # eps as stable-baselines3 sets it; one fused step saves a fifth of the update
            "optimizer_kwargs": {"eps": 1e-5, "fused": True},
            **for_actor,
        },
    )
    begin_at_zero(cast(torch.nn.Linear, learner.policy.action_net))
    torch.nn.init.constant_(learner.policy.value_net.bias, expected_return(own))
    if own.symmetric:
        mirror = mirror_of_environments(env)
        width = int(np.prod(env.observation_space.shape or ()))
        env.obs_rms = BothSides(width, mirror.observation)  # type: ignore[assignment]
        make_symmetric(learner.policy, mirror)
    return learner


def _entries_of_actor(config: TrainConfig, env: VecNormalize) -> dict[str, int]:
    """Return how many entries the actor sees, where the critic sees others; else nothing."""
    if not is_for_robots(config):
        return {}
    (chunks, *_) = env.venv.get_attr("chunks")
    return {"split": chunks.batches[0].observation_columns[POLICY].stop}


def _iterate(learner: PPO, config: TrainConfig, callback: BaseCallback) -> dict[str, float]:
    """Roll out, then update."""
    assert learner.env is not None
    learner.collect_rollouts(learner.env, callback, learner.rollout_buffer, learner.n_steps)
    learner._update_current_progress_remaining(learner.num_timesteps, config.total_steps)
    with torch_threads(config.learning_threads):
        learner.train()
    return {name: learner.logger.name_to_value[key] for name, key in _METRICS.items()}


ALGORITHM = Algorithm(
    build=_build,
    iterate=_iterate,
    metrics=tuple(_METRICS),
    layers=lambda learner: linear(
        [*learner.policy.mlp_extractor.policy_net, learner.policy.action_net]
    ),
    output="clip",
    optimisers=lambda learner: {"optimiser": learner.policy.optimizer},
    arrays=lambda learner: {},
    replay=lambda learner: None,
)
