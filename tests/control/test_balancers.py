"""Three maps from contact forces to torques: what each means, and what each leaves out."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.control import (
    ContactLimits,
    balancers,
    distribute,
    torque_map_garofalo2015,
    torque_map_inverse_dynamics,
    torque_map_ott2011,
)
from fbid_gym.dynamics import CentroidalTerms, DynamicsTerms, MuJoCoDynamics, centroidal_terms
from fbid_gym.dynamics.contacts import (
    ReducedContacts,
    contact_geometry,
    point_positions,
    reduced_contacts,
)

MAPS = (torque_map_ott2011, torque_map_garofalo2015, torque_map_inverse_dynamics)
COUNT = 8
LIMITS = ContactLimits(0.7)
EXACT = 1e-9


class Scene(NamedTuple):
    """Robots near their home stance."""

    robot: robots.Robot
    terms: DynamicsTerms
    body: CentroidalTerms
    contacts: ReducedContacts
    force: np.ndarray  # (COUNT, P, 3) random
    posture: np.ndarray  # (COUNT, n)

    @property
    def model(self) -> tuple[Any, ...]:
        """The arguments of every map."""
        return self.terms, self.body, self.contacts

    @property
    def row_force(self) -> np.ndarray:
        """(COUNT, k) of the random point forces."""
        return np.matvec(self.contacts.point_map, self.force.reshape(COUNT, -1))

    @property
    def wrench(self) -> np.ndarray:
        """(COUNT, 6) of the random point forces at the centre of mass."""
        arm = point_positions(contact_geometry(self.robot), self.terms) - self.terms.com[:, None]
        return np.concatenate([self.force.sum(1), np.cross(arm, self.force).sum(1)], axis=1)

    def accelerations(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations and row forces if the contacts hold, by the dynamics of (1) alone."""
        jacobian = self.contacts.jacobian
        inverse = np.linalg.inv(self.terms.mass_matrix)
        free = -self.terms.bias
        free[:, 6:] += torque
        response = inverse @ jacobian.mT
        motion = -self.contacts.bias - np.matvec(jacobian, np.matvec(inverse, free))
        force = np.matvec(np.linalg.pinv(jacobian @ response, rcond=1e-12), motion)
        return np.matvec(inverse, free + np.matvec(jacobian.mT, force)), force

    def momentum_rate(self, acceleration: np.ndarray) -> np.ndarray:
        """(COUNT, 6)."""
        rate = np.matvec(self.body.matrix, acceleration)
        rate += np.matvec(self.body.to_com, self.terms.bias[:, :6])
        rate[:, 2] -= 9.81 * self.robot.mass
        return rate

    @property
    def joint_inertia(self) -> np.ndarray:
        """(COUNT, n, n) that motors feel in flight, [G15] eq. (17)."""
        return np.linalg.inv(np.linalg.inv(self.terms.mass_matrix)[:, 6:, 6:])


def scene(name: str, rng: np.random.Generator, noise: float, speed: float) -> Scene:
    robot = robots.load(name)
    qpos = np.tile(robot.home_qpos, (COUNT, 1))
    qpos[:, 7:] += noise * rng.normal(size=(COUNT, robot.num_joints))
    velocity = speed * rng.normal(size=(COUNT, robot.nv))
    terms = MuJoCoDynamics(robot).terms(qpos, velocity)
    geometry = contact_geometry(robot)
    contacts = reduced_contacts(geometry, terms)
    force = 0.1 * robot.weight * rng.normal(size=(COUNT, geometry.num_points, 3))
    force[..., 2] += robot.weight / geometry.num_points
    posture = 5.0 * rng.normal(size=(COUNT, robot.num_joints))
    return Scene(robot, terms, centroidal_terms(terms, velocity), contacts, force, posture)


@pytest.fixture(params=robots.ROBOTS)
def moving(request, rng):
    return scene(request.param, rng, 0.1, 0.5)


@pytest.fixture
def rigorous(monkeypatch):
    """Without the ridge that bounds joint accelerations near singular postures."""
    monkeypatch.setattr(balancers, "RIDGE", 1e-12)


def assert_close(actual, expected, tolerance=EXACT):
    size = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=tolerance * size)


# --- the two quasi-static maps -------------------------------------------------------------------


def test_garofalo2015_is_minus_jbar_transposed(moving):
    torque = torque_map_garofalo2015(*moving.model).torque(moving.row_force, moving.wrench)
    transform = np.zeros_like(moving.terms.mass_matrix)
    transform[:, :6] = moving.body.matrix
    transform[:, 6:, 6:] = np.eye(moving.robot.num_joints)
    jacobian = (moving.contacts.jacobian @ np.linalg.inv(transform))[:, :, 6:]
    assert_close(torque, -np.matvec(jacobian.mT, moving.row_force))


def test_ott2011_is_minus_jcheck_transposed(moving):
    """The velocities of (35), [com velocity, angular velocity, qdot] = T v, inverted as a whole."""
    change = np.zeros_like(moving.terms.mass_matrix)
    change[:, :3] = moving.body.matrix[:, :3] / moving.robot.mass
    change[:, 3:6, 3:6] = moving.terms.world_from_base
    change[:, 6:, 6:] = np.eye(moving.robot.num_joints)
    jacobian = moving.contacts.jacobian @ np.linalg.inv(change)
    torque = torque_map_ott2011(*moving.model).torque(moving.row_force, moving.wrench)
    assert_close(torque, -np.matvec(jacobian[:, :, 6:].mT, moving.row_force))
    # and (37): the base rows of the same Jacobian sum up to the wrench at the centre of mass
    assert_close(np.matvec(jacobian[:, :, :6].mT, moving.row_force), moving.wrench)


@pytest.mark.parametrize("name", robots.ROBOTS)
@pytest.mark.parametrize("torque_map", MAPS)
def test_all_maps_carry_the_weight_at_rest(name, torque_map, rng):
    still = scene(name, rng, 0.0, 0.0)
    wrench, own = np.zeros((COUNT, 6)), torque_map(*still.model)
    wrench[:, 2] = weight = still.robot.weight
    maps = {"to_com": still.body.to_com, "point_map": still.contacts.point_map}
    result = distribute(own, wrench, LIMITS, weight=weight, **maps)
    acceleration, _ = still.accelerations(result.torque)
    np.testing.assert_allclose(result.residual, 0.0, atol=1e-9)
    np.testing.assert_allclose(acceleration, 0.0, atol=1e-5)


# --- full inverse dynamics -----------------------------------------------------------------------


@pytest.mark.usefixtures("rigorous")
@pytest.mark.parametrize("posture", [False, True])
def test_inverse_dynamics_changes_momentum_as_told(moving, posture):
    given = moving.posture if posture else None
    torque_map = torque_map_inverse_dynamics(*moving.model, given)
    torque = torque_map.torque(moving.row_force, moving.wrench)
    acceleration, force = moving.accelerations(torque)
    expected = moving.wrench.copy()
    expected[:, 2] -= moving.robot.mass * 9.81
    assert_close(moving.momentum_rate(acceleration), expected, 1e-6)
    assert_close(force, moving.row_force, 1e-6)


def test_the_ridge_costs_little_and_quasi_static_maps_do_not_change_momentum_as_told(moving):
    """What the third balancer is for: the others miss by tenths of the weight (go1: 5 %)."""
    for torque_map in MAPS:
        torque = torque_map(*moving.model).torque(moving.row_force, moving.wrench)
        acceleration, _ = moving.accelerations(torque)
        error = moving.momentum_rate(acceleration) - moving.wrench
        error[:, 2] += moving.robot.mass * 9.81
        missed = np.abs(error[:, :3]).max() / moving.robot.weight
        assert missed < 0.05 if torque_map is torque_map_inverse_dynamics else missed > 0.04


# --- posture ---------------------------------------------------------------------------------


@pytest.mark.usefixtures("rigorous")
@pytest.mark.parametrize("torque_map", MAPS)
def test_posture_moves_neither_contacts_nor_momentum(moving, torque_map):
    forces = moving.row_force, moving.wrench
    without, before = moving.accelerations(torque_map(*moving.model).torque(*forces))
    torque = torque_map(*moving.model, moving.posture).torque(*forces)
    with_posture, after = moving.accelerations(torque)
    size = np.abs(moving.posture).max() * np.abs(moving.terms.mass_matrix).max()
    assert_close(after / size, before / size, 1e-6)
    rates = (moving.momentum_rate(each) / size for each in (with_posture, without))
    assert_close(*rates, 1e-6)
    change = (with_posture - without)[:, 6:]
    if moving.robot.num_joints > moving.contacts.jacobian.shape[1]:
        # as much of the posture as is left: its orthogonal projection
        along = np.vecdot(change, moving.posture)
        np.testing.assert_allclose(along, np.vecdot(change, change), rtol=1e-3)
        assert (np.abs(change).max(axis=1) > 0.1).all()
        added = torque - torque_map(*moving.model).torque(*forces)
        assert_close(added, np.matvec(moving.joint_inertia, change), 1e-5)


@pytest.mark.parametrize("torque_map", MAPS)
def test_in_flight_the_posture_is_all_there_is(moving, torque_map):
    none = ReducedContacts(*map(np.zeros_like, moving.contacts))
    torque = torque_map(moving.terms, moving.body, none, moving.posture).offset
    force = -moving.terms.bias
    force[:, 6:] += torque
    acceleration = np.linalg.solve(moving.terms.mass_matrix, force[..., None])[..., 0]
    if torque_map is torque_map_inverse_dynamics:
        assert_close(acceleration[:, 6:], moving.posture, 1e-8)
    else:
        assert_close(torque, np.matvec(moving.joint_inertia, moving.posture))
