"""Action layers: policy action -> command -> joint torque, tick by tick."""

from collections.abc import Callable, Mapping
from typing import Any

from fbid_gym.actions.additions import Additions
from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.com_wrench import ComWrench
from fbid_gym.actions.joint_acceleration import JointAcceleration
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.layer import ActionLayer
from fbid_gym.actions.task_space_position import TaskSpacePosition
from fbid_gym.actions.torque import Torque
from fbid_gym.checks import check_choices
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Choice, Option, check_call, check_own_name, grouped, options_of
from fbid_gym.robots import Robot

__all__ = [
    "LAYERS",
    "ActionLayer",
    "Additions",
    "layer_choices",
    "layer_options",
    "make_layer",
    "register_layer",
]

LAYERS: dict[str, Callable[..., ActionLayer]] = {
    "torque": Torque.of,
    "joint_position": JointPosition.of,
    "task_space_position": TaskSpacePosition.of,
    "joint_position_feedforward": JointPositionFeedforward.of,
    "joint_acceleration": JointAcceleration.of,
    "base_acceleration": BaseAcceleration.of,
    "com_wrench": ComWrench.of,
}
"""Name of a layer -> its constructor, called as `(robot, control_hz, kind, **options)`; `kind` is
what its task asks for, see `MotionKind`."""

_BUILT_IN = tuple(LAYERS)
_STEERS = ("base_acceleration", "com_wrench")  # the footholds of a gait, by default


def register_layer(name: str, of: Callable[..., ActionLayer]) -> None:
    """Make an action layer of your own known as `action_layer="name"`; a second time replaces it.

    Args:
        name: not that of a layer of this package.
        of: its constructor, called as `(robot, control_hz, kind, **options)`. Its options are its
            keyword-only arguments, see `fbid_gym.options`.

    Raises:
        FbidError: another name or another constructor is expected.
    """
    check_own_name("action layer", name, _BUILT_IN)
    check_call(name, of, ("robot", "control_hz", "kind"))
    LAYERS[name] = of


def layer_choices(name: str) -> dict[str, Option]:
    """Return the options of a layer: its own, those of contacts, and what is added to any."""
    return options_of(_layer(name)) | options_of(Additions.of)


def layer_options(name: str) -> dict[str, Any]:
    """Return the options of a layer with their defaults."""
    return {option.name: option.default for option in layer_choices(name).values()}


def make_layer(
    name: str,
    robot: Robot,
    control_hz: int,
    kind: MotionKind,
    options: Mapping[str, Any] | None = None,
) -> tuple[ActionLayer, Additions]:
    """Build an action layer, one of `LAYERS`, and what of an action is added to the layer's.

    It drives a robot's joints with `control_hz` ticks per second, for the kind of motion that its
    task asks for. The options are its arguments by name, see `layer_options`.

    Raises:
        FbidError: unknown layer, unknown option or invalid value, or one that a motion of this kind
            cannot honour; the message names the choices.
    """
    build, given = _layer(name), dict(options or {})
    check_choices(f"option of action layer {name!r}", given, layer_options(name))
    added = {option: given.pop(option) for option in options_of(Additions.of) if option in given}
    if added.get("footholds") is None:
        added["footholds"] = kind.gait and name in _STEERS
    layer = build(robot, control_hz, kind, **grouped(build, given))
    return layer, Additions.of(robot, kind, **added)


def _layer(name: str) -> Callable[..., ActionLayer]:
    return LAYERS[Choice(LAYERS).check("action layer", name)]
