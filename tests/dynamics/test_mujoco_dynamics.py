"""The batch's terms against MuJoCo's own functions, one robot at a time."""

import mujoco
import mujoco.batch
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.mujoco_dynamics import LiveTerms
from tests.dynamics.models import random_states, relative_error, robot_called

EXACT = 1e-9


@pytest.fixture(scope="module", params=[*robots.ROBOTS, 0, 1, 2, 3])
def robot(request):
    """Robots and random trees; odd seeds have armature on the free joint."""
    return robot_called(request.param)


def assert_row(terms, row, model, data, base):
    """One robot's terms are those of its data."""
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    expected = {"mass_matrix": matrix, "bias": data.qfrc_bias, "base_position": data.xpos[base]}
    expected |= {"world_from_base": data.xmat[base].reshape(3, 3), "com": data.subtree_com[base]}
    expected |= {"com_velocity": data.subtree_linvel[base]}
    for name, value in expected.items():
        assert relative_error(getattr(terms, name)[row], value) < EXACT, name


def forwarded(model, qpos, qvel):
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    return data


def test_terms_are_mujocos(robot):
    qpos, qvel = random_states(robot.model, 4)
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    for index in range(4):
        data = forwarded(robot.model, qpos[index], qvel[index])
        assert_row(terms, index, robot.model, data, robot.base_body)


def test_the_batch_changes_nothing(robot):
    """A robot's terms are the same bits alone and among others, and do not change afterwards."""
    qpos, qvel = random_states(robot.model, 16)
    dynamics = MuJoCoDynamics(robot)
    together = dynamics.terms(qpos, qvel)
    kept = type(together)(*(value.copy() for value in together))
    alone = MuJoCoDynamics(robot).terms(qpos[5:6], qvel[5:6])
    dynamics.terms(qpos[::-1], qvel[::-1])  # another call must not touch what was returned
    for name, ours in kept._asdict().items():
        np.testing.assert_array_equal(getattr(together, name), ours, err_msg=name)
        np.testing.assert_array_equal(getattr(alone, name)[0], ours[5], err_msg=name)


def test_robots_of_different_masses(robot, rng):
    """Per-simulation masses, as domain randomisation makes them, enter every term."""
    qpos, qvel = random_states(robot.model, 3)
    batch = mujoco.batch.Batch(robot.model, 3, 1, persistent=True)
    live = LiveTerms(robot, batch)
    scale = rng.uniform(0.5, 2.0, (3, robot.model.nbody))
    shift = rng.normal(size=(3, robot.model.nbody, 3)) * 0.05
    batch.expand("body_mass")[:] = robot.model.body_mass * scale
    batch.expand("body_inertia")[:] = robot.model.body_inertia * scale[:, :, None]
    batch.expand("body_ipos")[:] = robot.model.body_ipos + shift
    batch.set_const()
    batch.bind("qpos")[:], batch.bind("qvel")[:] = qpos, qvel
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
    terms = live()
    for index in range(3):
        model = batch.get_model(index)
        data = forwarded(model, qpos[index], qvel[index])
        assert_row(terms, index, model, data, robot.base_body)


@pytest.mark.parametrize("count", [1, 3])
def test_other_bodies_of_the_world_change_nothing(robot, count):
    """The robot comes first in buffers that hold more."""
    spec = robot.spec.copy()
    other = spec.worldbody.add_body(pos=[9.0, 9.0, 9.0])
    other.add_freejoint()
    other.add_geom(size=[0.1, 0.0, 0.0], mass=1.0)
    other.mass, other.inertia, other.explicitinertial = 1.0, np.ones(3), True
    world = spec.compile()
    assert world.nv == robot.nv + 6
    qpos, qvel = random_states(robot.model, count)
    batch = mujoco.batch.Batch(world, count, 1, persistent=True)
    batch.bind("qpos")[:, : robot.nq], batch.bind("qvel")[:, : robot.nv] = qpos, qvel
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
    alone = MuJoCoDynamics(robot).terms(qpos, qvel)
    for name, value in LiveTerms(robot, batch)()._asdict().items():
        expected = getattr(alone, name)
        np.testing.assert_allclose(value, expected, rtol=1e-9, atol=1e-9, err_msg=name)


def test_bias_has_no_joint_damping():
    """Damping is the layers' business: h of [M10] has none."""
    robot = robots.load("biped")
    assert (robot.joint_damping > 0.0).all()
    qpos, qvel = random_states(robot.model, 2)
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    data = forwarded(robot.model, qpos[1], qvel[1])
    # M vdot + h = applied + passive forces, without contact.
    acceleration, force = np.zeros(robot.nv), data.qfrc_passive - terms.bias[1]
    mujoco.mj_solveM(robot.model, data, acceleration[None], force[None])
    np.testing.assert_allclose(acceleration, data.qacc_smooth, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(data.qfrc_passive[6:], -robot.joint_damping * qvel[1, 6:])
