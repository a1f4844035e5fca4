"""The reference: a page for each package, of the docstrings of what it makes public."""

import importlib

PAGES = {
    "fbid_gym": ("fbid_gym", ["fbid_gym"]),
    "envs": (
        "Environments",
        [
            "fbid_gym.envs",
            "fbid_gym.envs.robot_env",
            "fbid_gym.envs.vector_env",
            "fbid_gym.envs.sb3",
            "fbid_gym.envs.config",
            "fbid_gym.envs.randomisation",
        ],
    ),
    "tasks": (
        "Tasks",
        [
            "fbid_gym.tasks",
            "fbid_gym.tasks.task",
            "fbid_gym.tasks.body",
            "fbid_gym.tasks.reward",
            "fbid_gym.tasks.observation",
            "fbid_gym.tasks.outcome",
            "fbid_gym.tasks.start",
            "fbid_gym.tasks.pushes",
            "fbid_gym.tasks.balance",
            "fbid_gym.tasks.tracking",
            "fbid_gym.tasks.walk",
            "fbid_gym.tasks.walk_measures",
        ],
    ),
    "actions": (
        "Action layers",
        [
            "fbid_gym.actions",
            "fbid_gym.actions.layer",
            "fbid_gym.actions.torque",
            "fbid_gym.actions.joint_position",
            "fbid_gym.actions.joint_position_feedforward",
            "fbid_gym.actions.joint_acceleration",
            "fbid_gym.actions.base_acceleration",
            "fbid_gym.actions.com_wrench",
            "fbid_gym.actions.law",
            "fbid_gym.actions.gains",
            "fbid_gym.actions.contact_options",
            "fbid_gym.actions.footholds",
            "fbid_gym.actions.ranges",
            "fbid_gym.actions.joint_gains",
        ],
    ),
    "motions": (
        "Motions",
        [
            "fbid_gym.motions",
            "fbid_gym.motions.table",
            "fbid_gym.motions.target",
            "fbid_gym.motions.squat",
            "fbid_gym.motions.stepping",
            "fbid_gym.motions.crawl",
            "fbid_gym.motions.crawl_gait",
        ],
    ),
    "control": (
        "Control laws",
        [
            "fbid_gym.control",
            "fbid_gym.control.body_law",
            "fbid_gym.control.momentum_balance",
            "fbid_gym.control.inverse_dynamics",
            "fbid_gym.control.limited_inverse_dynamics",
            "fbid_gym.control.contact_forces",
            "fbid_gym.control.wrench_distribution",
            "fbid_gym.control.operational_space",
            "fbid_gym.control.balance",
            "fbid_gym.control.balance_gains",
            "fbid_gym.control.balancers",
            "fbid_gym.control.underactuation",
        ],
    ),
    "dynamics": (
        "Dynamics",
        [
            "fbid_gym.dynamics",
            "fbid_gym.dynamics.mujoco_dynamics",
            "fbid_gym.dynamics.pinocchio_dynamics",
            "fbid_gym.dynamics.centroidal",
            "fbid_gym.dynamics.contacts",
            "fbid_gym.dynamics.stance",
        ],
    ),
    "robots": (
        "Robots",
        ["fbid_gym.robots", "fbid_gym.robots.robot", "fbid_gym.robots.feet"],
    ),
    "quantities": ("Quantities", ["fbid_gym.quantities"]),
    "options": ("Options", ["fbid_gym.options"]),
    "policy": (
        "Policies",
        [
            "fbid_gym.policy",
            "fbid_gym.policy.policy",
            "fbid_gym.policy.shipping",
            "fbid_gym.policy.card",
        ],
    ),
    "errors": ("Errors", ["fbid_gym.errors"]),
}
"""Name of a page -> its title and the modules on it."""


def pages() -> dict[str, str]:
    """Return the pages, file name -> Markdown for mkdocstrings."""
    return {
        f"{name}.md": "\n\n".join([f"# {title}", *(_module(module) for module in modules)]) + "\n"
        for name, (title, modules) in PAGES.items()
    }


def _module(name: str) -> str:
    """A module and its members; of a package those that are its own, and links to the others."""
    public = getattr(importlib.import_module(name), "__all__", None)
    options = ["show_root_heading: false", "show_root_toc_entry: false"]
    parts = [f"## `{name}`"]
    if public is not None:
        own = [each for each in public if _home(name, each) == name]
        options.append(f"members: [{', '.join(own)}]" if own else "members: false")
        links = [f"[`{each}`][{_home(name, each)}.{each}]" for each in public]
        parts.append(f"Public: {', '.join(links)}.")
    lines = "\n".join(f"      {option}" for option in options)
    return "\n\n".join([*parts, f"::: {name}\n    options:\n{lines}\n"])


def _home(module: str, name: str) -> str:
    """Where a public name is defined; data are at home where they are named."""
    home: str = getattr(getattr(importlib.import_module(module), name), "__module__", module)
    return home if home.startswith("fbid_gym") else module
