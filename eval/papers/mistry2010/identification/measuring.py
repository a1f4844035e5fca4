"""Noisy measurements: the data of the identification."""

from dataclasses import dataclass

import numpy as np

from eval.papers.inertial_parameters import Samples
from eval.papers.log import Log
from eval.papers.trial import RATES
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.robots import Robot


@dataclass(frozen=True)
class Noise:
    """White noise of the sensors at every control tick, standard deviations.

    Attributes:
        joint: rad.
        joint_rate: rad/s.
        tilt: rad, orientation of the base.
        spin: rad/s, angular velocity of the base.
        drift: m/s, linear velocity of the base.
        torque: N·m.
    """

    joint: float = 2e-4
    joint_rate: float = 1e-2
    tilt: float = 1e-3
    spin: float = 5e-3
    drift: float = 1e-2
    torque: float = 0.5


@dataclass(frozen=True)
class Filter:
    """Local polynomials through a moving window: they smooth, and they differentiate.

    The torques pass the same filter as the velocities, so that nothing lags behind.

    Attributes:
        half: ticks on either side of an instant.
        order: of the polynomial.
        every: ticks from one sample to the next.
    """

    half: int = 100
    order: int = 5
    every: int = 5

    def __call__(self, values: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return (samples, m) of values (T, m), or of their derivative by time."""
        time = np.arange(-self.half, self.half + 1) / RATES.control
        weights = np.linalg.pinv(np.vander(time, self.order + 1, increasing=True))[derivative]
        windows = np.lib.stride_tricks.sliding_window_view(values, len(time), axis=0)
        return np.asarray(windows[:: self.every] @ weights)


def measured(
    robot: Robot,
    log: Log,
    index: int,
    planted: np.ndarray,
    level: float,
    rng: np.random.Generator,
    noise: Noise = Noise(),
    smooth: Filter = Filter(),
) -> Samples:
    """Samples from what the sensors of one robot say.

    Torques are the commanded ones less the joints' damping, accelerations come from velocities.

    Args:
        robot: the true robot, for its damping and contact points.
        log: of its motion, all ticks.
        index: which robot of the log.
        planted: (F,) bool, feet that may carry force.
        level: of the noise, 0 for none and 1 for `noise`.
        rng: of the noise.
        noise: standard deviations at level 1.
        smooth: the filter.
    """
    qpos, qvel, torque = (
        np.array(log[name][:, index], float) for name in ("qpos", "qvel", "torque")
    )

    def add(values: np.ndarray, deviation: float) -> None:
        values += level * deviation * rng.normal(size=values.shape)

    add(qpos[:, 7:], noise.joint)
    add(qpos[:, 4:7], noise.tilt / 2)  # near the identity; the filter and the terms normalise
    add(qvel[:, :3], noise.drift)
    add(qvel[:, 3:6], noise.spin)
    add(qvel[:, 6:], noise.joint_rate)
    add(torque, noise.torque)
    torque -= robot.joint_damping * qvel[:, 6:]
    position, velocity = smooth(qpos), smooth(qvel)
    active = np.tile(planted[contact_geometry(robot).foot_of_point], (len(position), 1))
    return Samples(position, velocity, smooth(qvel, 1), smooth(torque), active)
