"""The stable-baselines3 vector environment: `fbid_gym.make_sb3`."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from fbid_gym.checks import by_name, check_choices
from fbid_gym.envs.chunks import checked_array
from fbid_gym.envs.interface import checked_seed
from fbid_gym.envs.registered import registered
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.errors import FbidError, InvalidValueError


class SB3VecEnv(VecEnv):
    """N environments for stable-baselines3, which resets them itself.

    At the end of an episode the info holds `terminal_observation`, `TimeLimit.truncated` and
    `episode` (return r, length l, seconds since the start t; not of episodes that `stagger` cuts
    short), as SB3's own `Monitor` gives it, and all that `last_info` has. On other steps it has the
    numbers among that: terms of the reward, metrics, levels.

    Attributes:
        envs: what `gym.make_vec` makes, with attributes that `get_attr` finds, too.
        observation_names: what each entry of an observation is, with its unit.
        action_names: what each entry of an action commands, with its scale and unit.
        chunks: of these.
        robot: of these; of several the first.
        robots: of these.
        last_info: name -> (N, ...) arrays of the last step, named as in `gym.make_vec`.
    """

    def __init__(self, envs: RobotVectorEnv) -> None:
        """Wrap environments that reset in the step that ends an episode."""
        self.envs, self.chunks, num_envs = envs, envs.chunks, envs.num_envs
        self.robot, self.robots = envs.robot, envs.robots
        super().__init__(num_envs, envs.single_observation_space, envs.single_action_space)
        self.metadata |= envs.metadata
        self.observation_names, self.action_names = envs.observation_names, envs.action_names
        self.last_info: dict[str, np.ndarray] = {}
        self._returns, self._lengths = np.zeros(num_envs), np.zeros(num_envs, np.int64)
        self._started = time.monotonic()
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start new episodes everywhere: (N, O) float32."""
        given = [by_name("options", each, ("command",)) for each in self._options]
        if any(each.keys() != given[0].keys() for each in given):
            raise InvalidValueError("options", given, "a command for each environment, or for none")
        options = {name: np.array([each[name] for each in given]) for name in given[0]}
        observation, _ = self.envs.reset(seed=list(self._seeds), options=options)
        self._reset_seeds()
        self._reset_options()
        self._returns[:], self._lengths[:] = 0.0, 0
        return observation

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
        whole = self.chunks.every("limits") == self.chunks.num_steps
        observation, reward, terminated, truncated, told = self.envs.step(self._actions)
        final, done = told.pop("final_obs", None), terminated | truncated
        told.pop("final_info", None)
        self.last_info = {name: value for name, value in told.items() if name[0] != "_"}
        self._returns += reward
        self._lengths += 1
        infos = _rows({name: v for name, v in self.last_info.items() if v.ndim == 1})
        elapsed = round(time.monotonic() - self._started, 6)
        for env in np.flatnonzero(done):
            infos[env] |= {name: value[env] for name, value in self.last_info.items()}
            infos[env] |= {
                "terminal_observation": final[env],
                "TimeLimit.truncated": bool(truncated[env]),
            }
            # What an episode earns that is cut short says nothing of one that is not.
            if terminated[env] or whole[env]:
                earned, length = float(self._returns[env]), int(self._lengths[env])
                infos[env]["episode"] = {"r": earned, "l": length, "t": elapsed}
        self._returns[done], self._lengths[done] = 0.0, 0
        return observation, reward.astype(np.float32), done, infos

    def state_dict(self) -> dict[str, np.ndarray]:
        """Return the exact state of all environments as named arrays."""
        return self.chunks.state_dict() | {name: v.copy() for name, v in self._own().items()}

    def _own(self) -> dict[str, np.ndarray]:
        return {"returns": self._returns, "lengths": self._lengths}

    def load_state_dict(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state_dict`, or raise FbidError as that of `Chunks`."""
        own = self._own()
        if isinstance(state, Mapping):
            own = {name: checked_array(name, value, state) for name, value in own.items()}
        self.envs.load_state_dict(state)
        self._returns, self._lengths = (value.copy() for value in own.values())
        self._reset_seeds()

    def close(self) -> None:
        """Stop the threads, close the windows."""
        self.envs.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Draw every environment: (H, W, 3) uint8 each."""
        return self.envs.call("render")

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute; all environments share it."""
        whose = self.envs if hasattr(self.envs, attr_name) else self
        return [getattr(whose, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all environments; they share it."""
        self._check_all(indices)
        setattr(self.envs, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call `set_command` or `render` of all environments; rows of a batch have no others."""
        known = ("set_command", "render")
        check_choices("method of a single environment", [method_name], known)
        self._check_all(indices)
        return list(self.envs.call(method_name, *args, **kwargs))

    def _check_all(self, indices: Any) -> None:
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise InvalidValueError("indices", indices, "all environments: they share it")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return True for SB3's `Monitor`, whose `episode` is in the infos, else False."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]


def _rows(columns: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """Return a dictionary for each environment, of columns (N,) by name."""
    each = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in each]


def make_sb3(
    env_id: str, num_envs: int = 1, *, seed: int | None = None, **arguments: Any
) -> SB3VecEnv:
    """Build N environments for stable-baselines3.

    Args:
        env_id: one of this package's ids, such as "fbid_gym/BipedBalance-v0", or one that a user
            registered with its entry point.
        num_envs: how many.
        seed: environment i starts from seed + i.
        **arguments: as for `gym.make_vec`, see `RobotVectorEnv`: `num_threads`, `stagger`,
            `max_episode_steps`, how they are drawn and what they are. How they reset is SB3's.

    Raises:
        FbidError: an id that is not one of ours, or an argument that is not valid.
    """
    spec, seed = registered(env_id), checked_seed("seed", seed)
    made = gym.make_vec(spec, num_envs=num_envs, autoreset_mode="SAME_STEP", **arguments)
    assert isinstance(made, RobotVectorEnv)
    made.check_display()
    envs = SB3VecEnv(made)
    envs.seed(seed)
    return envs
