"""Controllers that are wrong about their robot: models with errors, and who believes in them."""

from collections.abc import Callable, Mapping, Sequence

import mujoco
import mujoco.batch
import numpy as np

from eval.papers.inertial_parameters.inertia import (
    body_parameters,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from eval.papers.trial import Belief
from fbid_gym.dynamics import DynamicsTerms
from fbid_gym.dynamics.mujoco_dynamics import LiveTerms
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import Robot

_INERTIAL = ("body_mass", "body_inertia", "body_ipos", "body_iquat")


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


def believing(models: Sequence[Robot]) -> Belief:
    """Give each robot of a trial the dynamics terms of a model of its own, one per robot."""
    return believing_in({k: [getattr(m.model, k) for m in models] for k in _INERTIAL})


def believing_in(inertial: Mapping[str, np.ndarray | Sequence[np.ndarray]]) -> Belief:
    """Give each robot of a trial the dynamics terms of inertial parameters of its own.

    Args:
        inertial: fields of MuJoCo's model by name, with a row per robot.
    """

    def believe(simulation: Simulation) -> Callable[[], DynamicsTerms]:
        count = simulation.num_robots
        batch = mujoco.batch.Batch(simulation.robot.model, count, 1, persistent=True)
        for name, values in inertial.items():
            batch.expand(name)[:] = values
        batch.set_const(np.arange(count))
        live = LiveTerms(simulation.robot, batch)
        qpos, qvel = batch.bind("qpos"), batch.bind("qvel")

        def terms() -> DynamicsTerms:
            qpos[:], qvel[:] = simulation.qpos, simulation.qvel
            batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
            return live()

        return terms

    return believe
