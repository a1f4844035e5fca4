"""stable-baselines3's PPO as this package sets it up, and the policy it exports."""

import random
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from fbid_gym.policy import Policy
from train.runs.config import PPOConfig, TrainConfig

MakeEnv = Callable[..., VecEnv]
"""`fbid_gym.make_sb3`, or what stands in for it: (env_id, num_envs=, seed=, **env_args)."""

_FORESIGHT = 1000
"""Policy steps beyond which nothing is expected."""

_ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU}


def seeds(seed: int) -> dict[str, int]:
    """Derive independent seeds from the one of the run.

    stable-baselines3 would seed robot i with seed + i, so that runs 0 and 1 would share 63 of 64
    robots' pushes. Seeds drawn through a SeedSequence do not overlap.

    Returns:
        "robots" and "learner", integers below 2**31.
    """
    drawn = np.random.SeedSequence(seed).generate_state(2) >> 1
    return {"robots": int(drawn[0]), "learner": int(drawn[1])}


def build(config: TrainConfig, robots: VecEnv) -> PPO:
    """Return the learner, seeded, before its first step.

    Seeds torch, NumPy and Python globally: stable-baselines3 draws from there.
    """
    torch.set_num_threads(config.torch_threads)
    seed = seeds(config.seed)["learner"]
    random.seed(seed)
    np.random.seed(seed)
    torch.manual_seed(seed)
    ppo = config.ppo
    env = VecNormalize(
        robots,
        norm_reward=ppo.normalise_reward,
        clip_obs=ppo.clip_observation,
        gamma=ppo.gamma,
    )
    learner = PPO(
        "MlpPolicy",
        env,
        n_steps=ppo.n_steps,
        batch_size=config.batch_size,
        n_epochs=ppo.n_epochs,
        learning_rate=_learning_rate(ppo),
        gamma=ppo.gamma,
        gae_lambda=ppo.gae_lambda,
        clip_range=ppo.clip_range,
        ent_coef=ppo.ent_coef,
        vf_coef=ppo.vf_coef,
        max_grad_norm=ppo.max_grad_norm,
        target_kl=ppo.target_kl,
        device="cpu",
        policy_kwargs={
            "net_arch": list(ppo.hidden),
            "activation_fn": _ACTIVATIONS[ppo.activation],
            "log_std_init": ppo.log_std_init,
            # eps as stable-baselines3 sets it; one fused step saves a fifth of the update
            "optimizer_kwargs": {"eps": 1e-5, "fused": True},
        },
    )
    _begin(learner, ppo)
    learner.set_logger(Logger(folder=None, output_formats=[]))
    return learner


def _begin(learner: PPO, ppo: PPOConfig) -> None:
    """Let the policy begin with the zero action, and the value network at what that earns."""
    action = cast(torch.nn.Linear, learner.policy.action_net)
    torch.nn.init.zeros_(action.weight)
    torch.nn.init.zeros_(action.bias)
    expected = ppo.expected_reward / max(1.0 - ppo.gamma, 1.0 / _FORESIGHT)
    torch.nn.init.constant_(learner.policy.value_net.bias, expected)


def _learning_rate(ppo: PPOConfig) -> float | Callable[[float], float]:
    """Return the constant rate, or the rate by the share of the training that is left."""
    first, last = ppo.learning_rate, ppo.learning_rate_end
    if last is None:
        return first
    return lambda left: last + (first - last) * max(left, 0.0)


def normaliser(learner: PPO) -> VecNormalize:
    """Return the observation and reward normalisation of a learner made by `build`."""
    env = learner.get_vec_normalize_env()
    assert env is not None
    return env


def moments(learner: PPO) -> tuple[RunningMeanStd, RunningMeanStd]:
    """Return the running statistics of the observations and of the discounted rewards."""
    normalise = normaliser(learner)
    # a dictionary of statistics only for dictionary observations, which ours are not
    return cast(RunningMeanStd, normalise.obs_rms), normalise.ret_rms


def robots(learner: PPO) -> VecEnv:
    """Return the environment below the normalisation."""
    return normaliser(learner).venv


def export(learner: PPO, config: TrainConfig, versions: dict[str, Any]) -> Policy:
    """Return the deterministic part of the learner as it is now."""
    normalise = normaliser(learner)
    network = learner.policy
    modules = [*network.mlp_extractor.policy_net, network.action_net]
    layers = [module for module in modules if isinstance(module, torch.nn.Linear)]
    observation, _ = moments(learner)
    return Policy(
        env_id=config.env.rpartition(":")[2],  # a policy says where, not what to import for it
        env_args=config.make_args(),
        mean=observation.mean,
        variance=observation.var,
        weights=tuple(layer.weight.detach().numpy() for layer in layers),
        biases=tuple(layer.bias.detach().numpy() for layer in layers),
        activation=config.ppo.activation,
        clip=normalise.clip_obs,
        epsilon=normalise.epsilon,
        trained_steps=learner.num_timesteps,
        versions=versions,
        source=str(config.folder),
    )
