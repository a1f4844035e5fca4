"""SAC, of stable-baselines3."""

from typing import Any

from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecNormalize

from train.algorithms.algorithm import ACTIVATIONS
from train.algorithms.off_policy import algorithm
from train.runs.config import OffPolicyConfig


def _make(env: VecNormalize, own: OffPolicyConfig, **arguments: Any) -> SAC:
    network = {"net_arch": list(own.hidden), "activation_fn": ACTIVATIONS[own.activation]}
    optimiser = {"optimizer_kwargs": {"fused": True}}
    return SAC("MlpPolicy", env, **arguments, policy_kwargs={**network, **optimiser})


ALGORITHM = algorithm(_make)
