"""A page for each environment: the package's own, with a clip and the policies for it."""

import hashlib
from collections.abc import Collection
from functools import cache
from typing import Any, NamedTuple

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.page import page, short, table
from fbid_gym.policy import Shipped, shipped
from fbid_gym.runtime.config import EnvConfig

_FIRST = "base_acceleration"
"""Whose clip is shown: of the layers the one that stands and walks in all of them."""

described = cache(page)  # id of an environment -> the package's page of it


class EnvironmentClip(NamedTuple):
    """The clip of an environment."""

    env_id: str
    shipped: Shipped | None
    """The policy that acts; None where none is shipped, then the zero action does."""

    @classmethod
    def of(cls, env_id: str) -> "EnvironmentClip":
        """Choose who acts: of several shipped policies one through the layer of the others."""
        found = shipped_for(env_id)
        return cls(env_id, min(found, key=lambda each: each.layer != _FIRST, default=None))

    @property
    def env_args(self) -> dict[str, Any]:
        """Arguments of the environment."""
        its = {"action_layer": _FIRST} if self.shipped is None else self.shipped.policy.env_args
        return dict(its)

    @property
    def file(self) -> str:
        """Name of the clip: another one for another policy, so that none shows what is gone."""
        acts = "zero"
        if self.shipped is not None:
            acts = hashlib.sha256(self.shipped.path.read_bytes()).hexdigest()[:8]
        return f"{short(self.env_id)}-{acts}.mp4"

    @property
    def caption(self) -> str:
        """The controller, in words."""
        if self.shipped is None:
            acts = f"The zero action of `{_FIRST}`; no policy is shipped for this environment."
        else:
            acts = f"The policy `shipped:{self.shipped.name}`."
        return f"{acts} Commands and pushes (arrows) are those of the environment, seed 0."


def shipped_for(env_id: str) -> list[Shipped]:
    """Return the policies that are shipped for an environment."""
    return [each for each in shipped() if each.policy.env_id == env_id]


def pages(clips: Collection[str]) -> dict[str, str]:
    """Return the pages, file name -> Markdown, with those clips that there are."""
    found = {"index.md": _index()}
    for env_id in ENVIRONMENTS:
        found[f"{short(env_id)}.md"] = _page(env_id, EnvironmentClip.of(env_id).file in clips)
    return found


def _index() -> str:
    rows = []
    for env_id, arguments in ENVIRONMENTS.items():
        config = EnvConfig.of(arguments)
        robot = config.load_robot()
        size = f"{robot.name}, {robot.mass:.3g} kg, {robot.num_joints} joints"
        about = described(env_id).split("\n\n")[1].partition(". ")[2]
        rows.append([f"[{short(env_id)}]({short(env_id)}.md)", size, config.terrain, about])
    return (
        "# Environments\n\nEvery environment takes every action layer, and any robot with suitable "
        'feet: `gym.make("fbid_gym/BipedWalk-v0", robot="g1", action_layer="com_wrench")`. Through '
        "`torque` a robot knows no gait, and falls at once until it has learnt. The tables of "
        "these pages are generated from the code.\n\n"
        + table(["Environment", "Robot", "Ground", "In one line"], rows)
        + "\n\nEvery argument with its default and its range: [arguments](../arguments.md). "
        "From action to torque: [action layers](../layers/index.md).\n"
    )


def _page(env_id: str, clip: bool) -> str:
    """Return the package's page of an environment with a clip and the policies for it."""
    beginning, rest = described(env_id).split("\n\n## ", 1)
    parts = [beginning]
    if clip:
        scene = EnvironmentClip.of(env_id)
        parts.append(
            f'<video src="{scene.file}" controls loop muted playsinline width="480"></video>\n\n'
            f"{scene.caption}"
        )
    if policies := shipped_for(env_id):
        names = ", ".join(f"`shipped:{each.name}`" for each in policies)
        parts.append(f"Policies that come with the package ([cards](../policies.md)): {names}.")
        parts.append(f"```\npython -m eval.rollout shipped:{policies[0].name} --video out.mp4\n```")
    return "\n\n".join([*parts, f"## {rest}"])
