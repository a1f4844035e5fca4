"""Controls of a session: each with its range, checked before anything changes."""

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
from fbid_gym.options import Choice, Flag, Kind, Number, Whole
from fbid_gym.robots.terrain import TERRAINS
from fbid_gym.tasks import Walk
from fbid_gym.tasks.balance import Balance
from fbid_gym.tasks.tracking import Tracking
from fbid_gym.tasks.walk import MOST_LOWERED

Settings = dict[str, Any]  # name of a control -> its value

ALONE = "nobody"
LONGEST_DELAY = 0.1  # s, of an action on its way
MOST_NOISE = 5.0
MOST_PUSH = 2.0  # weights of the robot
GROUPS = ("Command", "Push (or drag the robot)", "Who acts", "Time", "World", "Overlays")
"""Where controls stand on the page, in its order."""
COMMAND, PUSH, WHO, TIME, WORLD, OVERLAYS = GROUPS
ASIDE = (PUSH, TIME, OVERLAYS)
"""Groups whose controls, unless they reset, change nothing of a robot."""
_USUAL_PUSH, _USUAL_SECONDS = 0.4, 0.15  # weights, s
_SHOWN_FIRST = ("forces", "com")


@dataclass(frozen=True)
class Control:
    """A control: a slider or a field for a number, a menu of words, or a switch."""

    group: str  # where it stands on the page
    label: str  # with its unit
    kind: Kind  # what values it takes
    default: Any  # its value at the start
    resets: bool = False  # whether a change starts the episode anew


def controls(stage: Stage) -> dict[str, Control]:
    """Return all that can be set on a stage, by name, in the order of the page."""
    config = stage.config({})
    robot = config.load_robot()
    force = Number(0.0, float(int(MOST_PUSH * robot.weight)))
    usual_push = float(round(_USUAL_PUSH * robot.weight))
    robots, players = Choice(stage.robots), Choice((ALONE, *LAYERS, *stage.policies))
    policies, sensors = Choice((NO_POLICY, *stage.policies)), Choice(stage.sensors)
    loads, seeds = Number(0.0, round(0.5 * robot.mass, 1)), Whole(0, 2**31 - 1)
    limits, share = Choice(CONTACT_LIMITS), Number(0.0, 1.0)
    return {
        "push_force": Control(PUSH, "force (N)", force, usual_push),
        "push_seconds": Control(PUSH, "time (s)", Number(0.02, MOST_PUSH_SECONDS), _USUAL_SECONDS),
        "paused": Control(TIME, "paused", Flag(), False),
        "speed": Control(TIME, "speed (x real time)", Number(0.05, 1.0), 1.0),
        "get_up": Control(TIME, "restart after a fall", Flag(), True),
        "seed": Control(TIME, "seed", seeds, 0, resets=True),
        "robot": Control(WHO, "robot", robots, stage.robots[0], resets=True),
        "layer": Control(WHO, "action layer", Choice(tuple(LAYERS)), config.action_layer),
        "policy": Control(WHO, "policy", policies, stage.first),
        "contact_limits": Control(WHO, "contact limits", limits, stage.contact_limits),
        "beside": Control(WHO, "second robot", players, ALONE),
        **_commands(stage),
        "friction": Control(WORLD, "friction (x)", Number(0.1, 1.5), 1.0),
        "added_mass": Control(WORLD, "added mass (kg)", loads, 0.0),
        "motors": Control(WORLD, "motor torque (x)", Number(0.3, 1.2), 1.0),
        "action_delay": Control(WORLD, "action delay (s)", Number(0.0, LONGEST_DELAY), 0.0),
        "loop_delay": Control(WORLD, "loop delay (ms)", Number(0.0, 1e3 * LONGEST_LOOP), 0.0),
        "model_mass": Control(WORLD, "model's masses (x)", Number(0.5, 1.5), 1.0),
        "sensors": Control(WORLD, "sensors", sensors, stage.sensors[0], resets=True),
        "noise": Control(WORLD, "sensors' errors (x)", Number(0.0, MOST_NOISE), 1.0, resets=True),
        "terrain": Control(WORLD, "terrain", Choice(TERRAINS), config.terrain, resets=True),
        "difficulty": Control(WORLD, "difficulty", share, config.difficulty, resets=True),
        **{
            f"show_{kind}": Control(
                OVERLAYS, label.partition(" (")[0], Flag(), kind in _SHOWN_FIRST
            )
            for kind, label in LABELS.items()
        },
    }


def shown(settings: Settings) -> RenderOptions:
    """Return which overlays are switched on."""
    return RenderOptions(**{kind: settings[f"show_{kind}"] for kind in LABELS})


def _commands(stage: Stage) -> dict[str, Control]:
    """Return the controls of the task's commands."""
    task = stage.task()
    if task.kind.gait:
        task = cast(Walk, task)
        words = ("ahead", "forward (m/s)"), ("left", "left (m/s)"), ("turn", "turn (rad/s)")
        found = {
            name: Control(COMMAND, label, _rounded(ends), 0.0)
            for (name, label), ends in zip(words, task.most, strict=True)
            if ends[0] <= 0.0 <= ends[1]
        }
        if "ahead" in found:  # the page opens on a robot that walks
            middle = round(0.5 * _rounded(task.most[0]).most, 3)
            found["ahead"] = replace(found["ahead"], default=middle)
        lowest = -MOST_LOWERED * float(task.body.stance.home_com[2])
        found["height"] = Control(COMMAND, "height change (m)", _rounded((lowest, 0.0)), 0.0)
        gaits = Choice(gaits_of(task.body.robot))
        found["gait"] = Control(COMMAND, "gait", gaits, task.derived["gait"], resets=True)
        return found
    if isinstance(task, Balance):
        height = _rounded(task.body.height(np.array(task.height_range)))
        return {"height": Control(COMMAND, "height (m)", height, height.most)}
    if isinstance(task, Tracking) and task.speed_range[0] < task.speed_range[1]:
        pace = _rounded(task.speed_range)
        middle = round(0.5 * (pace.least + pace.most), 3)
        return {"pace": Control(COMMAND, "forward (m/s)", pace, middle)}
    return {}


def _rounded(ends: Any) -> Number:
    """A range to the millimetre."""
    return Number(round(float(ends[0]), 3), round(float(ends[1]), 3))


def rescaled(
    old: Mapping[str, Control], new: Mapping[str, Control], settings: Settings
) -> Settings:
    """Return settings for another robot, each number at its old share of what can be asked."""
    found = dict(settings)
    for name, control in new.items():
        ends, was = control.kind, old[name].kind
        if isinstance(ends, Number) and isinstance(was, Number) and control != old[name]:
            sizes = [max(abs(each.least), abs(each.most)) for each in (ends, was)]
            share = settings[name] / sizes[1] if sizes[1] else 0.0
            found[name] = float(np.clip(round(share * sizes[0], 3), ends.least, ends.most))
    return found


def checked(offered: Mapping[str, Control], name: Any, value: Any) -> Any:
    """Return a value that may be set, or raise one error that names it and the choices."""
    if not isinstance(name, str) or name not in offered:
        raise UnknownOptionError("setting", name, offered)
    return offered[name].kind.check(name, value)
