"""A page for each environment, in Gymnasium's form: what its docstring says, what the code says."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import gymnasium as gym

from eval.site.docstrings import sections
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.__main__ import meanings, table
from fbid_gym.envs.config import EnvConfig
from fbid_gym.options import Option, options_of
from fbid_gym.policy import Shipped, shipped
from fbid_gym.tasks import TASKS
from fbid_gym.tasks.observation import entry_bounds, entry_names

_FIRST = "base_acceleration"
"""Whose clip is shown: of the layers the one that stands and walks in all of them."""

_LINKS = {
    "BalanceEnv": "BipedBalance.md",
    "TrackingEnv": "BipedSquat.md",
    "WalkingEnv": "QuadrupedWalk.md",
    "TerrainEnv": "QuadrupedTerrain.md",
    "the other environments of task `walk`": "QuadrupedWalk.md",
}
"""What docstrings call a described environment -> a page that has its description."""


class Scene(NamedTuple):
    """What the clip of an environment shows.

    Attributes:
        env_id: of the environment.
        shipped: the policy that acts; None where none is shipped, then the zero action does.
    """

    env_id: str
    shipped: Shipped | None

    @classmethod
    def of(cls, env_id: str) -> "Scene":
        """Choose who acts: of several shipped policies one through the layer of the others."""
        found = shipped_for(env_id)
        return cls(env_id, min(found, key=lambda each: each.layer != _FIRST, default=None))

    @property
    def env_args(self) -> dict[str, Any]:
        """Arguments of the environment."""
        return {"action_layer": _FIRST} if self.shipped is None else {**self.shipped.card.env_args}

    @property
    def file(self) -> str:
        """Name of the clip: another one for another policy, so that none shows what is gone."""
        acts = "zero" if self.shipped is None else self.shipped.card.sha256[:8]
        return f"{short(self.env_id)}-{acts}.mp4"

    @property
    def caption(self) -> str:
        """Who acts, in words."""
        if self.shipped is None:
            return f"The zero action of `{_FIRST}`, seed 0; no policy is shipped for it."
        return f"The policy `shipped:{self.shipped.name}`, seed 0."


def shipped_for(env_id: str) -> list[Shipped]:
    """Return the policies that are shipped for an environment."""
    return [each for each in shipped() if each.env == env_id]


def pages(clips: Collection[str]) -> dict[str, str]:
    """Return the pages, file name -> Markdown.

    Args:
        clips: names of the files of clips that there are.
    """
    found = {"index.md": _index()}
    for env_id in ENVIRONMENTS:
        found[f"{short(env_id)}.md"] = _page(env_id, Scene.of(env_id).file in clips)
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
        scene = Scene.of(env_id)
        parts.append(
            f'<video src="{scene.file}" controls loop muted playsinline width="480"></video>\n\n'
            f"{scene.caption}"
        )
    if policies := shipped_for(env_id):
        names = ", ".join(f"`shipped:{each.name}`" for each in policies)
        parts.append(f"Policies that come with the package ([cards](../policies.md)): {names}.")
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
        ["Observation", f"`Box({len(entry_names(task.observation_groups))},)`, float32"],
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
    groups = _task(env_id).observation_groups
    entries = zip(entry_names(groups), entry_bounds(groups), strict=True)
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
