"""Rotations and coordinate changes, against MuJoCo, Pinocchio and finite differences."""

import mujoco
import numpy as np

from fbid_gym.dynamics import frames
from tests.dynamics.models import random_mjcf, random_states

ANGLES = [0.0, 1e-12, 1e-6, 0.3, 2.0, 3.0, np.pi - 1e-6, np.pi - 1e-12]


def unit(rng, *shape):
    vector = rng.normal(size=shape)
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def vectors(rng, angle, count=50):
    return angle * unit(rng, count, 3)


def to_quaternion(rotation_vectors):
    angle = np.linalg.norm(rotation_vectors, axis=-1, keepdims=True)
    return np.hstack((np.cos(angle / 2), rotation_vectors * np.sinc(angle / 2 / np.pi) / 2))


# --- rotations -------------------------------------------------------------------------------


def test_quaternion_to_matrix_is_mujocos(rng):
    quaternions = unit(rng, 50, 4)
    expected = np.empty((50, 9))
    for row, quaternion in zip(expected, quaternions, strict=True):
        mujoco.mju_quat2Mat(row, quaternion)
    actual = frames.quaternion_to_matrix(quaternions)
    np.testing.assert_allclose(actual, expected.reshape(50, 3, 3), atol=1e-15)
    scaled = frames.quaternion_to_matrix(rng.uniform(0.1, 9, size=(50, 1)) * quaternions)
    np.testing.assert_allclose(scaled, actual, atol=1e-15)


def test_rotation_vectors_and_quaternions_are_found_again_at_every_angle(rng):
    for angle in ANGLES:
        expected = vectors(rng, angle)
        quaternions = to_quaternion(expected)
        matrices = frames.quaternion_to_matrix(quaternions)
        tolerance = 1e-15 + 4e-15 * angle
        np.testing.assert_allclose(frames.rotation_vector(matrices), expected, atol=tolerance)
        found = frames.matrix_to_quaternion(matrices)
        assert (found[:, 0] >= 0).all()
        np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-15)
        np.testing.assert_allclose(found, quaternions, atol=2e-15)
    expected = vectors(rng, 1e-9)  # with its relative accuracy
    found = frames.rotation_vector(frames.quaternion_to_matrix(to_quaternion(expected)))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-24)
    axis = unit(rng, 50, 3)  # half a turn has length pi
    half = np.hstack((np.zeros((50, 1)), axis))
    vector = frames.rotation_vector(frames.quaternion_to_matrix(half))
    np.testing.assert_allclose(np.linalg.norm(vector, axis=-1), np.pi)
    np.testing.assert_allclose(np.abs(np.vecdot(vector, axis)), np.pi)


def test_orientation_error_turns_the_first_into_the_second(rng):
    """A body that turns at the error, in world axes, arrives after one second."""
    first, second = unit(rng, 20, 4), unit(rng, 20, 4)
    matrices = frames.quaternion_to_matrix(first), frames.quaternion_to_matrix(second)
    error = frames.rotation_vector(matrices[1] @ matrices[0].mT)
    for quaternion, vector, rotation, target in zip(first, error, *matrices, strict=True):
        body_rate = rotation.T @ vector
        mujoco.mju_quatIntegrate(quaternion, body_rate, 1.0)
        np.testing.assert_allclose(frames.quaternion_to_matrix(quaternion), target, atol=1e-14)


# --- coordinates of the floating base ----------------------------------------------------------


def test_configuration_round_trip():
    """Velocities and their products are held with Pinocchio's model, on every body."""
    model = mujoco.MjModel.from_xml_string(random_mjcf(7))
    qpos, _ = random_states(model, 20)
    assert np.abs(model.qpos0[7:]).min() > 1e-3  # `ref` matters here
    q = frames.configuration_to_pinocchio(qpos, model.qpos0)
    back = np.concatenate((q[:, :3], q[:, [6, 3, 4, 5]], q[:, 7:] + model.qpos0[7:]), axis=1)
    np.testing.assert_allclose(back, qpos)
    unscaled = qpos.copy()
    unscaled[:, 3:7] *= 3.0
    np.testing.assert_allclose(frames.configuration_to_pinocchio(unscaled, model.qpos0), q)
