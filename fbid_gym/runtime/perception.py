"""Sensor readings and estimates of N simulated robots, beside their true state.

Where sensors are perfect there is none of it.
"""

from collections.abc import Mapping

import numpy as np

from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.stance import Stance
from fbid_gym.estimation.errors import ERRORS, find_errors
from fbid_gym.estimation.estimator import Estimator
from fbid_gym.estimation.random_numbers import seeded
from fbid_gym.estimation.sensing import Wear, instruments_of, sense
from fbid_gym.estimation.sensors import UNITS, Sensors
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot

_ERRING = tuple(f"{unit}_{error}" for error in ("bias", "scale") for unit in UNITS)


class Perception:
    """The simulated sensors of N robots, and what these make of them.

    Attributes:
        sensors: of the robots.
        estimator: of their state, from what the sensors read.
    """

    def __init__(self, robot: Robot, sensors: Sensors, hz: int, tick: np.ndarray) -> None:
        """Build them for as many robots as there are `tick` (N,), control ticks of episodes."""
        count, feet = len(tick), robot.num_feet
        self.sensors, self._hz = sensors, hz
        self.estimator = Estimator(robot, sensors, hz, tick)
        points = Stance.of(robot).geometry.foot_of_point
        self._instruments = instruments_of(sensors, self.estimator.mounting, points, hz, robot)
        latest = max(sensors.imu_latency[1], sensors.encoder_latency[1], sensors.contact_latency[1])
        ages, size = 1 + round(latest * hz), 6 + 2 * robot.num_joints + feet + 1
        self._wear = Wear(
            generator=np.ones((count, 2), np.int64),
            mounted=np.tile(np.eye(3), (count, 1, 1)),
            latency=np.zeros((count, 3), np.int64),
            begun=np.zeros(count, bool),
            wrong=np.zeros((count, feet), bool),
            history=np.zeros((count, ages, size)),
            **{name: np.zeros((count, 3)) for name in (*_ERRING, "moved")},
        )
        self._all = np.ones(count, bool)

    def draw(self, env: int, rng: np.random.Generator) -> None:
        """Draw how the sensors of one robot err in its next episode."""
        own, wear = self.sensors.scaled, self._wear
        wear.generator[env] = seeded(rng)
        for unit in UNITS:
            for error in ("bias", "scale"):
                size = getattr(own, f"{unit}_{error}")
                getattr(wear, f"{unit}_{error}")[env] = size * rng.standard_normal(3)
        turned = own.misalignment * rng.standard_normal(3)
        half = np.concatenate([[1.0], 0.5 * turned])
        wear.mounted[env] = quaternion_to_matrix(half / np.linalg.norm(half)).T
        for kind, name in enumerate(("imu", "encoder", "contact")):
            latency = rng.uniform(*getattr(own, f"{name}_latency"))
            wear.latency[env, kind] = round(latency * self._hz)

    def begin(self, ids: np.ndarray, actual: RobotState) -> None:
        """Begin episodes of robots `ids` (K,), which rest where they are and know their heading."""
        self._wear.begun[ids], self._wear.wrong[ids] = False, False
        which = np.zeros(len(self._all), bool)
        which[ids] = True
        sense(self._instruments, actual, which, self._wear, self.estimator.readings)
        self.estimator.begin(ids, actual.qpos[ids])

    def update(self, actual: RobotState, torque: np.ndarray) -> None:
        """Read the sensors at the end of a control tick, and go on with the estimate.

        The state is the actual one, the torque (N, n) N·m that of the motors in the tick.
        """
        sense(self._instruments, actual, self._all, self._wear, self.estimator.readings)
        self.estimator.update(torque)

    def errors(self, actual: RobotState) -> dict[str, np.ndarray]:
        """Return by how much the estimate errs, by the names of `ERRORS`: (N,) each."""
        own = self.estimator
        points = self._instruments.foot_of_point
        found = find_errors(actual, own.state, points, own.threshold, own.contact)
        return dict(zip(ERRORS, (*found, own.belief.restarts.copy()), strict=True))

    @property
    def drawn(self) -> dict[str, np.ndarray]:
        """Present errors of the sensors: (N, ...) by name; live."""
        return {name: getattr(self._wear, name) for name in (*_ERRING, "mounted", "latency")}

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """All that goes on from tick to tick, by name; live."""
        worn = {f"wear_{name}": value for name, value in self._wear._asdict().items()}
        return worn | dict(self.estimator.arrays)
