"""The page of an environment, in Gymnasium's form, and the tables that pages are made of.

Prose comes from the docstrings of `RobotEnv`, of the task's module and of the ground; names,
numbers and defaults from the environment itself.
"""

import ast
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass, replace
from inspect import getdoc, getmodule, getsource
from typing import Any

import gymnasium as gym
import numpy as np

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS, curriculum
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.estimation.errors import ERRORS
from fbid_gym.options import Option, options_of
from fbid_gym.robots import terrain
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks import TASKS
from fbid_gym.tasks.reward import Terms

_MAKE = (
    "```python\nimport gymnasium as gym, fbid_gym\n\n"
    'env = gym.make("{}", action_layer="base_acceleration")\n```'
)

INFO = {
    "height": "m, of the base above the contact points; on a gait above the ground",
    "height_command": "m, as commanded, or as motion or gait have it",
    "height_error": "m, the difference",
    "joint_error": "rad, root mean square over the joints",
    "speed": "m/s, of the base: along the feet's heading; on a gait horizontal",
    "speed_command": "m/s, likewise",
    "velocity_error": "m/s, of the base, horizontal",
    "turning_error": "rad/s, of the yaw rate",
    "distance": "m, horizontal way of the base in this episode",
    "cost_of_transport": "Energy of the joints, the integral of `power`, over weight times "
    "`distance`, of this episode; a way shorter than h counts as h",
    "foothold_error": "m, mean horizontal distance of the feet from their planned footholds as "
    "they came down in this episode; 0 before the first",
    "clipped_footholds": "Control ticks of this episode, summed over the feet, at which a foothold "
    "was out of reach and was moved into it",
    "torque_rms": "N·m, root mean square over joints and ticks of the step",
    "power": "W, mean over the ticks of the joints' summed absolute power",
    "slip": "m/s, mean speed of the points on the ground",
    "push": "N, world, on the last control tick",
    "push_velocity": "m/s, world, by which pushes changed the base's velocity in this step",
    "torque": "N·m, of each joint, on the last control tick",
    "contact_force": "N, world, of the ground on each contact point",
    "layer_saturation": "Share of the joints at their limit",
    "layer_residual": "Share of the weight by which the base wrench misses the commanded one; "
    "model-based layers tell it (without limits on contact forces only `com_wrench`)",
    "layer_underactuation": "Base directions that the assumed contacts cannot push; likewise",
    "layer_strength": "Share of their torques that the motors are taken to give; of model-based "
    "layers with limited contact forces",
    "layer_grip": "Share of the friction that is counted on, less after feet slipped; likewise",
    "termination": "0, 1 after a fall, 2 where the simulation diverged: places in "
    '`env.metadata["terminations"]`',
    "clipped_actions": "Share of the action's entries outside [-1, 1], which were clipped",
    **ERRORS,
    "terrain_kind": "Of the ground below the base: "
    + ", ".join(f"{k} {name}" for k, name in enumerate(terrain.LEVELLED[:-1])),
    "terrain_level": "With a curriculum: of the present episode, 0 to 10",
}
"""What the entries of `info` are, beside the terms of the reward."""


def page(env_id: str) -> str:
    """Return the page of one of `ENVIRONMENTS`, in Markdown. Links are those of the site."""
    env = gym.make(env_id, action_layer="base_acceleration").unwrapped
    assert isinstance(env, RobotEnv)
    config, task = env.config, env.batch.task
    written: list[Any] = [getmodule(type(task)), getmodule(TASKS[config.task].of)]
    written += [terrain, curriculum] if config.terrain in terrain.LEVELLED else []
    own, shared = [sections(each) for each in dict.fromkeys(written)], sections(RobotEnv)
    about = sections(written[1])[""]
    made = {
        "Description": _facts(env_id, env),
        "Action Space": _actions(env),
        "Observation Space": _observation(env),
        "Rewards": table(["Term", "Weight", "Scale", "Is"], term_rows(env.batch.reward_terms)),
        "Arguments": _arguments(env_id, config),
        "Info": _info(env),
    }
    env.close()
    parts = [f"# {short(env_id)}", f"`{env_id}`. {about}", _MAKE.format(env_id)]
    for title in list(shared)[1:]:
        texts = [each[title] for each in own if title in each]
        texts.insert(len(texts) if title in ("Description", "Starting State") else 0, shared[title])
        parts += [f"## {title}", *texts, *([made[title]] if title in made else [])]
    return "\n\n".join(parts) + "\n"


def short(env_id: str) -> str:
    """Return the name of an environment without namespace and version."""
    return env_id.removeprefix("fbid_gym/").removesuffix("-v0")


def sections(written: Any) -> dict[str, str]:
    """Return the sections of a docstring, name -> text; "" is what stands before the first."""
    parts = re.split(r"^## (.+)\n", getdoc(written) or "", flags=re.MULTILINE)
    return {name: text.strip() for name, text in zip(["", *parts[1::2]], parts[::2], strict=True)}


def _facts(env_id: str, env: RobotEnv) -> str:
    config, task = env.config, env.batch.task
    robot, rates, push = task.body.robot, config.rates(), task.pushes.force
    kind = "flat" if robot.has_soles else "point"
    shares = [force / robot.weight for force in push]
    pushes = "{:.3g} to {:.3g} N, {:.2g} to {:.2g} of the weight".format(*push, *shares)
    said = (f"{a:.3g} to {b:.3g} {unit}" for unit, (a, b) in task.commands.items())
    rows = [
        ["Robot", f"`{robot.name}`: {robot.mass:.3g} kg, {robot.num_joints} joints, "
                  f"{robot.num_feet} {kind} feet, {robot.num_points} contact points"],
        ["Rates", f"physics {rates.physics} Hz, action layer {rates.control} Hz, policy "
                  f"{rates.policy} Hz"],
        ["Episode", f"{config.episode_seconds:g} s, {round(config.episode_seconds * rates.policy)} "
                    "policy steps"],
        ["Pushes", pushes if push[1] > 0 else "none by default"],
        ["Commands", ", ".join(said) or "none"],
        ["Ground", f"`{config.terrain}`"],
        ["Lengths", f"H {task.body.size:.3g} m, h {task.body.stance.home_com[2]:.3g} m"],
    ]  # fmt: skip
    return table(["", f"`{env_id}`"], rows)


def _actions(env: RobotEnv) -> str:
    rows, lists = [], []
    for layer in LAYERS:
        parts = replace(env.config, action_layer=layer).layer(env.batch.robot, env.batch.task)
        names = [name for part in parts for name in part.action_names]
        rows.append([f"[`{layer}`](../layers/{layer}.md)", f"`Box(-1, 1, ({len(names)},))`"])
        entries = table(["Entry", "Adds"], ([str(k), name] for k, name in enumerate(names)))
        lists.append(_folded(f"{layer}: what each entry adds at 1", entries))
    return "\n\n".join([table(["Layer", "Action"], rows), *lists])


def _observation(env: RobotEnv) -> str:
    entries = zip(env.observation_names, env.batch.observation_bound, strict=True)
    rows = [[str(k), name, f"{bound:g}"] for k, (name, bound) in enumerate(entries)]
    return _folded(
        f"Box({len(rows)},): all entries", table(["Entry", "Observation", "Range"], rows)
    )


def _arguments(env_id: str, config: EnvConfig) -> str:
    own, means, kind = ENVIRONMENTS[env_id], config.resolved(), TASKS[config.task].of
    options = options_of(EnvConfig) | options_of(kind)
    del options["task_options"]
    here = {n: replace(each, default=own.get(n, each.default)) for n, each in options.items()}
    derived = {n: means[n] for n, each in here.items() if each.default is None}
    listed = option_table(here, meanings(EnvConfig) | meanings(kind), derived)
    return "With the defaults of this environment:\n\n" + listed.replace("docs/", "")


def _info(env: RobotEnv) -> str:
    env.reset(seed=0)
    *_, info = env.step(np.zeros(len(env.action_names)))
    terms = {name: "Term of the reward" for name in info if name.startswith("reward_")}
    rows = [[f"`{name}`", str(np.shape(info[name]) or ""), (INFO | terms)[name]] for name in info]
    listed = table(["Key", "Shape", "Meaning"], rows)
    return f"`step` returns, here of `base_acceleration`:\n\n{listed}"


def _folded(title: str, content: str) -> str:
    """A part that opens on request."""
    return f'<details markdown="1"><summary>{title}</summary>\n\n{content}\n\n</details>'


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in [header, ["---"] * len(header), *rows])


def term_rows(terms: Terms) -> list[list[str]]:
    """Return a row for each term of a reward: name, weight, scale, and what it is."""
    return [
        [
            f"`{name}`",
            f"{term.weight:g}",
            "" if term.scale is None else f"{term.scale:g} {term.unit}".strip(),
            getdoc(term.function) or "",
        ]
        for name, term in terms.items()
    ]


def option_table(
    options: Mapping[str, Option],
    about: Mapping[str, str],
    derived: Mapping[str, Any] | None = None,
) -> str:
    """Return a table of options, with what each means (`about`), and what None is here."""
    rows = []
    for name, option in options.items():
        takes = option.kind.words if option.kind is not None else "see its meaning"
        default = f"`{code(option.default)}`".replace("times=", "")
        here = (derived or {}).get(name)
        if here is not None and not isinstance(here, dict):
            default += f", here `{code(_rounded(here))}`"
        rows.append([f"`{name}`", default, takes, about.get(name, "").replace("|", r"\|")])
    return table(["Option", "Default", "Takes", "Meaning"], rows) if rows else "None of its own."


def _rounded(value: Any) -> Any:
    """To three digits: numbers, and those of pairs."""
    if isinstance(value, list):
        return tuple(map(_rounded, value))
    return float(f"{value:.3g}") if isinstance(value, float) else value


def meanings(build: Callable[..., Any]) -> dict[str, str]:
    """Return what options mean: of a constructor's docstring, or of a dataclass's fields."""
    found: dict[str, str] = {}
    if is_dataclass(build):
        body = ast.parse(textwrap.dedent(getsource(build))).body[0]
        assert isinstance(body, ast.ClassDef)
        for field, said in zip(body.body[:-1], body.body[1:], strict=True):
            if isinstance(field, ast.AnnAssign) and isinstance(said, ast.Expr):
                assert isinstance(field.target, ast.Name) and isinstance(said.value, ast.Constant)
                found[field.target.id] = " ".join(str(said.value.value).split())
        return found
    _, _, args = (getdoc(build) or "").partition("Args:\n")
    for line in args.split("\n\n")[0].splitlines():
        if started := re.match(r"    (\w+): (.*)", line):
            name = started[1]
            found[name] = started[2]
        elif found:
            found[name] += f" {line.strip()}"
    return found


def code(value: Any) -> str:
    """Return a value as pages show it."""
    return repr(value).replace("'", '"')
