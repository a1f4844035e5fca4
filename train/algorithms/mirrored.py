"""PPO that learns from every sample and from its mirror image.

What is good to do is good in the mirror, for a robot whose left is as its right. The copies double
each minibatch, with the advantage, the return and the old probability of their originals (Mittal et
al. 2024, "Symmetry considerations for learning task symmetric robot policies", ICRA), which is
right as long as the policy is nearly symmetric. It begins so, with the zero action, and the scales
of its observations are those of both sides.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.mirrored import Mirrored, mirrored
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots.mirror import Reflection


class MirroredBuffer(RolloutBuffer):
    """Rollouts whose minibatches hold every sample twice: as it was, and in the mirror."""

    def __init__(self, *args: Any, mirror: Mirrored, **options: Any) -> None:
        """Take the arguments of stable-baselines3, and the mirror of the environments."""
        super().__init__(*args, **options)
        self._mirror = mirror

    def get(self, batch_size: int | None = None) -> Iterator[RolloutBufferSamples]:  # type: ignore[override]
        """Yield minibatches of twice this size, the originals first."""
        for found in super().get(batch_size):
            both = {name: torch.cat([value, value]) for name, value in found._asdict().items()}
            for name, its in (("observations", 0), ("actions", 1)):
                value = getattr(found, name)
                both[name] = torch.cat([value, _of(self._mirror[its], value)])
            yield RolloutBufferSamples(**both)


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
    env.obs_rms = _BothSides(found[0].observation)
    return {
        "rollout_buffer_class": MirroredBuffer,
        "rollout_buffer_kwargs": {"mirror": found[0]},
    }
