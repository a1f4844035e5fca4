"""What was understood of a robot, in words and tables."""

from collections.abc import Sequence

import numpy as np

from fbid_gym.robots.robot import Robot


def summary(robot: Robot) -> str:
    """Describe a robot: joints, limits, feet, what was changed, what speaks against its home."""
    head = (
        f"{robot.name}: {robot.num_joints} joints, {robot.num_feet} feet on {robot.num_points} "
        f"points, {robot.mass:.4g} kg, base {robot.home_qpos[2]:.4g} m high at home"
    )
    low, high = robot.joint_range.T
    gains = robot.servo_gains
    columns = {
        "joint": robot.joint_names,
        "from": _numbers(low),
        "to": _numbers(high),
        "home": _numbers(robot.home_qpos[7:]),
        "limit": _numbers(robot.torque_limit),
        "armature": _numbers(robot.model.dof_armature[6:]),
        "damping": _numbers(robot.joint_damping),
    }
    if gains is not None:
        columns |= {"servo kp": _numbers(gains.stiffness), "kd": _numbers(gains.damping)}
    feet = {
        "foot": robot.foot_names,
        "body": [robot.at_home.body_name(foot.body) for foot in robot.feet],
        "points": [str(foot.num_points) for foot in robot.feet],
        "radius": _numbers([foot.radius for foot in robot.feet]),
        "named": [", ".join(foot.point_names) for foot in robot.feet],
    }
    parts = [head, _table(columns), _table(feet)]
    if robot.notes:
        parts.append("Changed:\n" + _listed(robot.notes))
    told = robot.check()
    parts.append("At home:\n" + _listed(told or ["Nothing speaks against it."]))
    return "\n\n".join(parts)


def _numbers(values: Sequence[float] | np.ndarray) -> list[str]:
    return [f"{value:.3g}" for value in values]


def _listed(sentences: Sequence[str]) -> str:
    return "\n".join(f"- {sentence}" for sentence in sentences)


def _table(columns: dict[str, Sequence[str]]) -> str:
    """Columns side by side: words to the left, numbers to the right."""
    padded = []
    for name, cells in columns.items():
        words = any(cell[:1].isalpha() and cell not in ("inf", "nan") for cell in cells)
        width = max(map(len, [name, *cells]))
        padded.append([f"{cell:{'<>'[not words]}{width}}" for cell in [name, *cells]])
    return "\n".join("  ".join(row).rstrip() for row in zip(*padded, strict=True))
