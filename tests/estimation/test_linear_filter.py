"""The linear filter against dense ones in NumPy, chi-square bounds, and invariances."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from fbid_gym.estimation.linear_filter import BG, D, P, R, V
from tests.estimation.test_invariant_filter import FEET, HZ, OWN, SPREAD, G, World, element

UP = np.array([0.0, 0.0, 1.0])
# Neither gyroscope nor attitude errs, and the vertical is not looked at.
UPRIGHT = OWN._replace(turning=0.0, gyroscope_drift=0.0, leaning=1e30)


def upright(count, rng):
    """Robots that know their attitude, and err in velocity and place."""
    world = World(count, rng, start=1.0, kind="linear")
    known = Rotation.from_matrix(world.truth[:, :3, :3])
    world.belief.quaternion[:] = known.as_quat(scalar_first=True)
    for i in range(count):
        for axis, values in ((V, world.belief.velocity), (P, world.belief.position)):
            error = np.sqrt(world.belief.covariance[i, axis, axis]) * rng.standard_normal(3)
            values[i] = world.truth[i, :3, 3 if axis == V else 4] + error
        errors = SPREAD[5] * rng.standard_normal((FEET, 3))
        world.belief.foot[i] = world.truth[i, :3, 5:].T + errors
    world.belief.gyroscope_bias[:] = 0.0
    world.belief.accelerometer_bias[:] = 0.0
    world.belief.covariance[:, R, R] = world.belief.covariance[:, BG, BG] = 0.0
    return world


def test_dense_filters_in_numpy_agree(rng):
    """One for the attitude, one for all three axes of place, velocity and feet."""
    world = World(1, rng, start=1.0, kind="linear")
    world.belief.accelerometer_bias[:] = 0.0
    x, dt, size = element(world.belief, 0), OWN.tick, 6 + 3 * FEET
    rotation, bias = Rotation.from_matrix(x[:3, :3]), world.belief.gyroscope_bias[0].copy()
    mean = np.concatenate([x[:3, 3], x[:3, 4], x[:3, 5:].T.ravel()])
    covariance = np.kron(world.belief.covariance[0, V:, V:], np.eye(3))
    tilt = world.belief.covariance[0, :V, :V].copy()
    flow, h = np.eye(size), np.zeros((3 * FEET, size))
    flow[3:6, :3] = dt * np.eye(3)
    h[:, 3:6], h[:, 6:] = np.tile(np.eye(3), (FEET, 1)), -np.eye(3 * FEET)
    noise = np.zeros((size, size))
    noise[:6, :6] = OWN.pushing * np.kron([[1.0, dt / 2], [dt / 2, dt * dt / 3]], np.eye(3))
    noise[6:, 6:] = OWN.slipping * np.eye(3 * FEET)
    drift = np.array([[1.0, -dt], [0.0, 1.0]])
    drifting = np.diag([OWN.turning, OWN.gyroscope_drift])
    for _ in range(150):
        world.step(OWN)
        spin, force = world.readings.gyroscope[0] - bias, world.readings.accelerometer[0]
        middle = rotation * Rotation.from_rotvec(0.5 * dt * spin)
        push = middle.apply(force) - G * UP
        mean[3:6] += dt * (mean[:3] + 0.5 * dt * push)
        mean[:3] += dt * push
        covariance = flow @ covariance @ flow.T + noise
        # The observer: seen = xi + noise on both horizontal axes.
        up = middle.apply(force) - np.cross(middle.apply(spin), mean[:3])
        length = np.linalg.norm(up)
        tilt = drift @ tilt @ drift.T + drifting
        gain = tilt[:, 0] / (tilt[0, 0] + OWN.leaning / (1.0 - abs(length / G - 1.0)))
        tilt = tilt - np.outer(gain, tilt[0])
        seen = np.cross(UP, up / length)
        rotation = Rotation.from_rotvec(-gain[0] * seen) * rotation
        rotation *= Rotation.from_rotvec(dt * spin)
        bias = bias - gain[1] * middle.inv().apply(seen)
        # The legs, all at once.
        told = rotation.apply(world.readings.angle[0].reshape(FEET, 3)).ravel() - mean[6:]
        told += np.tile(mean[3:6], FEET)
        s = h @ covariance @ h.T + OWN.encoder * np.eye(3 * FEET)
        kalman = covariance @ h.T @ np.linalg.inv(s)
        mean, covariance = mean - kalman @ told, covariance - kalman @ h @ covariance
    belief = world.belief
    found = [belief.velocity[0], belief.position[0], belief.foot[0].ravel()]
    np.testing.assert_allclose(np.concatenate(found), mean, atol=1e-6)
    np.testing.assert_allclose(element(belief, 0)[:3, :3], rotation.as_matrix(), atol=1e-6)
    np.testing.assert_allclose(belief.gyroscope_bias[0], bias, atol=1e-6)
    np.testing.assert_allclose(np.kron(belief.covariance[0, V:, V:], np.eye(3)), covariance,
                               atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(belief.covariance[0, :V, :V], tilt, atol=1e-12)


def test_errors_of_the_odometry_are_as_large_as_it_believes(rng):
    """Normalised errors of velocity and place against a foot, of 100 robots, p = 0.001."""
    count = 100
    world = upright(count, rng)
    own = UPRIGHT._replace(accelerometer_drift=0.0)
    low, high = (chi2.ppf(p, 6 * count) / count for p in (0.0005, 0.9995))
    # Velocity, and the unit's place against the foot that always stands.
    rows = np.zeros((2, D + FEET - V))
    rows[0, 0], rows[1, P - V], rows[1, D - V] = 1.0, 1.0, -1.0
    for tick in range(1, 301):
        load = np.full((count, FEET), 10.0)
        load[:, 1 + (tick // 40) % (FEET - 1)] = 0.0
        world.step(own._replace(turning=0.0), load)
        if tick % 75 == 0:
            squares = 0.0
            for i, x in enumerate(world.truth):
                apart = world.belief.position[i] - world.belief.foot[i, 0]
                error = np.stack([world.belief.velocity[i] - x[:3, 3], apart - x[:3, 4] + x[:3, 5]])
                part = rows @ world.belief.covariance[i, V:, V:] @ rows.T
                squares += np.sum(error * np.linalg.solve(part, error))
            assert low < squares / count < high, (tick, low, squares / count, high)


def test_errors_of_the_attitude_are_as_large_as_it_believes(rng):
    """Robots that rest, but for accelerations without a memory: tilt and bias, p = 0.001."""
    count, dt = 100, OWN.tick
    own = OWN._replace(leaning=0.02**2, turning=(2e-3) ** 2 / HZ)
    world = World(count, rng, start=0.0, kind="linear")
    belief, readings = world.belief, world.readings
    bias = SPREAD[3] * rng.standard_normal((count, 3))
    turned = [Rotation.from_matrix(x[:3, :3]) for x in world.truth]
    tilts = SPREAD[0] * rng.standard_normal((count, 3)) * [1.0, 1.0, 0.0]
    for i in range(count):
        quaternion = (Rotation.from_rotvec(tilts[i]) * turned[i]).as_quat()
        belief.quaternion[i], belief.velocity[i] = np.roll(quaternion, 1), 0.0
        belief.covariance[i, R, R], belief.covariance[i, BG, BG] = SPREAD[0] ** 2, SPREAD[3] ** 2
    low, high = (chi2.ppf(p, 4 * count) / count for p in (0.0005, 0.9995))
    readings.load[:] = 0.0
    for tick in range(1, 501):
        bias += np.sqrt(own.gyroscope_drift) * rng.standard_normal((count, 3))
        readings.gyroscope[:] = bias
        readings.gyroscope[:] += np.sqrt(own.turning) / dt * rng.standard_normal((count, 3))
        for i in range(count):
            push = G * np.sqrt(own.leaning) * rng.standard_normal(3) * [1.0, 1.0, 0.0]
            readings.accelerometer[i] = turned[i].inv().apply(push + G * UP)
        belief.velocity[:], belief.position[:] = 0.0, 0.0  # no foot tells of them
        world.filter(own)
        if tick % 100 == 0:
            squares = 0.0
            for i in range(count):
                known = Rotation.from_quat(np.roll(belief.quaternion[i], -1))
                error = (known * turned[i].inv()).as_rotvec()
                zeta = turned[i].apply(belief.gyroscope_bias[i] - bias[i])
                both = np.stack([error, zeta])[:, :2]
                squares += np.sum(both * np.linalg.solve(belief.covariance[i, :V, :V], both))
            assert low < squares / count < high, (tick, low, squares / count, high)


def test_heading_and_place_do_not_matter():
    """The same readings, by robots that believe that they are elsewhere and face elsewhere."""
    turn, shift = Rotation.from_euler("z", 1.1), np.array([5.0, -3.0, 0.4])
    worlds = [World(1, np.random.default_rng(3), start=1.0, kind="linear") for _ in range(2)]
    there = worlds[1].belief
    known = turn * Rotation.from_quat(np.roll(there.quaternion[0], -1))
    there.quaternion[0] = np.roll(known.as_quat(), 1)
    there.velocity[0] = turn.apply(there.velocity[0])
    there.position[0] = turn.apply(there.position[0]) + shift
    there.foot[0] = turn.apply(there.foot[0]) + shift
    for tick in range(100):
        for world in worlds:
            world.step(OWN, 0.0 if 30 < tick < 40 else None)
    here, x = element(worlds[0].belief, 0), element(there, 0)
    np.testing.assert_allclose(turn.as_matrix() @ here[:3, :4], x[:3, :4], atol=1e-9)
    expected = turn.as_matrix() @ here[:3, 4:] + shift[:, None]
    np.testing.assert_allclose(expected, x[:3, 4:], atol=1e-9)
    np.testing.assert_allclose(there.gyroscope_bias, worlds[0].belief.gyroscope_bias, atol=1e-9)
