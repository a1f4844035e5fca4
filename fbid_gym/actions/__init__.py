"""Action layers: policy action -> command -> joint torque, tick by tick."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

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
from fbid_gym.checks import check_choices
from fbid_gym.options import (
    Choice,
    Option,
    check_call,
    check_own_name,
    grouped,
    options_of,
)
from fbid_gym.robots import Robot

__all__ = [
    "LAYERS",
    "WALKING_LAYERS",
    "ActionLayer",
    "Footholds",
    "layer_options",
    "make_layer",
    "make_walking_layer",
    "register_layer",
    "walking_layer_options",
    "walking_options",
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

_BUILT_IN = tuple(LAYERS)


def register_layer(
    name: str,
    of: Callable[..., ActionLayer],
    *,
    walking: Callable[..., ActionLayer] | None = None,
) -> None:
    """Make an action layer of your own known as `action_layer="name"`; a second time replaces it.

    Args:
        name: not that of a layer of this package.
        of: its constructor, called as `(robot, control_hz, **options)`. Its options are its
            keyword-only arguments, see `fbid_gym.options`.
        walking: the same on a gait, called as `(robot, control_hz, omega, **options)`; what it
            follows is a `GaitTarget`. None: not for the task `walk`.

    Raises:
        FbidError: another name or another constructor is expected.
    """
    check_own_name("action layer", name, _BUILT_IN)
    check_call(name, of, ("robot", "control_hz"))
    if walking is not None:
        check_call(name, walking, ("robot", "control_hz", "omega"))
    LAYERS[name] = of
    WALKING_LAYERS.pop(name, None)
    if walking is not None:
        WALKING_LAYERS[name] = walking


_STEERS = ("base_acceleration", "com_wrench")  # the footholds, by default


def walking_options(name: str) -> dict[str, Option]:
    """Return the options of a layer on a gait; what steers the gait every layer has."""
    steering = options_of(Footholds.of)
    steering["footholds"] = replace(steering["footholds"], default=name in _STEERS)
    return options_of(_layer(name, WALKING_LAYERS)) | steering


def walking_layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer on a gait, with their defaults."""
    return {option.name: option.default for option in walking_options(name).values()}


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
    given = dict(options or {})
    check_choices(f"option of action layer {name!r} on a gait", given, valid)
    steering = options_of(Footholds.of)
    steers = {option: given.pop(option, valid[option]) for option in steering}
    build = WALKING_LAYERS[name]
    layer = build(robot, control_hz, omega, **grouped(build, given))
    return layer, Footholds.of(robot, **steers)


def layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer with their defaults, those about contacts among them."""
    return {option.name: option.default for option in options_of(_layer(name)).values()}


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
    build, given = _layer(name), dict(options or {})
    check_choices(f"option of action layer {name!r}", given, layer_options(name))
    return build(robot, control_hz, **grouped(build, given))


def _layer(
    name: str, layers: Mapping[str, Callable[..., ActionLayer]] = LAYERS
) -> Callable[..., ActionLayer]:
    return layers[Choice(layers).check("action layer", name)]
