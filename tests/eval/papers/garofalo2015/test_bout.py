"""The pieces of [G15]'s experiments: balancers, bouts, and the numbers drawn from them."""

import mujoco
import numpy as np
import pytest

from eval.papers.garofalo2015.balancer import COLOUR, GAROFALO, Balancer, stance_rotation_inertia
from eval.papers.garofalo2015.bout import Blow, bout, settling_time, unrealised
from eval.papers.garofalo2015.largest_blow import FIRST, largest
from eval.papers.garofalo2015.pendulum import PendulumBlow
from eval.papers.garofalo2015.tracking import goals, swaying
from eval.papers.garofalo2015.uneven import BLOCKS, stance
from eval.papers.log import Log
from eval.papers.trial import simulate
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.robots import load
from tests.postures import posed

LEGS = ("hip", "knee", "ankle")


@pytest.mark.parametrize("name", COLOUR)
def test_every_balancer_stands_and_takes_a_small_blow(name):
    robot, pendulum = load("humanoid"), PendulumBlow()
    sides = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    blow = Blow(0.3, sides, np.full(2, 4.0))
    log = simulate(bout(robot, pendulum, blow, 1.0, every=5), Balancer(robot, name))
    assert log.survived.all()
    before = log.time < 0.3
    assert np.abs(log["com"][before]).max() < 3e-4
    assert np.abs(log["rotation"][before]).max() < 3e-4
    weight = log["contact_force"].sum(axis=2)[before][-1, :, 2]
    np.testing.assert_allclose(weight, robot.weight, rtol=2e-3)
    pushed = np.abs(log["com"][~before]).max(axis=0)
    assert 0.005 < pushed[0, 1] < 0.05 and 0.001 < pushed[1, 0] < 0.05
    assert (np.abs(log["torque"]) <= robot.torque_limit).all()


def test_a_blow_that_is_too_much_is_a_fall():
    robot, pendulum = load("humanoid"), PendulumBlow(energy=400.0)
    blow = Blow(0.1, np.array([[1.0, 0.0, 0.0]]), np.array([400.0]))
    log = simulate(bout(robot, pendulum, blow, 4.0, every=5), Balancer(robot, GAROFALO))
    assert not log.survived[0] and 0.1 < log.fell[0] < 3.0
    assert log.time[-1] <= log.fell[0]  # nothing is simulated beyond


def test_inertia_about_standing_feet():
    """Against MuJoCo: turn the base with feet and centre of mass in place, sum up the bodies."""
    robot = load("humanoid")
    inertia = stance_rotation_inertia(robot)
    model, data, rows = robot.model, posed(robot), []
    for foot in robot.feet:
        linear, angular = np.zeros((2, 3, robot.nv))
        mujoco.mj_jacBody(model, data, linear, angular, foot.body)
        rows += [linear, angular]
    com = np.zeros((3, robot.nv))
    mujoco.mj_jacSubtreeCom(model, data, com, robot.base_body)
    turn = np.zeros((3, robot.nv))
    turn[:, 3:6] = np.eye(3)
    still = [name for name in robot.joint_names if not any(p in name for p in LEGS)]
    hold = np.zeros((len(still), robot.nv))
    hold[range(len(still)), [model.joint(name).dofadr[0] for name in still]] = 1.0
    constraints = np.concatenate([hold, *rows, com, turn])
    momenta = np.empty((3, 3))
    for axis in range(3):
        asked = np.zeros(len(constraints))
        asked[-3 + axis] = 1.0
        data.qvel[:] = np.linalg.pinv(constraints) @ asked
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        momenta[:, axis] = data.subtree_angmom[robot.base_body]
    np.testing.assert_allclose(0.5 * (momenta + momenta.T), inertia, atol=1e-6)
    locked = 15.0  # kg m^2 about x and y, all joints locked
    assert (np.linalg.eigvalsh(inertia) > 1.0).all() and inertia[0, 0] < 0.5 * locked


def test_settling_time_is_when_the_error_last_exceeds_a_tenth():
    time = np.linspace(2.0, 8.0, 3001)
    decay = np.exp(-(time - 2.0) / 0.8)
    assert settling_time(time, -3.0 * decay) == pytest.approx(0.8 * np.log(10.0), abs=0.005)


def test_unrealised_is_the_wanted_wrench_less_the_rate_of_the_momentum():
    time = np.arange(500) * 0.01
    momentum, desired = np.zeros((500, 1, 6)), np.zeros((500, 1, 6))
    momentum[:, 0, 1], momentum[:, 0, 3] = 4.0 * np.sin(time), np.cos(2 * time)
    desired[:, 0, 2] = 760.0  # the weight is carried
    desired[:, 0, 1] = 4.0 * np.cos(time) + 3.0
    desired[:, 0, 3] = -2.0 * np.sin(2 * time) + 2.0 * np.sqrt(2.0) * np.sin(20 * time)
    log = Log(time, np.full(1, np.nan), {"momentum": momentum, "desired": desired})
    force, moment = unrealised(log, 0.5)
    assert force == pytest.approx(3.0, rel=1e-3)
    assert moment == pytest.approx(2.0, rel=0.01)


def test_the_largest_blow_is_found_between_what_was_tried():
    angle = np.array([0.0, 1.0, 2.0, 3.0])
    limit = np.array([40.0, 100.0, 1.0, 1e9])  # the third survives nothing, the last everything
    calls = []

    def test(who, energy):
        calls.append(len(who))
        return energy <= limit[who.astype(int)]

    low, high = largest(test, angle, refined=9)
    assert calls == [4 * len(FIRST), 36]
    for k in (0, 1):
        assert low[k] <= limit[k] < high[k] and high[k] - low[k] < 0.1 * limit[k]
    assert 0.0 <= low[2] < 1.0 and low[3] == FIRST[-1] and high[3] == np.inf


def test_a_stand_above_a_fall_does_not_count():
    lucky = FIRST[4]

    def test(who, energy):
        return (energy < FIRST[2]) | (energy == lucky)

    low, high = largest(test, np.zeros(1), refined=3)
    assert FIRST[1] <= low[0] < high[0] <= FIRST[2]


def test_the_moving_goal_has_its_own_rates():
    """Velocities, spins and momentum rates against differences of the goal itself."""
    robot, hertz, step = load("humanoid"), np.array([0.4, 1.5]), 1e-4
    terms = MuJoCoDynamics(robot).terms(np.tile(robot.home_qpos, (2, 1)), np.zeros((2, robot.nv)))
    goal = goals(robot, swaying(hertz))
    for time in (0.0, 0.7, 3.3):
        before, now, after = (goal(time + k * step, terms).target for k in (-1, 0, 1))
        rates = ((later - sooner) / (2 * step) for later, sooner in zip(after, before, strict=True))
        rate = now._make(rates)
        np.testing.assert_allclose(now.com_velocity, rate.com, atol=1e-4)
        spin = rate.world_from_base @ now.world_from_base.mT
        found = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        np.testing.assert_allclose(now.angular_velocity, found, atol=1e-4)
        force = robot.mass * rate.com_velocity
        np.testing.assert_allclose(now.momentum_rate[:, :3], force, atol=0.3)
        np.testing.assert_allclose(now.momentum_rate[:, 3:], rate.angular_momentum, atol=0.1)
    assert np.abs(goal(0.0, terms).target.com - terms.com).max() == 0.0


def test_a_stance_with_one_foot_on_a_block():
    robot, ground = load("humanoid"), BLOCKS[-1]
    data = posed(robot, stance(robot, ground))
    low, high = robot.joint_range.T
    assert ((low <= data.qpos[7:]) & (data.qpos[7:] <= high)).all()
    left, right = robot.feet
    np.testing.assert_allclose(data.xmat[left.body].reshape(3, 3), np.eye(3), atol=1e-3)
    np.testing.assert_allclose(data.xmat[right.body].reshape(3, 3), ground.rotation, atol=1e-3)
    soles = []
    for foot in robot.feet:
        middle = foot.points.mean(axis=0) - [0, 0, foot.radius]
        soles.append(data.xpos[foot.body] + data.xmat[foot.body].reshape(3, 3) @ middle)
    assert soles[1][2] - soles[0][2] == pytest.approx(ground.height, abs=1e-3)
    com = data.subtree_com[robot.base_body]
    np.testing.assert_allclose(com[:2], 0.5 * (soles[0] + soles[1])[:2], atol=2e-3)
    assert ground.rotation[2, 0] > 0.1  # toes up
    assert ground.rotation[2, 1] > 0.1  # the right foot's outer edge, at -y, is the lower one
