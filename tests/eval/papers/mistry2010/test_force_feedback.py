"""Eqs. (5) to (8) as printed, against forward dynamics, and what they leave to the forces."""

import numpy as np
import pytest

from eval.papers.mistry2010.force_feedback import (
    Equation,
    actuated_projection,
    contact_force_of_torque,
    estimated_force,
    force_feedback,
    inertia_weighted,
)
from fbid_gym.control import orthogonal_inverse_dynamics


def equation(system):
    """As the rivals take it."""
    return Equation(*system.law)


def dual_selection(mass_matrix):
    """Sbar^T = (S M^-1 S^T)^-1 S M^-1 of one robot, as the paper writes it."""
    inverse = np.linalg.inv(mass_matrix)
    return np.linalg.solve(inverse[6:, 6:], inverse[6:])


@pytest.fixture
def torque_of(rng):
    """Random joint torques for a system."""
    return lambda system: rng.normal(0.0, 30.0, (len(system.bias), system.bias.shape[1] - 6))


def test_equations_5_to_8_hold_as_printed(make_system, torque_of):
    """Signs included, at a moving robot under any torque; independent rows as in the paper."""
    system = make_system("four point feet")
    torque = torque_of(system)
    acceleration, force = system.forward(torque)
    nv = system.bias.shape[1]
    select = np.eye(nv)[6:]
    for i, jacobian in enumerate(system.jacobian):
        mass, load = system.mass_matrix[i], system.bias[i]
        inverse, drift = np.linalg.inv(mass), system.jacobian_bias[i]
        mobility = jacobian @ inverse @ jacobian.T
        # (5), solved for the acceleration of the contacts, which is none.
        unactuated = jacobian @ inverse @ (load - select.T @ torque[i])
        np.testing.assert_allclose(drift - unactuated + mobility @ force[i], 0.0, atol=1e-8)
        # (6)
        expected = np.linalg.solve(mobility, unactuated - drift)
        np.testing.assert_allclose(force[i], expected, atol=1e-7)
        # (7)
        bar = np.linalg.solve(mobility, jacobian @ inverse)  # Jbar^T
        dual = dual_selection(mass)
        inertia = np.linalg.inv(select @ inverse @ select.T)
        kept = np.eye(nv) - jacobian.T @ bar
        left = inertia @ acceleration[i, 6:] + dual @ kept @ load + dual @ mass @ (bar.T @ drift)
        np.testing.assert_allclose(left, dual @ kept @ select.T @ torque[i], atol=1e-7)
        # (8)
        left = inertia @ acceleration[i, 6:] + dual @ (load - jacobian.T @ force[i])
        np.testing.assert_allclose(left, torque[i], atol=1e-7)


def test_force_of_a_torque_is_that_of_forward_dynamics(make_system, torque_of, contacts):
    system = make_system(contacts)
    torque = torque_of(system)
    _, expected = system.forward(torque)
    found = contact_force_of_torque(equation(system), torque)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_eq_8_to_the_letter_for_any_force(make_system, rng, contacts):
    """A force that fits nothing, too; and the base acceleration is the one it causes."""
    system = make_system(contacts)
    force = rng.normal(0.0, 100.0, system.jacobian_bias.shape)
    found = force_feedback(equation(system), force)
    applied = np.matvec(system.jacobian.mT, force)
    for i, mass in enumerate(system.mass_matrix):
        inertia = np.linalg.inv(np.linalg.inv(mass)[6:, 6:])
        torque = inertia @ system.acceleration[i, 6:]
        torque += dual_selection(mass) @ (system.bias[i] - applied[i])
        np.testing.assert_allclose(found.torque[i], torque, atol=1e-7)
    residual = np.matvec(system.mass_matrix, found.acceleration) + system.bias - applied
    residual[:, 6:] -= found.torque
    np.testing.assert_allclose(residual, 0.0, atol=1e-8)
    np.testing.assert_array_equal(found.acceleration[:, 6:], system.acceleration[:, 6:])


def test_a_wrong_force_costs_what_the_law_says(make_system, rng, contacts):
    """Torque off by -Sbar^T J^T dF; acceleration by what forward dynamics make of that."""
    system = make_system(contacts).achievable()
    right = orthogonal_inverse_dynamics(*system.law)
    error = rng.normal(0.0, 20.0, right.contact_force.shape)
    found = force_feedback(equation(system), right.contact_force + error)
    achieved, _ = system.forward(found.torque)
    joints = slice(6, None)
    for i, jacobian in enumerate(system.jacobian):
        wrong = -dual_selection(system.mass_matrix[i]) @ jacobian.T @ error[i]
        np.testing.assert_allclose(found.torque[i] - right.torque[i], wrong, atol=1e-6)
        inverse = np.linalg.inv(system.mass_matrix[i])
        mobility = np.linalg.pinv(jacobian @ inverse @ jacobian.T, rcond=1e-10, hermitian=True)
        response = inverse - inverse @ jacobian.T @ mobility @ jacobian @ inverse
        moved = response[:, joints] @ wrong
        np.testing.assert_allclose(achieved[i] - system.acceleration[i], moved, atol=1e-5)


def test_wrongly_measured_internal_forces_move_nothing(make_system):
    """Errors that the base does not feel change the squeeze between the feet, not the motion."""
    system = make_system("two flat feet").achievable()
    right = orthogonal_inverse_dynamics(*system.law)
    left = np.linalg.svd(system.jacobian[:, :, :6])[0]
    internal = 50.0 * left[:, :, 6:].sum(axis=-1)
    found = force_feedback(equation(system), right.contact_force + internal)
    assert np.abs(found.torque - right.torque).max() > 1.0
    achieved, _ = system.forward(found.torque)
    np.testing.assert_allclose(achieved, system.acceleration, atol=1e-6)


def test_projection_is_the_papers_and_its_rank_what_contacts_leave(make_system, contacts):
    system = make_system(contacts)
    operator, rank = actuated_projection(equation(system))
    joints = system.bias.shape[1] - 6
    np.testing.assert_array_equal(rank, joints - system.rank + 6 - system.underactuation)
    for i, jacobian in enumerate(system.jacobian):
        inverse = np.linalg.inv(system.mass_matrix[i])
        bar = np.linalg.pinv(jacobian @ inverse @ jacobian.T, rcond=1e-10, hermitian=True)
        bar = bar @ jacobian @ inverse
        kept = (np.eye(joints + 6) - jacobian.T @ bar)[:, 6:]
        expected = dual_selection(system.mass_matrix[i]) @ kept
        np.testing.assert_allclose(operator[i], expected, atol=1e-8)
        values = np.linalg.eigvals(operator[i])
        np.testing.assert_allclose(values.imag, 0.0, atol=1e-6)
        assert values.real.min() > -1e-6
        assert values.real.max() < 1.0 + 1e-6
        assert (values.real < 1e-7).sum() == joints - rank[i]


@pytest.mark.parametrize(
    ("contacts", "lacking"),
    [("one flat foot", 0), ("two flat feet", 6), ("four point feet", 6), ("trot pair", 1)],
)
def test_what_the_projection_lacks_presses_contacts_together(
    make_system, torque_of, contacts, lacking
):
    """Torques in the null space of eq. (7)'s operator change contact forces and no motion."""
    system = make_system(contacts)
    operator, rank = actuated_projection(equation(system))
    np.testing.assert_array_equal(operator.shape[1] - rank, lacking)
    if lacking:
        torque = torque_of(system)
        before, force = system.forward(torque)
        idle = np.linalg.svd(operator)[2][:, -1]
        after, pressed = system.forward(torque + 100.0 * idle)
        np.testing.assert_allclose(after, before, atol=1e-5)
        assert (np.linalg.norm(pressed - force, axis=1) > 1.0).all()


@pytest.mark.parametrize(
    "contacts",
    ["one flat foot", "two flat feet", "flat foot and toe", "two edges", "four point feet"],
)
def test_eq_7_gives_the_torque_of_eq_15_whatever_the_inertia(make_system, contacts):
    """Where contacts hold the base: a model of other masses shifts both laws by the same."""
    system = make_system(contacts).achievable()
    wrong = make_system(contacts)
    for mass_matrix, bias in ((system.mass_matrix, system.bias), (wrong.mass_matrix, wrong.bias)):
        model = system._replace(mass_matrix=mass_matrix, bias=bias)
        expected = orthogonal_inverse_dynamics(*model.law)
        found = inertia_weighted(equation(model))
        np.testing.assert_allclose(found.torque, expected.torque, atol=1e-6)
        np.testing.assert_allclose(found.acceleration, system.acceleration, atol=1e-6)
        np.testing.assert_allclose(found.contact_force, expected.contact_force, atol=1e-5)


def test_eq_7_achieves_what_it_says(make_system, contacts):
    """Underactuated too, where joints do as commanded and the base what is left to it."""
    system = make_system(contacts).achievable()
    found = inertia_weighted(equation(system))
    acceleration, force = system.forward(found.torque)
    np.testing.assert_allclose(found.acceleration, acceleration, atol=1e-6)
    np.testing.assert_allclose(found.contact_force, force, atol=1e-5)
    np.testing.assert_allclose(found.acceleration[:, 6:], system.acceleration[:, 6:], atol=1e-6)
    impossible = make_system(contacts)
    found = inertia_weighted(equation(impossible))
    acceleration, _ = impossible.forward(found.torque)
    np.testing.assert_allclose(found.acceleration, acceleration, atol=1e-6)


def test_the_previous_torque_iterates_towards_eq_7(make_system, torque_of, contacts):
    """Ticks at a fixed state: error (1 - O)^k times the first, and never gone where O is zero."""
    system = make_system(contacts).achievable()
    goal = inertia_weighted(equation(system)).torque
    operator, _ = actuated_projection(equation(system))
    start = torque_of(system)
    torque = start
    for _ in range(10):
        torque = estimated_force(equation(system), torque).torque
    shrink = np.linalg.matrix_power(np.eye(operator.shape[1]) - operator, 10)
    np.testing.assert_allclose(torque, goal + np.matvec(shrink, start - goal), atol=1e-5)
    # S M^-1 S^T (torque - start) has no part in the null space of O: that part stays.
    inverse = np.linalg.inv(system.mass_matrix)[:, 6:, 6:]
    for i, lost in enumerate(system.bias.shape[1] - 6 - np.linalg.matrix_rank(operator, 1e-7)):
        idle = np.linalg.svd(operator[i])[2][len(operator[i]) - lost :]
        np.testing.assert_allclose(idle @ inverse[i] @ (torque - start)[i], 0.0, atol=1e-6)


def test_applied_feedback_is_magnified_and_where_eq_7_is_blind_sums_up(make_system):
    """A constant feedback torque as part of what was applied, along eigenvectors of O."""
    system = make_system("two flat feet", count=1).achievable()
    operator, _ = actuated_projection(equation(system))
    values, vectors = np.linalg.eig(operator[0])
    order = np.argsort(values.real)
    goal = inertia_weighted(equation(system)).torque
    ticks = 200
    for mode in (order[0], order[-3]):
        feedback, eigenvalue = vectors[:, mode].real, float(values[mode].real)
        torque = goal
        for _ in range(ticks):
            torque = estimated_force(equation(system), torque + feedback).torque
        # 1 / mu once the geometric series has converged, a term per tick where mu is zero.
        powers = (1.0 - max(eigenvalue, 0.0)) ** np.arange(ticks + 1)
        np.testing.assert_allclose(
            torque + feedback, goal + powers.sum() * feedback, atol=1e-5 * powers.sum()
        )
    assert eigenvalue > 0.05
    assert powers.sum() == pytest.approx(1.0 / eigenvalue, rel=1e-3)
