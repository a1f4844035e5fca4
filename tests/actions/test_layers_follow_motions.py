"""Which way a robot faces does not matter to layers, nor where it is."""

import numpy as np
import pytest

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import in_world
from fbid_gym.robots import ROBOTS
from tests import postures
from tests.actions.cases import layer_of, planned, torque_of
from tests.pairs import pairs

FOLLOWING = [
    ("joint_position", {}),
    ("joint_position_feedforward", {}),
    ("joint_acceleration", {"contact_limits": "none"}),
    ("base_acceleration", {}),
    ("base_acceleration", {"contact_limits": "none"}),
    ("com_wrench", {}),
    ("com_wrench", {"balancer": "garofalo2015"}),
    ("com_wrench", {"balancer": "ott2011", "contact_limits": "none"}),
]


def turned(state, angle):
    """The same robots elsewhere, turned about the vertical by `angle`."""
    qpos, rotation = postures.turned(state.qpos, angle, np.array([3.0, -2.0, 0.0]))
    qvel = state.qvel.copy()
    qvel[:, :3] = qvel[:, :3] @ rotation.T
    return state._replace(qpos=qpos, qvel=qvel)


@pytest.mark.parametrize(("name", "options", "robot"), pairs(FOLLOWING, ROBOTS), indirect=["robot"])
def test_which_way_a_robot_faces_does_not_matter(robot, states, name, options, rng):
    layer = layer_of(name, robot, **options)
    state, terms = states(6)
    action, motion = rng.uniform(-1, 1, (6, len(layer.action_names))), planned(robot, 6, rng)
    heading = Stance.of(robot).heading
    here = torque_of(layer, state, in_world(heading, motion, terms), terms, action)
    for angle in (0.7, 2.9, -1.8):
        elsewhere = turned(state, angle)
        known = MuJoCoDynamics(robot).terms(elsewhere.qpos, elsewhere.qvel)
        there = torque_of(layer, elsewhere, in_world(heading, motion, known), known, action)
        np.testing.assert_allclose(there, here, atol=1e-6 * robot.weight)
