"""Fixed parts of a session: environment, robot, and the policies that were named."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from fbid_gym.actions import layer_options
from fbid_gym.checks import check_choices
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import InvalidValueError
from fbid_gym.estimation.sensors import LIKE, PERFECT, PRESETS
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot, several
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks import Task
from train.runs.differences import differences, in_words

NO_POLICY = "zero action"
MOST_PUSH_SECONDS = 2.0
LONGEST_LOOP = 0.02  # s, from a state to the torque that answers it
OWN_SENSORS = "as begun"
_DAY = 86_400.0

# Set on the page, or made so that episodes do not end and nothing but the page pushes.
OWNED = (
    "action_layer", "layer_options", "terrain", "difficulty", "gait", "curriculum",
    "randomisation", "episode_seconds", "push_force", "push_velocity", "push_duration",
    "push_interval", "command_interval", "height_interval", "lowered_range", "render_mode",
    "render_options", "num_threads",
)  # fmt: skip
"""Arguments of an environment that are a session's own."""


_BEGUN = ("action_layer", "layer_options", "gait")
"""Of these, what a session begins with where a policy has them."""


def _fixed(env_args: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments that stay as they are while a page is open; not the robot, see there."""
    return {name: value for name, value in env_args.items() if name not in (*OWNED, "robot")}


def check_stage(env_id: str, policies: Mapping[str, Policy]) -> None:
    """Raise FbidError unless it is an environment of ours, and the policies are for it."""
    check_choices("environment", (env_id,), ENVIRONMENTS)
    for name, policy in policies.items():
        if policy.env_id != env_id:
            raise InvalidValueError(f"policy {name}", policy.env_id, f"a policy for {env_id}")


@dataclass(frozen=True)
class Stage:
    """Environment, robot and policies of a session."""

    env_id: str  # a registered environment
    arguments: Mapping[str, Any]
    """Further ones of the environment, for all policies; of those in `OWNED`, with what it begins.
    What they do not name is as the first policy learnt with."""
    policies: Mapping[str, Policy]  # those that can be chosen, by name
    first: str  # name of the one that acts first, or `NO_POLICY`
    robots: tuple[str, ...] = ()
    """Names of those that can be chosen; the first is there as a session begins."""
    chosen: str = ""  # name of the one that is there
    begun: Robot | None = None  # the first, once there is another

    @classmethod
    def of(
        cls,
        env_id: str,
        arguments: Mapping[str, Any],
        policies: Mapping[str, Policy],
        first: str = NO_POLICY,
    ) -> "Stage":
        """Check and build; FbidError for an environment that is none, or what does not fit it."""
        check_stage(env_id, policies)
        stage = cls(env_id, dict(arguments), dict(policies), first)
        return stage.among((stage.robot.name,))

    def among(self, robots: tuple[str, ...]) -> "Stage":
        """Return the stage with these robots to choose from, the first of which is there."""
        return replace(self, robots=robots, chosen=robots[0])

    @property
    def robot(self) -> Robot:
        """The robot, as it was loaded."""
        given = self.own["robot"]
        return given if isinstance(given, Robot) else several(given)[0]

    def with_robot(self, name: str) -> "Stage":
        """Return the stage with another of its robots; FbidError where that cannot be loaded."""
        if name == self.chosen:
            return self
        begun = self.begun or self.robot
        robot = begun if name == self.robots[0] else several(name)[0]
        arguments = {**self.arguments, "robot": robot}
        return replace(self, arguments=arguments, chosen=name, begun=begun)

    @cached_property
    def own(self) -> dict[str, Any]:
        """Arguments of the environment as the session begins."""
        trained = self.policies[self.first].env_args if self.first in self.policies else {}
        begun = {name: trained[name] for name in _BEGUN if name in trained}
        return {**ENVIRONMENTS[self.env_id], **_fixed(trained), **self.arguments, **begun}

    def unlike(self, policy: Policy) -> str:
        """Say in which arguments a policy's environment is not the one here; empty: in none.

        Those that the page sets and those that were given for all policies do not count, nor does
        the robot, of which there is one.
        """
        sides = self.own, {**ENVIRONMENTS[self.env_id], **_fixed(policy.env_args)}
        here, there = (
            {
                name: value
                for name, value in EnvConfig.of(_fixed(side)).as_dict().items()
                if name not in (*OWNED, *self.arguments, "robot", "sensors")
            }
            for side in sides
        )
        return in_words(differences(*(json.loads(json.dumps(side)) for side in (here, there))))

    @property
    def contact_limits(self) -> str:
        """With which the session begins."""
        return str((self.own.get("layer_options") or {}).get("contact_limits", "friction"))

    @property
    def sensors(self) -> tuple[str, ...]:
        """Kinds that can be chosen, the first is with which the session begins."""
        begun, known = self.own.get("sensors", PERFECT), (PERFECT, *PRESETS)
        word = begun if isinstance(begun, str) else OWN_SENSORS
        return (word, *(name for name in known if name != word))

    def sensors_of(self, word: str, noise: float) -> Any:
        """Return the argument of an environment for a kind of sensors, errors times `noise`."""
        if word == PERFECT:
            return word
        table: dict[str, Any] = dict(self.own["sensors"]) if word == OWN_SENSORS else {LIKE: word}
        return table | {"scale": noise * table.get("scale", 1.0)}

    def config(self, changes: Mapping[str, Any]) -> EnvConfig:
        """Return the configuration of an environment that goes on for a day.

        Pushes last as long as a policy step, and there is room for as many as the longest push
        takes; commands are one for all time.
        """
        plain = EnvConfig.of({**self.own, **changes})
        slots = round(MOST_PUSH_SECONDS * plain.rates().policy)
        endless = {
            "episode_seconds": _DAY,
            "push_force": (0.0, 0.0),
            "push_velocity": (0.0, 0.0),
            "push_duration": 1.0 / plain.rates().policy,
            "push_interval": (_DAY / slots, _DAY / slots),
            "randomisation": {"action_delay": (0.0, 0.1), "loop_delay": (0.0, LONGEST_LOOP)},
            "curriculum": False,
        }
        for name in ("command_interval", "height_interval"):
            if name in plain.as_dict():
                endless[name] = (_DAY, _DAY)
        return EnvConfig.of({**self.own, **changes, **endless})

    def task(self) -> Task:
        """Return the task."""
        config = self.config({})
        return config.make_task(config.load_robot())

    def options(self, layer: str, policy: Policy | None, contact_limits: str) -> dict[str, Any]:
        """Return the options of a layer: those a policy was trained with, and the limits."""
        begun = self.own if layer == self.own.get("action_layer", "joint_position") else {}
        given = policy.env_args if policy is not None else begun
        options = dict(given.get("layer_options") or {})
        if "contact_limits" in layer_options(layer):
            options["contact_limits"] = contact_limits
        return options
