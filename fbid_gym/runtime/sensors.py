"""What a controller is told of its robot at a tick, by name."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.checks import check_finite, real_numbers
from fbid_gym.errors import InvalidValueError, ShapeError, UnknownOptionError
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot

SENSORS: dict[str, str] = {
    "position": "(3,) m, of the base, in a world whose z points up",
    "orientation": "(4,) unit quaternion w, x, y, z, from the base's axes to the world's",
    "velocity": "(3,) m/s, of the base, along the world's axes",
    "angular_velocity": "(3,) rad/s, of the base, along its own axes",
    "joint_position": "(n,) rad (m for slides), in the order of `robot.joint_names`",
    "joint_velocity": "(n,) rad/s, likewise",
    "contact_force": "(P, 3) N, of the ground on each contact point, along the world's axes",
}
"""Name of a measured or estimated quantity -> its shape, unit and frame.

Robots that only feel whether they touch the ground give "contact", (P,) from 0 to 1, instead of
"contact_force": the points that touch share the robot's weight.
"""

_POSE = ("position", "orientation", "joint_position")
_MOTION = ("velocity", "angular_velocity", "joint_velocity")
_OFF_UNIT = 1e-3


def state_of(robot: Robot, sensors: Any, tick: int) -> RobotState:
    """Return the state of one robot that its sensors tell.

    Args:
        robot: whose sensors.
        sensors: `SENSORS` by name; or a `RobotState` of one robot, measured or estimated.
        tick: control ticks since the robot began.

    Raises:
        FbidError: what is given lacks something, is of another shape or not finite, and names it.
    """
    own = np.full(1, tick, np.int64)
    if isinstance(sensors, RobotState):
        qpos, qvel, force = (np.ascontiguousarray(part, float) for part in sensors[:3])
        state = RobotState(qpos, qvel, force, own)
        sizes = ((1, robot.nq), (1, robot.nv), (1, robot.num_points, 3))
        for name, size in zip(("qpos", "qvel", "contact_force"), sizes, strict=True):
            if getattr(state, name).shape != size:
                raise ShapeError(name, getattr(state, name).shape, f"{size}, one {robot.name!r}")
            check_finite(name, getattr(state, name))
        return state
    if not isinstance(sensors, Mapping):
        expected = "a dictionary from names of sensors to numbers, or a RobotState"
        raise InvalidValueError("sensors", sensors, expected)
    state = RobotState(
        np.concatenate([_read(robot, sensors, name) for name in _POSE])[None],
        np.concatenate([_read(robot, sensors, name) for name in _MOTION])[None],
        _forces(robot, sensors)[None],
        own,
    )
    if len(sensors) > len(SENSORS):
        odd = next(iter(sensors.keys() - SENSORS.keys()))
        raise UnknownOptionError("sensor", odd, (*SENSORS, "contact"))
    if abs(np.linalg.norm(state.qpos[0, 3:7]) - 1.0) > _OFF_UNIT:
        raise InvalidValueError("orientation", sensors["orientation"], "a unit quaternion")
    return state


def _read(robot: Robot, sensors: Mapping[str, Any], name: str) -> np.ndarray:
    joints, points = robot.num_joints, robot.num_points
    size = {"orientation": (4,), "contact_force": (points, 3), "contact": (points,)}.get(
        name, (joints,) if name.startswith("joint") else (3,)
    )
    if name not in sensors:
        raise InvalidValueError(f"sensor {name!r}", None, SENSORS[name])
    found = real_numbers(name, sensors[name], f"numbers of shape {size}").astype(float, copy=False)
    if found.shape != size:
        raise ShapeError(name, found.shape, f"{size}, of {robot.name!r}")
    check_finite(name, found)
    return found


def _forces(robot: Robot, sensors: Mapping[str, Any]) -> np.ndarray:
    """(P, 3) N."""
    if "contact" not in sensors:
        return np.ascontiguousarray(_read(robot, sensors, "contact_force"))
    touching = _read(robot, sensors, "contact")
    force = np.zeros((len(touching), 3))
    force[:, 2] = robot.weight * touching / max(touching.sum(), 1.0)
    return force
