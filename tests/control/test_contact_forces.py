"""Limited contact forces against Clarabel, optimality conditions, and the projection's laws."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from fbid_gym.control import Accuracy, ContactLimits
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY
from fbid_gym.control.dual_newton import nearest_force
from tests.control.cones import ContactForces, contact_forces, solved_by_clarabel, wrench_map_of
from tests.pairs import pairs

WEIGHT, LENGTH = 540.0, 0.3
SCALE = np.array([1.0, 1.0, 1.0, *[1.0 / LENGTH] * 3])
EXACT = {"accuracy": DEFAULT_ACCURACY._replace(tolerance=1e-11, max_iterations=100)}
REGULARISATION, TOLERANCE = DEFAULT_ACCURACY.regularisation, DEFAULT_ACCURACY.tolerance
MAX_ITERATIONS = DEFAULT_ACCURACY.max_iterations


class Scene(NamedTuple):
    """Wrench maps of two flat feet 0.9 m below the base, and desired wrenches."""

    wrench_map: np.ndarray
    wrench: np.ndarray


def feet(rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 6, 24): eight corner points, somewhat tilted and displaced."""
    corners = [
        (x, side + y, -0.9) for side in (-0.1, 0.1) for x in (-0.08, 0.14) for y in (-0.04, 0.04)
    ]
    points = np.array(corners) + rng.normal(0.0, 0.02, (count, 1, 3))
    return wrench_map_of(points + rng.normal(0.0, 0.003, (count, 8, 3)))


def scene(rng: np.random.Generator, push: float, count: int = 12) -> Scene:
    """Stance with horizontal pushes and moments of about `push` weights (times LENGTH)."""
    wrench = np.zeros((count, 6))
    wrench[:, 2] = WEIGHT
    wrench += push * WEIGHT * rng.normal(size=(count, 6)) * [1, 1, 0.3, LENGTH, LENGTH, LENGTH]
    # Moment that the weight at the feet's middle has about the base.
    wrench[:, 3] += rng.normal(0.0, 0.02, count) * WEIGHT
    wrench[:, 4] += -0.03 * WEIGHT + rng.normal(0.0, 0.02, count) * WEIGHT
    return Scene(feet(rng, count), wrench)


def project(free: np.ndarray, friction: Any, lowest: Any, highest: Any) -> np.ndarray:
    """Nearest forces (..., 3) within the limits."""
    force = np.empty_like(free)
    limits = np.stack(np.broadcast_arrays(friction, lowest, highest), axis=-1)
    limits = np.broadcast_to(limits, free.shape)
    for index in np.ndindex(free.shape[:-1]):
        force[index] = nearest_force(tuple(free[index]), tuple(limits[index].astype(float))).force
    return force


def within(budget: int) -> Accuracy:
    """The default accuracy with a budget of Newton steps."""
    return DEFAULT_ACCURACY._replace(max_iterations=budget)


def solve(case: Scene, limits: ContactLimits, **options: Any) -> ContactForces:
    """The solver under test at this file's scales."""
    return contact_forces(*case, limits, weight=WEIGHT, length=LENGTH, **options)


def reference(
    wrench_map: np.ndarray, wrench: np.ndarray, limits: np.ndarray
) -> tuple[np.ndarray, Callable[[np.ndarray], float]]:
    """Forces (P, 3) of one robot by Clarabel, and the cost it minimises; limits (3, P)."""
    maps, target = wrench_map * SCALE[:, None], wrench * SCALE / WEIGHT
    found = solved_by_clarabel(maps, target, limits.T, WEIGHT)

    def cost(force: np.ndarray) -> float:
        error = maps @ force.ravel() / WEIGHT - target
        return 0.5 * float(error @ error + REGULARISATION * np.sum((force / WEIGHT) ** 2))

    return found.reshape(-1, 3), cost


def assert_feasible(
    force: np.ndarray, friction: Any, lowest: Any, highest: Any, slack: float = 1e-9
) -> None:
    """Within friction cones and normal force limits."""
    slack = slack * WEIGHT
    tangential, normal = np.linalg.norm(force[..., :2], axis=-1), force[..., 2]
    assert (tangential <= friction * normal + slack).all()
    assert (normal >= lowest - slack).all() and (normal <= highest + slack).all()


LIMITS = {
    "friction": (0.7, 0.0, np.inf),
    "slippery": (0.2, 0.0, np.inf),
    "frictionless": (0.0, 0.0, np.inf),
    "pressed": (0.7, 20.0, np.inf),
    "bounded": (0.6, 5.0, 90.0),
    "pinned": (0.5, 60.0, 60.0),
    "each its own": np.linspace([0.1, 0.0, 60.0], [1.2, 20.0, 400.0], 8).T,
}


@pytest.mark.parametrize(("limits", "push"), pairs(LIMITS, [0.0, 0.5, 0.1, 2.0]))
def test_equals_clarabel(rng, limits, push):
    case = scene(rng, push)
    active = rng.random((12, 8)) < 0.8
    active[0], active[1] = True, False
    bounds = np.array([np.broadcast_to(x, (12, 8)) for x in LIMITS[limits]])
    solution = solve(case, ContactLimits(*LIMITS[limits]), active=active, **EXACT)
    assert_feasible(solution.force, bounds[0], bounds[1] * active, np.where(active, bounds[2], 0.0))
    compared = 0
    for i in range(12):
        on = active[i]
        if not on.any():
            np.testing.assert_array_equal(solution.force[i], 0.0)
            continue
        columns = case.wrench_map[i].reshape(6, 8, 3)[:, on].reshape(6, -1)
        expected, cost = reference(columns, case.wrench[i], bounds[:, i, on])
        found = solution.force[i, on]
        # A wrench delivered by sticking points is delivered without regularisation.
        assert cost(found) <= cost(expected) + (1e-11 if solution.residual[i] > 0.0 else 1e-8)
        if solution.residual[i] == 0.0:
            least = np.linalg.pinv(columns) @ case.wrench[i]
            np.testing.assert_allclose(found.ravel(), least, atol=1e-6 * WEIGHT)
            compared += 1
            continue
        # Now and then Clarabel stops early; then its forces are no reference.
        if cost(expected) - cost(found) < 1e-12:
            np.testing.assert_allclose(found, expected, atol=1e-4 * WEIGHT)
            compared += 1
    assert compared >= 6


@pytest.mark.parametrize("limits", ["friction", "pressed", "bounded", "each its own"])
def test_error_with_the_default_options(rng, limits):
    """From a cold start the wrench is that of the exact solution to 1e-6 of the weight.

    Also where it takes more than `MAX_ITERATIONS`: bounds on both sides, and infeasible.
    """
    for push in (0.0, 0.1, 0.5, 2.0):
        case, bounds = scene(rng, push, count=100), ContactLimits(*LIMITS[limits])
        exact, default = solve(case, bounds, **EXACT), solve(case, bounds)
        assert_feasible(default.force, *LIMITS[limits])
        error = (default.wrench - exact.wrench) * SCALE / WEIGHT
        assert np.linalg.norm(error, axis=1).max() < TOLERANCE
        if push == 0.5 and limits != "friction":
            assert (default.iterations > MAX_ITERATIONS).any()


@pytest.mark.parametrize(("limits", "push"), pairs(LIMITS, [0.1, 2.0, 0.5, 5.0]))
def test_every_problem_is_solved(rng, limits, push):
    """By its optimality condition, S^-1 y = w - G f with f the projection of G^T y / eps."""
    case = scene(rng, push, count=1000)
    found = solve(case, ContactLimits(*LIMITS[limits]))
    gradient = (found.wrench - case.wrench) * SCALE + REGULARISATION * found.dual
    slides = found.residual > 0.0
    assert slides.any()
    assert np.linalg.norm(gradient[slides], axis=1).max() < TOLERANCE * WEIGHT
    free = np.matvec((case.wrench_map * SCALE[:, None]).mT, found.dual).reshape(found.force.shape)
    expected = project(free[slides], *LIMITS[limits])
    np.testing.assert_allclose(found.force[slides], expected, atol=1e-9 * WEIGHT)


def test_a_spent_budget_leaves_usable_forces(rng):
    """One Newton step a round: feasible, and no worse than the warm start's forces."""
    case, limits = scene(rng, 0.8, count=50), ContactLimits(0.6, 5.0, 90.0)
    warm = rng.normal(size=(50, 6)) * WEIGHT
    maps, target = case.wrench_map * SCALE[:, None], case.wrench * SCALE
    free = np.matvec(maps.mT, warm).reshape(50, 8, 3)
    start = project(free, 0.6, 5.0, 90.0)
    before = np.linalg.norm(np.matvec(maps, start.reshape(50, 24)) - target, axis=1) / WEIGHT
    for budget in (0, 1, 2):
        solution = solve(case, limits, warm_start=warm, accuracy=within(budget))
        assert_feasible(solution.force, 0.6, 5.0, 90.0)
        assert (solution.residual <= before * (1.0 + 1e-9)).all()


def test_a_warm_start_follows_a_moving_wrench(rng):
    """Tick by tick through a push of half a weight, in few steps and with the same result."""
    case, limits = scene(rng, 0.0, count=50), ContactLimits(0.7)
    direction = rng.normal(size=(50, 6)) * [1, 1, 0.2, LENGTH, LENGTH, LENGTH]
    dual, iterations = None, []
    for phase in np.linspace(0.0, np.pi, 60):
        wrench = case.wrench + 0.5 * WEIGHT * np.sin(phase) * direction
        solution = solve(case._replace(wrench=wrench), limits, warm_start=dual)
        dual = solution.dual
        iterations.append(solution.iterations)
    assert np.mean(iterations) < 3.0
    exact = solve(case._replace(wrench=wrench), limits, **EXACT)
    error = (solution.wrench - exact.wrench) * SCALE / WEIGHT
    assert np.linalg.norm(error, axis=1).max() < 2.0 * TOLERANCE


def test_infeasible_wrenches_are_reported(rng):
    for wrench in (
        [50.0, 0.0, 1.0, 0.0, 0.0, 0.0],  # a huge side push
        [0.0, 0.0, -2.0, 0.0, 0.0, 0.0],  # pull
        [0.0, 0.0, 1.0, 30.0, -30.0, 30.0],  # huge moments
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ):
        case = Scene(feet(rng, 3), np.tile(WEIGHT * np.array(wrench), (3, 1)))
        solution = solve(case, ContactLimits(0.7))
        assert_feasible(solution.force, 0.7, 0.0, np.inf)
        assert all(np.isfinite(x).all() for x in solution)
        if any(wrench):
            assert (solution.residual > 0.5).all()
        else:
            np.testing.assert_allclose(solution.force, 0.0, atol=1e-100)
            np.testing.assert_allclose(solution.residual, 0.0, atol=1e-100)


def test_without_contacts_there_are_no_forces(rng):
    case = scene(rng, 0.1)
    solution = solve(case, ContactLimits(0.7, 10.0), active=np.zeros((12, 8), bool))
    np.testing.assert_array_equal(solution.force, 0.0)
    expected = np.linalg.norm(case.wrench * SCALE, axis=1) / WEIGHT
    np.testing.assert_allclose(solution.residual, expected)
    # Touchdown from there is as well solved as from nothing.
    landed = solve(case, ContactLimits(0.7, 10.0), warm_start=solution.dual)
    cold = solve(case, ContactLimits(0.7, 10.0))
    np.testing.assert_allclose(landed.wrench, cold.wrench, atol=2.0 * TOLERANCE * WEIGHT)


def brute_force(free: np.ndarray, friction: float, lowest: float, highest: float) -> np.ndarray:
    """Nearest feasible force by trying normal forces: given one, the tangential part is clipped."""
    size = np.linalg.norm(free[:2])
    top = min(highest, abs(free[2]) + size + lowest + 1.0)
    normals = np.linspace(lowest, top, 200001)
    tangents = np.minimum(size, friction * normals)
    best = np.argmin((tangents - size) ** 2 + (normals - free[2]) ** 2)
    return np.array([*(free[:2] * tangents[best] / size), normals[best]])


@pytest.mark.parametrize("bounds", [(0.7, 0.0, np.inf), (0.0, 0.0, 5.0), (1.5, 0.5, 2.0)])
def test_projection(rng, bounds):
    free = rng.normal(0.0, 3.0, (2, 60, 3))
    force = project(free, *bounds)
    for one, other in zip(free.reshape(-1, 3), force.reshape(-1, 3), strict=True):
        np.testing.assert_allclose(other, brute_force(one, *bounds), atol=1e-3)
    np.testing.assert_allclose(project(force, *bounds), force, atol=1e-12)
    gap = np.linalg.norm(force[0] - force[1], axis=-1)
    assert (gap <= np.linalg.norm(free[0] - free[1], axis=-1) + 1e-12).all()
    # A force straight up or down has no tangential direction.
    vertical = project(np.array([[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]]), *bounds)
    assert np.isfinite(vertical).all()
    np.testing.assert_array_equal(vertical[..., :2], 0.0)
