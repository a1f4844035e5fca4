"""`task_space_position`: PD on the places of body and feet, through their Jacobians."""

import numpy as np
import pytest

from fbid_gym.actions.joint_gains import JointGains, sampled_growth
from fbid_gym.actions.ranges import Falling
from fbid_gym.dynamics.stance import Stance
from tests.actions.cases import at_rest, home_of, layer_of, torque_of


def test_what_an_action_moves_is_pulled_there(robot, rng):
    """From home at rest, where nothing else pulls: tau = tau_home + sum of J^T K gap."""
    layer = layer_of("task_space_position", robot)
    state, terms = at_rest(robot)
    home = home_of(robot, terms)
    action = rng.uniform(-1.0, 1.0, (1, len(layer.action_names)))
    rows = len(layer.reach.stiffness)
    moved = np.repeat(layer.scale[[0, 3]], 3) * action[0, :6]
    axes = terms.world_from_trunk[0]
    moved[:3] = axes @ moved[:3]  # at home the heading is the trunk's
    expected = torque_of(layer, state, home, terms)[0]
    for foot, own in enumerate(Stance.of(robot).legs):
        jacobian = terms.foot_jacobian[0, foot, :rows]
        gap = -jacobian[:, :6] @ moved
        at = 6 + 3 * foot
        gap[:3] += axes @ (layer.reach.feet_scale * action[0, at : at + 3])
        expected += own * (jacobian[:, 6:].T @ (layer.reach.stiffness * gap))
    torque = torque_of(layer, state, home, terms, action)[0]
    np.testing.assert_allclose(torque, expected, atol=1e-6 * robot.weight)


@pytest.mark.parametrize("loop_delay", [0.0, 0.005])
def test_its_stiffness_is_steady_in_the_air(robot, loop_delay):
    layer = layer_of("task_space_position", robot, 250, loop_delay=loop_delay)
    stance, own = Stance.of(robot), layer.reach.joints
    stiffness = np.diag(own.stiffness)
    for foot, leg in enumerate(stance.legs):
        jacobian = stance.terms.foot_jacobian[0, foot, : len(layer.reach.stiffness), 6:] * leg
        stiffness += jacobian.T @ (layer.reach.stiffness[:, None] * jacobian)
    growth = sampled_growth(robot, stiffness, own.damping, 250, loop_delay)
    assert growth < 1.0 + 1e-6
    joints = JointGains.of(robot, 250, Falling(3.4), 1.0, loop_delay)
    np.testing.assert_array_equal(own.damping, joints.damping)
