"""The friction-limited law: dynamics, limits, and its agreement with eq. (15) where both apply."""

from typing import Any

import numpy as np
import pytest

from fbid_gym.control import (
    ContactLimits,
    LimitedInverseDynamics,
    limited_inverse_dynamics,
    orthogonal_inverse_dynamics,
)
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY
from tests.control.cones import contact_forces

LENGTH, GRAVITY = 0.3, 9.81
EXACT = DEFAULT_ACCURACY._replace(tolerance=1e-9, max_iterations=50)
LIMITS = ContactLimits(0.7)


def active_points(system: Any) -> np.ndarray:
    """(N, P) bool: points whose rows of J are not zero."""
    points = system.jacobian.reshape(len(system.bias), -1, 3, system.bias.shape[1])
    return np.any(points != 0.0, axis=(-2, -1))


def solve(system: Any, limits: ContactLimits = LIMITS, **options: Any) -> LimitedInverseDynamics:
    """The law on stacked point rows."""
    return limited_inverse_dynamics(
        *system.law, limits, active=active_points(system), length=LENGTH, **options
    )


def reduced(system: Any) -> tuple[Any, np.ndarray]:
    """Each foot's rows of J compressed to an orthonormal basis of their range, and the point map.

    Rows of J are stacked point rows = U (reduced rows), with U of orthonormal columns.
    """
    count, columns, _ = system.jacobian.shape
    left, sizes, right = np.linalg.svd(system.jacobian, full_matrices=False)
    rank = system.rank
    basis = left[:, :, :rank]
    jacobian = sizes[:, :rank, None] * right[:, :rank]
    drift = np.matvec(basis.mT, system.jacobian_bias)
    assert columns % 3 == 0
    return system._replace(jacobian=jacobian, jacobian_bias=drift), basis.mT


@pytest.mark.parametrize(("push", "base_priority"), [(0.1, 100.0), (1.0, 1.0), (10.0, 100.0)])
def test_what_is_promised_comes_true_within_limits(make_system, contacts, push, base_priority):
    """Simulated by dense least squares; absurd commands stay within limits as well."""
    system = make_system(contacts)
    system = system._replace(acceleration=push * system.acceleration)
    solution = solve(system, ContactLimits(0.5, 2.0, 300.0), base_priority=base_priority)
    required = np.matvec(system.mass_matrix, solution.acceleration) + system.bias
    given = np.matvec(system.jacobian.mT, solution.contact_force)
    given[:, 6:] += solution.torque
    np.testing.assert_allclose(required, given, atol=2e-5 * (1.0 + np.abs(required).max()))
    motion = np.matvec(system.jacobian, solution.acceleration) + system.jacobian_bias
    np.testing.assert_allclose(motion, 0.0, atol=1e-6 * (1.0 + push))
    force, active = solution.point_force, active_points(system)
    normal = force[..., 2]
    assert (np.linalg.norm(force[..., :2], axis=-1) <= 0.5 * normal + 1e-6).all()
    assert (normal[active] >= 2.0 - 1e-6).all() and (normal[active] <= 300.0 + 1e-6).all()
    np.testing.assert_array_equal(force[~active], 0.0)
    for achieved, expected in zip(
        system.forward(solution.torque)[0], solution.acceleration, strict=True
    ):
        slack = 1e-4 * (1.0 + np.abs(achieved).max())
        np.testing.assert_allclose(achieved, expected, atol=slack)
    absurd = solve(system._replace(acceleration=1e6 * system.acceleration))
    assert all(np.isfinite(field).all() for field in absurd)
    force, slack = absurd.point_force, 1e-9 * 1e6 * push * 1e3
    assert (np.linalg.norm(force[..., :2], axis=-1) <= 0.7 * force[..., 2] + slack).all()


def test_where_limits_do_not_bind_it_is_eq_15(make_system):
    """Same acceleration; the torque may differ by internal forces only."""
    system = make_system("two flat feet", count=60)
    system = system._replace(acceleration=0.01 * system.acceleration)  # almost still
    limited = solve(system, base_priority=10.0)
    free = orthogonal_inverse_dynamics(*system.law, base_priority=10.0)
    sticks = limited.residual == 0.0
    assert sticks.sum() > 5
    np.testing.assert_allclose(limited.acceleration[sticks], free.acceleration[sticks], atol=1e-5)
    gap = np.matvec(system.jacobian.mT, limited.contact_force - free.contact_force)
    gap[:, 6:] += limited.torque - free.torque
    np.testing.assert_allclose(gap[sticks], 0.0, atol=1e-4)
    cost = [np.linalg.norm(s.torque[sticks], axis=1) for s in (free, limited)]
    assert (cost[0] <= cost[1] + 1e-6).all()


def test_the_base_wrench_is_the_nearest_the_limits_allow(make_system):
    system = make_system("two flat feet", count=20)
    consistent = orthogonal_inverse_dynamics(*system.law).acceleration
    wanted = (np.matvec(system.mass_matrix, consistent) + system.bias)[:, :6]
    weight = GRAVITY * system.mass_matrix[0, 0, 0]
    maps = system.jacobian[:, :, :6].mT
    forces = contact_forces(maps, wanted, LIMITS, weight=weight, length=LENGTH)
    solution = solve(system)
    np.testing.assert_allclose(solution.point_force, forces.force, atol=2e-3 * weight)
    np.testing.assert_allclose(solution.residual, forces.residual, atol=1e-4)
    achieved = (np.matvec(system.mass_matrix, solution.acceleration) + system.bias)[:, :6]
    np.testing.assert_allclose(achieved, forces.wrench, atol=1e-3 * weight)
    scale = np.array([1, 1, 1, LENGTH, LENGTH, LENGTH]) * weight
    missed = np.linalg.norm((achieved - wanted) / scale, axis=1)
    np.testing.assert_allclose(solution.residual, missed, atol=1e-4)


def test_rows_may_be_compressed(make_system, contacts):
    """J in independent rows with a point map: the same forces and torques."""
    system = make_system(contacts)
    active = active_points(system)
    full = solve(system, accuracy=EXACT)
    compressed, point_map = reduced(system)
    short = limited_inverse_dynamics(
        *compressed.law, LIMITS, point_map=point_map, active=active, length=LENGTH, accuracy=EXACT
    )
    scale = 1.0 + np.abs(full.torque).max()
    np.testing.assert_allclose(short.point_force, full.point_force, atol=1e-4 * scale)
    np.testing.assert_allclose(short.torque, full.torque, atol=1e-4 * scale)
    assert short.contact_force.shape == (4, system.rank)
    found = np.matvec(compressed.jacobian.mT, short.contact_force)
    expected = np.matvec(system.jacobian.mT, full.contact_force)
    np.testing.assert_allclose(found, expected, atol=1e-3 * scale)


def test_a_base_first_by_any_weight_is_first_in_effect(make_system):
    system = make_system("two flat feet")
    one, other = (solve(system, base_priority=priority) for priority in (1e9, 1e12))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_without_contacts_the_base_falls_freely(make_system):
    system = make_system("flight")
    solution = solve(system)
    wrench = np.matvec(system.mass_matrix, solution.acceleration)[:, :6] + system.bias[:, :6]
    np.testing.assert_allclose(wrench, 0.0, atol=1e-4)
    np.testing.assert_array_equal(solution.point_force, 0.0)
    assert np.isfinite(solution.torque).all()
    # Also with no rows at all.
    empty = make_system("flight", drop_rows=True)
    solution = limited_inverse_dynamics(*empty.law, LIMITS, length=LENGTH)
    assert solution.point_force.shape == (4, 0, 3)
    assert np.isfinite(solution.torque).all()
