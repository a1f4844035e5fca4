"""The interface of an algorithm to a training, and code that all algorithms share."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import torch
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from fbid_gym.bundles import Tensors
from train.runs.config import LearnerConfig, TrainConfig

ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU}

_FORESIGHT = 1000
"""Policy steps beyond which nothing is expected."""


class Algorithm(NamedTuple):
    """Functions of a learner, each of which takes the result of `build`."""

    build: Callable[[TrainConfig, VecNormalize], Any]
    """Return the learner before its first step; draws from torch's generator."""
    iterate: Callable[[Any, TrainConfig, BaseCallback], dict[str, float]]
    """Act for `TrainConfig.iteration_steps`, learn, and return the metrics."""
    metrics: tuple[str, ...]
    """Its own columns of `progress.csv`; those that `iterate` leaves out are not known yet."""
    layers: Callable[[Any], list[torch.nn.Linear]]
    """From the normalised observation to the action."""
    output: str
    """Its output, one of `fbid_gym.policy.OUTPUTS`, which keeps actions within limits."""
    optimisers: Callable[[Any], dict[str, torch.optim.Optimizer]]
    """By the name that they have in a checkpoint."""
    arrays: Callable[[Any], Tensors]
    """The learner's own arrays, beside its network, that its next iteration depends on; writing
    into them changes the learner."""
    replay: Callable[[Any], ReplayBuffer | None]
    """Its replay buffer, if it has one."""


def learning_rate(own: LearnerConfig) -> float | Callable[[float], float]:
    """Return the constant rate, or the rate by the share of the training that is left."""
    first, last = own.learning_rate, own.learning_rate_end
    if last is None:
        return first
    return lambda left: last + (first - last) * max(left, 0.0)


def expected_return(own: LearnerConfig) -> float:
    """Return the initial output of a value network."""
    return own.expected_reward / max(1.0 - own.gamma, 1.0 / _FORESIGHT)


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch compute on so many threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def linear(modules: Iterable[torch.nn.Module]) -> list[torch.nn.Linear]:
    """Return those that are linear layers."""
    return [module for module in modules if isinstance(module, torch.nn.Linear)]


def begin_at_zero(layer: torch.nn.Linear) -> None:
    """Let a policy begin with the zero action."""
    torch.nn.init.zeros_(layer.weight)
    torch.nn.init.zeros_(layer.bias)
