"""What can be set while a session runs: each with its range, checked before anything changes."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from eval.play.stage import Stage
from fbid_gym.actions import LAYERS
from fbid_gym.actions.contact_options import CONTACT_LIMITS
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.options import Choice, Flag, Number, Whole
from fbid_gym.robots.terrain import TERRAINS
from fbid_gym.tasks import Walk
from fbid_gym.tasks.balance import Balance
from fbid_gym.tasks.tracking import Tracking

Settings = dict[str, Any]
"""Name of a control -> its value."""

NO_POLICY, ALONE = "zero action", "nobody"
LONGEST_DELAY = 0.1
"""s, of an action on its way."""
_LONGEST_TEXT = 10_000


@dataclass(frozen=True)
class Slider:
    """A number in a range.

    Attributes:
        group: where it stands on the page.
        label: with its unit.
        least: smallest value.
        most: largest value.
        default: at the start.
        whole: whether only whole numbers will do.
        resets: whether a change starts the episode anew.
    """

    group: str
    label: str
    least: float
    most: float
    default: float
    whole: bool = False
    resets: bool = False

    def checked(self, name: str, value: Any) -> float | int:
        """Return the value, or raise one error that names it and the range."""
        if self.whole:
            return Whole(int(self.least), int(self.most)).check(name, value)
        return Number(self.least, self.most).check(name, value)


@dataclass(frozen=True)
class Menu:
    """One of a few words; attributes as of `Slider`."""

    group: str
    label: str
    choices: tuple[str, ...]
    default: str
    resets: bool = False

    def checked(self, name: str, value: Any) -> str:
        """Return the value, or raise one error that names it and the choices."""
        return Choice(self.choices).check(name, value)


@dataclass(frozen=True)
class Switch:
    """Yes or no; attributes as of `Slider`."""

    group: str
    label: str
    default: bool
    resets: bool = False

    def checked(self, name: str, value: Any) -> bool:
        """Return the value, or raise one error that names it."""
        return Flag().check(name, value)


Control = Slider | Menu | Switch


def controls(stage: Stage) -> dict[str, Control]:
    """Return all that can be set on a stage, by name, in the order of the page."""
    config = stage.config({})
    robot = config.load_robot()
    return {
        "paused": Switch("Time", "paused", False),
        "speed": Slider("Time", "speed, share of real time", 0.05, 1.0, 1.0),
        "get_up": Switch("Time", "start anew 1.5 s after a fall", True),
        "seed": Slider("Time", "seed of the start", 0, 2**31 - 1, 0, whole=True, resets=True),
        "layer": Menu("Who acts", "action layer", tuple(LAYERS), config.action_layer),
        "policy": Menu("Who acts", "policy", (NO_POLICY, *stage.policies), stage.first),
        "contact_limits": Menu("Who acts", "contact limits", CONTACT_LIMITS, stage.contact_limits),
        "beside": Menu("Who acts", "beside it", (ALONE, *LAYERS, *stage.policies), ALONE),
        **_commands(stage),
        "friction": Slider("World", "friction of the ground, factor", 0.1, 1.5, 1.0),
        "added_mass": Slider("World", "mass added to the trunk (kg)", 0.0, 0.5 * robot.mass, 0.0),
        "motors": Slider("World", "strength of the motors, factor", 0.3, 1.2, 1.0),
        "action_delay": Slider("World", "delay of actions (s)", 0.0, LONGEST_DELAY, 0.0),
        "model_mass": Slider("World", "masses in the law's model, factor", 0.5, 1.5, 1.0),
        "terrain": Menu("World", "terrain", TERRAINS, config.terrain, resets=True),
        "difficulty": Slider(
            "World", "difficulty of the terrain", 0.0, 1.0, config.difficulty, resets=True
        ),
    }


def _commands(stage: Stage) -> dict[str, Control]:
    """What the task can be told."""
    task = stage.task()
    if isinstance(task, Walk):
        words = ("ahead", "forward (m/s)"), ("left", "to the left (m/s)"), ("turn", "turn (rad/s)")
        found: dict[str, Control] = {
            name: Slider("Command", label, *_rounded(ends), 0.0)
            for (name, label), ends in zip(words, task.most, strict=True)
            if ends[0] <= 0.0 <= ends[1]
        }
        if len(task.body.robot.feet) == 4:
            names = tuple(PATTERNS)
            found["gait"] = Menu("Command", "gait", names, task.gait_name, resets=True)
        return found
    if isinstance(task, Balance):
        least, most = _rounded(task.body.home_height * np.array(task.height_range))
        return {"height": Slider("Command", "height (m), a policy's to follow", least, most, most)}
    if isinstance(task, Tracking) and task.speed_range[0] < task.speed_range[1]:
        least, most = _rounded(task.speed_range)
        middle = round(0.5 * (least + most), 3)
        return {"pace": Slider("Command", "forward (m/s)", least, most, middle)}
    return {}


def _rounded(ends: Any) -> tuple[float, float]:
    """A range to the millimetre."""
    return round(float(ends[0]), 3), round(float(ends[1]), 3)


def defaults(offered: Mapping[str, Control]) -> Settings:
    """Return the settings at the start."""
    return {name: control.default for name, control in offered.items()}


def checked(offered: Mapping[str, Control], name: Any, value: Any) -> Any:
    """Return a value that may be set, or raise one error that names it and the choices."""
    if not isinstance(name, str) or name not in offered:
        raise UnknownOptionError("setting", name, offered)
    return offered[name].checked(name, value)


def to_text(offered: Mapping[str, Control], settings: Settings) -> str:
    """Return what differs from the start as one line of JSON, to be sent to somebody."""
    return json.dumps(
        {name: value for name, value in settings.items() if value != offered[name].default}
    )


def from_text(offered: Mapping[str, Control], text: Any) -> Settings:
    """Read what `to_text` wrote; what it does not name is as at the start.

    Raises:
        FbidError: not such a text, or a value that may not be set.
    """
    expected = "settings as the page shows them, a line of JSON"
    if not isinstance(text, str) or len(text) > _LONGEST_TEXT:
        raise InvalidValueError("settings", str(text)[:40], expected)
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        raise InvalidValueError("settings", text[:80], expected) from None
    if not isinstance(given, dict):
        raise InvalidValueError("settings", text[:80], expected)
    return defaults(offered) | {
        name: checked(offered, name, value) for name, value in given.items()
    }
