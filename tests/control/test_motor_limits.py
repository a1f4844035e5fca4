"""Torque limits in the force problem against Clarabel; and motors that give less than they say."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions.law import BodyLaw
from fbid_gym.control.motor_limits import MotorModel, believed_strength
from fbid_gym.dynamics.contacts import point_positions, reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots.drives import TorqueLine, least_and_most, torque_line
from tests.control.cones import solved_by_clarabel
from tests.control.test_whole_body import Scene, desired_of, law_of, scene_of, torque_of, with_line

FULL, FREE = 0.3, 6.0  # rad/s: scenes are slow
HZ = 500


def weakened(law: BodyLaw, share: float) -> BodyLaw:
    """The law with motors of a share of their torque, that loses some with speed."""
    ones = np.ones(law.robot.num_joints)
    line = TorqueLine(share * law.robot.torque_limit, FULL * ones, ones / (FREE - FULL))
    return with_line(law, line)


def bounds(law: BodyLaw, scene: Scene) -> np.ndarray:
    """(N, n, 2) N·m, least and greatest torque at the present speeds."""
    line, speeds = law.constants.motors.line, scene.state.qvel[:, 6:]
    return np.array(
        [[least_and_most(line, j, speed, 1.0) for j, speed in enumerate(row)] for row in speeds]
    )


def exact(law: BodyLaw, scene: Scene, row: int) -> float:
    """Least share of the weight by which the wrench on the base can miss the desired one."""
    terms, constants, robot = scene.terms, law.constants, law.robot
    mass_matrix, bias = terms.mass_matrix[row], terms.bias[row]
    desired = desired_of(law, scene)[row]
    weight = robot.weight
    scale = constants.nearness[:, None]
    points = point_positions(constants.geometry, terms)[row]
    jacobian = []
    for point, foot in enumerate(constants.geometry.foot_of_point):
        whole = terms.foot_jacobian[row, foot]
        arm = points[point] - terms.foot_position[row, foot]
        jacobian.append(whole[:3] + np.cross(whole[3:].T, arm).T)
    by_force = np.concatenate(jacobian)  # (3 P, nv)
    wrench = (mass_matrix @ desired + bias)[:6]
    # The least motion that keeps the contacts and changes the wrench: rows b of M, see
    # `limited_inverse_dynamics`.
    held = reduced_contacts(constants.geometry, terms).jacobian[row]
    inverse = np.diag(constants.mobility)
    free = inverse - inverse @ held.T @ np.linalg.pinv(held @ inverse @ held.T) @ held @ inverse
    response = free @ mass_matrix[:6].T @ np.linalg.inv(mass_matrix[:6] @ free @ mass_matrix[:6].T)
    # tau = M_j (a + response (G f - w)) + h_j - J_j^T f
    slope = mass_matrix[6:] @ response @ by_force[:, :6].T - by_force[:, 6:].T
    offset = (mass_matrix @ (desired - response @ wrench) + bias)[6:]
    least, most = bounds(law, scene)[row].T
    limits = constants.limits[0].copy()
    limits[:, 2] = np.minimum(limits[:, 2], constants.most_load * weight)
    maps, target = scale * by_force[:, :6].T, constants.nearness * wrench / weight
    torque = slope, least - offset, most - offset
    found = solved_by_clarabel(maps, target, limits, weight, torque=torque)
    if found is None:
        return np.nan
    missed = scale[:, 0] * (by_force[:, :6].T @ found - wrench)
    return float(np.linalg.norm(missed) / weight)


@pytest.mark.parametrize(("name", "share"), [("go1", 0.25), ("humanoid", 0.3)])
def test_forces_are_the_best_that_motors_can_give(
    name: str, share: float, rng: np.random.Generator
) -> None:
    law, scene = law_of(robots.load(name)), scene_of(robots.load(name), rng, each=12)
    weak = weakened(law, share)
    standing = np.flatnonzero(scene.target.planted.all(axis=1))
    plain, missed_plainly = torque_of(law, scene)
    torque, missed = torque_of(weak, scene)
    least, most = np.moveaxis(bounds(weak, scene), 2, 0)
    size = share * law.robot.torque_limit

    def beyond(one: np.ndarray) -> np.ndarray:
        return (np.maximum(one - most, least - one) / size).max(axis=1)

    bound = [row for row in standing if beyond(plain)[row] > 0.05]
    assert len(bound) >= 5
    # Where nothing binds, nothing changes.
    easy = beyond(plain) <= 0.0
    np.testing.assert_array_equal(torque[easy], plain[easy])
    assert (missed[bound] >= missed_plainly[bound] - 1e-6).all()
    oracle = np.array([exact(weak, scene, row) for row in bound])
    assert np.nanmedian(np.abs(missed[bound] - oracle)) < 0.02
    assert np.nanmax(missed[bound] - oracle) < 0.15
    assert np.median(beyond(torque)[bound]) < 0.05


def test_no_torque_jumps_where_one_begins_to_bind(rng: np.random.Generator) -> None:
    """Motors that are weaker by a hair, about where the first bounded problem is solved."""
    law, scene = law_of(robots.load("go1")), scene_of(robots.load("go1"), rng, each=4)
    plain, _ = torque_of(law, scene)
    limit, found = law.robot.torque_limit, []
    for row in np.flatnonzero(scene.target.planted.all(axis=1)):
        share = np.abs(plain[row] / limit).max() / 1.05
        torques = []
        for factor in (1.0 + 1e-6, 1.0 - 1e-6, 1.0 - 1e-3, 0.9):
            line = TorqueLine(factor * share * limit, *np.zeros((2, len(limit))))
            torques.append(torque_of(with_line(law, line), scene)[0][row])
        found.append([np.abs(one - plain[row]).max() / (share * limit.min()) for one in torques])
    none, hair, little, much = np.array(found).T
    assert len(found) >= 4 and (none == 0.0).all()
    assert hair.max() < 1e-4 and 0.0 < little.max() < 0.05 and much.max() > 0.02


def test_ideal_motors_bound_nothing_within_their_limits(rng: np.random.Generator) -> None:
    robot = robots.load("go1")
    boundless, scene = law_of(robot), scene_of(robot, rng, size=0.5)
    torque, ideal = torque_of(boundless, scene)[0], with_line(boundless, torque_line(robot))
    within = (np.abs(torque) <= robot.torque_limit).all(axis=1)
    assert within.sum() > 10
    np.testing.assert_array_equal(torque_of(ideal, scene)[0][within], torque[within])


@pytest.mark.parametrize("strength", [0.3, 0.5, 0.97, 1.0, 1.4])
def test_weak_motors_are_seen_from_how_the_centre_of_mass_moves(strength: float) -> None:
    """A mass on a leg that asks for its weight and a spring's force, and gets a share of it."""
    robot = robots.load("go1")
    terms = Stance.of(robot).terms._replace(com_velocity=np.zeros((1, 3)))
    mass, window = terms.mass_matrix[0, 0, 0], 0.17
    line = TorqueLine(robot.torque_limit.copy(), *np.zeros((2, 12)))
    motors, past, height, found = MotorModel(line, 1.0 / HZ, window), np.zeros(4), 0.0, 1.0
    for _ in range(6 * HZ):
        found = believed_strength(motors, robot.gravity, terms, past, 0)
        speed = terms.com_velocity[0, 2]
        past[1] = mass * (robot.gravity - 150.0 * height - 20.0 * speed) / found
        terms.com_velocity[0, 2] += (strength * past[1] / mass - robot.gravity) / HZ
        height += terms.com_velocity[0, 2] / HZ
    trusted = abs(strength - 1.0) < 0.1
    assert found == pytest.approx(1.0 if trusted else strength, abs=1e-3)
    sag = 0.0 if not trusted else robot.gravity * (1.0 / strength - 1.0) / 150.0
    assert height == pytest.approx(-sag, abs=1e-4)
