"""The Gymnasium vector environment: `gym.make_vec`."""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from fbid_gym.checks import by_name, count, real_numbers
from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.rendering import RENDER_MODES, RobotRenderer
from fbid_gym.errors import FbidError, InvalidValueError, ShapeError, UnknownOptionError


class RobotVectorEnv(VectorEnv):
    """N environments stepped together, see `RobotEnv` for what each of them is.

    Environment i of `reset(seed=s)` gives the same numbers as `RobotEnv` with seed s + i.

    Arguments beyond those of `RobotEnv`:

    | Argument         | Default     | Meaning                                              |
    | ---------------- | ----------- | ---------------------------------------------------- |
    | `num_envs`       |             | Number of environments.                              |
    | `num_threads`    | 1           | Threads that step them.                              |
    | `autoreset_mode` | `NEXT_STEP` | `gymnasium.vector.AutoresetMode`, or its name.       |

    Attributes:
        observation_names: what each entry of an environment's observation is, with its unit.
        action_names: what each entry of its action commands, with its scale and unit.
    """

    metadata: dict[str, Any]

    def __init__(
        self,
        num_envs: int = 1,
        robot: Any = "biped",
        *,
        render_mode: str | None = None,
        render_options: dict[str, Any] | None = None,
        num_threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **arguments: Any,
    ) -> None:
        """Build the environments."""
        self._renderer = RobotRenderer(render_mode, render_options)
        self.config = EnvConfig.of({"robot": robot} | arguments)
        self.chunks = Chunks(self.config, num_envs, num_threads)
        first = self.chunks.batches[0]
        num_envs = self.chunks.num_envs
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space, self.single_action_space = spaces(first)
        self.observation_names, self.action_names = first.observation_names, first.action_names
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": self.config.rates().policy,
            "autoreset_mode": _autoreset_mode(autoreset_mode),
        }
        self._seeded = False
        self._done = np.ones(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | np.ndarray | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start new episodes.

        Args:
            seed: environment i gets seed + i; or one seed (or None) each, in a list or an array.
            options: {"reset_mask": (N,) bool} resets only those environments.

        Raises:
            FbidError: seeds, options or a mask that are none. Nothing was seeded or reset.
        """
        everyone = np.ones(self.num_envs, bool)
        given = by_name("options", options, ("reset_mask",)).get("reset_mask", everyone)
        chosen = real_numbers("reset_mask", given, f"({self.num_envs},) bool")
        if chosen.shape != (self.num_envs,) or chosen.dtype != bool:
            raise ShapeError("reset_mask", chosen.shape, f"({self.num_envs},) bool")
        for env, one in enumerate(self._seeds(seed)):
            if chosen[env] and (one is not None or not self._seeded):
                self.chunks.seed(env, seeding.np_random(one)[0])
        self._seeded = True
        self.chunks.reset(chosen)
        self._done[chosen] = False
        return self.chunks.observation(), {}

    def _seeds(self, seed: Any) -> list[int | None]:
        """Return one for each environment, as Gymnasium takes them: ints of Python, or None."""
        given = seed.tolist() if isinstance(seed, np.ndarray) else seed
        if not isinstance(given, list | tuple):
            first = checked_seed("seed", given)
            return [None if first is None else first + env for env in range(self.num_envs)]
        if len(given) != self.num_envs:
            raise InvalidValueError("seed", seed, f"one integer, or {self.num_envs} of them")
        return [checked_seed(f"seed of environment {env}", one) for env, one in enumerate(given)]

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Hold the actions (N, A) for one policy step."""
        mode = self.metadata["autoreset_mode"]
        if not self._seeded or (mode != AutoresetMode.NEXT_STEP and self._done.any()):
            ended = np.flatnonzero(self._done).tolist()
            raise FbidError(
                f"Environments {ended} have no episode to step: call reset(), or reset(options="
                '{"reset_mask": ...}) for some of them.'
            )
        step = self.chunks.step(actions)
        observation, reward = step.observation, step.reward
        terminated, truncated = step.terminated, step.truncated
        everyone = np.ones(self.num_envs, bool)
        info: dict[str, Any] = dict(step.info)
        info |= {f"_{name}": everyone for name in step.info}
        if mode == AutoresetMode.NEXT_STEP and self._done.any():
            # Gymnasium's convention: this step only resets those, and says nothing else of them.
            again = self._done
            self.chunks.reset(again)
            observation = self.chunks.observation()
            reward = np.where(again, 0.0, reward)
            terminated, truncated = terminated & ~again, truncated & ~again
            info |= {f"_{name}": ~again for name in step.info}
        done = terminated | truncated
        if mode == AutoresetMode.SAME_STEP and done.any():
            final = np.full(self.num_envs, None, object)
            for env in np.flatnonzero(done):
                final[env] = observation[env].copy()
            info["final_obs"], info["_final_obs"] = final, done.copy()
            info["final_info"] = dict(step.info) | {f"_{name}": done.copy() for name in step.info}
            info["_final_info"] = done.copy()
            info |= {f"_{name}": ~done for name in step.info}
            self.chunks.reset(done)
            observation = self.chunks.observation()
        self._done = done if mode != AutoresetMode.SAME_STEP else np.zeros_like(done)
        return observation, reward, terminated, truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Draw every environment: a tuple of (H, W, 3) uint8 frames."""
        if self.render_mode is None:
            gym.logger.warn("render() without a render_mode draws nothing")
            return None
        self.chunks.check_open()
        frames = self._renderer.frames(self.chunks.batches, self.render_mode)
        return tuple(frame for frame in frames if frame is not None) or None

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads, close the windows."""
        self.chunks.close()
        self._renderer.close()


def spaces(batch: EnvBatch) -> tuple[gym.spaces.Box, gym.spaces.Box]:
    """Return the observation and the action space of one environment."""
    bound = batch.observation_bound.astype(np.float32)
    observation = gym.spaces.Box(-bound, bound, dtype=np.float32)
    action = gym.spaces.Box(-1.0, 1.0, (len(batch.action_names),), dtype=np.float32)
    return observation, action


def checked_seed(name: str, value: Any) -> int | None:
    """Return a seed as Gymnasium takes it: an int of Python, or None."""
    return None if value is None else count(name, value)


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    for known in AutoresetMode:
        if isinstance(mode, str) and mode in (known.name, known.value):
            return known
    raise UnknownOptionError("autoreset_mode", mode, [known.name for known in AutoresetMode])
