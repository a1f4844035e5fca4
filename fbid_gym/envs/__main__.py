"""Every argument of the environments with its default and its range: `python -m fbid_gym.envs`.

It prints docs/arguments.md, made of what the code says.
"""

import argparse
import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import is_dataclass
from typing import Any

from fbid_gym.actions import LAYERS, Footholds
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import BodyOptions, default_gains, default_moment_priority
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import NUM_ENVS, NUM_THREADS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.overlays import RenderOptions
from fbid_gym.envs.randomisation import Randomisation
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Option, options_of
from fbid_gym.robots import load
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
What differs is drawn anew for each robot and each episode; nothing does by default. The
controller's model starts from the file and does not see how the robot differs, and neither does the
policy. Observations have no noise. With `--env-args '{"randomisation": {"mass": 0.2}}'` a training
does:

```python
import gymnasium as gym

import fbid_gym

differences = {"mass": 0.2, "friction": (0.5, 1.2), "action_delay": (0.0, 0.02)}
env = gym.make("fbid_gym/QuadrupedWalk-v0", randomisation=differences)
```"""
_TERMS = """\
A reward is the sum of its terms, each from 0 to its weight. A scale is an error at which a term has
fallen to 1/e; g is gravity, H the height of hips or centre of mass above the feet, whichever is
higher, h that of the centre of mass. With `--env-args '{"reward_weights": {"torque": 0.0}}'` a
training has other weights:

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
On a gait joints that neither feet nor body need are held as firmly as a foot in the air. Of
`footholds` the default is True on a gait, of `base_acceleration` and `com_wrench`, else False."""
_SB3 = """\
`make_sb3` also takes `seed` (environment i starts from seed + i) and `stagger` (False; truncates
first episodes, evenly spread, so that robots do not end together, as trainings of this repository
do)."""
_VECTOR = {
    "num_envs": Option("num_envs", 1, NUM_ENVS, False),
    "num_threads": Option("num_threads", 1, NUM_THREADS, False),
}
_OF_VECTOR = {"num_envs": "Number of environments.", "num_threads": "Threads that step them."}


def meanings(build: Callable[..., Any]) -> dict[str, str]:
    """Return what options mean: of a constructor's docstring, or of a dataclass's fields."""
    if is_dataclass(build):
        return dict(_of_fields(build))
    found: dict[str, str] = {}
    _, _, args = (inspect.getdoc(build) or "").partition("Args:\n")
    for line in args.split("\n\n")[0].splitlines():
        if started := re.match(r"    (\w+): (.*)", line):
            name = started[1]
            found[name] = started[2]
        elif found:
            found[name] += f" {line.strip()}"
    return found


def _of_fields(kind: type) -> Iterable[tuple[str, str]]:
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    assert isinstance(body, ast.ClassDef)
    for field, said in zip(body.body[:-1], body.body[1:], strict=True):
        if isinstance(field, ast.AnnAssign) and isinstance(said, ast.Expr):
            assert isinstance(field.target, ast.Name) and isinstance(said.value, ast.Constant)
            yield field.target.id, " ".join(str(said.value.value).split())


def table(options: Mapping[str, Option], about: Mapping[str, str]) -> str:
    """Return a Markdown table of options."""
    lines = ["| Option | Default | Takes | Meaning |", "| --- | --- | --- | --- |"]
    for name, option in options.items():
        takes = option.kind.words if option.kind is not None else "see its meaning"
        said = about.get(name, "").replace("|", r"\|")
        default = _code(option.default).replace("times=", "")
        lines.append(f"| `{name}` | `{default}` | {takes} | {said} |")
    return "\n".join(lines) if options else "None of its own."


def settings() -> str:
    """Return a Markdown table of the arguments that ids stand for."""
    lines = ["| Environment | Sets |", "| --- | --- |"]
    for env, arguments in ENVIRONMENTS.items():
        said = (f"`{name}={_code(value)}`" for name, value in arguments.items())
        lines.append(f"| `{env}` | {', '.join(said)} |")
    return "\n".join(lines)


def terms() -> str:
    """Return a Markdown table of the terms of every reward."""
    lines = ["| Task | Term | Weight | Scale | Rewards |", "| --- | --- | --- | --- | --- |"]
    tables = {id(kind.terms): kind.terms for kind in TASKS.values()}
    for own in tables.values():
        tasks = ", ".join(f"`{name}`" for name, kind in TASKS.items() if kind.terms is own)
        for name, term in own.items():
            said = inspect.getdoc(term.function) or ""
            scale = f"{term.scale:g} {term.unit}".strip()
            lines.append(f"| {tasks} | `{name}` | {term.weight:g} | {scale} | {said} |")
    return "\n".join(lines)


def kinds() -> str:
    """Return a Markdown table of what a kind of motion makes of options that are None."""
    columns = [("go1", False), ("go1", True), ("biped", True)]
    of = [(load(robot), MotionKind(gait, 1.0)) for robot, gait in columns]
    gains = [default_gains(robot, kind)._asdict() for robot, kind in of]
    rows = {
        f"{part}_frequency": [f"{each[part]:g}, {each[f'{part}_damping']:g}" for each in gains]
        for part in ("balance", "height", "rotation", "posture", "swing")
    }
    rows["moment_priority"] = [f"{default_moment_priority(*each):.3g}" for each in of]
    ramps = [ContactOptions().on(*each).contact_ramp for each in of]
    rows["contact_ramp"] = [f"{ramp:g} / omega" if ramp else "0" for ramp in ramps]
    lines = ["| Option | Planned | Gait, point feet | Gait, soles |", "| --- | --- | --- | --- |"]
    lines += [f"| `{name}` | {' | '.join(values)} |" for name, values in rows.items()]
    return "\n".join(lines)


def page() -> str:
    """Return docs/arguments.md."""
    parts = [_HEAD.rstrip()]

    def section(title: str, options: Mapping[str, Option], about: Mapping[str, str]) -> None:
        parts.extend([title, table(options, about)])

    own = options_of(EnvConfig)
    del own["task_options"]
    section("## Of every environment", own, meanings(EnvConfig))
    parts.extend(["## What each environment sets", _SETS, settings()])
    section("## Of `gym.make_vec` and `make_sb3`", _VECTOR, _OF_VECTOR)
    parts.append(_SB3)
    parts.append("## Of the tasks")
    for name, task in TASKS.items():
        section(f"### `{name}`", options_of(task.of), meanings(task.of))
    parts.extend(["## Terms of the reward: `reward_weights`, `reward_scales`", _TERMS])
    parts.append(terms())
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
    section("### Steering a gait, of every layer", options_of(Footholds.of), meanings(Footholds.of))
    section("## `randomisation`", options_of(Randomisation), meanings(Randomisation))
    parts.append(_RANDOMISED)
    section("## `render_options`", options_of(RenderOptions), meanings(RenderOptions))
    return "\n\n".join(parts) + "\n"


def _code(value: Any) -> str:
    return repr(value).replace("'", '"')


if __name__ == "__main__":
    argparse.ArgumentParser("python -m fbid_gym.envs", description=__doc__).parse_args()
    sys.stdout.write(page())
