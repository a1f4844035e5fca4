"""Action layers: policy action -> command -> joint torque, tick by tick."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.joint_acceleration import JointAcceleration
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.actions.layer import ActionLayer, Memory
from fbid_gym.actions.torque import Torque
from fbid_gym.errors import UnknownOptionError
from fbid_gym.robots import Robot

__all__ = ["LAYERS", "ActionLayer", "Memory", "layer_options", "make_layer"]

LAYERS: dict[str, Callable[..., ActionLayer]] = {
    "torque": Torque.of,
    "joint_position": JointPosition.of,
    "joint_acceleration": JointAcceleration.of,
    "base_acceleration": BaseAcceleration.of,
}
"""Name of a layer -> its constructor, called as `(robot, control_hz, **options)`."""


def layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer with their defaults."""
    parameters = inspect.signature(_layer(name)).parameters.values()
    return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


def make_layer(
    name: str, robot: Robot, control_hz: int, options: Mapping[str, Any] | None = None
) -> ActionLayer:
    """Build an action layer.

    Args:
        name: one of `LAYERS`.
        robot: whose joints it drives.
        control_hz: control ticks per second.
        options: arguments of the layer by name, see `layer_options`.

    Raises:
        FbidError: unknown layer, unknown option or invalid value; the message names the choices.
    """
    build, valid = _layer(name), layer_options(name)
    for option in options or {}:
        if option not in valid:
            raise UnknownOptionError(f"option of action layer {name!r}", option, valid or ["none"])
    return build(robot, control_hz, **(options or {}))


def _layer(name: str) -> Callable[..., ActionLayer]:
    if name not in LAYERS:
        raise UnknownOptionError("action layer", name, LAYERS)
    return LAYERS[name]
