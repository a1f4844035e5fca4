"""Our stepping controller: hull of the soles, footwork, and that it holds what others do not."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.footwork import Footwork, swing
from eval.papers.mistry2010.polygon import Polygon
from eval.papers.mistry2010.stepper import Stepper, StepperGains
from eval.papers.mistry2010.stepping_cases import CROUCHED, OURS, controller
from eval.papers.trial import RATES, Push, Trial, pushed, simulate
from fbid_gym.dynamics.frames import rotation_vector
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import stepping
from fbid_gym.quantities import RobotState
from fbid_gym.robots import load


@pytest.fixture(scope="module")
def robot():
    return load("biped")


@pytest.fixture(scope="module")
def stepper(robot):
    return Stepper(robot, CROUCHED)


def soles(rng, count):
    """Two turned rectangles for each robot, (N, 8, 2), and which points count, (N, 8)."""
    corners = np.array([[0.11, 0.04], [0.11, -0.04], [-0.11, 0.04], [-0.11, -0.04]])
    angle = rng.uniform(-0.4, 0.4, (count, 2))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    places = np.array([[0.0, 0.14], [0.0, -0.14]]) + rng.uniform(-0.1, 0.1, (count, 2, 2))
    points = np.einsum("ijnf,pj->nfpi", turn, corners) + places[:, :, None]
    on = np.repeat(rng.permuted(np.tile([True, True], (count, 1)), axis=1), 4, axis=1)
    on[::3, :4] = False
    return points.reshape(count, 8, 2), on


def distance_inside(points, place):
    """Signed distance of a place to the edge of the hull of the points, by scipy."""
    equations = ConvexHull(points).equations
    return -(equations[:, :2] @ place + equations[:, 2]).max()


def test_the_margin_is_that_of_the_convex_hull(rng):
    points, on = soles(rng, 60)
    place = rng.uniform(-0.3, 0.3, (60, 2))
    found = Polygon.around(points, on).margin(place)
    exact = [distance_inside(p[a], x) for p, a, x in zip(points, on, place, strict=True)]
    inside = np.array(exact) > 0
    assert inside.any() and not inside.all()
    np.testing.assert_allclose(found[inside], np.array(exact)[inside], atol=1e-9)
    # Beyond a corner the distance to the edges' lines is less than the distance to the hull.
    assert (found[~inside] < 0.0).all()


def test_pressures_outside_come_to_the_edge_and_others_stay(rng):
    points, on = soles(rng, 60)
    place = rng.uniform(-0.4, 0.4, (60, 2))
    hull = Polygon.around(points, on)
    found, margin = hull.nearest(place), hull.margin(place)
    np.testing.assert_allclose(found[margin > 1e-5], place[margin > 1e-5])
    for p, a, x, y, m in zip(points, on, place, found, margin, strict=True):
        assert distance_inside(p[a], y) > -1e-5
        if m < -1e-5:
            assert abs(distance_inside(p[a], y)) < 1e-5
            # No corner is much nearer than what was found.
            assert np.linalg.norm(x - y) < 1.1 * np.linalg.norm(p[a] - x, axis=1).min()


def test_a_foot_gets_where_it_shall_be_at_rest_and_in_time(rng):
    count, step, span = 20, 0.002, np.full(20, 0.2)
    position, velocity = np.zeros((count, 3)), np.zeros((count, 3))
    target = np.zeros((count, 3))
    target[:, :2] = rng.uniform(-0.1, 0.1, (count, 2))
    highest = np.zeros(count)
    for tick in range(100):
        if tick == 30:  # the target may move
            target[:, :2] += rng.uniform(-0.03, 0.03, (count, 2))
        clock = np.full(count, tick * step)
        pull = swing(position, velocity, target, clock, span, 0.05, 200.0)
        position += step * velocity + 0.5 * step**2 * pull
        velocity += step * pull
        highest = np.maximum(highest, position[:, 2])
    assert (highest > 0.04).all() and (highest < 0.06).all()
    np.testing.assert_allclose(position, target, atol=6e-3)
    assert np.abs(velocity).max() < 0.4


def test_a_foot_that_finds_no_ground_goes_on_down_and_no_faster_than_it_may():
    place, still = np.zeros((1, 3)), np.zeros((1, 3))
    late = swing(place, still, place, np.array([0.3]), np.array([0.2]), 0.05, 60.0)
    assert late[0, 2] < 0.0 and late[0, 0] == 0.0
    far = swing(place, still, place + [1.0, 0.0, 0.0], np.array([0.1]), np.array([0.2]), 0.05, 60.0)
    assert np.linalg.norm(far) == pytest.approx(60.0)


def walk(footwork, ticks, planned, load, calm, falls):
    """Run the footwork of one robot; each argument is a function of the tick."""
    memory, seen = footwork.memory(np.ones((1, 2), bool)), []
    for tick in range(ticks):
        footwork.advance(
            np.array([planned(tick)]),
            np.array([load(tick)]),
            np.array([calm(tick)]),
            np.array([falls(tick)]),
            memory,
        )
        seen.append(memory["swings"][0].copy())
    return np.array(seen), memory


def test_planned_steps_wait_until_the_robot_is_calm_and_end_on_the_ground():
    footwork = Footwork(0.01, 0.1)
    left_up = lambda tick: [not 10 <= tick < 20, True]  # noqa: E731
    seen, memory = walk(
        footwork, 60, left_up, lambda t: [300.0 * (t >= 40), 300.0], lambda t: t >= 30,
        lambda t: [False, False],
    )  # fmt: skip
    assert np.flatnonzero(seen[:, 0]).tolist() == list(range(30, 40))
    assert not seen[:, 1].any()
    assert memory["steps"] == 1 and memory["captures"] == 0


def test_a_fall_is_caught_at_once_with_one_foot_at_a_time():
    footwork = Footwork(0.01, 0.1, capture=0.2)
    seen, memory = walk(
        footwork, 60, lambda t: [t < 12, True], lambda t: [300.0, 300.0], lambda t: True,
        lambda t: [False, 10 <= t < 15],
    )  # fmt: skip
    assert np.flatnonzero(seen[:, 1]).tolist() == list(range(10, 23))
    assert not seen.all(axis=1).any()
    # The planned step of the other foot comes after.
    assert np.flatnonzero(seen[:, 0])[0] >= 23 + 5
    assert memory["captures"] == 1 and memory["steps"] == 1


def test_torques_move_the_foot_in_the_air_as_wanted_with_forces_under_the_other(
    robot, stepper, rng
):
    """Forward dynamics in motion: what does a robot do whose right sole is held to the ground?"""
    count = 6
    simulation = Simulation(robot, count, RATES)
    tick = np.full(count, 375)
    plan = stepper.plan.reference(tick)
    qvel = plan.qvel + 0.02 * rng.standard_normal(plan.qvel.shape)
    simulation.place(np.arange(count), plan.qpos, qvel)
    state = RobotState(simulation.qpos, simulation.qvel, simulation.contact_force, tick)
    terms, memory = simulation.terms(), stepper.memory(count)
    command = stepper(state, terms, plan, memory)
    assert memory["swings"].tolist() == [[True, False]] * count

    motor = command.feedforward - robot.joint_damping * qvel[:, 6:]
    drive = np.concatenate([np.zeros((count, 6)), motor], axis=1) - terms.bias
    left, right = terms.foot_jacobian.swapaxes(0, 1)
    creep = -StepperGains().grip * terms.foot_velocity[:, 1]
    tilt = rotation_vector(terms.world_from_foot[:, 1])[:, :2]
    creep[:, 3:5] -= (0.5 * StepperGains().grip) ** 2 * tilt
    held = np.concatenate([drive, creep - terms.foot_bias[:, 1]], axis=1)
    system = np.block([[terms.mass_matrix, -right.mT], [right, np.zeros((count, 6, 6))]])
    found = np.linalg.solve(system, held[..., None])[..., 0]
    motion, wrench = found[:, : robot.nv], found[:, robot.nv :]

    # Midway, the left foot comes down to the ground where it is already.
    lifted = np.matvec(left, motion) + terms.foot_bias[:, 0]
    place, velocity = terms.foot_position[:, 0], terms.foot_velocity[:, 0, :3]
    wanted = swing(place, velocity, place, memory["clock"], memory["span"], 0.05, 60.0)
    assert (memory["clock"] > 0.5 * memory["span"]).all()
    np.testing.assert_allclose(lifted[:, 2], wanted[:, 2], atol=0.2)
    # The right sole carries it all: friction, and the centre of pressure under the sole.
    assert (np.hypot(*wrench[:, :2].T) <= 0.7 * wrench[:, 2]).all()
    arm = np.stack([-wrench[:, 4], wrench[:, 3]], axis=1) / wrench[:, 2:3]
    assert (np.abs(arm) <= np.array([0.112, 0.042])).all()


@pytest.mark.slow
def test_it_takes_200_newtons_where_the_papers_controller_falls(robot):
    angle = np.pi * np.array([0.0, 0.5, 1.0, 1.5])
    force = 200.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    push = pushed(Push(np.full(4, 0.4), 0.15, force))
    plan, start = following(stepping(robot, CROUCHED)), np.array([0.0, 0.3, 1.0, 1.8])
    trial = Trial(robot, plan, 3.0, 4, start=start, disturb=push, watch=("steps",))
    log = simulate(trial, controller(robot, "crouched", OURS))
    assert log.survived.all()
    assert (log["steps"][-1] >= 1).all()
