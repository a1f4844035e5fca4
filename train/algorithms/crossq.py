"""CrossQ, of sb3-contrib: SAC with normalised batches in place of slow copies.

Bhatt et al. 2024, "CrossQ: Batch Normalization in Deep Reinforcement Learning for Greater Sample
Efficiency and Simplicity", ICLR.
"""

from typing import Any

from sb3_contrib import CrossQ
from sb3_contrib.crossq.policies import Actor, CrossQPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecNormalize

from train.algorithms.algorithm import ACTIVATIONS
from train.algorithms.off_policy import algorithm
from train.runs.config import CrossQConfig, OffPolicyConfig


class _PlainActor(CrossQPolicy):
    """Its value networks normalise batches, its actor does not.

    So a policy has the layers of any other, and a training can begin with that of PPO.
    """

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> Actor:
        """Return the actor."""
        self.actor_kwargs["batch_norm"] = False
        return super().make_actor(features_extractor)


def _make(env: VecNormalize, own: OffPolicyConfig, **arguments: Any) -> CrossQ:
    assert isinstance(own, CrossQConfig)
    widths = {"pi": list(own.hidden), "qf": list(own.value_hidden)}
    network = {"net_arch": widths, "activation_fn": ACTIVATIONS[own.activation]}
    optimiser = {"optimizer_kwargs": {"fused": True, "betas": (0.5, 0.999)}}  # the paper's
    return CrossQ(_PlainActor, env, **arguments, policy_kwargs={**network, **optimiser})


ALGORITHM = algorithm(_make)
