"""Measured state of a robot at a tick, by name, for a controller."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from fbid_gym.checks import check_choices, check_finite, contiguous, real_numbers
from fbid_gym.errors import InvalidValueError, ShapeError
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

_FORCE, TOUCH = "contact_force", "contact"
# Where in qpos, and in qvel, they are.
_POSE = {"position": slice(3), "orientation": slice(3, 7), "joint_position": slice(7, None)}
_MOTION = {"velocity": slice(3), "angular_velocity": slice(3, 6), "joint_velocity": slice(6, None)}
_OFF_UNIT, _FLOAT = 1e-3, np.dtype(float)


class Sensing:
    """Sensors of one robot."""

    def __init__(self, robot: Robot) -> None:
        """Measure a robot."""
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(SENSORS, (3,))
        shapes |= {"orientation": (4,), _FORCE: (robot.num_points, 3), TOUCH: (robot.num_points,)}
        shapes |= dict.fromkeys(("joint_position", "joint_velocity"), (robot.num_joints,))
        self._robot, self._shapes = robot, shapes  # these of each sensor's numbers, by name

    def state(self, sensors: Any, tick: int) -> RobotState:
        """Return the state (N = 1) that sensors tell.

        Args:
            sensors: `SENSORS` by name; or a `RobotState` of one robot, measured or estimated.
            tick: control ticks since the robot began.

        Raises:
            FbidError: something is missing, of another shape or not finite; names it.
        """
        if isinstance(sensors, RobotState):
            return self._checked(sensors, tick)
        if not isinstance(sensors, Mapping):
            expected = "a dictionary from names of sensors to numbers, or a RobotState"
            raise InvalidValueError("sensors", sensors, expected)
        check_choices("sensor", sensors, self._shapes)
        qpos, qvel = np.empty(self._robot.nq), np.empty(self._robot.nv)
        for whole, parts in ((qpos, _POSE), (qvel, _MOTION)):
            for name, part in parts.items():
                whole[part] = self._read(sensors, name)
        force = self._forces(sensors)
        flat = force.ravel()
        # A number that is not finite makes a sum of squares that is not.
        if not isfinite(qpos.dot(qpos) + qvel.dot(qvel) + flat.dot(flat)):
            for name, value in sensors.items():
                check_finite(name, np.asarray(value))
        quaternion = qpos[3:7]
        if not abs(quaternion.dot(quaternion) - 1.0) < 2.0 * _OFF_UNIT:
            raise InvalidValueError("orientation", sensors["orientation"], "a unit quaternion")
        return RobotState(qpos[None], qvel[None], force[None], np.array([tick], np.int64))

    def _checked(self, state: RobotState, tick: int) -> RobotState:
        shapes = (1, self._robot.nq), (1, self._robot.nv), (1, *self._shapes[_FORCE])
        found = {}
        for name, shape in zip(RobotState._fields, shapes, strict=False):
            part = contiguous(getattr(state, name))
            if part.shape != shape:
                raise ShapeError(name, part.shape, f"{shape}, one {self._robot.name!r}")
            check_finite(name, part)
            found[name] = part
        return RobotState(**found, tick=np.array([tick], np.int64))

    def _read(self, sensors: Mapping[str, Any], name: str) -> np.ndarray:
        return read(sensors, name, self._shapes[name], SENSORS.get(name, ""), self._robot.name)

    def _forces(self, sensors: Mapping[str, Any]) -> np.ndarray:
        """(P, 3) N."""
        if TOUCH not in sensors:
            return contiguous(self._read(sensors, _FORCE))
        touching = self._read(sensors, TOUCH)
        force = np.zeros((len(touching), 3))
        force[:, 2] = self._robot.weight * touching / max(np.add.reduce(touching), 1.0)
        return force


def read(
    given: Mapping[str, Any], name: str, shape: tuple[int, ...], words: str, robot: str
) -> np.ndarray:
    """Return the numbers of one sensor, in that shape.

    Raises:
        FbidError: it is missing, or of another shape; says in `words` what it is.
    """
    if name not in given:
        raise InvalidValueError(f"sensor {name!r}", None, words)
    found = given[name]
    if type(found) is not np.ndarray or found.dtype != _FLOAT:
        found = real_numbers(name, found, f"numbers of shape {shape}").astype(float)
    if found.shape != shape:
        raise ShapeError(name, found.shape, f"{shape}, of {robot!r}")
    return found
