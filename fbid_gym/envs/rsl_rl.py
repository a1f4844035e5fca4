"""The vector environment of rsl_rl: `fbid_gym.make_rsl_rl`."""

from typing import Any

import gymnasium as gym
import numpy as np
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from fbid_gym.envs.registered import registered
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.runtime.observer import CRITIC, POLICY


class RslRlVecEnv(VecEnv):
    """N environments for rsl_rl, which reset themselves.

    All that is observed is one group, "policy"; observations for robots have "critic" as another.

    It is made of `envs`, which `gym.make_vec` makes. `extras` has "time_outs" (N,) of episodes that
    were truncated, and in "log" the mean over robots of every number in the info: terms of the
    reward, metrics, levels.
    """

    def __init__(self, envs: RobotVectorEnv, seed: int | None, device: str) -> None:
        """Wrap environments, and begin their first episodes."""
        self.envs, self.device, self.cfg = envs, device, envs.config.resolved()
        self.num_envs, self.num_actions = envs.num_envs, len(envs.action_names)
        self.max_episode_length = envs.chunks.num_steps
        columns = envs.chunks.batches[0].observation_columns
        self._groups = {name: columns[name] for name in (POLICY, CRITIC) if name in columns}
        self._groups = self._groups or {POLICY: slice(None)}
        self._observation = self._tensor(envs.reset(seed=seed)[0])

    def get_observations(self) -> TensorDict:
        """Return the current observations, by group: (N, O) each."""
        groups = {name: self._observation[:, part] for name, part in self._groups.items()}
        return TensorDict(groups, batch_size=[self.num_envs])

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Hold the actions (N, A) for one policy step."""
        step = self.envs.step(actions.detach().cpu().numpy())
        seen, reward, terminated, truncated, info = step
        self._observation = self._tensor(seen)
        told = {name: value for name, value in info.items() if np.ndim(value) == 1}
        log = {f"/{name}": float(v.mean()) for name, v in told.items() if v.dtype.kind in "fi"}
        extras = {"time_outs": self._tensor(truncated), "log": log}
        done = self._tensor(terminated | truncated)
        return self.get_observations(), self._tensor(reward), done, extras

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Steps that the episodes count, (N,); those set to more than they have lasted end sooner.

        So does `init_at_random_ep_len` of rsl_rl, and robots do not end together.
        """
        chunks = self.envs.chunks
        counted = chunks.every("lengths") + chunks.num_steps - chunks.every("limits")
        return torch.as_tensor(counted, device=self.device)

    @episode_length_buf.setter
    def episode_length_buf(self, counted: torch.Tensor) -> None:
        chunks = self.envs.chunks
        rest = chunks.num_steps - counted.cpu().numpy() + chunks.every("lengths")
        for batch, part in zip(chunks.batches, chunks.slices, strict=True):
            batch.limits[:] = np.clip(rest[part], 1, chunks.num_steps)

    def _tensor(self, value: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(value.astype(np.float32), device=self.device)


def make_rsl_rl(
    env_id: str,
    num_envs: int = 1,
    *,
    seed: int | None = None,
    device: str = "cpu",
    **arguments: Any,
) -> RslRlVecEnv:
    """Build N environments for rsl_rl.

    Args:
        env_id: one of this package's ids, such as "fbid_gym/QuadrupedWalk-v0", or one that a user
            registered with its entry points.
        num_envs: how many.
        seed: environment i starts from seed + i.
        device: of the tensors; robots are stepped on the CPU.
        **arguments: of the environments, as for `gym.make_vec`.

    Raises:
        FbidError: an id that is not one of ours, or an argument that is not valid.
    """
    spec = registered(env_id)
    envs = gym.make_vec(spec, num_envs=num_envs, autoreset_mode="SAME_STEP", **arguments)
    assert isinstance(envs, RobotVectorEnv)
    return RslRlVecEnv(envs, seed, device)
