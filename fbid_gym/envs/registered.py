"""Entries in Gymnasium's registry, and the meaning of their arguments."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from fbid_gym.envs import ENTRY_POINT
from fbid_gym.options import Choice
from fbid_gym.runtime.config import AROUND, EnvConfig


def resolved_arguments(env_id: str, arguments: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what the arguments of a registered environment mean today, as JSON can hold it.

    They are as for `gym.make`; how an environment is drawn or stepped is left out. None where it is
    not one of ours.
    """
    if not env_id.startswith("fbid_gym/") or env_id not in gym.registry:
        return None
    given = {name: value for name, value in arguments.items() if name not in AROUND}
    return EnvConfig.of({**gym.registry[env_id].kwargs, **given}).resolved()


def registered(env_id: Any) -> EnvSpec:
    """Return what is registered under an id of this package, or of a user with its environments."""
    ours = {name: spec for name, spec in gym.registry.items() if spec.entry_point == ENTRY_POINT}
    return ours[Choice(ours, "environment id").check("env_id", env_id)]
