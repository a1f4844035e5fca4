"""Sensor readings of one robot at a tick, by name, for an estimator."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from fbid_gym.checks import check_choices, check_finite
from fbid_gym.estimation.estimator import Estimator
from fbid_gym.estimation.sensors import Sensors
from fbid_gym.options import Flag
from fbid_gym.robots import Robot
from fbid_gym.runtime.sensors import SENSORS, TOUCH, read

READINGS: dict[str, str] = {
    "gyroscope": "(3,) rad/s, along the axes of the inertial unit",
    "accelerometer": "(3,) m/s^2, specific force, likewise: upwards at rest",
    "joint_position": SENSORS["joint_position"],
    "joint_velocity": SENSORS["joint_velocity"],
    "contact_load": "(F,) N, vertical force on each foot, in the order of `robot.foot_names`",
}
"""Name of a reading -> its shape, unit and frame.

"joint_velocity" may be left out: then it is differences of positions, filtered as the sensors of
the environment say. So may "contact_load" where these tell contacts from torques: all but the first
is ignored then, and without that all feet bear the same at first. "fresh" may be False at ticks at
which the encoders have not read anew.
"""

_FRESH = "fresh"
_OF_A_STATE = {*SENSORS, TOUCH} - READINGS.keys()


class Reader:
    """Takes the readings of one robot to its estimator."""

    def __init__(self, robot: Robot, sensors: Sensors, hz: int, tick: np.ndarray) -> None:
        """Build it, for a control rate, Hz, and (1,) its ticks, live."""
        self._robot, self.estimator = robot, Estimator(robot, sensors, hz, tick)  # of its state
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("gyroscope", "accelerometer"), (3,))
        shapes |= dict.fromkeys(("joint_position", "joint_velocity"), (robot.num_joints,))
        self._shapes = shapes | {"contact_load": (robot.num_feet,)}  # of each reading's numbers
        # Those that may be left out.
        by_torque = ("contact_load",) if sensors.contact == "torque" else ()
        self._spared = ("joint_velocity", *by_torque)
        # From one reading of the encoders to the next, and the share of the way to the newest
        # velocity that their low pass goes.
        self._seconds, self._follow = sensors.every("encoder", hz) / hz, sensors.follow(hz)

    @staticmethod
    def reads(given: Any) -> bool:
        """Whether readings are given, and not a state that is known by other means."""
        return isinstance(given, Mapping) and _OF_A_STATE.isdisjoint(given)

    def take(self, given: Mapping[str, Any], begins: bool) -> None:
        """Check `READINGS` by name, and write them to those of the estimator; `begins`: the first.

        Raises:
            FbidError: a reading that is missing, of another shape or not finite; names it. Nothing
                has been written.
        """
        check_choices("sensor", given, (*self._shapes, _FRESH))
        found, own = {}, self.estimator.readings
        for name, shape in self._shapes.items():
            if name in given or name not in self._spared:
                value = found[name] = read(given, name, shape, READINGS[name], self._robot.name)
                if not isfinite(value.dot(value)):  # as where any of them is not
                    check_finite(name, value)
        fresh = _FRESH not in given or Flag().check(_FRESH, given[_FRESH]) or begins
        angle, rate = found["joint_position"], found.get("joint_velocity")
        if rate is None:
            rate = np.zeros_like(angle) if begins else own.rate[0]
            if fresh and not begins:
                rate = rate + self._follow * ((angle - own.angle[0]) / self._seconds - rate)
        own.gyroscope[0], own.accelerometer[0] = found["gyroscope"], found["accelerometer"]
        own.angle[0], own.rate[0], own.fresh[0] = angle, rate, fresh
        if "contact_load" in found:
            own.load[0] = found["contact_load"]
        elif begins:
            own.load[0] = self._robot.weight / self._robot.num_feet  # it stands
