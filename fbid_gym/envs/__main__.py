"""Describe environments and their arguments, from the code: `python -m fbid_gym.envs [ID]`.

With an id it prints the page of that environment, without one docs/arguments.md: every argument
with its default and its range.
"""

import argparse
import sys
from collections.abc import Mapping
from inspect import getdoc

from fbid_gym.actions import LAYERS, Additions
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import PARTS, BodyOptions, default_gains
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import MOST_STEPS, NUM_ENVS, NUM_THREADS
from fbid_gym.envs.overlays import RenderOptions
from fbid_gym.envs.page import code, meanings, option_table, page, sections, table, term_rows
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.estimation import Sensors, sensors
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Flag, Option, options_of
from fbid_gym.robots import load
from fbid_gym.robots.drives import MotorTable
from fbid_gym.runtime.config import Drawing, EnvConfig
from fbid_gym.runtime.randomisation import Randomisation
from fbid_gym.tasks import TASKS

_HEAD = """\
# Arguments

What `gym.make`, `gym.make_vec` and `fbid_gym.make_sb3` take, made by `python -m fbid_gym.envs`. The
ranges are wider than robots of 0.1 kg to 1 t need; what lies outside is refused with the name, the
value and the range. Numbers may be NumPy's. `Falling(1.7)` is 1.7 times the frequency at which the
robot falls over, sqrt(g / height of the centre of mass) / (2 pi). `None` is derived from robot and
task. Where robots walk to commands other values stand: [what each environment
sets](#what-each-environment-sets).
"""

_SETS = "These stand instead of the defaults; what `gym.make` is given goes before both."
_RANDOMISED = """\
With `--env-args '{"randomisation": {"mass": 0.2}}'` a training does:

```python
import gymnasium as gym

import fbid_gym

differences = {"mass": 0.2, "friction": (0.5, 1.2), "action_delay": (0.0, 0.02)}
env = gym.make("fbid_gym/QuadrupedWalk-v0", randomisation=differences)
```"""
_TERMS = """\
With `--env-args '{"reward_weights": {"torque": 0.0}}'` a training has other weights:

```python
import gymnasium as gym

import fbid_gym

weights, scales = {"torque": 0.0, "velocity": 0.6}, {"velocity": 0.1}
env = gym.make("fbid_gym/QuadrupedWalk-v0", reward_weights=weights, reward_scales=scales)
```"""
_KINDS = """\
Every layer has the same options whatever the task. Where a layer's option is `None`, the kind of
motion decides: one that is planned beforehand, standing among them, or an online gait (task
`walk`). Of the body and the feet, stiffness in omega^2 and damping in omega, the rate at which the
robot falls; a frequency stands for both, critically damped unless `damping_ratio` says otherwise,
or the option is the pair itself:"""
_SPARE = """\
On soles `moment_priority` is 1.5 (d / h)^2, here of `biped`, by contact points d apart and a centre
of mass h high. On a gait joints that neither feet nor body need are held like a foot in the air. Of
`footholds` the default is True on a gait, of `base_acceleration` and `com_wrench`, else False."""
_SENSORS = """\
The presets "good", "mems" and "raw", with the data sheets that their numbers are from, stand in
`fbid_gym/estimation/sensors.py`. With sensors that are not perfect the info of a step has the
estimate's errors, `estimate_...`. What robots lose by them: [Measured](measured.md)."""
_SB3 = """\
`gym.make_vec` also takes `autoreset_mode`, `make_sb3` takes `seed` (environment i starts from
seed + i)."""
_VECTOR = {
    "num_envs": Option("num_envs", 1, NUM_ENVS, False),
    "num_threads": Option("num_threads", 1, NUM_THREADS, False),
    "max_episode_steps": Option("max_episode_steps", None, MOST_STEPS, True),
    "stagger": Option("stagger", False, Flag(), False),
}


def settings() -> str:
    """Return a Markdown table of the arguments that ids stand for."""
    rows = []
    for env, arguments in ENVIRONMENTS.items():
        said = (f"`{name}={code(value)}`" for name, value in arguments.items())
        rows.append([f"`{env}`", ", ".join(said)])
    return table(["Environment", "Sets"], rows)


def terms() -> str:
    """Return a Markdown table of the terms of every reward."""
    tables = {id(kind.terms): kind.terms for kind in TASKS.values()}
    rows = []
    for own in tables.values():
        tasks = ", ".join(f"`{name}`" for name, kind in TASKS.items() if kind.terms is own)
        rows += [[tasks, *row] for row in term_rows(own)]
    return table(["Task", "Term", "Weight", "Scale", "Is"], rows)


def kinds() -> str:
    """Return a Markdown table of what a kind of motion makes of options that are None."""
    columns = [("go1", False), ("go1", True), ("biped", True)]
    of = [(load(robot), MotionKind(gait, 1.0)) for robot, gait in columns]
    gains = [default_gains(robot, kind)._asdict() for robot, kind in of]
    rows = {f"{x}_frequency": [f"{g[x]:g}, {g[f'{x}_damping']:g}" for g in gains] for x in PARTS}
    rows["velocity_gain"] = [f"{each['small_errors']:g}" for each in gains]
    rows["velocity_of"] = ["base" if each["of_base"] else "com" for each in gains]
    rows["moment_priority"] = [f"{BodyOptions().priority(*each):.3g}" for each in of]
    ramps = [ContactOptions().on(*each).contact_ramp for each in of]
    rows["contact_ramp"] = [f"{ramp:g} / omega" if ramp else "0" for ramp in ramps]
    listed = ([f"`{name}`", *values] for name, values in rows.items())
    return table(["Option", "Planned", "Gait, point feet", "Gait, soles"], listed)


def arguments_page() -> str:
    """Return docs/arguments.md."""
    parts = [_HEAD.rstrip()]

    def section(title: str, options: Mapping[str, Option], about: Mapping[str, str]) -> None:
        parts.extend([title, option_table(options, about)])

    own = options_of(EnvConfig)
    del own["task_options"]
    section("## Of every environment", own, meanings(EnvConfig))
    parts.extend(["## What each environment sets", _SETS, settings()])
    section("## Of `gym.make_vec` and `make_sb3`", _VECTOR, meanings(RobotVectorEnv))
    parts.append(_SB3)
    parts.append("## Of the tasks")
    for name, task in TASKS.items():
        section(f"### `{name}`", options_of(task.of), meanings(task.of))
    parts.extend(["## Terms of the reward: `reward_weights`, `reward_scales`"])
    parts.extend([sections(RobotEnv)["Rewards"], _TERMS, terms()])
    parts.append("## Of the action layers: `layer_options`")
    parts.extend([_KINDS, kinds(), _SPARE])
    shared = {"the body": BodyOptions, "contacts": ContactOptions}
    for name, layer in LAYERS.items():
        own, about = options_of(layer), []
        for what, group in shared.items():
            if options_of(group).keys() <= own.keys():
                own = {k: v for k, v in own.items() if k not in options_of(group)}
                about.append(what)
        section(f"### `{name}`", own, meanings(layer))
        if about:
            parts.append(f"And those about {' and '.join(about)}.")
    for what, group in shared.items():
        section(f"### About {what}", options_of(group), meanings(group))
    section("### Added to every layer", options_of(Additions.of), meanings(Additions.of))
    section("## `motors`", options_of(MotorTable), meanings(MotorTable))
    parts.append(getdoc(MotorTable) or "")
    section("## `randomisation`", options_of(Randomisation), meanings(Randomisation))
    parts.extend([getdoc(Randomisation) or "", _RANDOMISED])
    parts.append("## `sensors`")
    parts += [getdoc(sensors) or "", _SENSORS, option_table(options_of(Sensors), meanings(Sensors))]
    section("## How environments are drawn", options_of(Drawing), meanings(Drawing))
    section("### `render_options`", options_of(RenderOptions), meanings(RenderOptions))
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser("python -m fbid_gym.envs", description=__doc__)
    parser.add_argument("env_id", nargs="?", choices=list(ENVIRONMENTS), help="whose page to print")
    env_id = parser.parse_args().env_id
    sys.stdout.write(page(env_id) if env_id else arguments_page())
