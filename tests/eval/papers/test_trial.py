"""The loop of the papers' experiments: who is lost and when, pushes, starts, and what is logged."""

from typing import NamedTuple

import numpy as np
import pytest

from eval.papers.camera import Camera
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import orthogonal
from eval.papers.trial import RATES, Trial, pushed, simulate
from fbid_gym.motions import periodic_squat


class Torque(NamedTuple):
    torque: np.ndarray


class Broken:
    """Too much torque for all robots; from a tick on, no numbers for the first."""

    def __init__(self, robot, since):
        self.shape, self.since = robot.num_joints, since

    def memory(self, num_robots):
        return {"ticks": np.zeros(num_robots)}

    def __call__(self, state, terms, goal, memory):
        memory["ticks"] = memory["ticks"] + 1.0
        torque = np.full((len(state.tick), self.shape), 1e6)
        torque[0] = np.nan if memory["ticks"][0] > self.since else 0.0
        return Torque(torque)


@pytest.fixture(scope="module")
def motion(robot):
    return periodic_squat(robot, frequency=2.0)


def test_torques_are_limited_and_a_robot_without_any_is_lost(robot, motion):
    trial = Trial(robot, following(motion), 0.05, 2, every=5, watch=("ticks",))
    log = simulate(trial, Broken(robot, since=10))
    assert log.fell[0] == pytest.approx(10 / RATES.control)
    assert (log["torque"][log.time > log.fell[0], 0] == 0.0).all()
    # The second one is thrown about, but its torques are numbers.
    np.testing.assert_array_equal(log["torque"][0, 1], robot.torque_limit.astype(np.float32))
    np.testing.assert_allclose(log["ticks"][:, 0], 1.0 + 5.0 * np.arange(len(log.time)))
    np.testing.assert_allclose(log.time, 5 / RATES.control * np.arange(len(log.time)))


def test_robots_begin_where_and_when_they_shall(robot, motion):
    start = np.array([0.0, 0.13])
    pose = np.array([[0.0, 0.0, 0.0], [2.0, -1.0, 0.5]])
    controller = JointController(robot, PdGains.of(robot, 4.0), orthogonal())
    trial = Trial(robot, following(motion, pose=pose), 0.1, 2, start=start)
    log = simulate(trial, controller)
    ticks = np.round(start * RATES.control).astype(int)
    np.testing.assert_allclose(log["target"][0], motion.rows.qpos[ticks, 7:], atol=1e-6)
    assert np.abs(log.error).max() < 1e-2
    there = log["qpos"][0, 1, :7]
    back = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    ahead = motion.rows.qpos[ticks[1], :2] @ back
    np.testing.assert_allclose(there[:2], pose[1, :2] + ahead, atol=1e-6)
    yaw = 2.0 * np.arctan2(there[6], there[3])
    assert yaw == pytest.approx(0.5, abs=1e-6)


def test_pushes_come_when_they_are_due_and_add_up(robot, motion):
    start, force = np.array([[0.02, 0.04], [0.04, 0.9]]), np.zeros((2, 2, 3))
    force[0, 0, 0], force[0, 1], force[1, 0, 1], force[1, 1] = 10.0, [5.0, 0.0, 1.0], 20.0, 9.0
    controller = JointController(robot, PdGains.of(robot, 4.0))
    push = pushed(start, force, 0.03)
    log = simulate(Trial(robot, following(motion), 0.1, 2, disturb=push), controller)
    tick = np.arange(len(log.time))
    ten = 10.0 * ((tick >= 10) & (tick < 25)) + 5.0 * ((tick >= 20) & (tick < 35))
    np.testing.assert_allclose(log["push"][:, 0, 0], ten)
    np.testing.assert_allclose(log["push"][:, 1, 1], 20.0 * ((tick >= 20) & (tick < 35)))
    assert (log["push"][:, 1, [0, 2]] == 0.0).all()


def test_statistics_end_with_a_fall():
    time, values = 0.1 * np.arange(6), np.zeros((6, 3, 2))
    values[:, 0], values[:3, 1], values[3:, 1] = 2.0, [3.0, 4.0], np.inf
    log = Log(time, np.array([np.nan, 0.3, 0.0]), {"what": values})
    rms = log.rms(values)
    np.testing.assert_allclose(rms[:2], [[2.0, 2.0], [3.0, 4.0]])
    assert np.isnan(rms[2]).all()
    np.testing.assert_allclose(log.rms_of_joints(values)[1], np.sqrt(12.5))
    assert log.survived.tolist() == [True, False, False]
    assert [log.fall(k) for k in range(3)] == [None, 0.3, 0.0]
    assert log.at([0.0, 0.15, 0.2, 9.0]).tolist() == [0, 2, 2, 5]
    first, second = log.groups(2)
    np.testing.assert_array_equal(first["what"], values[:, :2])
    np.testing.assert_array_equal(second.fell, [0.0])


def test_pictures_are_of_the_moments_that_a_log_has(robot):
    qpos = np.tile(robot.home_qpos, (4, 1, 1))
    qpos[2:, 0, 2] -= 0.2
    signals = {"qpos": qpos, "push": np.full((4, 1, 3), 50.0)}
    log = Log(0.1 * np.arange(4), np.full(1, np.nan), signals)
    camera = Camera(robot, 640, 480)
    first, last = camera.strip(log, [0.0, 0.2, 9.0])
    assert first.shape == (480, 640, 3) and (first != last).any()
    assert camera.film(log, 10.0)[4:8] == b"ftyp"
