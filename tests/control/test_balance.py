"""The desired wrench: the spring of a potential, damping of the right thing, gains checked."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from eval.papers.garofalo2015.balancer import TABLE_1
from fbid_gym.control.balance import (
    BalanceTarget,
    desired_wrench_garofalo2015,
    desired_wrench_ott2011,
    resting_target,
)
from fbid_gym.control.balance_gains import BalanceGains

COUNT = 20


def symmetric(rng, size=1.0):
    """A random symmetric positive definite matrix (3, 3)."""
    root = rng.normal(size=(3, 3))
    return size * (root @ root.T + 0.1 * np.eye(3))


def spring(stiffness):
    return BalanceGains(1.0, 1.0, rotation_stiffness=stiffness, rotation_damping=1.0)


def quaternion(rotation):
    """Scalar part (N,) and vector part (N, 3), of either sign."""
    xyzw = Rotation.from_matrix(rotation).as_quat()
    return xyzw[:, 3], xyzw[:, :3]


@pytest.fixture
def orientations(rng):
    """Actual and desired rotations, (COUNT, 3, 3) each, by any angle from each other."""
    return [Rotation.random(COUNT, rng=rng).as_matrix() for _ in range(2)]


def moment_of(gains, rotation, desired):
    """(N, 3) N·m of the rotational spring alone, world: of robots at rest where they should be."""
    still = np.zeros((len(rotation), 3))
    state = {"com": still, "rotation": rotation, "momentum": np.zeros((len(still), 6)), "mass": 1.0}
    return desired_wrench_garofalo2015(gains, resting_target(still, desired), **state)[:, 3:]


# --- the rotational spring -------------------------------------------------------------------


def test_the_moment_is_the_papers_and_the_gradient_of_a_potential(rng, orientations):
    rotation, desired = orientations
    stiffness = symmetric(rng)
    gains = spring(stiffness)
    moment = moment_of(gains, rotation, desired)
    # -tau_P with the error R^T R_d, in the axes of the base; tau_P, with the error as printed, in
    # the axes of the desired orientation.
    for axes, other, sign in ((rotation, desired, 2.0), (desired, rotation, -2.0)):
        scalar, vector = quaternion(axes.mT @ other)
        turned = vector @ stiffness
        expected = np.matvec(axes, sign * (scalar[:, None] * turned + np.cross(vector, turned)))
        np.testing.assert_allclose(moment, expected, atol=1e-12)

    def energy(rotation):
        _, vector = quaternion(desired.mT @ rotation)
        return 2.0 * np.vecdot(vector, vector @ stiffness)

    for axis in np.eye(3):
        turn = Rotation.from_rotvec(1e-5 * axis).as_matrix()
        slope = (energy(turn @ rotation) - energy(turn.T @ rotation)) / 2e-5
        np.testing.assert_allclose(moment @ axis, -slope, atol=1e-8)
    # Linear for small errors, and finite half a turn away.
    error = 1e-6 * rng.normal(size=(COUNT, 3))
    near = moment_of(gains, desired @ Rotation.from_rotvec(error).as_matrix(), desired)
    np.testing.assert_allclose(near, -np.matvec(desired @ stiffness, error), atol=1e-11)
    opposite = np.diag([1.0, -1.0, -1.0])[None]
    np.testing.assert_allclose(moment_of(spring(5.0), opposite, np.eye(3)[None]), 0.0, atol=1e-12)


# --- the laws ----------------------------------------------------------------------------------


@pytest.fixture
def measured(rng, orientations):
    rotation, desired = orientations
    wanted, *moving = rng.normal(size=(4, COUNT, 3))
    target = BalanceTarget(wanted, desired, *moving, rng.normal(size=(COUNT, 6)))
    com, mass = rng.normal(size=(COUNT, 3)), rng.uniform(20.0, 80.0, COUNT)
    return target, {"com": com, "rotation": rotation, "mass": mass}


def test_eqs_36_38_and_39(rng, measured):
    target, state = measured
    gains, mass = BalanceGains(*(symmetric(rng) for _ in range(4))), state["mass"][:, None]
    velocity, spin, momentum = *rng.normal(size=(2, COUNT, 3)), rng.normal(size=(COUNT, 6))
    rates = {"com_velocity": velocity, "angular_velocity": spin}
    ott = desired_wrench_ott2011(gains, target, **rates, **state)
    garofalo = desired_wrench_garofalo2015(gains, target, momentum=momentum, **state)
    rest = np.zeros((COUNT, 6))
    rest[:, :3] = mass * [0.0, 0.0, 9.81] - (state["com"] - target.com) @ gains.stiffness
    rest[:, 3:] = moment_of(gains, state["rotation"], target.world_from_base)
    rest += target.momentum_rate
    left = momentum[:, :3] - mass * target.com_velocity, momentum[:, 3:] - target.angular_momentum
    for wrench, late, turning in (
        (ott, velocity - target.com_velocity, spin - target.angular_velocity),
        (garofalo, *left),
    ):
        damped = np.concatenate([late @ gains.damping, turning @ gains.rotation_damping], axis=1)
        np.testing.assert_allclose(wrench, rest - damped, atol=1e-10)


def test_both_laws_damp_a_rigid_body_alike(rng, orientations):
    rotation, desired = orientations
    mass, inertia = 60.0, np.diag([3.0, 2.0, 0.4])
    gains = BalanceGains.from_frequencies(mass, inertia, linear=1.0, rotation=(1.5, 1.2, 0.8))
    com, velocity, spin = rng.normal(size=(3, COUNT, 3))
    target = resting_target(com + 0.1, desired)
    state = {"com": com, "rotation": rotation, "mass": np.full(COUNT, mass)}
    momentum = np.concatenate([mass * velocity, spin @ inertia], axis=1)
    ours = desired_wrench_garofalo2015(gains, target, momentum=momentum, **state)
    rates = {"com_velocity": velocity, "angular_velocity": spin}
    theirs = desired_wrench_ott2011(gains.on_velocity(mass, inertia), target, **rates, **state)
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


# --- gains -------------------------------------------------------------------------------------


def test_gains_are_matrices():
    gains = BalanceGains(2.0, (1.0, 2.0, 3.0), np.diag([4.0, 5.0, 0.0]), 1)
    np.testing.assert_array_equal(gains.stiffness, 2.0 * np.eye(3))
    np.testing.assert_array_equal(gains.damping, np.diag([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(gains.rotation_stiffness, np.diag([4.0, 5.0, 0.0]))


def test_frequencies_become_gains(rng):
    inertia = symmetric(rng)
    gains = BalanceGains.from_frequencies(
        50.0, inertia, linear=(1.0, 2.0, 3.0), rotation=1.5, damping_ratio=0.7
    )
    # m x'' = -K_P x - K_D m x', and the same for rotation with `inertia`
    for axis, hertz in enumerate((1.0, 2.0, 3.0)):
        roots = np.roots([1.0, gains.damping[axis, axis], gains.stiffness[axis, axis] / 50.0])
        np.testing.assert_allclose(np.abs(roots), 2.0 * np.pi * hertz)
        np.testing.assert_allclose(-roots.real / np.abs(roots), 0.7)
    omega = 3.0 * np.pi
    np.testing.assert_allclose(gains.rotation_stiffness, omega**2 * inertia)
    np.testing.assert_allclose(gains.rotation_damping, 1.4 * omega * np.eye(3))


def test_table_1_is_nearly_critical_damping_of_the_hips_rotation():
    """K_R and D fit each other if D multiplies momentum: TORO's stance inertia is a few kg m^2."""
    for axis in range(2):
        stiffness = TABLE_1.rotation_stiffness[axis, axis]
        damping = TABLE_1.rotation_damping[axis, axis]
        # D = 2 zeta w and K_R = I w^2 give I = 4 zeta^2 K_R / D^2.
        assert 3.0 < 4.0 * stiffness / damping**2 < 6.0
