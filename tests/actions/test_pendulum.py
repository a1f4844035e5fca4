"""Standing legs carry a robot as a pendulum on its centre of pressure."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions.joint_gains import holding_torque
from fbid_gym.actions.pendulum import Pendulum, carry
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind, home_target, standing_target
from fbid_gym.runtime.config import EnvConfig
from tests.actions.cases import layer_of

OMEGA = 3.0


@pytest.fixture(scope="module", params=["go1", "biped", "g1"])
def robot(request):
    return robots.load(request.param)


def standing(robot, rng, links):
    """Robots at rest in some postures, all feet to carry, and the pendulum of such robots."""
    qpos = np.repeat(robot.home_qpos[None], 3, axis=0)
    qpos[:, 7:] += 0.05 * rng.normal(size=(3, robot.num_joints))
    terms = MuJoCoDynamics(robot).terms(qpos, np.zeros((3, robot.nv)))
    target = standing_target(terms, robot.home_qpos)
    kind = MotionKind(True, OMEGA)
    return Pendulum.of(robot, kind, links=links), target, terms


def test_gravity_compensation_is_an_equilibrium(robot, rng):
    """The feet's forces and moments that are left to balance gravity do, in all coordinates."""
    pendulum, target, terms = standing(robot, rng, links=True)
    torque = carry(pendulum, target, terms)
    rows = 6 if robot.has_soles else 3
    for i in range(3):
        left = terms.bias[i].copy()
        left[6:] -= torque[i]
        jacobian = terms.foot_jacobian[i, :, :rows].reshape(-1, robot.nv)
        force, *_ = np.linalg.lstsq(jacobian.T, left, rcond=1e-9)
        np.testing.assert_allclose(jacobian.T @ force, left, atol=1e-6 * robot.weight)
        vertical = force.reshape(-1, rows)[:, 2]
        assert (vertical > 0.0).all() and vertical.sum() == pytest.approx(robot.weight)


def test_legs_hold_their_own_weight_as_at_home(robot):
    """There that is gravity compensation; as before, legs on points that step leave it out."""
    stance, kind = Stance.of(robot), MotionKind(True, OMEGA)
    held, whole, massless = (
        carry(Pendulum.of(robot, kind, **told), home_target(robot), stance.terms)[0]
        for told in ({}, {"links": True}, {"leg_weight": False})
    )
    np.testing.assert_allclose(held, whole, atol=1e-9 * robot.weight)
    if robot.has_soles:
        np.testing.assert_allclose(massless, holding_torque(robot), atol=1e-9 * robot.weight)
        return
    legs, own = stance.legs.any(axis=0), robot.gravity * stance.terms.mass_matrix[0, 2, 6:]
    np.testing.assert_allclose(held - massless, np.where(legs, own, 0.0), atol=1e-9 * robot.weight)


def test_one_foot_pushes_from_the_centre_of_pressure_to_the_centre_of_mass(rng):
    robot = robots.load("biped")
    pendulum, target, terms = standing(robot, rng, links=False)
    target.load[:, 1] = 0.0
    target.com_acceleration[:, :2] = 0.3 * rng.normal(size=(3, 2))
    torque, legs = carry(pendulum, target, terms) - pendulum.rest, Stance.of(robot).legs
    np.testing.assert_array_equal(torque[:, legs[1]], 0.0)
    for i in range(3):
        own = terms.foot_jacobian[i, 0][:, 6:][:, legs[0]]
        pushed, *_ = np.linalg.lstsq(own.T, -torque[i, legs[0]], rcond=1e-9)
        force, moment = np.split(pushed, 2)
        foot, com = terms.foot_position[i, 0], terms.com[i]
        pressure = com - target.com_acceleration[i] / OMEGA**2
        to_com = np.append((com - pressure)[:2], com[2] - foot[2])
        np.testing.assert_allclose(force, robot.weight * to_com / to_com[2], rtol=1e-6)
        at = np.append(pressure[:2], foot[2])
        np.testing.assert_allclose(moment, np.cross(at - foot, force), atol=1e-6 * robot.weight)


def test_in_flight_nothing_is_carried(robot, rng):
    pendulum, target, terms = standing(robot, rng, links=False)
    target.load[:] = 0.0
    rest = np.broadcast_to(pendulum.rest, (3, robot.num_joints))
    np.testing.assert_array_equal(carry(pendulum, target, terms), rest)


def test_who_holds_the_home_posture_is_no_pendulum():
    with pytest.raises(InvalidValueError, match=r"pendulum.*True"):
        layer_of("joint_position", robots.load("biped"), reference="home", pendulum=True)


@pytest.mark.parametrize(("task", "lifts"), [("balance", False), ("squat", False), ("step", True)])
def test_who_lifts_feet_is_a_pendulum_by_default(task, lifts):
    config = EnvConfig.of({"task": task, "robot": "biped", "action_layer": "joint_position"})
    assert EnvBatch(config, 1).layer.pendulum == lifts
