"""PPO that learns from every sample and from its mirror image.

What is good to do is good in the mirror, for a robot whose left is as its right. The copies double
each minibatch, with the advantage and the return of their originals (Mittal et al. 2024, "Symmetry
considerations for learning task symmetric robot policies", ICRA). Their old probability is that of
the mirrored action where the robot's mirror image is. With that of the original, as there, a policy
is told to have moved far that is a little asymmetric and has little noise, and is hardly ever
updated: ours have a standard deviation of 0.13. The scales of observations are those of both sides.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.mirrored import Mirrored, mirrored
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots.mirror import Reflection


class MirroredBuffer(RolloutBuffer):
    """Rollouts whose minibatches hold every sample twice: as it was, and in the mirror.

    Attributes:
        policy: the learner's; to be set before the first rollout.
    """

    policy: ActorCriticPolicy

    def __init__(self, *args: Any, mirror: Mirrored, **options: Any) -> None:
        """Take the arguments of stable-baselines3, and the mirror of the environments."""
        super().__init__(*args, **options)
        self._mirror, self._log_prob = mirror, torch.empty(0)

    def get(self, batch_size: int | None = None) -> Iterator[RolloutBufferSamples]:  # type: ignore[override]
        """Yield minibatches of twice this size, the originals first."""
        if not self.generator_ready:  # before the first update on these rollouts
            flat = [self.swap_and_flatten(x) for x in (self.observations, self.actions)]
            other = [
                _of(*each) for each in zip(self._mirror, map(self.to_torch, flat), strict=True)
            ]
            with torch.no_grad():
                self._log_prob = self.policy.evaluate_actions(*other)[1]
        yield from super().get(batch_size)

    def _get_samples(self, batch_inds: np.ndarray, env: Any = None) -> RolloutBufferSamples:
        found = super()._get_samples(batch_inds, env)
        other = found._replace(
            observations=_of(self._mirror.observation, found.observations),
            actions=_of(self._mirror.action, found.actions),
            old_log_prob=self._log_prob[batch_inds],
        )
        return RolloutBufferSamples(*map(torch.cat, zip(found, other, strict=True)))


def _of(reflection: Reflection, values: torch.Tensor) -> torch.Tensor:
    sign = torch.as_tensor(reflection.sign, dtype=values.dtype)
    return values[:, torch.as_tensor(reflection.entry)] * sign


class _BothSides(RunningMeanStd):
    """Statistics of observations and of their mirror images: normalised, they mirror alike."""

    def __init__(self, reflection: Reflection) -> None:
        super().__init__(shape=reflection.entry.shape)
        self._reflection = reflection

    def update(self, arr: np.ndarray) -> None:
        super().update(np.concatenate([arr, self._reflection.of(arr)]))


def mirror_in(env: VecNormalize) -> dict[str, Any]:
    """Have the scales of observations be those of both sides; return the arguments of PPO.

    Raises:
        RobotError: a robot that has no mirror symmetry.
        InvalidValueError: environments that are not this package's, an entry of which is not known
            what it is in the mirror, or robots whose entries differ.
    """
    chunks = getattr(env.venv, "chunks", None)
    if not isinstance(chunks, Chunks):
        expected = "false in environments that are not of fbid_gym"
        raise InvalidValueError("ppo.mirror", True, expected)
    found = [mirrored(batch) for batch in chunks.batches]
    same = all(
        np.array_equal(one, other)
        for its in found
        for mine, first in zip(its, found[0], strict=True)
        for one, other in zip(mine, first, strict=True)
    )
    if not same:
        expected = "false for robots whose entries are not the same in the mirror"
        raise InvalidValueError("ppo.mirror", True, expected)
    env.obs_rms = _BothSides(found[0].observation)  # type: ignore[assignment]
    return {
        "rollout_buffer_class": MirroredBuffer,
        "rollout_buffer_kwargs": {"mirror": found[0]},
    }
