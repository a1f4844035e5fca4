"""The Gymnasium environment: `gym.make`."""

from dataclasses import asdict
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from fbid_gym.checks import by_name
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.rendering import RENDER_MODES, RobotRenderer, check_rendering
from fbid_gym.envs.vector_env import checked_seed, spaces
from fbid_gym.errors import FbidError


class RobotEnv(gym.Env):
    """One robot with one task, driven through one action layer.

    What it is about stands with the task: see `BalanceEnv`, `TrackingEnv` and `WalkingEnv`. The
    arguments are those of `EnvConfig`.

    Attributes:
        observation_names: what each entry of an observation is, with its unit.
        action_names: what each entry of an action commands, with its scale and unit.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}

    def __init__(
        self,
        robot: Any = "biped",
        *,
        render_mode: str | None = None,
        render_options: dict[str, Any] | None = None,
        **arguments: Any,
    ) -> None:
        """Build the environment."""
        self.drawn_over = check_rendering(render_mode, render_options)
        self.config = EnvConfig.of({"robot": robot} | arguments)
        self.batch = EnvBatch(self.config, 1)
        self.metadata = self.metadata | {"render_fps": self.config.rates().policy}
        self.observation_space, self.action_space = spaces(self.batch)
        self.observation_names = self.batch.observation_names
        self.action_names = self.batch.action_names
        self.render_mode = render_mode
        self._renderer: RobotRenderer | None = None
        self._only = np.zeros(1, int)
        self._begun, self._closed = False, False

    def __reduce__(self) -> tuple[Any, ...]:
        """Copied and pickled as it was made, without its episode, as Gymnasium's own are."""
        made = partial(
            type(self),
            render_mode=self.render_mode,
            render_options=asdict(self.drawn_over),
            **self.config.arguments,
        )
        return made, (), {"spec": self.spec}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start a new episode; there are no options. Only a seed begins a curriculum anew."""
        self._check_open()
        by_name("options", options, ())
        seed = checked_seed("seed", seed)
        super().reset(seed=seed)
        if seed is None:
            self.batch.draw_from(0, self.np_random)
        else:
            self.batch.seed(0, self.np_random)
        self.batch.reset(self._only)
        self._begun = True
        if self.render_mode == "human":
            self.render()
        return self.batch.observation()[0], {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Hold the action (A,) for one policy step."""
        self._check_open()
        if not self._begun:
            raise FbidError("There is no episode to step: call reset().")
        step = self.batch.step(self.batch.check_action(action)[None])
        if self.render_mode == "human":
            self.render()
        info = {name: value[0] for name, value in step.info.items()}
        return (
            step.observation[0],
            float(step.reward[0]),
            bool(step.terminated[0]),
            bool(step.truncated[0]),
            info,
        )

    def render(self) -> np.ndarray | None:
        """Draw the environment: (H, W, 3) uint8 for "rgb_array", a window for "human"."""
        if self.render_mode is None:
            gym.logger.warn("render() without a render_mode draws nothing")
            return None
        self._check_open()
        if self._renderer is None:
            self._renderer = RobotRenderer(self.batch, self.render_mode, self.drawn_over)
        return self._renderer.render(self.batch, 0)

    def close(self) -> None:
        """Close the window and give back the memory; nothing steps any more."""
        self._closed = True
        vars(self).pop("batch", None)
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _check_open(self) -> None:
        if self._closed:
            raise FbidError("This environment is closed: make another one.")
