"""The Gymnasium vector environment: `gym.make_vec`."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from fbid_gym.checks import by_name, real_numbers
from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.interface import Interface, checked_seed
from fbid_gym.envs.rendering import RobotRenderer
from fbid_gym.errors import FbidError, InvalidValueError, ShapeError, UnknownOptionError
from fbid_gym.robots import several
from fbid_gym.runtime.config import Drawing, EnvConfig


class RobotVectorEnv(Interface, VectorEnv):
    """N environments stepped together, see `RobotEnv` for what each of them is.

    Environment i of `reset(seed=s)` gives the same numbers as `RobotEnv` with seed s + i.

    It takes the arguments of `RobotEnv`, too. First episodes are those of `reset()` without a mask.

    Args:
        num_envs: Number of environments.
        robots: Instead of `robot` a list, see `fbid_gym.robots.several`: so many environments of
            each, one after the other.
        num_threads: Threads that step them.
        autoreset_mode: `gymnasium.vector.AutoresetMode`, or its name.
        max_episode_steps: Steps after which episodes are truncated, if they have not ended before.
        stagger: Whether first episodes are truncated, evenly spread, so that robots do not end
            together, as trainings of this repository do.
    """

    def __init__(
        self,
        num_envs: int = 1,
        robot: Any = "biped",
        *,
        robots: Any = None,
        num_threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        stagger: bool = False,
        **arguments: Any,
    ) -> None:
        """Build the environments."""
        drawing, rest = Drawing.of({"robot": robot} | arguments)
        listed = (robot,) if robots is None else several(robots)
        configs = [EnvConfig.of(rest | {"robot": one}) for one in listed]
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.chunks = Chunks(configs, num_envs, num_threads, max_episode_steps, stagger)
        self.robots = tuple(kind[0].robot for kind in self.chunks.kinds)
        around: dict[str, Any] = {"num_envs": num_envs, "num_threads": num_threads}
        around |= {"autoreset_mode": self.autoreset_mode, "max_episode_steps": max_episode_steps}
        around |= {"robots": None if robots is None else listed, "stagger": stagger}
        spaces = self._present(configs[0], drawing, self.chunks.batches[0], **around)
        self.single_observation_space, self.single_action_space = spaces
        rest_of_them = (RobotRenderer(drawing, robot) for robot in self.robots[1:])
        self._renderers = (self._renderer, *rest_of_them)
        self.num_envs = num_envs = self.chunks.num_envs
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata["autoreset_mode"] = self.autoreset_mode
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
            options: {"reset_mask": (N,) bool} resets only those environments; {"command": ...}
                has them follow a command, see `set_command`.

        Raises:
            FbidError: seeds, options or a mask that are none. Nothing was seeded or reset.
        """
        given = by_name("options", options, ("reset_mask", "command"))
        chosen = np.ones(self.num_envs, bool)
        if "reset_mask" in given:
            words = f"({self.num_envs},) bool"
            chosen = real_numbers("reset_mask", given["reset_mask"], words)
            if chosen.shape != (self.num_envs,) or chosen.dtype != bool:
                raise ShapeError("reset_mask", chosen.shape, words)
        if (command := given.get("command")) is not None:
            self.chunks.check_command(command)
        for env, one in enumerate(self._seeds(seed)):
            if chosen[env] and (one is not None or not self._seeded):
                self.chunks.seed(env, seeding.np_random(one)[0])
        self._seeded = True
        self.chunks.reset(chosen if "reset_mask" in given else None, command)
        self._done[chosen] = False
        self._show()
        return self.chunks.observation(), {}

    def set_command(self, command: Any) -> None:
        """Have the robots follow a command until their episodes end, see `Chunks.set_command`."""
        self.chunks.set_command(command)

    def load_state_dict(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state_dict` of the `chunks`; raises as theirs does."""
        self.chunks.load_state_dict(state)
        self._seeded = True
        self._done[:] = False

    def check_display(self) -> None:
        """Raise FbidError where there shall be a window and cannot."""
        self._renderer.check_display()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what a method, or an attribute that they share, gives for each environment."""
        if name == "render":
            return self.render() or (None,) * self.num_envs
        found = getattr(self, name)
        return (found(*args, **kwargs) if callable(found) else found,) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute that the environments share, once for each."""
        return (getattr(self, name),) * self.num_envs

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute that the environments share: to one value, or to the same of each."""
        each = list(values) if isinstance(values, list | tuple) else [values] * self.num_envs
        if len(each) != self.num_envs or not all(np.array_equal(each[0], one) for one in each):
            raise InvalidValueError(name, values, "one value: the environments share it")
        setattr(self, name, each[0])

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
        mode = self.autoreset_mode
        if not self._seeded or (mode != AutoresetMode.NEXT_STEP and self._done.any()):
            ended = np.flatnonzero(self._done).tolist()
            raise FbidError(
                f"Environments {ended} have no episode to step: call reset(), or reset(options="
                '{"reset_mask": ...}) for some of them.'
            )
        observation, reward, terminated, truncated, told = self.chunks.step(actions)
        everyone = np.ones(self.num_envs, bool)
        info: dict[str, Any] = told | {f"_{name}": everyone for name in told}
        if mode == AutoresetMode.NEXT_STEP and self._done.any():
            # Gymnasium's convention: this step only resets those, and says nothing else of them.
            again = self._done
            self.chunks.reset(again)
            observation = self.chunks.observation()
            reward = np.where(again, 0.0, reward)
            terminated, truncated = terminated & ~again, truncated & ~again
            info |= {f"_{name}": ~again for name in told}
        done = terminated | truncated
        if mode == AutoresetMode.SAME_STEP and done.any():
            final = np.full(self.num_envs, None, object)
            for env in np.flatnonzero(done):
                final[env] = observation[env].copy()
            info["final_obs"], info["_final_obs"] = final, done.copy()
            info["final_info"] = told | {f"_{name}": done.copy() for name in told}
            info["_final_info"] = done.copy()
            info |= {f"_{name}": ~done for name in told}
            self.chunks.reset(done)
            observation = self.chunks.observation()
        self._done = done if mode != AutoresetMode.SAME_STEP else np.zeros_like(done)
        self._show()
        return observation, reward, terminated, truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Draw every environment: a tuple of (H, W, 3) uint8 frames."""
        if self.render_mode is None:
            gym.logger.warn("render() without a render_mode draws nothing")
            return None
        self.chunks.check_open()
        if self.render_mode == "human":
            self._renderer.render(self.chunks.batches[0], 0)
            return None
        drawn = zip(self._renderers, self.chunks.kinds, strict=True)
        return tuple(frame for renderer, kind in drawn for frame in renderer.frames(kind))

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads, close the windows."""
        self.chunks.close()
        for renderer in self._renderers:
            renderer.close()


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    for known in AutoresetMode:
        if mode is known or (isinstance(mode, str) and mode in (known.name, known.value)):
            return known
    raise UnknownOptionError("autoreset_mode", mode, [known.name for known in AutoresetMode])
