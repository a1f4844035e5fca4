"""The laws of [M10] side by side on the built-in robots: what they share, and what parts them."""

from typing import NamedTuple

import numpy as np
import pytest
import scipy.linalg

from eval.papers.mistry2010.force_feedback import (
    Equation,
    estimated_force,
    force_feedback,
    inertia_weighted,
)
from fbid_gym import robots
from fbid_gym.control import ContactLimits, limited_inverse_dynamics, orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics, PinocchioDynamics
from fbid_gym.dynamics.contacts import contact_geometry, point_jacobian, reduced_contacts
from fbid_gym.robots import zoo
from tests.control.systems import forward
from tests.pairs import pairs

ROBOTS = ("biped", "quadruped")


class Scene(NamedTuple):
    """The arguments of the laws at moving states, and which points are planted."""

    qpos: np.ndarray
    qvel: np.ndarray
    active: np.ndarray
    law: tuple[np.ndarray, ...]


def states(name: str, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Bent legs, tilted base, everything moving."""
    robot, rng = robots.load(name), np.random.default_rng(seed)
    qpos = np.tile(robot.home_qpos, (count, 1))
    qpos[:, 3:7] += rng.normal(0.0, 0.2, (count, 4))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 7:] += rng.normal(0.0, 0.2, (count, robot.num_joints))
    return qpos, rng.normal(size=(count, robot.nv))


def law_of(name: str, dynamics: object, qpos: np.ndarray, qvel: np.ndarray, active: np.ndarray):
    """M, h, J and Jdot v at these states."""
    terms = dynamics.terms(qpos, qvel)
    contacts = reduced_contacts(contact_geometry(robots.load(name)), terms, active)
    return terms.mass_matrix, terms.bias, contacts.jacobian, contacts.bias


def scene(name: str, seed: int, count: int = 8) -> Scene:
    """Commands that contacts allow; every other biped on one foot, quadruped on three."""
    robot = robots.load(name)
    qpos, qvel = states(name, count, seed)
    active = np.ones((count, robot.num_points), bool)
    active[1::2, : robot.feet[0].num_points] = False
    mass_matrix, bias, jacobian, drift = law_of(name, MuJoCoDynamics(robot), qpos, qvel, active)
    command = np.random.default_rng(seed).normal(0.0, 3.0, qvel.shape)
    solution = orthogonal_inverse_dynamics(mass_matrix, bias, jacobian, command, drift)
    assert not solution.underactuation.any()
    return Scene(qpos, qvel, active, (mass_matrix, bias, jacobian, solution.acceleration, drift))


def truth(name: str, case: Scene, torque: np.ndarray) -> np.ndarray:
    """Accelerations, with Pinocchio's terms and dense algebra."""
    dynamics = PinocchioDynamics(robots.load(name))
    return forward(*law_of(name, dynamics, *case[:3]), torque)[0]


@pytest.mark.parametrize("name", ROBOTS)
def test_every_law_does_what_is_asked_if_it_knows_the_truth(name):
    """Eqs. (15), (7) and (8): one acceleration; (8) with the forces of any torque that gives it."""
    case = scene(name, seed=1)
    least = orthogonal_inverse_dynamics(*case.law)
    cost = np.linspace(0.1, 10.0, least.torque.shape[1])
    squeezed = orthogonal_inverse_dynamics(*case.law, torque_cost=cost)
    assert np.abs(squeezed.torque - least.torque).max() > 0.01
    equation, scale = Equation(*case.law), 1.0 + np.abs(case.law[3]).max()
    for found, source in (
        (least, least),
        (squeezed, squeezed),
        (inertia_weighted(equation), least),
        (force_feedback(equation, least.contact_force), least),
        (force_feedback(equation, squeezed.contact_force), squeezed),
        (estimated_force(equation, squeezed.torque), squeezed),
    ):
        achieved = truth(name, case, found.torque)
        np.testing.assert_allclose(achieved, case.law[3], atol=1e-6 * scale)
        np.testing.assert_allclose(found.torque, source.torque, atol=1e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_wrong_inertia_costs_eq_7_and_eq_15_the_same(name):
    """The error is N (N^T M N)^-1 N^T (dM a + dh) for both: the projection does not matter."""
    case, robot, rng = scene(name, seed=3), robots.load(name), np.random.default_rng(3)
    bodies = [robot.model.body(i).name for i in range(robot.base_body, robot.model.nbody)]
    mass = {body: float(rng.uniform(0.6, 1.4)) for body in bodies}
    com = {body: rng.normal(0.0, 0.01, 3) for body in bodies}
    wrong = PinocchioDynamics(robot, mass_scale=mass, com_offset=com)
    mass_matrix, bias, jacobian, drift = law_of(name, wrong, *case[:3])
    command = case.law[3]
    model = (mass_matrix, bias, jacobian, command, drift)
    orthogonal = orthogonal_inverse_dynamics(*model).torque
    weighted = inertia_weighted(Equation(*model)).torque
    np.testing.assert_allclose(weighted, orthogonal, atol=1e-6)
    achieved = truth(name, case, orthogonal)
    assert np.abs(achieved - command).max() > 0.3
    surplus = np.matvec(mass_matrix - case.law[0], command) + bias - case.law[1]
    for i in range(len(command)):
        free = scipy.linalg.null_space(jacobian[i], rcond=1e-9)
        error = free @ np.linalg.solve(free.T @ case.law[0][i] @ free, free.T @ surplus[i])
        np.testing.assert_allclose(achieved[i] - command[i], error, atol=1e-5)


def along_a_path(name: str, steps: int) -> tuple[np.ndarray, ...]:
    """Arguments of the law along one second of tumbling, swinging motion with planted feet."""
    robot, rng = robots.load(name), np.random.default_rng(6)
    time = np.linspace(0.0, 1.0, steps)[:, None]
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    qpos = np.tile(robot.home_qpos, (steps, 1))
    qpos[:, 3:4], qpos[:, 4:7] = np.cos(np.pi * time), np.sin(np.pi * time) * axis
    swing = rng.uniform(0.1, 0.4, robot.num_joints)
    phase = rng.uniform(0.0, 6.0, robot.num_joints)
    qpos[:, 7:] += swing * np.sin(2.0 * np.pi * time + phase)
    qvel = np.zeros((steps, robot.nv))
    qvel[:, 3:6] = 2.0 * np.pi * axis
    qvel[:, 6:] = 2.0 * np.pi * swing * np.cos(2.0 * np.pi * time + phase)
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    contacts = reduced_contacts(contact_geometry(robot), terms)
    command = np.tile(rng.normal(size=robot.nv), (steps, 1))
    return terms.mass_matrix, terms.bias, contacts.jacobian, command, contacts.bias


def largest_step(values: np.ndarray) -> float:
    """Largest change of an entry from one instant to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


@pytest.mark.parametrize(("name", "pivoting"), pairs(ROBOTS, [False, True], 1))
def test_torque_is_continuous_along_a_motion_where_q_is_not(name, pivoting):
    """[M10] III-B.6: Q jumps however small the step is; the torque's step shrinks with it.

    Householder QR flips a column's sign, and with column pivoting the pivots trade places. Eq. (15)
    computed from that very Q gives the torques of our law.
    """
    jumps, jerks, flips = [], [], 0
    for steps in (501, 2001):
        law = along_a_path(name, steps)
        jacobian = law[2]
        rank = jacobian.shape[1]
        solution = orthogonal_inverse_dynamics(*law)
        np.testing.assert_array_equal(solution.rank, rank)
        np.testing.assert_array_equal(solution.underactuation, 0)
        if pivoting:
            factors = [scipy.linalg.qr(j.T, pivoting=True) for j in jacobian]
            q, order = np.array([f[0] for f in factors]), np.array([f[2] for f in factors])
            flips = int(np.any(np.diff(order, axis=0) != 0, axis=1).sum())
        else:
            q, r = np.linalg.qr(jacobian.mT, mode="complete")
            signs = np.sign(np.diagonal(r, axis1=1, axis2=2))
            flips = int(np.any(np.diff(signs, axis=0) != 0, axis=1).sum())
        free = q[:, :, rank:].mT
        force = np.matvec(law[0], solution.acceleration) + law[1]
        torque = np.matvec(np.linalg.pinv(free[:, :, 6:]), np.matvec(free, force))
        np.testing.assert_allclose(solution.torque, torque, atol=1e-6 * np.abs(torque).max())
        jumps.append(largest_step(q))
        jerks.append(largest_step(solution.torque))
    assert flips >= 2
    assert min(jumps) > 0.5
    assert jerks[1] < 0.3 * jerks[0]


# Legs of four and five joints on soles: contacts that leave the body two or four motions.
@pytest.mark.parametrize("seed", [2, 3, 20, 38])
@pytest.mark.parametrize("base_priority", [1.0, 1e3])
def test_what_limited_forces_give_is_what_is_promised(seed, base_priority):
    """M a + h = S^T tau + J^T lambda, though the contacts leave the body hardly a motion."""
    robot, rng = zoo.built(zoo.draw(seed)), np.random.default_rng(seed)
    qpos = np.tile(robot.home_qpos, (32, 1))
    qpos[:, 7:] += rng.normal(0.0, 0.1, (32, robot.num_joints))
    qvel = rng.normal(0.0, 0.3, (32, robot.nv))
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    jacobian, drift = point_jacobian(contact_geometry(robot), terms)
    command, size = rng.normal(0.0, 5.0, qvel.shape), robot.home_qpos[2]
    law = (terms.mass_matrix, terms.bias, jacobian, command, drift, ContactLimits(0.6))
    solution = limited_inverse_dynamics(*law, base_priority=base_priority, length=size)
    assert (solution.residual > 1e-2).any()
    given = np.matvec(jacobian.mT, solution.contact_force)
    given[:, 6:] += solution.torque
    needed = np.matvec(terms.mass_matrix, solution.acceleration) + terms.bias
    scale = robot.weight * np.array([1.0] * 3 + [size] * (robot.nv - 3))
    np.testing.assert_allclose((needed - given) / scale, 0.0, atol=1e-8)
