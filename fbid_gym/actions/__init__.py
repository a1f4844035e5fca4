"""Action layers: policy action -> command -> joint torque, tick by tick."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.com_wrench import ComWrench
from fbid_gym.actions.footholds import Footholds
from fbid_gym.actions.joint_acceleration import JointAcceleration
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.layer import ActionLayer
from fbid_gym.actions.torque import Torque
from fbid_gym.actions.walking_base import walking_base_acceleration, walking_com_wrench
from fbid_gym.actions.walking_joints import (
    walking_feedforward,
    walking_joint_acceleration,
    walking_joint_position,
    walking_torque,
)
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.robots import Robot

__all__ = [
    "LAYERS",
    "WALKING_LAYERS",
    "ActionLayer",
    "Footholds",
    "layer_options",
    "make_layer",
    "make_walking_layer",
    "walking_layer_options",
]

LAYERS: dict[str, Callable[..., ActionLayer]] = {
    "torque": Torque.of,
    "joint_position": JointPosition.of,
    "joint_position_feedforward": JointPositionFeedforward.of,
    "joint_acceleration": JointAcceleration.of,
    "base_acceleration": BaseAcceleration.of,
    "com_wrench": ComWrench.of,
}
"""Name of a layer -> its constructor, called as `(robot, control_hz, **options)`."""


WALKING_LAYERS: dict[str, Callable[..., ActionLayer]] = {
    "torque": walking_torque,
    "joint_position": walking_joint_position,
    "joint_position_feedforward": walking_feedforward,
    "joint_acceleration": walking_joint_acceleration,
    "base_acceleration": walking_base_acceleration,
    "com_wrench": walking_com_wrench,
}
"""The same layers on a gait, called as `(robot, control_hz, omega, **options)`."""

STEERING = ("footholds", "step_rate")
"""Options of every layer on a gait: whether the action moves the next footholds, and whether it
changes the gait's frequency."""

_STEERS = ("base_acceleration", "com_wrench")  # by default


def walking_layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer on a gait, with their defaults."""
    own = _flat(_own_options(_layer(name, WALKING_LAYERS)))
    return own | {"footholds": name in _STEERS, "step_rate": False}


def make_walking_layer(
    name: str,
    robot: Robot,
    control_hz: int,
    omega: float,
    options: Mapping[str, Any] | None = None,
) -> tuple[ActionLayer, Footholds]:
    """Build an action layer on a gait, and what of an action steers that.

    Args:
        name: one of `WALKING_LAYERS`.
        robot: whose joints it drives.
        control_hz: control ticks per second.
        omega: 1/s, rate at which the robot falls, see `Gait`.
        options: arguments of the layer by name, see `walking_layer_options`.

    Raises:
        FbidError: unknown layer, unknown option or invalid value; the message names the choices.
    """
    valid = walking_layer_options(name)
    for option in options or {}:
        if option not in valid:
            raise UnknownOptionError(f"option of action layer {name!r} on a gait", option, valid)
    given = valid | dict(options or {})
    steers = {option: given.pop(option) for option in STEERING}
    for option, value in steers.items():
        if not isinstance(value, bool | np.bool_):
            raise InvalidValueError(option, value, "True or False")
    build = WALKING_LAYERS[name]
    layer = build(robot, control_hz, omega, **_grouped(_own_options(build), given))
    return layer, Footholds.of(robot, **steers)


def layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer with their defaults, those about contacts among them."""
    return _flat(_own_options(_layer(name)))


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
    given = dict(options or {})
    for option in given:
        if option not in valid:
            raise UnknownOptionError(f"option of action layer {name!r}", option, valid or ["none"])
    return build(robot, control_hz, **_grouped(_own_options(build), given))


def _own_options(build: Callable[..., ActionLayer]) -> dict[str, Any]:
    """The keyword arguments of a layer's constructor; `contact` holds those about contacts."""
    parameters = inspect.signature(build).parameters.values()
    return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


def _flat(own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a constructor with keyword arguments `own`, one by one."""
    options = dict(own)
    contact = options.pop("contact", None)
    return options if contact is None else options | vars(contact)


def _grouped(own: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return options one by one as such a constructor takes them."""
    if "contact" not in own:
        return dict(given)
    about_contacts = {name: value for name, value in given.items() if name not in own}
    rest = {name: value for name, value in given.items() if name in own}
    return rest | {"contact": replace(own["contact"], **about_contacts)}


def _layer(
    name: str, layers: Mapping[str, Callable[..., ActionLayer]] = LAYERS
) -> Callable[..., ActionLayer]:
    if name not in layers:
        raise UnknownOptionError("action layer", name, layers)
    return layers[name]
