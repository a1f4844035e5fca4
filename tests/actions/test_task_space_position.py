"""`task_space_position`: PD on the places of body and feet, through their Jacobians."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.linalg import null_space

from fbid_gym.actions.joint_gains import JointGains, growth, missing_damping, sampled_growth
from fbid_gym.actions.ranges import Falling
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import Target
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
    assert sampled_growth(robot, stiffness, own.damping, 250, loop_delay) < 1.0 + 1e-6
    joints = JointGains.of(robot, 250, Falling(3.4), 1.0, loop_delay)
    np.testing.assert_array_equal(own.damping, joints.damping)


@pytest.mark.parametrize("stands", [True, False])
def test_with_a_delay_it_knows_no_motion_grows(robot, stands):
    """By the differences of its torques: with the feet held where they are, and in the air."""
    delay, small = 0.005, 1e-6
    layer = layer_of("task_space_position", robot, 250, loop_delay=delay)
    # What leads feet by the base's velocity is bounded, and no part of small motions.
    legs = layer.reach.legs._replace(lead=0.0)
    layer = replace(layer, reach=layer.reach._replace(legs=legs))
    _, terms = at_rest(robot)
    feet = terms.foot_jacobian[0, :, : legs.rows].reshape(-1, robot.nv)
    moves = null_space(feet, rcond=1e-9) if stands else np.eye(robot.nv)
    count = moves.shape[1]
    state, _ = at_rest(robot, 4 * count)
    for k in range(count):
        for side, row in ((small, 4 * k), (-small, 4 * k + 1)):
            mujoco.mj_integratePos(robot.model, state.qpos[row], moves[:, k].copy(), side)
            state.qvel[row + 2] = side * moves[:, k]
    home = Target(*(np.repeat(value, 4 * count, axis=0) for value in home_of(robot, terms)))
    there = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    torque = torque_of(layer, state, home, there)
    back = np.linalg.solve(moves.T @ terms.mass_matrix[0] @ moves, moves[6:].T)
    stiff, damped = (
        -back @ (torque[first::4] - torque[first + 1 :: 4]).T / (2.0 * small) for first in (0, 2)
    )
    assert growth(stiff, damped, 250, delay) < 1.0 + 1e-4
    asked = missing_damping(JointGains.of(robot, 250, Falling(3.4), 1.0, delay))
    assert 0.0 <= legs.calm <= asked
