"""Wrenches over contacts: Clarabel, limits, priorities, and what happens with too few contacts."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fbid_gym import robots
from fbid_gym.control import ContactLimits, TorqueMap, distribute, torque_map_inverse_dynamics
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY, wrench_scale
from fbid_gym.dynamics import MuJoCoDynamics, centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry, point_positions, reduced_contacts
from tests.control.cones import solved_by_clarabel, wrench_map_of

EXACT = DEFAULT_ACCURACY._replace(tolerance=1e-9, max_iterations=50)
STEPS = DEFAULT_ACCURACY.torque_steps
COUNT = 16
FRICTION = 0.6
LIMITS = ContactLimits(FRICTION)


class Scene(NamedTuple):
    """Robots in stance, moving, a wrench for each, and the arguments of `distribute`."""

    robot: robots.Robot
    points: np.ndarray
    com: np.ndarray
    torque_map: TorqueMap
    wrench: np.ndarray
    options: dict[str, Any]

    def solve(self, **changes: Any) -> Any:
        """`distribute`, some arguments replaced."""
        given = {"torque_map": self.torque_map, "wrench": self.wrench, "limits": LIMITS}
        return distribute(**given | self.options | changes)

    @property
    def wrench_map(self) -> np.ndarray:
        """(COUNT, 6, 3 P) from the positions of the points, not from Jacobians."""
        return wrench_map_of(self.points - self.com[:, None])

    @property
    def torques(self) -> tuple[np.ndarray, np.ndarray]:
        """Slope (COUNT, n, 3 P) and offset of the torques as functions of point forces."""
        contact = self.torque_map.jacobian[:, :, 6:].mT @ self.options["point_map"]
        return self.torque_map.per_wrench @ self.wrench_map - contact, self.torque_map.offset


def scene(name: str, rng: np.random.Generator, push: float = 0.1) -> Scene:
    robot = robots.load(name)
    qpos = np.tile(robot.home_qpos, (COUNT, 1))
    qpos[:, 7:] += 0.1 * rng.normal(size=(COUNT, robot.num_joints))
    velocity = 0.3 * rng.normal(size=(COUNT, robot.nv))
    terms = MuJoCoDynamics(robot).terms(qpos, velocity)
    body, geometry = centroidal_terms(terms, velocity), contact_geometry(robot)
    contacts = reduced_contacts(geometry, terms)
    points = point_positions(geometry, terms)
    centre = points.mean(axis=1)
    length = float(np.linalg.norm((points - centre[:, None])[..., :2], axis=2).mean())
    wrench = push * robot.weight * rng.normal(size=(COUNT, 6))
    wrench[:, 3:] *= length
    wrench[:, 2] += robot.weight
    # The weight acts above the feet, not above the centre of mass of a randomly bent robot.
    wrench[:, 3:] += np.cross(centre - terms.com, robot.weight * np.array([0.0, 0.0, 1.0]))
    options = {"to_com": body.to_com, "point_map": contacts.point_map}
    options |= {"weight": robot.weight, "length": length}
    torque_map = torque_map_inverse_dynamics(terms, body, contacts)
    return Scene(robot, points, terms.com, torque_map, wrench, options)


@pytest.fixture(params=robots.ROBOTS)
def stance(request, rng):
    return scene(request.param, rng)


@pytest.fixture(params=robots.ROBOTS)
def hard(request, rng):
    """Wrenches that the contacts cannot deliver."""
    return scene(request.param, rng, push=0.6)


def exact(stance, row, *, cost=None, torque_limit=None):
    """Forces (3 P,) of one robot by Clarabel, or None if there are none."""
    scale = wrench_scale(stance.options["length"], cost)
    weight = stance.robot.weight
    maps = stance.wrench_map[row] * scale[:, None]
    limits, torque = np.tile([FRICTION, 0.0, np.inf], (maps.shape[1] // 3, 1)), None
    if torque_limit is not None:
        slope, offset = (x[row] for x in stance.torques)
        torque = slope, -torque_limit - offset, torque_limit - offset
    target = stance.wrench[row] * scale / weight
    return solved_by_clarabel(maps, target, limits, weight, torque=torque, tolerance=1e-11)


def assert_within_friction(force, friction=FRICTION):
    assert (force[..., 2] >= 0.0).all()
    tangential = np.linalg.norm(force[..., :2], axis=-1)
    assert (tangential <= friction * force[..., 2] + 1e-9 * (1.0 + force[..., 2])).all()


# --- against the exact solution ----------------------------------------------------------------


@pytest.mark.parametrize("cost", [None, (1.0, 1.0, 25.0, 0.04, 0.04, 1.0)])
def test_forces_are_clarabels(hard, cost):
    result = hard.solve(wrench_cost=cost, accuracy=EXACT)
    for row in range(COUNT):
        expected = exact(hard, row, cost=cost)
        wrench = hard.wrench_map[row] @ expected
        scale = hard.robot.weight * np.array([1.0] * 3 + [hard.options["length"]] * 3)
        np.testing.assert_allclose(result.wrench[row] / scale, wrench / scale, atol=1e-4)
    assert_within_friction(result.point_force)


def tight_limits(stance):
    """Torque limits that some robots break: 0.7 of what the ninth of ten needs, joint by joint."""
    needed = np.quantile(np.abs(stance.solve().torque), 0.9, axis=0)
    return 0.7 * needed + 0.01 * stance.robot.torque_limit


@pytest.mark.parametrize(
    ("steps", "wrench_error", "excess"), [(STEPS, 0.12, 0.15), (8000, 1e-3, 1e-3)]
)
def test_forces_under_torque_limits_are_clarabels(stance, steps, wrench_error, excess):
    """By default roughly, with enough steps exactly."""
    limit = tight_limits(stance)
    accuracy = DEFAULT_ACCURACY._replace(torque_steps=steps)
    free, result = stance.solve(), stance.solve(torque_limit=limit, accuracy=accuracy)
    beyond = (np.abs(free.torque) > limit).any(axis=1)
    assert COUNT / 2 < beyond.sum()
    scale = stance.robot.weight * np.array([1.0] * 3 + [stance.options["length"]] * 3)
    solved, errors = 0, []
    for row in np.flatnonzero(beyond):
        expected = exact(stance, row, torque_limit=limit)
        if expected is None:
            continue
        solved += 1
        missed = result.wrench[row] - stance.wrench_map[row] @ expected
        errors.append(np.linalg.norm(missed / scale))
        assert (np.abs(result.torque[row]) <= (1.0 + excess) * limit).all()
    assert solved > COUNT / 3
    assert np.max(errors) < wrench_error
    assert np.median(errors) < wrench_error / 3
    assert_within_friction(result.point_force)
    np.testing.assert_array_equal(result.torque[~beyond], free.torque[~beyond])
    np.testing.assert_array_equal(result.wrench[~beyond], free.wrench[~beyond])


# --- what the result says ----------------------------------------------------------------------


def test_result_is_consistent(hard):
    result = hard.solve(torque_limit=hard.robot.torque_limit)
    force = result.point_force.reshape(COUNT, -1)
    wrench = np.matvec(hard.wrench_map, force)
    np.testing.assert_allclose(result.wrench, wrench, atol=1e-9 * hard.robot.weight)
    slope, offset = hard.torques
    size = np.abs(result.torque).max()
    np.testing.assert_allclose(result.torque, offset + np.matvec(slope, force), atol=1e-9 * size)
    np.testing.assert_array_equal(result.wrench_desired, hard.wrench)
    scale = wrench_scale(hard.options["length"], None)
    missing = np.linalg.norm((result.wrench - hard.wrench) * scale, axis=1) / hard.robot.weight
    np.testing.assert_allclose(result.residual, missing, atol=1e-9)
    assert (result.residual > 1e-3).any()
    assert_within_friction(result.point_force)


def test_what_costs_more_goes_first(hard):
    errors = {}
    for axis in range(6):
        cost = [1.0] * 6
        for factor in (0.01, 1.0, 100.0):
            cost[axis] = factor
            result = hard.solve(wrench_cost=tuple(cost), accuracy=EXACT)
            errors[factor] = np.abs(result.wrench - hard.wrench)[:, axis]
        tolerance = 1e-4 * hard.robot.weight
        assert (errors[100.0] <= errors[1.0] + tolerance).all()
        assert (errors[1.0] <= errors[0.01] + tolerance).all()
        assert (errors[100.0] < 0.5 * errors[0.01]).any()


def test_a_slope_is_level_ground_seen_from_aside(stance, rng):
    """Tilting world, robot and wrench together changes nothing but the axes."""
    turn = Rotation.from_rotvec([0.2, -0.15, 0.4]).as_matrix()
    both = np.kron(np.eye(2), turn)
    points = len(stance.points[0])
    level = stance.solve()
    # x' = turn x: rows of the contacts are unchanged, point forces come in world axes.
    result = stance.solve(
        wrench=stance.wrench @ both.T,
        to_com=both @ stance.options["to_com"],
        point_map=stance.options["point_map"] @ np.kron(np.eye(points), turn.T),
        torque_map=stance.torque_map._replace(per_wrench=stance.torque_map.per_wrench @ both.T),
        contact_rotation=np.broadcast_to(turn, (COUNT, points, 3, 3)),
    )
    size = 1e-3 * stance.robot.weight
    np.testing.assert_allclose(result.point_force, level.point_force @ turn.T, atol=size)
    np.testing.assert_allclose(result.torque, level.torque, atol=size)
    assert_within_friction(result.point_force @ turn, FRICTION)


# --- too little to stand on ----------------------------------------------------------------------


def test_with_too_little_the_rest_is_delivered(stance):
    """Without contacts, without rows, without friction, and with motors that can do nothing."""
    nobody = np.zeros((COUNT, stance.robot.num_points), bool)
    empty = stance.torque_map._replace(jacobian=stance.torque_map.jacobian[:, :0])
    no_rows = {"torque_map": empty, "point_map": stance.options["point_map"][:, :0, :0]}
    for changes in ({"active": nobody}, {"limits": ContactLimits(FRICTION, 0.0, 0.0)}, no_rows):
        limit = None if changes is no_rows else stance.robot.torque_limit
        result = stance.solve(torque_limit=limit, **changes)
        assert result.point_force.shape[1] == (0 if limit is None else stance.robot.num_points)
        assert not result.point_force.any() and (result.residual > 0.5).all()
        np.testing.assert_allclose(result.wrench, 0.0, atol=1e-9)
        np.testing.assert_allclose(result.torque, stance.torque_map.offset)
    smooth = stance.solve(limits=ContactLimits(0.0))
    assert not smooth.point_force[..., :2].any() and np.isfinite(smooth.torque).all()
    np.testing.assert_allclose(smooth.wrench[:, :2], 0.0, atol=1e-9 * stance.robot.weight)
    assert (np.abs(smooth.wrench[:, 2] / stance.robot.weight - 1.0) < 0.5).all()
    weak = stance.solve(torque_limit=1e-6 * stance.robot.torque_limit)
    assert all(np.isfinite(part).all() for part in weak)
    assert_within_friction(weak.point_force)


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_two_points_cannot_turn_about_the_line_through_them(name, rng):
    stance = scene(name, rng)
    active = np.zeros((COUNT, stance.robot.num_points), bool)
    active[:, [0, -1]] = True
    result = stance.solve(active=active)
    assert np.isfinite(result.torque).all()
    np.testing.assert_array_equal(result.point_force[:, 1:-1], 0.0)
    line = stance.points[:, -1] - stance.points[:, 0]
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    arm = stance.com - stance.points[:, 0]
    moment = result.wrench[:, 3:] + np.cross(arm, result.wrench[:, :3])
    np.testing.assert_allclose(np.vecdot(moment, line), 0.0, atol=1e-9 * stance.robot.weight)
    assert (result.residual > 1e-3).all()
