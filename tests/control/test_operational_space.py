"""Eqs. (19) and (20) against the stacked pseudo-inverse, and what happens where it has none."""

from typing import Any

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.control import (
    TaskMotion,
    operational_space_acceleration,
    orthogonal_inverse_dynamics,
    task_acceleration,
)
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts

EXACT = {"least_gain": 1e-4}


def task_of(rng: np.random.Generator, system: Any, rows: int) -> tuple[np.ndarray, ...]:
    """J_t, Jdot_t v and a wanted acceleration, for a task that any free motion can serve."""
    count, nv = system.bias.shape
    return rng.normal(size=(count, rows, nv)), *rng.normal(size=(2, count, rows))


def velocities(
    jacobian: np.ndarray,
    task_jacobian: np.ndarray,
    task: np.ndarray,
    reference: np.ndarray | None = None,
    **options: Any,
) -> TaskMotion:
    """The law on the level of velocities: floating-base inverse kinematics, the paper's [11]."""
    still = np.zeros(jacobian.shape[:2])
    return operational_space_acceleration(
        jacobian, still, task_jacobian, None, task, reference, **options
    )


@pytest.mark.parametrize(
    ("rows", "with_reference", "weighted"),
    [(1, True, False), (2, False, False), (4, True, False), (3, True, True)],
)
def test_equals_the_stacked_pseudo_inverse_and_is_the_nearest_to_the_reference(
    make_system, rng, contacts, rows, with_reference, weighted
):
    """The change from it costs nothing in any direction that stays free."""
    system = make_system(contacts)
    task_jacobian, task_bias, task = task_of(rng, system, rows)
    cost = np.exp(rng.normal(size=system.bias.shape[1])) if weighted else None
    reference = system.acceleration if with_reference else np.zeros_like(system.acceleration)
    last, own = (task, (reference if with_reference else None)), EXACT | {"motion_cost": cost}
    given = system.jacobian, system.jacobian_bias, task_jacobian, task_bias, *last
    found = operational_space_acceleration(*given, **own)
    kinematics = velocities(system.jacobian, task_jacobian, *last, **own)
    root = np.ones(system.bias.shape[1]) if cost is None else np.sqrt(cost)
    for i, jacobian in enumerate(system.jacobian):
        stacked = np.concatenate([jacobian, task_jacobian[i]])
        inverse = np.linalg.pinv(stacked / root, rcond=1e-9) / root[:, None]
        still = np.concatenate([np.zeros(len(jacobian)), task[i]])
        drift = np.concatenate([system.jacobian_bias[i], task_bias[i]])
        free = np.linalg.svd(stacked)[2][np.linalg.matrix_rank(stacked, 1e-8) :]
        for motion, rest in ((found.motion[i], drift), (kinematics.motion[i], 0.0 * drift)):
            expected = reference[i] + inverse @ (still - rest - stacked @ reference[i])
            np.testing.assert_allclose(motion, expected, atol=1e-7)
            np.testing.assert_allclose(stacked @ motion + rest, still, atol=1e-7)
            change = root**2 * (motion - reference[i])
            np.testing.assert_allclose(free @ change, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.task_error, 0.0, atol=1e-8)
    np.testing.assert_allclose(kinematics.task_error, 0.0, atol=1e-8)


def test_units_of_the_cost_do_not_matter(make_system, rng, contacts):
    """Contacts hold in any; gains are in units of its root."""
    system = make_system(contacts)
    given = system.jacobian, system.jacobian_bias, *task_of(rng, system, 2)
    expected = operational_space_acceleration(*given, least_gain=1e-2)
    for size in (1e-3, 1e3):
        cost = np.full(system.bias.shape[1], size)
        own = {"motion_cost": cost, "least_gain": 1e-2 / np.sqrt(size)}
        found = operational_space_acceleration(*given, **own)
        np.testing.assert_allclose(found.motion, expected.motion, atol=1e-6)
        np.testing.assert_allclose(found.task_error, expected.task_error, atol=1e-6)


def test_one_task_jacobian_serves_all_robots(make_system):
    """J_b,xy in coordinates with the base's position first; its rate is zero."""
    system = make_system("two flat feet")
    count, nv = system.bias.shape
    rows = np.eye(nv)[:2]
    task = np.tile([0.3, -0.2], (count, 1))
    arguments = (system.jacobian, system.jacobian_bias)
    found = operational_space_acceleration(*arguments, rows, None, task, **EXACT)
    np.testing.assert_allclose(found.motion[:, :2], task, atol=1e-9)
    batched, zeros = np.broadcast_to(rows, (count, 2, nv)), np.zeros((count, 2))
    again = operational_space_acceleration(*arguments, batched, zeros, task, **EXACT)
    np.testing.assert_array_equal(found.motion, again.motion)


def test_contacts_outrank_a_task_that_contradicts_them(make_system, rng, contacts):
    """Lift a planted foot: it stays, the error says so, and the rest of the task is served."""
    system = make_system(contacts)
    count, nv = system.bias.shape
    impossible = system.jacobian[:, :1] if system.rank else np.zeros((count, 1, nv))
    task_jacobian = np.concatenate([impossible, rng.normal(size=(count, 1, nv))], axis=1)
    task = np.ones((count, 2))
    found = velocities(system.jacobian, task_jacobian, task)
    np.testing.assert_allclose(np.matvec(system.jacobian, found.motion), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.task_error, [[1.0, 0.0]] * count, atol=1e-6)
    left = task - np.matvec(task_jacobian, found.motion)
    np.testing.assert_allclose(found.task_error, left, atol=1e-8)


def test_weak_directions_fade_out_as_promised():
    """One coordinate moves the task by `gain`: shares, bounds and smoothness over all gains."""
    least, gains = 0.05, np.concatenate([[0.0], np.geomspace(1e-9, 1.0, 4000)])
    task_jacobian = np.zeros((len(gains), 2, 8))
    task_jacobian[:, 0, 3], task_jacobian[:, 1, 5] = gains, 1.0
    nothing, task = np.zeros((len(gains), 0, 8)), np.ones((len(gains), 2))
    found = velocities(nothing, task_jacobian, task, least_gain=least)
    share = gains * found.motion[:, 3]
    y = np.minimum(gains / least, 1.0)
    np.testing.assert_allclose(share, y**2 / (1.0 - y**2 + y**4), atol=1e-9)
    np.testing.assert_allclose(found.task_error[:, 0], 1.0 - share, atol=1e-9)
    np.testing.assert_allclose(found.motion[:, 5], 1.0, atol=1e-12)
    assert np.abs(found.motion).max() <= 1.07 / least
    assert np.abs(np.diff(found.motion[:, 3])).max() < 0.01 / least
    exact = gains >= least
    np.testing.assert_allclose(share[exact], 1.0, atol=1e-12)


def biped_squatting(knee: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States of the biped, both soles level, by knee angle; moving joints."""
    robot = robots.load("biped")
    qpos = np.tile(robot.home_qpos, (len(knee), 1))
    for side in ("left", "right"):
        for joint, share in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
            qpos[:, 7 + robot.joint_names.index(f"{side}_{joint}")] = share * knee
    return qpos, np.random.default_rng(3).normal(size=(len(knee), robot.nv))


def test_straight_knees_ask_for_no_unbounded_motion():
    """Lift the base over knees that straighten: the plain pseudo-inverse grows without bound."""
    robot = robots.load("biped")
    qpos, qvel = biped_squatting(np.geomspace(1.0, 1e-5, 200))
    contacts = reduced_contacts(contact_geometry(robot), MuJoCoDynamics(robot).terms(qpos, qvel))
    lift = np.eye(robot.nv)[2:3]
    task, still = np.ones((len(qpos), 1)), np.zeros_like(contacts.bias)
    plain = [np.linalg.pinv(np.concatenate([j, lift]))[:, -1] for j in contacts.jacobian]
    assert np.abs(plain).max() > 1e3
    found = operational_space_acceleration(contacts.jacobian, still, lift, None, task)
    assert np.linalg.norm(found.motion, axis=1).max() < 1.07 / 0.05
    assert np.abs(np.diff(found.motion, axis=0)).max() < 3.0
    held = np.matvec(contacts.jacobian, found.motion)
    np.testing.assert_allclose(held, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.task_error[0], 0.0, atol=1e-9)
    assert found.task_error[-1, 0] > 0.99
    # The paper's task leaves the vertical out, so that straight knees do not matter to it.
    xy = np.eye(robot.nv)[:2]
    sway = operational_space_acceleration(contacts.jacobian, still, xy, None, np.ones((200, 2)))
    np.testing.assert_allclose(sway.task_error, 0.0, atol=1e-8)
    assert np.linalg.norm(sway.motion, axis=1).max() < 20.0


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_eq_15_realises_the_superposition(name):
    """Joint-space motion and base task through eq. (15): the command arrives unchanged."""
    robot = robots.load(name)
    rng = np.random.default_rng(5)
    qpos = np.tile(robot.home_qpos, (6, 1))
    qpos[:, 7:] += rng.normal(0.0, 0.1, qpos[:, 7:].shape)
    terms = MuJoCoDynamics(robot).terms(qpos, rng.normal(size=(6, robot.nv)))
    contacts = reduced_contacts(contact_geometry(robot), terms)
    task, reference = rng.normal(size=(6, 2)), rng.normal(size=(6, robot.nv))
    command = operational_space_acceleration(
        contacts.jacobian, contacts.bias, np.eye(robot.nv)[:2], None, task, reference
    )
    solution = orthogonal_inverse_dynamics(
        terms.mass_matrix, terms.bias, contacts.jacobian, command.motion, contacts.bias
    )
    np.testing.assert_allclose(solution.acceleration, command.motion, atol=1e-7)
    np.testing.assert_allclose(solution.acceleration[:, :2], task, atol=1e-7)


def test_eq_20_pulls_towards_the_target():
    desired, position = np.array([[1.0, 2.0]]), np.array([[0.5, 2.5]])
    velocity = np.array([[0.1, -0.2]])
    found = task_acceleration(desired, position, velocity, 9.0, 6.0)
    np.testing.assert_allclose(found, [[9.0 * 0.5 - 0.6, -9.0 * 0.5 + 1.2]])
    gains = np.array([9.0, 4.0]), np.array([6.0, 4.0])
    moving = {"desired_velocity": velocity, "desired_acceleration": np.ones((1, 2))}
    found = task_acceleration(desired, position, velocity, *gains, **moving)
    np.testing.assert_allclose(found, [[5.5, -1.0]])
