"""The stable-baselines3 vector environment: `fbid_gym.make_sb3`."""

import copy
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from fbid_gym.checks import by_name
from fbid_gym.envs.chunks import Chunks, checked_array
from fbid_gym.envs.config import Drawing, EnvConfig, registered
from fbid_gym.envs.interface import Interface, checked_seed
from fbid_gym.errors import FbidError, InvalidValueError, UnknownOptionError
from fbid_gym.robots import Robot


class SB3VecEnv(Interface, VecEnv):
    """N environments for stable-baselines3, which resets them itself.

    At the end of an episode the info holds `terminal_observation`, `TimeLimit.truncated` and
    `episode` (return r, length l, seconds since the start t; not of episodes that `stagger` cuts
    short), as SB3's own `Monitor` gives it, and all that `last_info` has. On other steps it has the
    numbers among that: terms of the reward, metrics, levels.

    Attributes:
        last_info: name -> (N, ...) arrays of the last step, named as in `gym.make_vec`.
        robot: the robot.
    """

    def __init__(
        self,
        config: EnvConfig,
        drawing: Drawing,
        num_envs: int,
        num_threads: int = 1,
        max_episode_steps: int | None = None,
        stagger: bool = False,
    ) -> None:
        """Build the environments; see `make_sb3`."""
        self.chunks = Chunks(config, num_envs, num_threads, max_episode_steps, stagger)
        first, most = self.chunks.batches[0], self.chunks.num_steps
        made = {"config": config, "drawing": drawing, **self.chunks.made}
        spaces = self._present(config, drawing, first, most, made)
        num_envs = self.chunks.num_envs
        self._renderer.check_display()
        metadata = self.metadata
        super().__init__(num_envs, *spaces)
        self.metadata = metadata | self.metadata
        self.robot: Robot = first.robot
        self.last_info: dict[str, np.ndarray] = {}
        self._seeded, self._returns = False, np.zeros(num_envs)
        self._started = time.monotonic()
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start new episodes everywhere: (N, O) float32."""
        for env, seed in enumerate(self._seeds):
            if seed is not None or not self._seeded:
                self.chunks.seed(env, seeding.np_random(seed)[0])
        self._seeded = True
        self._reset_seeds()
        self.chunks.reset(command=self._commands())
        self._returns[:] = 0.0
        return self.chunks.observation()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed environment i with seed + i from the next reset on; None draws a seed."""
        return super().seed(checked_seed("seed", seed))

    def _commands(self) -> np.ndarray | None:
        """Those of `set_options`, one for each environment; they hold for one reset."""
        found = [by_name("options", each, ("command",)).get("command") for each in self._options]
        self._reset_options()
        if all(command is None for command in found):
            return None
        if any(command is None for command in found):
            raise InvalidValueError("options", found, "a command for each environment, or for none")
        return np.array(found)

    def set_command(self, command: Any) -> None:
        """Have the robots follow a command until their episodes end, see `Chunks.set_command`."""
        self.chunks.set_command(command)

    def step_async(self, actions: np.ndarray) -> None:
        """Take note of the actions (N, A)."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step, and reset the environments whose episode ended."""
        if self._actions is None:
            raise FbidError("step_wait() without step_async(actions).")
        if not self._seeded:
            raise FbidError("There is no episode to step: call reset().")
        chunks, step = self.chunks, self.chunks.step(self._actions)
        self.last_info = step.info
        self._returns += step.reward
        done, observation = step.terminated | step.truncated, step.observation
        infos = _rows({name: value for name, value in step.info.items() if value.ndim == 1})
        if done.any():
            elapsed = time.monotonic() - self._started
            lengths, limits = chunks.every("lengths"), chunks.every("limits")
            for env in np.flatnonzero(done):
                infos[env] |= {name: value[env] for name, value in step.info.items()} | {
                    "terminal_observation": observation[env],
                    "TimeLimit.truncated": bool(step.truncated[env]),
                }
                # What an episode earns that is cut short says nothing of one that is not.
                if step.terminated[env] or limits[env] == chunks.num_steps:
                    infos[env]["episode"] = {
                        "r": float(self._returns[env]),
                        "l": int(lengths[env]),
                        "t": round(elapsed, 6),
                    }
            chunks.reset(done)
            self._returns[done] = 0.0
            observation = chunks.observation()
        if self.render_mode == "human":
            self.render()
        return observation, step.reward.astype(np.float32), done, infos

    def state_dict(self) -> dict[str, np.ndarray]:
        """Return the exact state of all environments as named arrays."""
        return self.chunks.state_dict() | {"returns": self._returns.copy()}

    def load_state_dict(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state_dict` of as many environments of the same kind.

        Raises:
            FbidError: the state is of other environments. Nothing was loaded.
        """
        given = isinstance(state, Mapping)
        returns = checked_array("returns", self._returns, state) if given else self._returns
        self.chunks.load_state_dict(state)
        self._returns = returns.copy()
        self._seeded = True
        self._reset_seeds()

    def close(self) -> None:
        """Stop the threads, close the windows."""
        self.chunks.close()
        self._renderer.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Draw every environment: (H, W, 3) uint8 each."""
        self.chunks.check_open()
        return self._renderer.frames(self.chunks.batches)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute; all environments share it."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all environments; they share it."""
        self._check_all(indices)
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call `set_command` or `render` of all environments; rows of a batch have no others."""
        if method_name == "render":
            return self._renderer.frames(self.chunks.batches)
        if method_name != "set_command":
            choices = ("set_command", "render")
            raise UnknownOptionError("method of a single environment", method_name, choices)
        self._check_all(indices)
        self.set_command(*args, **kwargs)
        return [None] * self.num_envs

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
    env_id: str,
    num_envs: int = 1,
    *,
    seed: int | None = None,
    num_threads: int = 1,
    max_episode_steps: int | None = None,
    stagger: bool = False,
    **arguments: Any,
) -> SB3VecEnv:
    """Build N environments for stable-baselines3.

    Args:
        env_id: one of this package's ids, such as "fbid_gym/BipedBalance-v0", or one that a user
            registered with its entry points.
        num_envs: how many.
        seed: environment i starts from seed + i.
        num_threads: threads that step them.
        stagger: truncate the first episode of each environment, evenly spread over its duration, so
            that those to come do not begin and end together. Else whole episodes are reported all
            at once, and in between only those that end early. What is cut short has no `episode` in
            its info.
        max_episode_steps: after which episodes are truncated at the latest.
        **arguments: of the environment, as for `gym.make`; those of how it is drawn among them.

    Raises:
        FbidError: an id that is not one of ours, or an argument that is not valid.
    """
    spec, seed = copy.deepcopy(registered(env_id)), checked_seed("seed", seed)
    spec.kwargs |= arguments
    drawing, rest = Drawing.of(spec.kwargs)
    limit = max_episode_steps or spec.max_episode_steps
    envs = SB3VecEnv(drawing=drawing, config=EnvConfig.of(rest), num_envs=num_envs,
                     num_threads=num_threads, max_episode_steps=limit, stagger=stagger)  # fmt: skip
    envs.spec = spec
    envs.seed(seed)
    return envs
