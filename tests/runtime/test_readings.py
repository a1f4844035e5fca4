"""A controller that is given what sensors read: its environment's torques, and what it refuses."""

import re
from functools import partial

import numpy as np
import pytest

from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.policy import Policy
from fbid_gym.quantities import RobotState
from fbid_gym.runtime import READINGS, Controller
from fbid_gym.runtime.config import EnvConfig
from tests.batches import started
from tests.runtime.test_controller import refuse_failures_of, without

WALK, COMMAND = "fbid_gym/QuadrupedWalk-v0", (0.4, 0.1, 0.3)
SHIPPED = Policy.load("shipped:QuadrupedWalk-v0/base_acceleration")
SLOW_ENCODERS = {"like": "raw", "encoder_rate": 125, "estimator": "linear"}


def read(estimator) -> dict[str, np.ndarray]:
    """What the sensors of the only robot have read by now, in arrays of its own."""
    own = estimator.readings
    parts = own.gyroscope, own.accelerometer, own.angle, own.rate, own.load
    found = {name: part[0].copy() for name, part in zip(READINGS, parts, strict=True)}
    return found | {"fresh": own.fresh[0]}


def side_by_side(monkeypatch, policy, given=dict, steps=100, there=False, **more):
    """Drive a simulation, whose readings the controller has: by how much their torques differ.

    And the batch, and by how much their readings differ at the last tick, by name. The controller
    begins at home, or `there`, where the simulation does: then both round alike.
    """
    arguments = {**ENVIRONMENTS[WALK], **SHIPPED.env_args, "episode_seconds": 4.0, **more}
    batch, controller = started(arguments, 1), Controller(EnvConfig.of(arguments), policy)
    estimator, advance = batch.perception.estimator, batch.simulation.tick
    apart, last = [], {}
    size = len(controller.observation_names)
    assert controller.observation_names == batch.observation_names[:size]

    def tick(torque, push, effort, state):
        torques, true = controller.tick(given(read(estimator))), read(estimator)
        mine = read(controller.estimator)
        last.update({name: np.abs(mine[name] - true[name]).max() for name in READINGS})
        advance(torque, push, effort, state)
        apart.append(np.abs(torques - effort.torque[0]).max())

    monkeypatch.setattr(batch.simulation, "tick", tick)
    for _ in range(2):
        batch.reset(np.arange(1), batch.check_command(COMMAND, 1))
        controller.reset()
        controller.set_command(*COMMAND)
        if there:
            controller._where = batch.simulation.qpos.copy()
        for _ in range(steps):
            if batch.step(policy(batch.observation()[:, :size])).terminated[0]:
                break
    assert len(apart) > steps * batch.rates.ticks
    return np.array(apart), batch, last


def linear(seen: np.ndarray) -> np.ndarray:
    """Actions that depend on all that is seen."""
    weights = np.random.default_rng(0).standard_normal((seen.shape[1], 14)) / seen.shape[1]
    return np.tanh(np.clip(seen, -5.0, 5.0) @ weights)


@pytest.mark.parametrize(
    ("policy", "more"),
    [
        (SHIPPED, {"sensors": "mems"}),
        (linear, {"sensors": "mems", "observation": "measured+estimate", "history": 3}),
        (SHIPPED, {"sensors": {"like": "mems", "contact": "torque"}, "there": True}),
        (linear, {"sensors": SLOW_ENCODERS, "observation": "measured", "there": True}),
    ],
)
def test_its_torques_are_those_of_the_environment(policy, more, monkeypatch):
    """Pushes and all, tick by tick, by an estimate of its own; and again after a reset."""
    apart, batch, _ = side_by_side(monkeypatch, policy, **more)
    assert apart.max() < 1e-9
    own = batch.perception.estimator.state
    assert np.abs(own.qvel - batch.simulation.qvel).max() > 1e-3  # it was no truth


def test_velocities_that_are_not_read_are_differences(monkeypatch):
    """Filtered as the environment's sensors do it, so that only the start is another."""
    given = partial(without, "joint_velocity")
    apart, _, last = side_by_side(monkeypatch, SHIPPED, given, 30, sensors="mems")
    assert max(last.values()) < 1e-9
    assert apart[-30:].max() < 1e-2 < apart.max()


def test_feet_without_sensors_are_told_by_torques(monkeypatch):
    """But for the start: which foot bears how much nobody says then."""
    own, given = {"like": "mems", "contact": "torque"}, partial(without, "contact_load")
    _, batch, last = side_by_side(monkeypatch, SHIPPED, given, 60, sensors=own)
    assert last["contact_load"] < 0.02 * batch.robot.weight


@pytest.fixture(scope="module")
def walker() -> Controller:
    return Controller.load(SHIPPED, sensors="mems")


def at_rest(controller: Controller) -> dict[str, np.ndarray]:
    robot = controller.robot
    return {
        "gyroscope": np.zeros(3),
        "accelerometer": np.array([0.0, 0.0, robot.gravity]),
        "joint_position": robot.home_qpos[7:],
        "joint_velocity": np.zeros(robot.num_joints),
        "contact_load": np.full(robot.num_feet, robot.weight / robot.num_feet),
    }


@pytest.mark.parametrize("name", READINGS)
def test_a_reading_that_fails_is_named_and_nothing_goes_on(walker, name):
    refuse_failures_of(name, walker, at_rest(walker), needed=name != "joint_velocity")


def test_a_state_will_do_and_an_estimate_goes_on_where_it_was(walker):
    robot, sensors = walker.robot, at_rest(walker)
    qpos = robot.home_qpos[None].copy()
    qpos[0, :2] = 3.0, -2.0
    force = np.tile([0.0, 0.0, robot.weight / robot.num_points], (1, robot.num_points, 1))
    state = RobotState(qpos, np.zeros((1, robot.nv)), force, np.zeros(1, np.int64))
    walker.reset()
    plain = Controller.load(SHIPPED)
    np.testing.assert_array_equal(walker.tick(state), plain.tick(state))
    walker.tick(sensors)
    np.testing.assert_allclose(walker.estimator.state.qpos, qpos, atol=1e-9)
    assert plain.estimator is None


def test_what_else_is_no_reading(walker):
    own = {"sensors": "mems", "observation": "measured"}
    measured = Controller(EnvConfig.of({**ENVIRONMENTS[WALK], **own}))
    seen = measured.loop.observer.seen
    assert "gyroscope" in seen and "velocity" not in seen
    sensors = at_rest(walker)
    walker.reset()
    for controller, given, words in (
        (walker, {}, "sensor 'gyroscope': None. Expected (3,) rad/s"),
        (walker, {**sensors, "gyro": np.zeros(3)}, "Unknown sensor 'gyro'"),
        (walker, {**sensors, "fresh": "no"}, "Invalid fresh: 'no'"),
        (walker, {**sensors, "velocity": np.zeros(3)}, "Unknown sensor 'gyroscope'"),
        (measured, {"position": np.zeros(3)}, "gyroscope, accelerometer"),
    ):
        with pytest.raises(FbidError, match=re.escape(words)):
            controller.tick(given)
    with pytest.raises(InvalidValueError, match="observation"):
        Controller.load(SHIPPED, observation="measured")
