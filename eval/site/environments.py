"""A page for each environment, in Gymnasium's form: what its docstring says, what the code says."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import gymnasium as gym

from eval.site.docstrings import sections
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.__main__ import meanings, table
from fbid_gym.envs.config import EnvConfig
from fbid_gym.options import Option, options_of
from fbid_gym.tasks import TASKS

_LINKS = {
    "BalanceEnv": "BipedBalance.md",
    "TrackingEnv": "BipedSquat.md",
    "WalkingEnv": "QuadrupedWalk.md",
    "TerrainEnv": "QuadrupedTerrain.md",
    "the other environments of task `walk`": "QuadrupedWalk.md",
}
"""What docstrings call a described environment -> a page that has its description."""


def pages(clips: Iterable[str]) -> dict[str, str]:
    """Return the pages, file name -> Markdown.

    Args:
        clips: names of the environments, without namespace and version, of which there is a clip.
    """
    found = {"index.md": _index()}
    for env_id in ENVIRONMENTS:
        found[f"{short(env_id)}.md"] = _page(env_id, short(env_id) in set(clips))
    return found


def short(env_id: str) -> str:
    """Return the name of an environment without namespace and version."""
    return env_id.removeprefix("fbid_gym/").removesuffix("-v0")


def _index() -> str:
    rows = []
    for env_id, arguments in ENVIRONMENTS.items():
        config = EnvConfig.of(arguments)
        robot = config.load_robot()
        first = sections(_described(env_id))[""].splitlines()[0]
        size = f"{robot.name}, {robot.mass:.3g} kg, {robot.num_joints} joints"
        rows.append([f"[{short(env_id)}]({short(env_id)}.md)", size, config.task, first])
    return (
        "# Environments\n\nEvery environment takes every action layer, and any robot with the feet "
        'for it: `gym.make("fbid_gym/BipedWalk-v0", robot="g1", action_layer="com_wrench")`. The '
        "tables of these pages are made of the code as the site is built.\n\n"
        + markdown_table(["Environment", "Robot", "Task", "In one line"], rows)
        + "\n\nEvery argument with its default and its range: [arguments](../arguments.md). "
        "What a policy's action becomes: [action layers](../layers/index.md).\n"
    )


def _page(env_id: str, clip: bool) -> str:
    said = sections(_described(env_id))
    name = short(env_id)
    added = {
        "Description": _facts(env_id),
        "Action Space": _actions(env_id),
        "Observation Space": _observation(env_id),
        "Arguments": _arguments(env_id),
    }
    parts = [f"# {name}", f"`{env_id}`. {said.pop('')}"]
    if clip:
        parts.append(
            f'<video src="{name}.mp4" controls loop muted playsinline width="480"></video>\n\n'
            "The zero action, seed 0."
        )
    for title, text in said.items():
        parts += [f"## {title}", _linked(text, name)]
        if title in added:
            parts.append(added[title])
    return "\n\n".join(parts) + "\n"


def _described(env_id: str) -> type:
    """The class whose docstring describes it."""
    found: type = gym.envs.registration.load_env_creator(str(gym.spec(env_id).entry_point))  # type: ignore[assignment]
    return found


@cache
def _config(env_id: str) -> EnvConfig:
    return EnvConfig.of(ENVIRONMENTS[env_id])


@cache
def _task(env_id: str) -> Any:
    config = _config(env_id)
    return config.make_task(config.load_robot())


def _facts(env_id: str) -> str:
    config, task = _config(env_id), _task(env_id)
    robot, rates, push = config.load_robot(), config.rates(), task.pushes.force
    kind = "flat" if robot.has_soles else "point"
    rows = [
        ["Robot", f"`{robot.name}`: {robot.mass:.3g} kg, {robot.num_joints} joints, "
                  f"{robot.num_feet} {kind} feet, {robot.num_points} contact points"],
        ["Rates", f"physics {rates.physics} Hz, action layer {rates.control} Hz, policy "
                  f"{rates.policy} Hz"],
        ["Episode", f"{config.episode_seconds:g} s, {round(config.episode_seconds * rates.policy)} "
                    "policy steps"],
        ["Pushes", f"{push[0]:.3g} to {push[1]:.3g} N" if push[1] > 0 else "none by default"],
        ["Ground", f"`{config.terrain}`"],
        ["Observation", f"`Box({len(task.observation_names)},)`, float32"],
    ]  # fmt: skip
    return markdown_table(["", f"`{env_id}`"], rows)


def _actions(env_id: str) -> str:
    rows, lists = [], []
    config, task = _config(env_id), _task(env_id)
    for layer in LAYERS:
        parts = replace(config, action_layer=layer).layer(config.load_robot(), task)
        names = [name for part in parts for name in part.action_names]
        rows.append([f"[`{layer}`](../layers/{layer}.md)", f"`Box(-1, 1, ({len(names)},))`"])
        lists.append(_details(f"`{layer}`: what each entry adds at 1", _numbered(names)))
    return "\n\n".join(
        ["### Of this environment", markdown_table(["Layer", "Action"], rows), *lists]
    )


def _observation(env_id: str) -> str:
    task = _task(env_id)
    entries = zip(task.observation_names, task.observation_bound, strict=True)
    rows = [[str(k), name, f"{bound:g}"] for k, (name, bound) in enumerate(entries)]
    listed = markdown_table(["Entry", "Observation", "Range"], rows)
    return _details(f"All {len(rows)} entries of this environment", listed)


def _arguments(env_id: str) -> str:
    config, own = _config(env_id), ENVIRONMENTS[env_id]
    options, about = options_of(EnvConfig), meanings(EnvConfig)
    del options["task_options"]
    kind = TASKS[config.task].of
    options |= options_of(kind)
    about |= meanings(kind)
    mine = {name: _own(option, own) for name, option in options.items()}
    listed = table(mine, about).replace("docs/", "")
    return "### Every argument, with the defaults of this environment\n\n" + listed


def _own(option: Option, own: dict[str, Any]) -> Option:
    return replace(option, default=own.get(option.name, option.default))


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _numbered(names: Sequence[str]) -> str:
    return markdown_table(["Entry", "Adds"], [[str(k), name] for k, name in enumerate(names)])


def _details(title: str, content: str) -> str:
    """A part that opens on request."""
    inside = "\n".join(f"    {line}".rstrip() for line in content.splitlines())
    return f'??? note "{title}"\n\n{inside}'


def _linked(text: str, page: str) -> str:
    """A docstring's text, with links to the environments that it names."""
    for words, target in _LINKS.items():
        if target != f"{page}.md":
            plain = words if " " in words else f"`{words}`"
            text = text.replace(plain, f"[{plain}]({target})")
    return text
