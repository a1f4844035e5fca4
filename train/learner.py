"""A learner of stable-baselines3 as this package sets it up, and the policy it exports."""

import random
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch.nn.utils.parametrize import is_parametrized

from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy, place_of
from train.algorithms import ALGORITHMS
from train.runs.config import TrainConfig
from train.runs.environment import load_policy

_ALIKE = "action_layer", "layer_options", "observation"  # they say what a policy's numbers mean

MakeEnv = Callable[..., VecEnv]
"""`fbid_gym.make_sb3`, or a stand-in: (env_id, num_envs=, seed=, stagger=, **env_args)."""


def seeds(seed: int) -> dict[str, int]:
    """Derive independent seeds from the one of the run.

    stable-baselines3 would seed robot i with seed + i, so that runs 0 and 1 would share 63 of 64
    robots' pushes. Seeds drawn through a SeedSequence do not overlap.

    Returns:
        "robots" and "learner", integers below 2**31.
    """
    drawn = np.random.SeedSequence(seed).generate_state(2) >> 1
    return {"robots": int(drawn[0]), "learner": int(drawn[1])}


def build(config: TrainConfig, robots: VecEnv) -> BaseAlgorithm:
    """Return the learner, seeded, before its first step.

    Seeds torch, NumPy and Python globally: stable-baselines3 draws from there.
    """
    torch.set_num_threads(1)  # while robots are stepped, their threads take the cores
    seed = seeds(config.seed)["learner"]
    random.seed(seed)
    np.random.seed(seed)
    torch.manual_seed(seed)
    own = config.hyperparameters
    env = VecNormalize(
        robots, norm_reward=own.normalise_reward, clip_obs=own.clip_observation, gamma=own.gamma
    )
    learner: BaseAlgorithm = ALGORITHMS[config.algorithm].build(config, env)
    learner.set_logger(Logger(folder=None, output_formats=[]))
    if config.start is not None:
        _begin_with(learner, config, load_policy(place_of(config.start)))
    return learner


def _begin_with(learner: BaseAlgorithm, config: TrainConfig, policy: Policy) -> None:
    """Let a learner begin with a policy, and with its scaling of the observations.

    SAC squashes what PPO cuts off: from one to the other, large actions are not the same.
    """
    layers = ALGORITHMS[config.algorithm].layers(learner)
    args, own = config.make_args(), config.hyperparameters
    for name, its, expected in (
        ("weights", [w.shape for w in policy.weights], [tuple(x.weight.shape) for x in layers]),
        ("activation", policy.activation, own.activation),
        ("clip", policy.clip, own.clip_observation),
        *((name, policy.env_args.get(name), args.get(name)) for name in _ALIKE),
    ):
        if its != expected:
            said = f"a policy with {name} {expected}; it has {its}"
            raise InvalidValueError("start", config.start, said)
    with torch.no_grad():
        for layer, *numbers in zip(layers, policy.weights, policy.biases, strict=True):
            for name, its in zip(("weight", "bias"), map(torch.tensor, numbers), strict=True):
                symmetric = is_parametrized(layer, name)
                place = f"parametrizations.{name}.original" if symmetric else name
                layer.get_parameter(place).copy_(its)
                if not torch.allclose(getattr(layer, name), its, atol=1e-6):
                    expected = "a symmetric policy, with ppo.symmetric"
                    raise InvalidValueError("start", config.start, expected)
    observation, _ = moments(learner)
    seen = policy.observation_size  # what follows is the critic's
    observation.mean[:seen], observation.var[:seen] = policy.mean, policy.variance
    observation.count = float(max(policy.trained_steps, 1))


def normaliser(learner: BaseAlgorithm) -> VecNormalize:
    """Return the observation and reward normalisation of a learner made by `build`."""
    env = learner.get_vec_normalize_env()
    assert env is not None
    return env


def moments(learner: BaseAlgorithm) -> tuple[RunningMeanStd, RunningMeanStd]:
    """Return the running statistics of the observations and of the discounted rewards."""
    normalise = normaliser(learner)
    # a dictionary of statistics only for dictionary observations, which ours are not
    return cast(RunningMeanStd, normalise.obs_rms), normalise.ret_rms


def robots(learner: BaseAlgorithm) -> VecEnv:
    """Return the environment below the normalisation."""
    return normaliser(learner).venv


def export(learner: BaseAlgorithm, config: TrainConfig, versions: dict[str, Any]) -> Policy:
    """Return the deterministic part of the learner as it is now."""
    normalise = normaliser(learner)
    algorithm = ALGORITHMS[config.algorithm]
    layers = algorithm.layers(learner)
    observation, _ = moments(learner)
    seen = layers[0].in_features  # what follows is the critic's
    return Policy(
        env_id=config.env.rpartition(":")[2],  # a policy names no module to import
        # It acts in an environment of one robot, whatever it was trained on.
        env_args={n: value for n, value in config.make_args().items() if n != "robots"},
        mean=observation.mean[:seen],
        variance=observation.var[:seen],
        weights=tuple(layer.weight.detach().numpy() for layer in layers),
        biases=tuple(layer.bias.detach().numpy() for layer in layers),
        activation=config.hyperparameters.activation,
        output=algorithm.output,
        clip=normalise.clip_obs,
        epsilon=normalise.epsilon,
        algorithm=config.algorithm,
        trained_steps=learner.num_timesteps,
        versions=versions,
        source=str(config.folder),
    )
