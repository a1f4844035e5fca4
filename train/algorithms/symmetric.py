"""Policies that are symmetric by construction: on a mirrored observation, the mirrored action.

Actor and critic are averaged, layer by layer, with their images in the mirror, in which the second
half of a layer's units takes the place of the first (Mittal et al. 2024, "Symmetry considerations
for learning task symmetric robot policies", ICRA). So all that is learnt of the left holds for the
right. The network is as wide as any other, has half as many free numbers, and is exported alike.
"""

import math
from itertools import pairwise

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize
from torch import nn
from torch.nn.utils.parametrize import register_parametrization

from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.mirrored import Mirrored, mirrored
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots.mirror import Reflection
from train.algorithms.algorithm import linear

_VALUE = Reflection(np.array([0]), np.array([1.0]))  # as good in the mirror


def mirror_of_environments(env: VecNormalize) -> Mirrored:
    """Return the mirror image of observations and actions, the same for all robots.

    Raises:
        RobotError: a robot without mirror symmetry.
        InvalidValueError: environments of others, an entry whose mirror image is not known, or
            robots whose entries are mirrored differently.
    """
    chunks = getattr(env.venv, "chunks", None)
    if not isinstance(chunks, Chunks):
        raise InvalidValueError("ppo.symmetric", True, "false in environments not of fbid_gym")
    first, *others = (mirrored(batch) for batch in chunks.batches)
    for other in others:
        if not all(map(np.array_equal, (*first[0], *first[1]), (*other[0], *other[1]))):
            expected = "false for robots whose observations or actions are mirrored differently"
            raise InvalidValueError("ppo.symmetric", True, expected)
    return first


def make_symmetric(policy: ActorCriticPolicy, mirror: Mirrored) -> None:
    """Make an actor symmetric, and the critic that sees the same.

    A critic that sees more stays as it is: how a payload or the errors of sensors were drawn has no
    mirror image among its entries.
    """
    actor = linear([*policy.mlp_extractor.policy_net, policy.action_net])
    critic = linear([*policy.mlp_extractor.value_net, policy.value_net])
    for layers, output in ((actor, mirror.action), (critic, _VALUE)):
        if layers is critic and policy.features_dim != len(mirror.observation.entry):
            continue
        hidden = [_halves_swapped(layer.out_features) for layer in layers[:-1]]
        sides = pairwise([mirror.observation, *hidden, output])
        for layer, (before, after) in zip(layers, sides, strict=True):
            with torch.no_grad():  # the mean of two independent draws varies half as much as one
                layer.weight.mul_(2.0**0.5)
            register_parametrization(layer, "weight", _Symmetric(after, before))
            register_parametrization(layer, "bias", _Symmetric(after))


class BothSides(RunningMeanStd):
    """Statistics of observations and of their mirror images: scaled by them, they mirror alike."""

    def __init__(self, width: int, reflection: Reflection) -> None:
        """Begin with no observation; the reflection is of the first of `width` entries."""
        super().__init__(shape=(width,))
        self._reflection = reflection

    def update(self, arr: np.ndarray) -> None:
        """Take observations (N, width) into account."""
        image, seen = arr.copy(), len(self._reflection.entry)
        image[:, :seen] = self._reflection.of(arr[:, :seen])
        super().update(np.concatenate([arr, image]))


class _Symmetric(nn.Module):
    """The mean of a layer's numbers and of their mirror image, along each of their axes."""

    def __init__(self, *axes: Reflection) -> None:
        super().__init__()
        self._entries = [torch.tensor(own.entry) for own in axes]
        signs = np.ix_(*(own.sign for own in axes))
        self._sign = torch.tensor(math.prod(signs), dtype=torch.float32)

    def forward(self, numbers: torch.Tensor) -> torch.Tensor:
        image = numbers
        for axis, entry in enumerate(self._entries):
            image = image.index_select(axis, entry)
        return 0.5 * (numbers + self._sign * image)


def _halves_swapped(width: int) -> Reflection:
    """Return the mirror of a layer's units."""
    return Reflection(np.roll(np.arange(width), width // 2), np.ones(width))
