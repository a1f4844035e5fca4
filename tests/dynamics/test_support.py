"""The feet's frame: it stays where the feet are, wherever the robot stands."""

import numpy as np
import pytest
from scipy.optimize import linprog

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, point_positions
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from tests.dynamics.models import random_mjcf
from tests.postures import points, posed, turned


@pytest.fixture(scope="module", params=[*robots.ROBOTS, "one point"])
def robot(request):
    if request.param in robots.ROBOTS:
        return robots.load(request.param)
    return robots.Robot.from_mjcf(random_mjcf(3), ["ball"])


@pytest.fixture(scope="module")
def support(robot):
    return Stance.of(robot)


def near_home(robot, rng, count, size=0.15):
    qpos = np.tile(robot.home_qpos, (count, 1))
    qpos[:, 7:] += rng.uniform(-size, size, (count, robot.num_joints))
    return qpos


def frames(robot, support, qpos):
    return support.frame(MuJoCoDynamics(robot).terms(qpos, np.zeros((len(qpos), robot.nv))))


def test_at_home_the_frame_is_below_the_robot_and_not_turned(robot, support):
    frame = frames(robot, support, robot.home_qpos[None])
    data = posed(robot)
    centre = points(robot, data).mean(axis=0)
    np.testing.assert_allclose(frame.centre[0], centre, atol=1e-12)
    np.testing.assert_allclose(frame.world_from_support[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(support.home_base, data.xpos[robot.base_body] - centre, atol=1e-12)
    com = data.subtree_com[robot.base_body]
    np.testing.assert_allclose(support.home_com, com - centre, atol=1e-12)
    home = data.xmat[robot.base_body].reshape(3, 3)
    np.testing.assert_allclose(base_from_trunk(robot).T, home, atol=1e-12)


def test_the_centre_is_the_mean_of_the_points(robot, support, rng):
    qpos = near_home(robot, rng, 5)
    terms = MuJoCoDynamics(robot).terms(qpos, np.zeros((5, robot.nv)))
    found = point_positions(contact_geometry(robot), terms)
    np.testing.assert_allclose(support.frame(terms).centre, found.mean(axis=1), atol=1e-12)


def test_the_frame_goes_with_the_robot(robot, support, rng):
    qpos = near_home(robot, rng, 6)
    before = frames(robot, support, qpos)
    for heading in (-2.9, -1.0, 0.4, 3.0):
        shift = rng.normal(size=3)
        moved, rotation = turned(qpos, heading, shift)
        after = frames(robot, support, moved)
        np.testing.assert_allclose(after.centre, before.centre @ rotation.T + shift, atol=1e-12)
        # A single point has no heading of its own: its frame keeps the world's.
        turning = rotation if robot.num_points > 1 else np.eye(3)
        expected = turning @ before.world_from_support
        np.testing.assert_allclose(after.world_from_support, expected, atol=1e-12)


def test_the_heading_fits_the_points_best(robot, support, rng):
    """Planar Procrustes: no other heading brings the home layout nearer to the points."""
    qpos, _ = turned(near_home(robot, rng, 4, size=0.4), 1.1, np.zeros(3))
    dynamics, geometry = MuJoCoDynamics(robot), contact_geometry(robot)
    home = points(robot, posed(robot))
    terms = dynamics.terms(qpos, np.zeros((4, robot.nv)))
    places = point_positions(geometry, terms)
    layout = (home - home.mean(axis=0))[:, :2]
    now = (places - places.mean(axis=1, keepdims=True))[..., :2]
    headings = np.linspace(-np.pi, np.pi, 20001)
    cosine, sine = np.cos(headings), np.sin(headings)
    turns = np.array([[cosine, -sine], [sine, cosine]]).transpose(2, 0, 1)
    rotation = support.frame(terms).world_from_support
    for index in range(4):
        misfit = ((now[index] - layout @ turns.mT) ** 2).sum(axis=(1, 2))
        ours = ((now[index] - layout @ rotation[index, :2, :2].T) ** 2).sum()
        assert ours <= misfit.min() + 1e-12
    np.testing.assert_allclose(rotation @ rotation.mT, np.tile(np.eye(3), (4, 1, 1)), atol=1e-12)
    np.testing.assert_array_equal(rotation[:, :, 2], np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_margins_are_how_far_the_centre_of_pressure_can_go(robot, support):
    """A linear programme: how far along an axis some shares of the load on the points reach."""
    places = points(robot, posed(robot))
    apart = (places - places.mean(axis=0))[:, :2]
    layout = apart - support.home_com[:2]
    for axis in range(2):
        # Shares s >= 0 with sum 1 and layout^T s = distance * direction.
        reach = []
        for sign in (1.0, -1.0):
            equations = np.zeros((3, len(layout) + 1))
            equations[:2, :-1], equations[axis, -1], equations[2, :-1] = layout.T, -sign, 1.0
            cost = np.append(np.zeros(len(layout)), -1.0)
            found = linprog(cost, A_eq=equations, b_eq=[0.0, 0.0, 1.0])
            reach.append(found.x[-1] if found.success else 0.0)
        assert support.margin[axis] == pytest.approx(max(min(reach), 0.0), abs=1e-9)
    assert support.radius == pytest.approx(np.hypot(*apart.T).mean())
