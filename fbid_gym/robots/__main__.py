"""Show what is understood of a robot: `python -m fbid_gym.robots my.xml [--feet left_foot …]`."""

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fbid_gym.__main__ import called
from fbid_gym.envs.verdict import by_policy, verdict
from fbid_gym.exit_status import exit_status
from fbid_gym.policy import Policy
from fbid_gym.robots import ROBOTS, ZOO, load
from fbid_gym.robots.description import feet_in_words, in_json
from fbid_gym.robots.portrait import portrait, write_png
from fbid_gym.robots.robot import Robot


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a robot's joints, limits, feet and check at home, draw it, let it stand and walk.

    Returns 2 on errors.
    """
    given = _parser().parse_args(arguments)
    return exit_status(lambda: _show(given))


def _show(given: argparse.Namespace) -> None:
    policy = None if given.policy is None else Policy.load(given.policy)
    options = {
        name: _value(name, text)
        for name in ("home", "torque_limit", "armature", "base", "name")
        if (text := getattr(given, name)) is not None
    }
    if (given.robot in ROBOTS or given.robot.startswith(ZOO)) and not options and not given.feet:
        robot = load(given.robot)
    else:
        robot = Robot.load(given.robot, feet_in_words(given.feet), **options)
    print(summary(robot))
    path = Path(given.picture or f"{robot.name}.png")
    write_png(path, portrait(robot))
    print(f"\nPicture: {path} (red: contact points, yellow: their hull, blue: centre of mass)")
    if given.verdict:
        print("\nWithout a policy, by the zero action of its layers:", flush=True)
        for sentence in verdict(robot):
            print(f"- {sentence}", flush=True)
    if policy is not None:
        print(f"\nBy {given.policy}, without pushes:\n- {by_policy(robot, policy)}", flush=True)


def summary(robot: Robot) -> str:
    """Describe a robot: joints, limits, feet, what was changed, what speaks against its home."""
    head = (
        f"{robot.name}: {robot.num_joints} joints, {robot.num_feet} feet on {robot.num_points} "
        f"points, {robot.mass:.4g} kg, base {robot.home_qpos[2]:.4g} m high at home"
    )
    low, high = robot.joint_range.T
    columns: dict[str, Iterable[Any]] = {
        **{"joint": robot.joint_names, "from": low, "to": high, "home": robot.home_qpos[7:]},
        **{"limit": robot.torque_limit, "armature": robot.model.dof_armature[6:]},
        "damping": robot.joint_damping,
    }
    if robot.servo_gains is not None:
        columns |= {"servo kp": robot.servo_gains.stiffness, "kd": robot.servo_gains.damping}
    feet = {
        "foot": robot.foot_names,
        "body": [robot.at_home.body_name(foot.body) for foot in robot.feet],
        "points": [str(foot.num_points) for foot in robot.feet],
        "radius": [foot.radius for foot in robot.feet],
        "named": [", ".join(foot.point_names) for foot in robot.feet],
    }
    parts = [head, _table(columns), _table(feet)]
    if robot.notes:
        parts.append("Changed:\n" + _listed(robot.notes))
    told = robot.check()
    parts.append("At home:\n" + _listed(told or ["Nothing speaks against it."]))
    return "\n\n".join(parts)


def _listed(sentences: Sequence[str]) -> str:
    return "\n".join(f"- {sentence}" for sentence in sentences)


def _table(columns: Mapping[str, Iterable[Any]]) -> str:
    """Columns side by side: words to the left, numbers to the right."""
    padded = []
    for name, values in columns.items():
        cells = [value if isinstance(value, str) else f"{value:.3g}" for value in values]
        words = any(cell[:1].isalpha() and cell not in ("inf", "nan") for cell in cells)
        width = max(map(len, [name, *cells]))
        padded.append([f"{cell:{'<>'[not words]}{width}}" for cell in [name, *cells]])
    return "\n".join("  ".join(row).rstrip() for row in zip(*padded, strict=True))


def _parser() -> argparse.ArgumentParser:
    prog = " ".join(called("fbid_gym.robots"))
    parser = argparse.ArgumentParser(prog=prog, description="Show what is understood of a robot.")
    parser.add_argument(
        "robot",
        help="path of an MJCF, URDF or robot.toml, a name of robot_descriptions, menagerie:NAME, "
        "or a drawn one such as zoo:quadruped:7",
    )
    parser.add_argument(
        "--feet",
        nargs="+",
        help='names of bodies, sites or spheres; or as JSON, \'{"left": ["heel", "toe"], …}\'',
    )
    parser.add_argument("--home", help="a keyframe's name, stand, or joint angles as JSON")
    parser.add_argument("--torque-limit", help="N·m; or as JSON, '{\"*_knee\": 30, …}'")
    parser.add_argument("--armature", help="kg·m², likewise")
    parser.add_argument("--base", help="the body that shall float, if the file has no free joint")
    parser.add_argument("--name", help="of the robot")
    parser.add_argument(
        "--no-verdict", dest="verdict", action="store_false", help="do not let it stand and walk"
    )
    parser.add_argument(
        "--policy", help="run folder, file or shipped:NAME, with observation='body': let it act too"
    )
    parser.add_argument("--picture", help="where to draw it; by default, the robot's name .png")
    return parser


def _value(name: str, text: str) -> Any:
    """A word, a number, or what JSON says."""
    if name in ("home", "torque_limit", "armature") and text[:1] in "{[-0123456789.":
        return in_json(name, text)
    return text


if __name__ == "__main__":
    sys.exit(main())
