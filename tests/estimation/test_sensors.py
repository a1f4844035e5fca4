"""Sensors read what they should, and err by what they say."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import FbidError
from fbid_gym.estimation import PRESETS, Sensors, sensors_of
from fbid_gym.estimation.errors import find_errors
from fbid_gym.estimation.legs import legs_of, mounting_of, place_foot
from fbid_gym.estimation.random_numbers import normal, seeded, uniform
from fbid_gym.quantities import RobotState, some_of
from fbid_gym.robots import load
from fbid_gym.runtime.perception import Perception

HZ, COUNT = 250, 1000


def states(robot, rng, count=COUNT):
    """Robots that move anyhow."""
    qpos = np.tile(robot.home_qpos, (count, 1))
    qpos[:, 3:7] = rng.standard_normal((count, 4))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 7:] += rng.uniform(-0.3, 0.3, (count, robot.num_joints))
    qvel = rng.uniform(-1.0, 1.0, (count, robot.nv))
    force = np.zeros((count, robot.num_points, 3))
    force[..., 2] = robot.weight / robot.num_points
    return RobotState(qpos, qvel, force, np.zeros(count, np.int64))


def reading(sensors, ticks=1):
    """Robots whose sensors have been read for some ticks in which nothing moves but the clock."""
    rng, robot = np.random.default_rng(1), load("go1")
    state = states(robot, rng)
    found = Perception(robot, sensors, HZ, state.tick)
    for env in range(COUNT):
        found.draw(env, rng)
    found.begin(np.arange(COUNT), state)
    for _ in range(ticks):
        state.tick[:] += 1
        found.update(state, np.zeros((COUNT, robot.num_joints)))
    return robot, state, found


def test_the_generator_is_vignas_and_normal_numbers_are():
    """By Python's whole numbers, which have no end; tail and neighbours included."""
    row = seeded(np.random.default_rng(0))
    first, second = map(int, row)
    for _ in range(100):
        expected = (((first >> 12) + (second >> 12)) % 2**52 + 0.5) / 2**52
        mixed = (first ^ first << 23) % 2**64
        first, second = second, mixed ^ second ^ mixed >> 18 ^ second >> 5
        assert uniform(row) == expected
    drawn = np.array([normal(row) for _ in range(100_000)])
    assert stats.kstest(drawn, "norm").pvalue > 0.01
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.01
    beyond = np.abs(drawn[np.abs(drawn) > 3.0])  # 3.4427 is where the layers end
    assert abs(len(beyond) / len(drawn) / (2.0 * stats.norm.sf(3.0)) - 1.0) < 0.2
    assert stats.kstest(beyond, lambda x: 1.0 - stats.norm.sf(x) / stats.norm.sf(3.0)).pvalue > 0.01
    assert np.isfinite([normal(np.zeros(2, np.int64)), uniform(np.zeros(2, np.int64))]).all()


def test_sensors_that_do_not_err_read_the_truth():
    robot, state, found = reading(Sensors())
    turned = quaternion_to_matrix(state.qpos[:, 3:7])
    read = found.estimator.readings
    np.testing.assert_allclose(read.gyroscope, state.qvel[:, 3:6], atol=1e-12)
    np.testing.assert_allclose(read.angle, state.qpos[:, 7:], atol=1e-12)
    np.testing.assert_allclose(read.rate, 0.0, atol=1e-9)  # differences: here nothing moves
    np.testing.assert_allclose(read.load, robot.weight / robot.num_feet)
    # Half a tick ago the robot was turned less far.
    expected = robot.gravity * turned[:, 2]
    assert np.abs(read.accelerometer - expected).max() < robot.gravity * 4.0 / HZ
    np.testing.assert_allclose(np.linalg.norm(read.accelerometer, axis=1), robot.gravity)


def test_noise_bias_and_drift_are_those_of_the_table():
    sensors = Sensors(
        gyroscope_noise=0.01, gyroscope_bias=0.1, gyroscope_drift=0.2,
        accelerometer_noise=0.02, accelerometer_bias=0.5, accelerometer_drift=0.3,
        encoder_noise=1e-3, contact_noise=0.05,
    )  # fmt: skip
    ticks = 25
    robot, state, found = reading(sensors, ticks)
    wear, read = found._wear, found.estimator.readings
    spread = 4.5 / np.sqrt(2.0 * 3 * COUNT)  # of a standard deviation, p below 1e-5
    for values, expected in (
        (wear.gyroscope_bias, np.hypot(0.1, 0.2 * np.sqrt(ticks / HZ))),
        (wear.accelerometer_bias, np.hypot(0.5, 0.3 * np.sqrt(ticks / HZ))),
        (read.gyroscope - state.qvel[:, 3:6] - wear.gyroscope_bias, 0.01 * np.sqrt(HZ)),
        (read.angle - state.qpos[:, 7:], 1e-3),
        (read.load - robot.weight / robot.num_feet, 0.05 * robot.weight),
    ):
        assert abs(values.std() / expected - 1.0) < spread
        assert abs(values.mean()) < 4.5 * expected / np.sqrt(values.size)


def test_errors_are_by_how_much_robots_were_moved(rng):
    """Turned about the vertical, tilted, shifted and sped up; the same for one robot as for all."""
    robot = load("go1")
    actual, seen = states(robot, rng, 20), states(robot, rng, 20)
    heading, tilt = rng.uniform(-3.0, 3.0, 20), rng.uniform(0.0, 1.0, 20)
    aside, shift, speed = rng.standard_normal((3, 20, 3))
    axis = aside * [1.0, 1.0, 0.0] / np.linalg.norm(aside[:, :2], axis=1)[:, None]
    turned = Rotation.from_euler("z", heading[:, None]) * Rotation.from_rotvec(tilt[:, None] * axis)
    turned = turned * Rotation.from_quat(np.roll(actual.qpos[:, 3:7], -1, axis=1))
    seen.qpos[:, 3:7] = np.roll(turned.as_quat(), 1, axis=1)
    seen.qpos[:, :3] = actual.qpos[:, :3] + shift
    seen.qvel[:, :3] = Rotation.from_euler("z", heading[:, None]).apply(actual.qvel[:, :3]) + speed
    contact = rng.random((20, robot.num_feet)) < 0.5
    own = Stance.of(robot).geometry.foot_of_point, 0.1 * robot.weight, contact
    found = find_errors(actual, seen, *own)
    size = np.linalg.norm
    expected = [
        *(tilt, size(speed, axis=1), shift[:, 2], heading),
        *(size(shift[:, :2], axis=1), 1.0 - contact.mean(axis=1)),
    ]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    for i in range(20):
        rows = np.array([i])
        alone = find_errors(some_of(actual, rows), some_of(seen, rows), *own[:2], contact[rows])
        np.testing.assert_array_equal(alone[:, 0], found[:, i])


def test_steps_ranges_and_wrong_contacts():
    sensors = Sensors(encoder_resolution=0.01, gyroscope_range=1.0, contact_errors=0.1)
    robot, state, found = reading(sensors, 200)
    steps = found.estimator.readings.angle / 0.01
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(found.estimator.readings.angle - state.qpos[:, 7:]).max() <= 0.005 + 1e-12
    fast = Sensors(gyroscope_range=1.0, gyroscope_bias=1.0)
    assert np.abs(reading(fast)[2].estimator.readings.gyroscope).max() == 1.0
    wrong = found.errors(state)["estimate_contact_error"].mean()
    assert abs(wrong - 0.1) < 0.03


def test_readings_come_late_and_seldom():
    sensors = Sensors(encoder_latency=(0.008, 0.008), imu_rate=125, encoder_filter=None)
    rng, robot = np.random.default_rng(1), load("go1")
    state = states(robot, rng, 3)
    found = Perception(robot, sensors, HZ, state.tick)
    for env in range(3):
        found.draw(env, rng)
    found.begin(np.arange(3), state)
    angles, rates = [state.qpos[:, 7:].copy()], [state.qvel[:, 3:6].copy()]
    for tick in range(1, 8):
        state.tick[:] = tick
        state.qpos[:, 7:] += 0.01 * rng.standard_normal((3, robot.num_joints))
        state.qvel[:, 3:6] += 0.1
        angles.append(state.qpos[:, 7:].copy())
        rates.append(state.qvel[:, 3:6].copy())
        found.update(state, np.zeros((3, robot.num_joints)))
        np.testing.assert_array_equal(found.estimator.readings.angle, angles[max(tick - 2, 0)])
        turning = found.estimator.readings.gyroscope
        np.testing.assert_allclose(turning, rates[tick - tick % 2], atol=1e-12)


@pytest.mark.parametrize("name", ["go1", "biped", "g1"])
def test_legs_are_those_of_mujoco(name, rng):
    robot = load(name)
    mounting, note = mounting_of(robot)
    assert "no site 'imu'" in note
    legs = legs_of(robot, mounting)
    state = states(robot, rng, 20)
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    axis, arm = np.zeros((2, legs.joint.shape[1], 3))
    for i in range(20):
        world_from_unit = terms.world_from_base[i] @ mounting.base_from_imu
        for foot in range(robot.num_feet):
            angle, rate = state.qpos[i, 7:].copy(), state.qvel[i, 6:].copy()
            centre, spin = place_foot(legs, foot, angle, rate, axis, arm)
            seen = world_from_unit @ np.array(centre) - [0.0, 0.0, legs.radius[foot]]
            expected = terms.foot_position[i, foot] - terms.base_position[i]
            np.testing.assert_allclose(seen, expected, atol=1e-9)
            turning = terms.foot_jacobian[i, foot, 3:, 6:] @ rate
            np.testing.assert_allclose(world_from_unit @ np.array(spin), turning, atol=1e-9)
            own = legs.joint[foot][legs.joint[foot] >= 0]
            if legs.radius[foot] == 0.0:
                columns = terms.foot_jacobian[i, foot, :3][:, 6 + own]
                np.testing.assert_allclose(world_from_unit @ arm[: len(own)].T, columns, atol=1e-9)
    assert Stance.of(robot).geometry.num_points == robot.num_points


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("best", "sensors 'best'"),
        (3, "sensors 3"),
        ({"like": "best"}, "sensors 'best'"),
        ({"gyroscop_noise": 0.1}, "Unknown sensor option 'gyroscop_noise'"),
        ({"imu_latency": (0.0, 0.2)}, "no older reading is remembered"),
        ({"scale": float("nan")}, "sensors scale"),
    ],
)
def test_bad_sensors_are_refused_by_name(given, message):
    with pytest.raises(FbidError) as error:
        sensors_of(given)
    assert message in str(error.value)


def test_tables_begin_from_presets_and_scale():
    assert sensors_of("perfect") is None
    assert sensors_of({"like": "mems"}) == PRESETS["mems"]
    twice = sensors_of({"like": "mems", "scale": 2.0}).scaled
    assert twice.gyroscope_bias == 2.0 * PRESETS["mems"].gyroscope_bias
    assert twice.contact_threshold == PRESETS["mems"].contact_threshold
    none = sensors_of({"like": "mems", "scale": 0.0}).scaled
    assert none.accelerometer_noise == none.encoder_resolution == none.misalignment == 0.0
