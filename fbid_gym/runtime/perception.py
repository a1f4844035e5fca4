"""What N robots sense and believe, beside what is: their sensors, and the estimate of their state.

Where sensors are perfect there is none of it.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fbid_gym.dynamics.frames import matrix_to_quaternion, quaternion_to_matrix
from fbid_gym.dynamics.stance import Stance
from fbid_gym.estimation.contact_torques import TorqueSense, find_loads
from fbid_gym.estimation.correction import correct
from fbid_gym.estimation.filter_constants import filter_of
from fbid_gym.estimation.invariant_filter import Belief
from fbid_gym.estimation.legs import legs_of, mounting_of
from fbid_gym.estimation.prediction import predict
from fbid_gym.estimation.random_numbers import seeded
from fbid_gym.estimation.sensing import Readings, Wear, instruments_of, sense
from fbid_gym.estimation.sensors import Sensors
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.robots import Robot

ERRORS = {
    "estimate_tilt_error": "rad, between the vertical and what the robot takes for it",
    "estimate_velocity_error": "m/s, of the base, along the robot's own heading",
    "estimate_height_error": "m, of the base; it drifts from step to step",
    "estimate_heading_error": "rad; no sensor tells it, it drifts",
    "estimate_drift": "m, horizontally, since the episode began; it drifts as well",
    "estimate_contact_error": "share of the feet whose contact is told wrong",
    "estimate_restarts": "how often the estimate was lost and begun anew in this episode",
}
"""Entries of the info, with their unit."""


_DRAWN = (
    *("gyroscope_bias", "accelerometer_bias", "gyroscope_scale", "accelerometer_scale"),
    *("mounted", "latency"),
)


class Perception:
    """The sensors and the estimator of N robots.

    Attributes:
        sensors: of the robots.
        state: what the robots believe of theirs; live. The forces are those that their feet tell.
        readings: of the sensors; live.
        notes: what is assumed of the robot, one sentence each.
        foot_names: of the robot.
    """

    def __init__(self, robot: Robot, sensors: Sensors, hz: int, tick: np.ndarray) -> None:
        """Build them for as many robots as there are `tick` (N,), control ticks of episodes."""
        count, feet, joints = len(tick), robot.num_feet, robot.num_joints
        self.sensors, self._hz = sensors, hz
        mounting, note = mounting_of(robot)
        self.notes = (note,) if note else ()
        self.foot_names = robot.foot_names
        self._mounting = mounting
        self._legs = legs_of(robot, mounting)
        points = Stance.of(robot).geometry.foot_of_point
        self._instruments = instruments_of(sensors, mounting, points, hz, robot)
        self._filter = filter_of(sensors, robot, mounting, hz)
        latest = max(sensors.imu_latency[1], sensors.encoder_latency[1], sensors.contact_latency[1])
        ages, size = 1 + round(latest * hz), 6 + 2 * joints + feet + 1
        ones = np.ones(count, np.int64)
        self._wear = Wear(
            generator=np.stack([ones, ones], axis=1),
            gyroscope_bias=np.zeros((count, 3)),
            accelerometer_bias=np.zeros((count, 3)),
            gyroscope_scale=np.zeros((count, 3)),
            accelerometer_scale=np.zeros((count, 3)),
            mounted=np.tile(np.eye(3), (count, 1, 1)),
            latency=np.zeros((count, 3), np.int64),
            begun=np.zeros(count, bool),
            moved=np.zeros((count, 3)),
            wrong=np.zeros((count, feet), bool),
            history=np.zeros((count, ages, size)),
        )
        self.readings = Readings.none(count, joints, feet)
        self._belief = Belief.none(count, feet)
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

    def draw(self, env: int, rng: np.random.Generator) -> None:
        """Draw how the sensors of one robot err in its next episode."""
        own, wear = self.sensors.scaled, self._wear
        wear.generator[env] = seeded(rng)
        for name in ("gyroscope", "accelerometer"):
            for error in ("bias", "scale"):
                size = getattr(own, f"{name}_{error}")
                getattr(wear, f"{name}_{error}")[env] = size * rng.standard_normal(3)
        turned = own.misalignment * rng.standard_normal(3)
        half = np.concatenate([[1.0], 0.5 * turned])
        wear.mounted[env] = quaternion_to_matrix(half / np.linalg.norm(half)).T
        for kind, name in enumerate(("imu", "encoder", "contact")):
            latency = rng.uniform(*getattr(own, f"{name}_latency"))
            wear.latency[env, kind] = round(latency * self._hz)

    def begin(self, ids: np.ndarray, actual: RobotState) -> None:
        """Begin episodes of robots `ids` (K,), which rest where they are and know their heading."""
        belief, mounting = self._belief, self._mounting
        for part in (self._wear.begun, self._wear.wrong, belief.position, belief.standing):
            part[ids] = 0
        for part in (belief.slipped, belief.age, belief.refused, belief.restarts):
            part[ids] = 0
        base = quaternion_to_matrix(actual.qpos[ids, 3:7])
        belief.origin[ids] = actual.qpos[ids, :3] + base @ mounting.place
        belief.quaternion[ids] = matrix_to_quaternion(base @ mounting.base_from_imu)
        belief.lost[ids] = True
        which = np.zeros(len(self._all), bool)
        which[ids] = True
        sense(self._instruments, actual, which, self._wear, self.readings)
        belief.felt[ids] = self.readings.accelerometer[ids]
        self._loads[ids] = self.readings.load[ids]
        correct(self._filter, self._legs, self.readings, which, belief, self.state)

    def prepare(self, terms: Callable[[], DynamicsTerms]) -> None:
        """Keep the terms of the controllers' model at the beginning of a tick, if they are used."""
        if self._torque_sense is not None:
            self._terms = terms()

    def update(self, actual: RobotState, torque: np.ndarray) -> None:
        """Read the sensors at the end of a control tick, and go on with the estimate.

        Args:
            actual: state of the robots.
            torque: (N, n) N·m, of the motors in the tick.
        """
        sense(self._instruments, actual, self._all, self._wear, self.readings)
        if self._torque_sense is not None:
            self._feel(self._torque_sense, torque, self._terms)
        predict(self._filter, self.readings, self._all, self._belief)
        correct(self._filter, self._legs, self.readings, self._all, self._belief, self.state)

    def _feel(self, own: TorqueSense, torque: np.ndarray, terms: DynamicsTerms) -> None:
        """Tell the feet's loads from the torques, in place of sensors."""
        readings, before = self.readings, self.state.qvel
        to_base = self._mounting.base_from_imu.T
        spin = (readings.gyroscope - self._belief.gyroscope_bias) @ to_base
        force = readings.accelerometer - self._belief.accelerometer_bias
        push = np.matvec(quaternion_to_matrix(self._belief.quaternion), force)
        push[:, 2] -= self._instruments.gravity
        moved = before[:, :3] + push * own.tick
        after = np.concatenate([moved, spin, readings.rate], axis=1)
        find_loads(own, terms, np.ascontiguousarray(torque), before, after, self._loads)
        readings.load[:] = self._loads

    def errors(self, actual: RobotState) -> dict[str, np.ndarray]:
        """Return by how much the estimate errs, by the names of `ERRORS`: (N,) each."""
        mine, belief = self.state, self._belief
        true, own = (
            quaternion_to_matrix(actual.qpos[:, 3:7]),
            quaternion_to_matrix(mine.qpos[:, 3:7]),
        )
        sides = np.linalg.norm(np.cross(true[:, 2], own[:, 2]), axis=1)
        away = mine.qpos[:, :3] - actual.qpos[:, :3]
        turned = np.einsum("nij,nkj->nik", own, true)  # true heading to own, about the vertical
        angle = np.arctan2(turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1])
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y, z = actual.qvel[:, :3].T
        along = np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=1)
        feet = self._instruments.foot_of_point
        of_foot = feet[:, None] == np.arange(belief.standing.shape[1])
        load = actual.contact_force[:, :, 2] @ of_foot
        wrong = (load > self._filter.threshold) != self.contact
        return {
            "estimate_tilt_error": np.arctan2(sides, np.vecdot(true[:, 2], own[:, 2])),
            "estimate_velocity_error": np.linalg.norm(mine.qvel[:, :3] - along, axis=1),
            "estimate_height_error": away[:, 2],
            "estimate_heading_error": angle,
            "estimate_drift": np.hypot(away[:, 0], away[:, 1]),
            "estimate_contact_error": wrong.mean(axis=1),
            "estimate_restarts": belief.restarts.copy(),
        }

    @property
    def contact(self) -> np.ndarray:
        """Which feet are told to be on the ground: (N, F) bool."""
        return self.readings.load > self._filter.threshold

    @property
    def drawn(self) -> dict[str, np.ndarray]:
        """How the sensors err now: (N, ...) by name; live."""
        return {name: getattr(self._wear, name) for name in _DRAWN}

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """All that goes on from tick to tick, by name; live."""
        parts: dict[str, Any] = {"wear": self._wear, "readings": self.readings}
        parts |= {"belief": self._belief, "state": self.state}
        found = {f"{p}_{n}": v for p, values in parts.items() for n, v in values._asdict().items()}
        del found["state_tick"]  # it is the environment's
        found["loads"] = self._loads
        return found

    @property
    def greatest(self) -> dict[str, int]:
        """The largest whole number that an array may hold where it looks something up."""
        return {"wear_latency": self._wear.history.shape[1] - 1}
