"""Models that are wrong, and measurements that are noisy: the data of the identification."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import mujoco.batch
import numpy as np

from eval.papers.log import Log
from eval.papers.trial import RATES
from fbid_gym.dynamics.contacts import ContactGeometry
from fbid_gym.dynamics.identification import (
    Samples,
    body_parameters,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from fbid_gym.dynamics.live_terms import LiveTerms
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import Robot


def wrong_model(robot: Robot, size: float, rng: np.random.Generator) -> Robot:
    """Return a robot whose link masses and centres of mass are wrong.

    Each mass is off by a factor from 1 - size to 1 + size, and with it the inertia; each centre of
    mass by a displacement of up to `size` along every principal axis, in units of the half-length
    of the uniform box with the link's inertia.

    Args:
        robot: the true one.
        size: largest relative error.
        rng: to draw from.
    """
    bodies = np.flatnonzero(robot.model.body_mass > 0.0)
    matrix = pseudo_inertia(body_parameters(robot.model, bodies))
    mass = matrix[:, 3, 3]
    com = matrix[:, :3, 3] / mass[:, None]
    spread, axes = np.linalg.eigh(
        matrix[:, :3, :3] / mass[:, None, None] - com[:, :, None] * com[:, None]
    )
    displacement = rng.uniform(-size, size, com.shape) * np.sqrt(3.0 * spread)
    shift = np.tile(np.eye(4), (len(bodies), 1, 1))
    shift[:, :3, 3] = np.matvec(axes, displacement)
    factor = 1.0 + rng.uniform(-size, size, len(bodies))
    wrong = factor[:, None, None] * (shift @ matrix @ shift.mT)
    return with_parameters(robot, bodies, parameters_of_pseudo_inertia(wrong))


def believing(models: Sequence[Robot]) -> Callable[[Simulation], Callable[[], DynamicsTerms]]:
    """Return what gives each robot of a trial the dynamics terms of its own, wrong model.

    Args:
        models: one per robot of the trial.
    """

    def believe(simulation: Simulation) -> Callable[[], DynamicsTerms]:
        batch = mujoco.batch.Batch(simulation.robot.model, len(models), 1, persistent=True)
        for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
            batch.expand(name)[:] = [getattr(model.model, name) for model in models]
        batch.set_const(np.arange(len(models)))
        live, qpos, qvel = (
            LiveTerms(simulation.robot, batch),
            batch.bind("qpos"),
            batch.bind("qvel"),
        )

        def terms() -> DynamicsTerms:
            qpos[:], qvel[:] = simulation.qpos, simulation.qvel
            batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
            return live()

        return terms

    return believe


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
        np.array(part[:, index], float) for part in (log.qpos, log.qvel, log.torque)
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
    active = np.tile(planted[ContactGeometry.of(robot).foot_of_point], (len(position), 1))
    return Samples(position, velocity, smooth(qvel, 1), smooth(torque), active)
