"""What can be set while a session runs: each with its range, checked before anything changes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from eval.play.stage import LONGEST_LOOP, MOST_PUSH_SECONDS, NO_POLICY, Stage
from fbid_gym.actions import LAYERS
from fbid_gym.actions.contact_options import CONTACT_LIMITS
from fbid_gym.envs.overlays import LABELS, RenderOptions
from fbid_gym.errors import UnknownOptionError
from fbid_gym.motions.gait.gait import gaits_of
from fbid_gym.options import Choice, Flag, Number, Whole
from fbid_gym.robots.terrain import TERRAINS
from fbid_gym.tasks import Walk
from fbid_gym.tasks.balance import Balance
from fbid_gym.tasks.tracking import Tracking
from fbid_gym.tasks.walk import MOST_LOWERED

Settings = dict[str, Any]
"""Name of a control -> its value."""

ALONE = "nobody"
LONGEST_DELAY = 0.1
"""s, of an action on its way."""
MOST_NOISE = 5.0
MOST_PUSH = 2.0
"""Weights of the robot."""
COMMAND, PUSH, WHO, TIME, WORLD, OVERLAYS = GROUPS = (
    "Command",
    "Push (or drag the robot)",
    "Who acts",
    "Time",
    "World",
    "Overlays",
)
"""Where controls stand on the page, in its order."""
ASIDE = (PUSH, TIME, OVERLAYS)
"""Groups whose controls, unless they reset, change nothing of a robot."""
_USUAL_PUSH, _USUAL_SECONDS = 0.4, 0.15  # weights, s
_SHOWN_FIRST = ("forces", "com")


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
        "push_force": Slider(
            PUSH,
            "force (N)",
            0.0,
            float(int(MOST_PUSH * robot.weight)),
            float(round(_USUAL_PUSH * robot.weight)),
        ),
        "push_seconds": Slider(PUSH, "time (s)", 0.02, MOST_PUSH_SECONDS, _USUAL_SECONDS),
        "paused": Switch(TIME, "paused", False),
        "speed": Slider(TIME, "speed (x real time)", 0.05, 1.0, 1.0),
        "get_up": Switch(TIME, "restart after a fall", True),
        "seed": Slider(TIME, "seed", 0, 2**31 - 1, 0, whole=True, resets=True),
        "robot": Menu(WHO, "robot", stage.robots, stage.robots[0], resets=True),
        "layer": Menu(WHO, "action layer", tuple(LAYERS), config.action_layer),
        "policy": Menu(WHO, "policy", (NO_POLICY, *stage.policies), stage.first),
        "contact_limits": Menu(WHO, "contact limits", CONTACT_LIMITS, stage.contact_limits),
        "beside": Menu(WHO, "second robot", (ALONE, *LAYERS, *stage.policies), ALONE),
        **_commands(stage),
        "friction": Slider(WORLD, "friction (x)", 0.1, 1.5, 1.0),
        "added_mass": Slider(WORLD, "added mass (kg)", 0.0, round(0.5 * robot.mass, 1), 0.0),
        "motors": Slider(WORLD, "motor torque (x)", 0.3, 1.2, 1.0),
        "action_delay": Slider(WORLD, "action delay (s)", 0.0, LONGEST_DELAY, 0.0),
        "loop_delay": Slider(WORLD, "loop delay (ms)", 0.0, 1e3 * LONGEST_LOOP, 0.0),
        "model_mass": Slider(WORLD, "model's masses (x)", 0.5, 1.5, 1.0),
        "sensors": Menu(WORLD, "sensors", stage.sensors, stage.sensors[0], resets=True),
        "noise": Slider(WORLD, "sensors' errors (x)", 0.0, MOST_NOISE, 1.0, resets=True),
        "terrain": Menu(WORLD, "terrain", TERRAINS, config.terrain, resets=True),
        "difficulty": Slider(WORLD, "difficulty", 0.0, 1.0, config.difficulty, resets=True),
        **{
            _switch(kind): Switch(OVERLAYS, label.partition(" (")[0], kind in _SHOWN_FIRST)
            for kind, label in LABELS.items()
        },
    }


def _switch(kind: str) -> str:
    """Name of the control of a kind of overlay."""
    return f"show_{kind}"


def shown(settings: Settings) -> RenderOptions:
    """Return which overlays are switched on."""
    return RenderOptions(**{kind: settings[_switch(kind)] for kind in LABELS})


def _commands(stage: Stage) -> dict[str, Control]:
    """What the task can be told."""
    task = stage.task()
    if task.kind.gait:
        task = cast(Walk, task)
        words = ("ahead", "forward (m/s)"), ("left", "left (m/s)"), ("turn", "turn (rad/s)")
        found: dict[str, Any] = {
            name: Slider(COMMAND, label, *_rounded(ends), 0.0)
            for (name, label), ends in zip(words, task.most, strict=True)
            if ends[0] <= 0.0 <= ends[1]
        }
        if ahead := found.get("ahead"):  # the page opens on a robot that walks
            found["ahead"] = replace(ahead, default=round(0.5 * ahead.most, 3))
        lowest, _ = _rounded((-MOST_LOWERED * float(task.body.stance.home_com[2]), 0.0))
        found["height"] = Slider(COMMAND, "height change (m)", lowest, 0.0, 0.0)
        names = gaits_of(task.body.robot)
        found["gait"] = Menu(COMMAND, "gait", names, task.derived["gait"], resets=True)
        return found
    if isinstance(task, Balance):
        least, most = _rounded(task.body.height(np.array(task.height_range)))
        return {"height": Slider(COMMAND, "height (m)", least, most, most)}
    if isinstance(task, Tracking) and task.speed_range[0] < task.speed_range[1]:
        least, most = _rounded(task.speed_range)
        middle = round(0.5 * (least + most), 3)
        return {"pace": Slider(COMMAND, "forward (m/s)", least, most, middle)}
    return {}


def _rounded(ends: Any) -> tuple[float, float]:
    """A range to the millimetre."""
    return round(float(ends[0]), 3), round(float(ends[1]), 3)


def rescaled(
    old: Mapping[str, Control], new: Mapping[str, Control], settings: Settings
) -> Settings:
    """Return settings for another robot, each number at its old share of what can be asked."""
    found = dict(settings)
    for name, control in new.items():
        was = old[name]
        if isinstance(control, Slider) and isinstance(was, Slider) and control != was:
            sizes = [max(abs(each.least), abs(each.most)) for each in (control, was)]
            share = settings[name] / sizes[1] if sizes[1] else 0.0
            found[name] = float(np.clip(round(share * sizes[0], 3), control.least, control.most))
    return found


def defaults(offered: Mapping[str, Control]) -> Settings:
    """Return the settings at the start."""
    return {name: control.default for name, control in offered.items()}


def checked(offered: Mapping[str, Control], name: Any, value: Any) -> Any:
    """Return a value that may be set, or raise one error that names it and the choices."""
    if not isinstance(name, str) or name not in offered:
        raise UnknownOptionError("setting", name, offered)
    return offered[name].checked(name, value)
