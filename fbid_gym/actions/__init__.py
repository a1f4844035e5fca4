"""Action layers: policy action -> command -> joint torque, tick by tick."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.com_wrench import ComWrench
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.joint_acceleration import JointAcceleration
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.layer import ActionLayer
from fbid_gym.actions.torque import Torque
from fbid_gym.errors import UnknownOptionError
from fbid_gym.robots import Robot

__all__ = ["LAYERS", "ActionLayer", "layer_options", "make_layer"]

LAYERS: dict[str, Callable[..., ActionLayer]] = {
    "torque": Torque.of,
    "joint_position": JointPosition.of,
    "joint_position_feedforward": JointPositionFeedforward.of,
    "joint_acceleration": JointAcceleration.of,
    "base_acceleration": BaseAcceleration.of,
    "com_wrench": ComWrench.of,
}
"""Name of a layer -> its constructor, called as `(robot, control_hz, **options)`."""


def layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer with their defaults, those about contacts among them."""
    options = _own_options(name)
    contact = options.pop("contact", None)
    return options if contact is None else options | vars(contact)


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
    build, own, valid = _layer(name), _own_options(name), layer_options(name)
    given = dict(options or {})
    for option in given:
        if option not in valid:
            raise UnknownOptionError(f"option of action layer {name!r}", option, valid or ["none"])
    if "contact" in own:
        about_contacts = {key: given.pop(key) for key in list(given) if key not in own}
        given["contact"] = ContactOptions(**about_contacts)
    return build(robot, control_hz, **given)


def _own_options(name: str) -> dict[str, Any]:
    """The keyword arguments of a layer's constructor; `contact` holds those about contacts."""
    parameters = inspect.signature(_layer(name)).parameters.values()
    return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


def _layer(name: str) -> Callable[..., ActionLayer]:
    if name not in LAYERS:
        raise UnknownOptionError("action layer", name, LAYERS)
    return LAYERS[name]
