"""Model-based layers ask for what a moving reference asks, whichever way the robot faces."""

import mujoco
import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import point_jacobian

FOLLOWING = ("joint_position_feedforward", "joint_acceleration", "base_acceleration")


def turned(state, angle):
    """The same robots elsewhere, turned about the vertical by `angle`."""
    quaternion, rotation = np.empty(4), np.empty(9)
    mujoco.mju_axisAngle2Quat(quaternion, np.array([0.0, 0.0, 1.0]), angle)
    mujoco.mju_quat2Mat(rotation, quaternion)
    rotation = rotation.reshape(3, 3)
    qpos, qvel = state.qpos.copy(), state.qvel.copy()
    for row in qpos:
        before = row[3:7].copy()
        mujoco.mju_mulQuat(row[3:7], quaternion, before)
    qpos[:, :3] = qpos[:, :3] @ rotation.T + [3.0, -2.0, 0.0]
    qvel[:, :3] = qvel[:, :3] @ rotation.T
    return state._replace(qpos=qpos, qvel=qvel), rotation


@pytest.mark.parametrize("name", FOLLOWING)
@pytest.mark.parametrize("limits", ["friction", "none"])
def test_which_way_a_robot_faces_does_not_matter(robot, states, moving, name, limits, rng):
    layer = make_layer(name, robot, 500, {"contact_limits": limits})
    state, terms = states(6)
    action = rng.uniform(-1, 1, (6, len(layer.action_names)))
    reference = moving(6)
    here = layer.torque(action, state, reference, lambda: terms, layer.memory(6))
    for angle in (0.7, 2.9, -1.8):
        elsewhere, _ = turned(state, angle)
        known = MuJoCoDynamics(robot).terms(elsewhere.qpos, elsewhere.qvel)
        there = layer.torque(action, elsewhere, reference, lambda k=known: k, layer.memory(6))
        np.testing.assert_allclose(there, here, atol=1e-6 * robot.weight)


def test_base_acceleration_adds_the_reference_to_its_springs(robot, states, moving, rng):
    """Entry by entry, in the frame of feet that face anywhere."""
    frequencies = {"balance": 0.7, "height": 1.3, "rotation": 1.7, "posture": 0.9}
    options = {f"{key}_frequency": value for key, value in frequencies.items()}
    layer = make_layer("base_acceleration", robot, 500, options | {"damping_ratio": 0.8})
    state, _ = turned(states(8)[0], 2.3)
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    reference, action = moving(8), rng.uniform(-1, 1, (8, 6))
    found = layer.acceleration(action, state, reference, terms)
    frame = layer.stance.frame(terms)
    w = {key: 2 * np.pi * value for key, value in frequencies.items()}

    def pulled(key, acceleration, position, velocity):
        return acceleration + w[key] ** 2 * position + 2 * 0.8 * w[key] * velocity

    for row in range(8):
        level = frame.world_from_support[row]
        com = level.T @ (terms.com[row] - frame.centre[row])
        com_velocity = level.T @ terms.com_velocity[row]
        linear = pulled(
            "balance",
            reference.com_acceleration_in_support[row],
            reference.com_in_support[row] - com,
            reference.com_velocity_in_support[row] - com_velocity,
        )
        linear[2] = pulled(
            "height",
            reference.qacc[row, 2],
            reference.qpos[row, 2] - (terms.base_position[row, 2] - frame.centre[row, 2]),
            reference.qvel[row, 2] - state.qvel[row, 2],
        )
        wanted = np.empty(9)
        mujoco.mju_quat2Mat(wanted, reference.qpos[row, 3:7])
        left = terms.world_from_base[row].T @ level @ wanted.reshape(3, 3)
        axial = 0.5 * np.array(
            [left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]]
        )
        rate = reference.qvel[row, 3:6] - state.qvel[row, 3:6]
        angular = pulled("rotation", reference.qacc[row, 3:6], axial, rate)
        joints = pulled(
            "posture",
            reference.qacc[row, 6:],
            reference.qpos[row, 7:] - state.qpos[row, 7:],
            reference.qvel[row, 6:] - state.qvel[row, 6:],
        )
        linear += layer.scale[:3] * action[row, :3]
        angular += layer.scale[3:] * action[row, 3:]
        expected = np.concatenate([level @ linear, angular, joints])
        np.testing.assert_allclose(found[row], expected, atol=1e-9)


def test_joint_acceleration_adds_the_reference_to_its_springs(robot, states, moving, rng):
    """The torque is that of [M10] eq. (15) for the nearest acceleration that the feet allow.

    Found with the weight of the base against the joints that the layer has, here by projections of
    the stacked contact points instead of reduced ones.
    """
    options = {"natural_frequency": 0.8, "damping_ratio": 0.6, "scale": 5.0}
    layer = make_layer("joint_acceleration", robot, 500, options | {"contact_limits": "none"})
    state, _ = turned(states(5)[0], -2.0)
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    reference, action = moving(5), rng.uniform(-1, 1, (5, robot.num_joints))
    # Feet that stand: the points of a turning foot move apart, which fewer rows see differently.
    jacobian, _ = point_jacobian(layer.law.constants.geometry, terms)
    for row in range(5):
        state.qvel[row] -= (
            np.linalg.pinv(jacobian[row], rcond=1e-9) @ jacobian[row] @ state.qvel[row]
        )
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    jacobian, bias = point_jacobian(layer.law.constants.geometry, terms)
    ours = layer.torque(action, state, reference, lambda: terms, layer.memory(5))
    w = 2 * np.pi * 0.8
    for row in range(5):
        wanted = np.zeros(robot.nv)
        wanted[6:] = reference.qacc[row, 6:] + 5.0 * action[row]
        wanted[6:] += w**2 * (reference.qpos[row, 7:] - state.qpos[row, 7:])
        wanted[6:] += 2 * 0.6 * w * (reference.qvel[row, 6:] - state.qvel[row, 6:])
        weight = 1.0 / np.sqrt(layer.law.constants.nearness.mobility)
        error = jacobian[row] @ wanted + bias[row]
        nearest = wanted - np.linalg.pinv(jacobian[row] / weight, rcond=1e-9) @ error / weight
        free = np.eye(robot.nv) - np.linalg.pinv(jacobian[row], rcond=1e-9) @ jacobian[row]
        force = free @ (terms.mass_matrix[row] @ nearest + terms.bias[row])
        expected = np.linalg.pinv(free[:, 6:], rcond=1e-9) @ force
        expected += robot.joint_damping * state.qvel[row, 6:]
        np.testing.assert_allclose(ours[row], expected, atol=1e-6 * robot.weight)
