"""A policy against stable-baselines3, as closely as two computations in float32 can agree."""

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from fbid_gym.policy import ACTIVATIONS, Policy
from train.learner import normaliser


def randomise(learner: BaseAlgorithm) -> None:
    """Give it a network whose actions differ; what little training comes to is another's each."""
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in learner.policy.parameters():
            parameter.normal_(0.0, 0.3, generator=generator)


def assert_same_actions(policy: Policy, learner: BaseAlgorithm, observation: np.ndarray) -> None:
    """Each is within what rounding does to it, so both are within twice that."""
    expected, _ = learner.predict(
        normaliser(learner).normalize_obs(observation), deterministic=True
    )
    bound = 2.0 * _rounding(policy, observation)
    assert bound.max() < 1e-3  # another bias, clip or epsilon would be seen
    assert (np.abs(policy(observation) - expected) <= bound).all()


def _rounding(policy: Policy, observation: np.ndarray) -> np.ndarray:
    """Return (N, A), how far from the exact action float32 may end, in whatever order it adds.

    A sum of n products is off by n roundings of the sum of their sizes at most [N. Higham, Accuracy
    and Stability of Numerical Algorithms, section 3.1], and no activation makes an error larger.
    """
    unit = np.finfo(np.float32).eps  # a rounding is half of it: the other half is for second order
    scaled = (observation - policy.mean) / np.sqrt(policy.variance + policy.epsilon)
    x = np.clip(scaled, -policy.clip, policy.clip)
    error = unit * np.abs(x)
    last = len(policy.weights) - 1
    for k, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        sizes = np.abs(x) @ np.abs(weight).T + np.abs(bias)
        error = error @ np.abs(weight).T + 0.5 * (weight.shape[1] + 2) * unit * sizes
        x = x @ weight.T.astype(np.float64) + bias
        if k < last:
            x = ACTIVATIONS[policy.activation](x)
            error += 2.0 * unit * np.abs(x)  # activations round, too
    return error + 2.0 * unit
