"""Eq. (15) against the paper's own steps, its laws of optimality, and forward dynamics."""

from itertools import product

import numpy as np
import pytest

from fbid_gym.control import orthogonal_inverse_dynamics, underactuation
from tests.control.systems import equation_15, null_space


@pytest.mark.parametrize("base_priority", [1.0, 100.0])
def test_what_is_promised_comes_true_and_nothing_is_nearer_or_cheaper(
    make_system, rng, contacts, base_priority
):
    """Simulated by dense least squares; first-order conditions of both convex problems."""
    system = make_system(contacts)
    nv = system.bias.shape[1]
    cost = np.exp(rng.normal(0.0, 1.0, nv - 6)) if base_priority > 1.0 else np.ones(nv - 6)
    metric, select = np.append(np.full(6, base_priority), np.ones(nv - 6)), np.eye(nv)[6:]
    given = {"torque_cost": cost, "base_priority": base_priority}
    solution = orthogonal_inverse_dynamics(*system.law, **given)
    forces = np.pad(solution.torque, ((0, 0), (6, 0)))
    forces += np.matvec(system.jacobian.mT, solution.contact_force)
    needed = np.matvec(system.mass_matrix, solution.acceleration) + system.bias
    np.testing.assert_allclose(needed, forces, atol=1e-8)
    motion = np.matvec(system.jacobian, solution.acceleration) + system.jacobian_bias
    np.testing.assert_allclose(motion, 0.0, atol=1e-9)
    achieved, _ = system.forward(solution.torque)
    np.testing.assert_allclose(achieved, solution.acceleration, atol=1e-6)
    for i, jacobian in enumerate(system.jacobian):
        # The correction is orthogonal, in its metric, to every motion that stays achievable.
        beyond = null_space(jacobian[:, :6]).T @ system.mass_matrix[i, :6]
        motions = null_space(np.concatenate([jacobian, beyond]))
        correction = metric * (solution.acceleration[i] - system.acceleration[i])
        np.testing.assert_allclose(motions.T @ correction, 0.0, atol=1e-7 * base_priority)
        # Torques with the same motion cost more.
        same = null_space(np.concatenate([select.T, jacobian.T], axis=1))[: nv - 6]
        np.testing.assert_allclose(same.T @ (cost * solution.torque[i]), 0.0, atol=1e-7)
    achievable = system._replace(acceleration=solution.acceleration)
    again = orthogonal_inverse_dynamics(*achievable.law, **given)
    np.testing.assert_allclose(again.acceleration, solution.acceleration, atol=1e-8)
    np.testing.assert_allclose(again.torque, solution.torque, atol=1e-7)


def test_equals_the_papers_equations(make_system, rng, contacts):
    for drop_rows, weighted, priority in product((False, True), (False, True), (1.0, 100.0)):
        system = make_system(contacts, drop_rows=drop_rows)
        cost = np.exp(rng.normal(0.0, 2.0, system.bias.shape[1] - 6)) if weighted else None
        given = {"torque_cost": cost, "base_priority": priority}
        solution = orthogonal_inverse_dynamics(*system.law, **given)
        np.testing.assert_array_equal(solution.rank, system.rank)
        np.testing.assert_array_equal(solution.underactuation, system.underactuation)
        for i, command in enumerate(solution.acceleration):
            torque, contact_force = equation_15(*(part[i] for part in system[:3]), command, cost)
            np.testing.assert_allclose(solution.torque[i], torque, atol=1e-7)
            np.testing.assert_allclose(solution.contact_force[i], contact_force, atol=1e-7)


def test_what_contacts_can_push_does_not_depend_on_weights(make_system, contacts):
    """Weights without bound would leave to rounding what joints alone, or the base alone, hold."""
    system = make_system(contacts)

    def solved(priority, slack):
        solution = orthogonal_inverse_dynamics(*system.law, base_priority=priority)
        np.testing.assert_array_equal(solution.rank, system.rank)
        motion = np.matvec(system.jacobian, solution.acceleration) + system.jacobian_bias
        np.testing.assert_allclose(motion, 0.0, atol=slack)  # rounding, if weights are far apart
        return solution

    for axes, priority in product(([2], [4], [0, 1, 2], [3, 4, 5]), (1e-6, 1e-3, 1e3, 1e6)):
        uneven = np.ones(6)
        uneven[axes] = priority
        solution = solved(uneven, 1e-2)
        np.testing.assert_array_equal(solution.underactuation, system.underactuation)
        assert (solution.residual < 1e-5).all()
    for far in (1e3, 1e-3):
        first, *others = (solved(far**power, 1e-2 if power < 3 else 1e-4) for power in (2, 3, 4))
        np.testing.assert_array_equal(first.underactuation, system.underactuation)
        for one, two in zip(*others, strict=True):
            np.testing.assert_array_equal(one, two)


def test_torque_does_not_depend_on_how_contacts_are_written(make_system, rng, contacts):
    """Rows rotated, permuted, scaled or repeated: same contacts, same torque ([M10] III.B.6)."""
    system = make_system(contacts)
    base = orthogonal_inverse_dynamics(*system.law)
    rows = system.jacobian.shape[1]
    rotation = np.linalg.qr(rng.normal(size=(rows, rows)))[0]
    repeated = np.concatenate([np.eye(rows), np.eye(rows)[: rows // 2]])
    for mix in (rotation, np.eye(rows)[rng.permutation(rows)], 3.0 * rotation, repeated):
        drift = np.matvec(mix, system.jacobian_bias)
        mixed = system._replace(jacobian=mix @ system.jacobian, jacobian_bias=drift)
        solution = orthogonal_inverse_dynamics(*mixed.law)
        np.testing.assert_allclose(solution.torque, base.torque, atol=1e-6)
        np.testing.assert_array_equal(solution.rank, base.rank)
        found = np.matvec(mixed.jacobian.mT, solution.contact_force)
        expected = np.matvec(system.jacobian.mT, base.contact_force)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_contacts_nearly_in_line_do_not_ask_for_huge_forces(make_system):
    """Three contact points within micrometres of a line cannot hold a moment about it."""
    system = make_system("trot pair", count=1)
    # A third point almost midway between the two, moving almost with their mean.
    third = 0.5 * (system.jacobian[:, 0:3] + system.jacobian[:, 9:12])
    third[:, 2, 3:6] += 1e-6
    system.jacobian[:, 3:6], system.jacobian_bias[:] = third, 0.0
    solution = orthogonal_inverse_dynamics(*system.law)
    assert solution.underactuation[0] == 1
    assert np.abs(solution.torque).max() < 1e4


def test_counts_the_directions_that_contacts_miss(make_system, contacts):
    system = make_system(contacts)
    found = underactuation(system.jacobian)
    rank = np.linalg.matrix_rank(system.jacobian[:, :, :6], rtol=1e-3)
    np.testing.assert_array_equal(found, 6 - rank)
    np.testing.assert_array_equal(found, orthogonal_inverse_dynamics(*system.law).underactuation)


def test_a_robot_gone_wrong_reaches_nothing_and_harms_no_other(make_system):
    jacobian = make_system("two flat feet").jacobian
    expected = underactuation(jacobian)
    jacobian[1, 3, 2] = np.nan
    expected[1] = 6.0
    np.testing.assert_array_equal(underactuation(jacobian), expected)
