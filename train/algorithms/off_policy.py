"""Shared part of SAC and CrossQ, which learn at every step from a replay buffer."""

from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
import torch
from sb3_contrib import CrossQ
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import TrainFreq, TrainFrequencyUnit
from stable_baselines3.common.vec_env import VecNormalize

from fbid_gym.bundles import Tensors
from fbid_gym.errors import InvalidValueError
from train.algorithms.algorithm import (
    Algorithm,
    begin_at_zero,
    expected_return,
    learning_rate,
    linear,
    torch_threads,
)
from train.algorithms.asymmetric import is_for_robots
from train.runs.config import OffPolicyConfig, TrainConfig

Learner = SAC | CrossQ

_METRICS = {
    "policy_loss": "train/actor_loss",
    "value_loss": "train/critic_loss",
    "temperature": "train/ent_coef",
    "temperature_loss": "train/ent_coef_loss",
}
_ONE_STEP = TrainFreq(1, TrainFrequencyUnit.STEP)


def algorithm(make: Callable[..., Learner]) -> Algorithm:
    """Return the algorithm whose learner `make(environment, settings, **arguments)` makes.

    The settings are an `OffPolicyConfig`; the arguments go to stable-baselines3.
    """

    def build(config: TrainConfig, env: VecNormalize) -> Learner:
        return _begin(make(env, _own(config), **_arguments(config, env)), config)

    return Algorithm(
        build=build,
        iterate=_iterate,
        metrics=tuple(_METRICS),
        layers=lambda learner: linear([*learner.actor.latent_pi, learner.actor.mu]),
        output="tanh",
        optimisers=_optimisers,
        arrays=_arrays,
        replay=lambda learner: learner.replay_buffer,
    )


def _own(config: TrainConfig) -> OffPolicyConfig:
    own = config.hyperparameters
    assert isinstance(own, OffPolicyConfig)
    return own


def _arguments(config: TrainConfig, env: VecNormalize) -> dict[str, Any]:
    """Return the arguments of stable-baselines3 that both learners have."""
    own = _own(config)
    if is_for_robots(config):  # its actor would see what only a critic may
        given = config.make_args()["observation"]
        expected = '"full" or "body"; or --algorithm ppo'
        raise InvalidValueError(f"observation for {config.algorithm}", given, expected)
    (actions,) = env.action_space.shape or ()
    return {
        **config.as_they_are,
        "learning_rate": learning_rate(own),
        "ent_coef": f"auto_{own.ent_coef}",
        "target_entropy": own.target_entropy * actions,
        "device": "cpu",
    }


def _begin(learner: Learner, config: TrainConfig) -> Learner:
    """Let a learner begin with the zero action, its noise and the expected return."""
    own = _own(config)
    noise = cast(torch.nn.Linear, learner.actor.log_std)
    begin_at_zero(cast(torch.nn.Linear, learner.actor.mu))
    torch.nn.init.zeros_(noise.weight)
    torch.nn.init.constant_(noise.bias, own.log_std_init)
    for network in learner.critic.q_networks:
        # The slope of a random network would be the first that the policy learns.
        last = cast(torch.nn.Linear, cast(torch.nn.Sequential, network)[-1])
        torch.nn.init.zeros_(last.weight)
        torch.nn.init.constant_(last.bias, expected_return(own))
    if isinstance(learner, SAC):
        learner.critic_target.load_state_dict(learner.critic.state_dict())
    return learner


def _iterate(learner: Learner, config: TrainConfig, callback: BaseCallback) -> dict[str, float]:
    """Act for a step of all robots, learn, and again."""
    own = _own(config)
    assert learner.env is not None and learner.replay_buffer is not None
    found: list[Mapping[str, float]] = []
    for _ in range(own.n_steps):
        # No random actions at the beginning, see `OffPolicyConfig.learning_starts`.
        learner.collect_rollouts(
            learner.env, callback, _ONE_STEP, learner.replay_buffer, learning_starts=0
        )
        if learner.num_timesteps >= own.learning_starts:
            learner.actor.requires_grad_(learner.num_timesteps >= own.policy_starts)
            with torch_threads(config.learning_threads):
                learner.train(own.gradient_steps, own.batch_size)
            found.append(dict(learner.logger.name_to_value))
    told = {name: [its[key] for its in found if key in its] for name, key in _METRICS.items()}
    return {name: float(np.mean(values)) for name, values in told.items() if values}


def _optimisers(learner: Learner) -> dict[str, torch.optim.Optimizer]:
    assert learner.ent_coef_optimizer is not None
    return {
        "actor_optimiser": learner.actor.optimizer,
        "critic_optimiser": learner.critic.optimizer,
        "temperature_optimiser": learner.ent_coef_optimizer,
    }


def _arrays(learner: Learner) -> Tensors:
    assert learner.log_ent_coef is not None
    return {
        "log_temperature": learner.log_ent_coef.detach().numpy(),
        "last_original_obs": np.asarray(learner._last_original_obs),
    }
