"""Estimate the state of N robots from the readings of their sensors.

Whose sensors they are does not matter: environments simulate them, a robot has its own.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fbid_gym.dynamics.frames import matrix_to_quaternion, quaternion_to_matrix
from fbid_gym.estimation.contact_torques import Felt, TorqueSense, find_loads
from fbid_gym.estimation.correction import update
from fbid_gym.estimation.filter_constants import filter_of
from fbid_gym.estimation.invariant_filter import Belief
from fbid_gym.estimation.legs import legs_of, mounting_of
from fbid_gym.estimation.linear_filter import update_linear
from fbid_gym.estimation.sensing import Readings
from fbid_gym.estimation.sensors import Sensors
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.robots import Robot

_FILTERS = {
    "invariant": (update, lambda feet: 15 + 3 * feet),
    "linear": (update_linear, lambda feet: 4 + feet),
}
"""Name -> what updates it at a tick, and the size of its covariance."""


class Estimator:
    """The estimator of N robots.

    Attributes:
        readings: that have arrived; whoever has the sensors writes them.
        state: what the robots believe of theirs; live. The forces are those that their feet tell.
        belief: of the filter; live.
        mounting: of the inertial unit.
        threshold: N, on a foot that counts as on the ground.
        notes: what is assumed of the robot, one sentence each.
        foot_names: of the robot.
    """

    def __init__(self, robot: Robot, sensors: Sensors, hz: int, tick: np.ndarray) -> None:
        """Build it for as many robots as there are `tick` (N,), control ticks of episodes."""
        count, feet, joints = len(tick), robot.num_feet, robot.num_joints
        self.mounting, note = mounting_of(robot)
        self.notes = (note,) if note else ()
        self.foot_names = robot.foot_names
        self._legs = legs_of(robot, self.mounting)
        self._filter = filter_of(sensors, robot, self.mounting, hz)
        self.threshold = self._filter.threshold
        self.readings = Readings.none(count, joints, feet)
        self._update, size = _FILTERS[sensors.estimator]
        self.belief = Belief.none(count, feet, size(feet))
        force = np.zeros((count, robot.num_points, 3))
        home = np.tile(robot.home_qpos, (count, 1))
        self.state = RobotState(home, np.zeros((count, robot.nv)), force, tick)
        self._all = np.ones(count, bool)
        self._torque_sense: TorqueSense | None = None
        self._loads = np.zeros((count, feet))  # from torques, where feet have no sensors
        if sensors.contact == "torque":
            self._torque_sense = TorqueSense.of(
                self._legs.joint, robot.has_soles, robot.joint_damping, 1.0 / hz
            )

    def begin(self, ids: np.ndarray, qpos: np.ndarray) -> None:
        """Begin with the first readings of robots `ids` (K,), which rest.

        Of qpos (K, nq) they know the base's place and heading.
        """
        belief, mounting = self.belief, self.mounting
        counts = belief.slipped, belief.age, belief.refused, belief.restarts
        for part in (belief.position, belief.standing, *counts):
            part[ids] = 0
        base = quaternion_to_matrix(qpos[:, 3:7])
        belief.origin[ids] = qpos[:, :3] + base @ mounting.place
        belief.quaternion[ids] = matrix_to_quaternion(base @ mounting.base_from_imu)
        belief.lost[ids] = True
        which = np.zeros(len(self._all), bool)
        which[ids] = True
        belief.felt[ids] = self.readings.accelerometer[ids]
        self._loads[ids] = self.readings.load[ids]
        self._update(self._filter, self._legs, self.readings, which, belief, self.state)

    def prepare(self, terms: Callable[[], DynamicsTerms]) -> None:
        """Keep the terms of the controllers' model at the beginning of a tick, if they are used."""
        if self._torque_sense is not None:
            self._terms = terms()

    def update(self, torque: np.ndarray) -> None:
        """Go on by the readings at the end of a control tick, and its motors' torque (N, n) N·m."""
        if self._torque_sense is not None:
            self._feel(self._torque_sense, torque, self._terms)
        own, legs = self._filter, self._legs
        self._update(own, legs, self.readings, self._all, self.belief, self.state)

    def _feel(self, own: TorqueSense, torque: np.ndarray, terms: DynamicsTerms) -> None:
        """Tell the feet's loads from the torques, in place of sensors."""
        readings, before = self.readings, self.state.qvel
        to_base = self.mounting.base_from_imu.T
        spin = (readings.gyroscope - self.belief.gyroscope_bias) @ to_base
        force = readings.accelerometer - self.belief.accelerometer_bias
        push = np.matvec(quaternion_to_matrix(self.belief.quaternion), force)
        push[:, 2] -= self._filter.gravity
        moved = before[:, :3] + push * own.tick
        after = np.concatenate([moved, spin, readings.rate], axis=1)
        felt = Felt(terms, np.ascontiguousarray(torque), before, after)
        find_loads(own, felt, self._loads)
        readings.load[:] = self._loads

    @property
    def contact(self) -> np.ndarray:
        """Feet that are told to be on the ground: (N, F) bool."""
        return self.readings.load > self.threshold

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """All that goes on from tick to tick, by name, but for the tick; live."""
        parts: dict[str, Any] = {
            "readings": self.readings,
            "belief": self.belief,
            "state": self.state,
        }
        found = {f"{p}_{n}": v for p, values in parts.items() for n, v in values._asdict().items()}
        del found["state_tick"]
        return found | {"loads": self._loads}
