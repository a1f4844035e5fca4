"""Shared interface of our environments, of one robot or of many."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.policy_step import TERMINATIONS
from fbid_gym.envs.rendering import RobotRenderer
from fbid_gym.options import Whole
from fbid_gym.robots import several
from fbid_gym.runtime.config import AROUND, Drawing, EnvConfig, plain

METADATA: dict[str, Any] = {
    "render_modes": ["human", "rgb_array"],
    "render_fps": 50,
    "terminations": TERMINATIONS,
}


class Interface:
    """Properties that all our environments share.

    That is `config`, `robot` (of several the first), `drawn_over` the robots, and what each entry
    of an observation and an action is, with its unit: `observation_names`, `action_names`.
    """

    config: EnvConfig
    metadata: dict[str, Any]
    _spec: EnvSpec | None

    def _present(
        self, config: EnvConfig, drawing: Drawing, batch: EnvBatch, **around: Any
    ) -> tuple[gym.spaces.Box, gym.spaces.Box]:
        """Set the attributes by the first robot's `batch`; return its observation, action space."""
        self._renderer = RobotRenderer(drawing, batch.robot)
        self.drawn_over, self.render_mode = self._renderer.shown, drawing.render_mode
        self.robot = batch.robot
        self.config, self._made = config, vars(drawing) | config.arguments | around
        self._num_steps, self._spec = batch.num_steps, None
        self.metadata = METADATA | {"render_fps": config.rates().policy}
        self.observation_names, self.action_names = batch.observation_names, batch.action_names
        bound = batch.observation_bound.astype(np.float32)
        action = gym.spaces.Box(-1.0, 1.0, (len(batch.action_names),), dtype=np.float32)
        return gym.spaces.Box(-bound, bound, dtype=np.float32), action

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's specification of the environment, with the steps of an episode."""
        return self._spec

    @spec.setter
    def spec(self, given: EnvSpec | None) -> None:
        self._spec = None
        if given is not None:
            self._spec = Spec(given.id)
            vars(self._spec).update(vars(given), max_episode_steps=self._num_steps)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copied and pickled as it was made, without its episode, as Gymnasium's own are."""
        return partial(type(self), **self._made), (), {"_spec": self._spec}


class Spec(EnvSpec):
    """A spec whose JSON holds what JSON can.

    A robot of the user's is there by its name: who makes an environment of it gives the robot, as
    in `gym.make(EnvSpec.from_json(text), robot=mine)`.
    """

    def to_json(self) -> str:
        """Return it as JSON; numbers of NumPy are numbers, a `Falling` is in hertz."""
        own = {name: value for name, value in self.kwargs.items() if name not in AROUND}
        meant = EnvConfig.of(own).resolved()
        written = plain(self.kwargs) | {name: _told(own[name], meant[name]) for name in own}
        if self.kwargs.get("robots") is not None:
            written["robots"] = [robot.name for robot in several(self.kwargs["robots"])]
        return EnvSpec.to_json(replace(self, kwargs=written))


def _told(given: Any, meant: Any) -> Any:
    """Return an argument as JSON holds it and `gym.make` takes it; infinity stays."""
    if isinstance(given, Mapping):
        return {name: _told(value, meant[name]) for name, value in given.items()}
    return given if isinstance(given, float) and np.isinf(given) else meant


def checked_seed(name: str, value: Any) -> int | None:
    """Return a seed as Gymnasium takes it: an int of Python, or None."""
    return None if value is None else Whole(0, np.inf).check(name, value)
