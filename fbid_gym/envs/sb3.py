"""The stable-baselines3 vector environment: `fbid_gym.make_sb3`."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from stable_baselines3.common.vec_env import VecEnv

from fbid_gym.envs.chunks import Chunks, checked_array
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.rendering import RENDER_MODES, RobotRenderer
from fbid_gym.envs.vector_env import checked_seed, spaces
from fbid_gym.errors import FbidError, InvalidValueError, UnknownOptionError
from fbid_gym.options import Choice
from fbid_gym.robots import Robot


class SB3VecEnv(VecEnv):
    """N environments for stable-baselines3, which resets them itself.

    At the end of an episode the info holds `terminal_observation`, `TimeLimit.truncated` and
    `episode` (return r, length l, seconds since the start t; not of episodes that `stagger` cuts
    short), as SB3's own wrappers give them.
    Per-step quantities of all environments are in `last_info`; they enter the infos' dictionaries
    only when an episode ends, because building N dictionaries of twenty entries on every step would
    cost as much as the control law.

    Attributes:
        last_info: name -> (N, ...) arrays of the last step, named as in `gym.make_vec`.
        observation_names: what each entry of an environment's observation is, with its unit.
        action_names: what each entry of its action commands, with its scale and unit.
    """

    def __init__(
        self,
        config: EnvConfig,
        num_envs: int,
        num_threads: int,
        stagger: bool = False,
        render_mode: str | None = None,
        render_options: dict[str, Any] | None = None,
    ) -> None:
        """Build the environments; see `make_sb3`."""
        self._renderer = RobotRenderer(render_mode, render_options)
        self.chunks = Chunks(config, num_envs, num_threads)
        self.render_mode, num_envs = render_mode, self.chunks.num_envs
        self.metadata: dict[str, Any] = {
            "render_modes": list(RENDER_MODES),
            "render_fps": config.rates().policy,
        }
        first = self.chunks.batches[0]
        super().__init__(num_envs, *spaces(first))
        self.observation_names, self.action_names = first.observation_names, first.action_names
        self.robot: Robot = first.robot
        self.last_info: dict[str, np.ndarray] = {}
        self._seeded = False
        self._returns, self._lengths = np.zeros(num_envs), np.zeros(num_envs, np.int64)
        # Steps after which the episode ends at the latest: of the first, and of all others.
        self._whole = first.num_steps
        parts = np.arange(1, num_envs + 1) if stagger else np.full(num_envs, num_envs)
        self._first = -(-self._whole * parts // num_envs)
        self._limits = self._first.copy()
        self._started = time.monotonic()
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start new episodes everywhere: (N, O) float32."""
        for env, seed in enumerate(self._seeds):
            if seed is not None or not self._seeded:
                self.chunks.seed(env, seeding.np_random(seed)[0])
        self._seeded = True
        self._reset_seeds()
        self.chunks.reset(np.ones(self.num_envs, bool))
        self._returns[:], self._lengths[:], self._limits[:] = 0.0, 0, self._first
        return self.chunks.observation()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed environment i with seed + i from the next reset on; None draws a seed."""
        return super().seed(checked_seed("seed", seed))

    def step_async(self, actions: np.ndarray) -> None:
        """Take note of the actions (N, A)."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step, and reset the environments whose episode ended."""
        if self._actions is None:
            raise FbidError("step_wait() without step_async(actions).")
        if not self._seeded:
            raise FbidError("There is no episode to step: call reset().")
        step = self.chunks.step(self._actions)
        self.last_info = step.info
        self._returns += step.reward
        self._lengths += 1
        ended = step.terminated | step.truncated
        cut = (self._lengths >= self._limits) & ~ended
        done = ended | cut
        observation = step.observation
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            elapsed = time.monotonic() - self._started
            for env in np.flatnonzero(done):
                infos[env] = {name: value[env] for name, value in step.info.items()} | {
                    "terminal_observation": observation[env],
                    "TimeLimit.truncated": bool(step.truncated[env] or cut[env]),
                }
                # What an episode earns that is cut short says nothing of one that is not.
                if not cut[env]:
                    infos[env]["episode"] = {
                        "r": float(self._returns[env]),
                        "l": int(self._lengths[env]),
                        "t": round(elapsed, 6),
                    }
            self.chunks.reset(done)
            self._returns[done], self._lengths[done] = 0.0, 0
            self._limits[done] = self._whole
            observation = self.chunks.observation()
        return observation, step.reward.astype(np.float32), done, infos

    def state_dict(self) -> dict[str, np.ndarray]:
        """Return the exact state of all environments as named arrays."""
        return self.chunks.state_dict() | {name: v.copy() for name, v in self._own().items()}

    def _own(self) -> dict[str, np.ndarray]:
        return {"returns": self._returns, "lengths": self._lengths, "limits": self._limits}

    def load_state_dict(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state_dict` of as many environments of the same kind.

        Raises:
            FbidError: the state is of other environments. Nothing was loaded.
        """
        own = self._own()
        if isinstance(state, Mapping):
            own = {name: checked_array(name, value, state) for name, value in own.items()}
        self.chunks.load_state_dict(state)
        self._returns, self._lengths, self._limits = (value.copy() for value in own.values())
        self._seeded = True
        self._reset_seeds()

    def close(self) -> None:
        """Stop the threads, close the windows."""
        self.chunks.close()
        self._renderer.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Draw every environment: (H, W, 3) uint8 each."""
        self.chunks.check_open()
        return self._renderer.frames(self.chunks.batches, "rgb_array")

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute; all environments share it."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all environments; they share it."""
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise InvalidValueError("indices", indices, "all environments: they share attributes")
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list:
        """Not supported: the environments are rows of a batch and have no methods of their own."""
        raise UnknownOptionError("method of a single environment", method_name, ["none"])

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each: wrap the whole batch instead."""
        return [False for _ in self._get_indices(indices)]


def make_sb3(
    env_id: str,
    num_envs: int = 1,
    *,
    seed: int | None = None,
    num_threads: int = 1,
    stagger: bool = False,
    render_mode: str | None = None,
    render_options: dict[str, Any] | None = None,
    **arguments: Any,
) -> SB3VecEnv:
    """Build N environments for stable-baselines3.

    Args:
        env_id: one of this package's ids, such as "fbid_gym/BipedBalance-v0".
        num_envs: how many.
        seed: environment i starts from seed + i.
        num_threads: threads that step them.
        stagger: truncate the first episode of each environment, evenly spread over its duration, so
            that those to come do not begin and end together. Else whole episodes are reported all
            at once, and in between only those that end early. What is cut short has no `episode` in
            its info.
        render_mode: None or "rgb_array".
        render_options: what is drawn over the robots, see `RenderOptions`.
        **arguments: of the environment, as for `gym.make`.

    Raises:
        FbidError: an id that is not one of ours, or an argument that is not valid.
    """
    ours = [name for name in gym.registry if name.startswith("fbid_gym/")]
    Choice(ours).check("environment id", env_id)
    seed = checked_seed("seed", seed)
    config = EnvConfig.of({**gym.registry[env_id].kwargs, **arguments})
    envs = SB3VecEnv(config, num_envs, num_threads, stagger, render_mode, render_options)
    envs.seed(seed)
    return envs
