"""Gains of joints for a loop whose torques come late."""

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions.joint_gains import JointGains, sampled_growth
from fbid_gym.actions.ranges import Falling
from fbid_gym.control.look_ahead import Delay, look_ahead
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.loop_delay import LoopDelay
from fbid_gym.errors import FbidError
from fbid_gym.quantities import RobotState
from tests.actions.cases import layer_of
from tests.batches import started
from tests.dynamics.models import random_states

HZ = 250


def played(robot, gains, share, seconds, ticks, rng):
    """The largest coordinate or rate of a robot in the air, held by a share of gains, by ticks."""
    mobility = np.linalg.inv(Stance.of(robot).terms.mass_matrix[0])[6:, 6:]
    late = LoopDelay(1, robot.num_joints, HZ, seconds)
    late.begin(np.zeros(1, int), np.array([seconds]))
    place, rate = rng.normal(size=(2, robot.num_joints))
    sizes, tick = [], 1.0 / HZ
    for count in range(ticks):
        torque = -share * (gains.stiffness * place + gains.damping * rate)
        acting = late.arriving(torque[None], np.array([count]))[0]
        place = place + tick * rate + 0.5 * tick**2 * mobility @ acting
        rate = rate + tick * mobility @ acting
        sizes.append(np.abs(np.concatenate([place, rate])).max())
    return np.array(sizes)


@pytest.mark.parametrize("seconds", [0.0, 0.004, 0.005])
@pytest.mark.parametrize("name", ["go1", "biped"])
def test_growth_is_that_of_the_delayed_loop(name, seconds, rng):
    robot = robots.load(name)
    gains = JointGains.of(robot, HZ, Falling(3.4), 1.0, seconds)
    for share in (1.0, 1.4):
        growth = sampled_growth(robot, share * gains.stiffness, share * gains.damping, HZ, seconds)
        sizes = played(robot, gains, share, seconds, 800, rng)
        seen = (sizes[600:].max() / sizes[400:600].max()) ** (1.0 / 200.0)
        assert seen == pytest.approx(growth, abs=5e-3)
        assert share > 1.0 or growth < 1.0


def test_a_delay_that_is_not_told_shakes_what_a_told_one_does_not(rng):
    robot = robots.load("go1")
    unaware, aware = (JointGains.of(robot, HZ, Falling(3.4), 1.0, late) for late in (0.0, 0.005))
    assert sampled_growth(robot, *unaware[:2], HZ, 0.005) > 1.0
    assert sampled_growth(robot, *aware[:2], HZ, 0.005) < 1.0
    assert (aware.damping < unaware.damping).any()


@pytest.mark.parametrize("sensors", ["perfect", "mems"])
def test_drives_that_close_the_loop_hold_a_posture_as_without_a_delay(sensors):
    """Targets that stay are never late; torques that answer joints are."""
    stand = ENVIRONMENTS["fbid_gym/QuadrupedBalance-v0"] | {"action_layer": "joint_position"}
    states = []
    for late, driven in ((1e-9, True), (0.012, True), (0.012, False)):  # and the same draws
        own = {"randomisation": {"loop_delay": (late, late)}, "sensors": sensors}
        batch = started(stand | own | {"layer_options": {"in_drives": driven}}, 4)
        for _ in range(20):  # before noise of rounding grows to a tick of an encoder
            batch.step(np.zeros((4, len(batch.action_names))))
        states.append(batch.simulation.qpos.copy())
    np.testing.assert_allclose(states[0], states[1], rtol=0.0, atol=1e-6)
    assert abs(states[0] - states[2]).max() > 1e-3


def test_delays_beyond_any_are_refused():
    robot = robots.load("biped")
    with pytest.raises(FbidError, match=r"loop_delay.*Expected 0 with in_drives=True"):
        layer_of("joint_position", robot, loop_delay=0.005, in_drives=True)
    with pytest.raises(FbidError, match=r'loop_delay.* or the balancer "inverse_dynamics"'):
        layer_of("com_wrench", robot, balancer="ott2011", loop_delay=0.005)
    with pytest.raises(FbidError, match=r"at most .* and 0.03 s of delay"):
        layer_of("joint_position", robot, natural_frequency=30.0, loop_delay=0.03)


@pytest.mark.parametrize("name", ["go1", "biped"])
def test_a_law_foresees_the_state_after_the_delay(name, rng):
    """Coordinates as MuJoCo integrates them; what follows from them to second order."""
    robot, tick, wrong = robots.load(name), 0.0016, []
    qpos, qvel = random_states(robot.model, 4)
    dynamics = MuJoCoDynamics(robot)
    state = RobotState(qpos, qvel, np.zeros((4, robot.num_points, 3)), np.zeros(4, np.int64))
    for share in (1.0, 0.5):
        delay, own = 2.5 * share * tick, share * tick
        late = Delay(delay, own, robot.gravity, np.array([foot.radius for foot in robot.feet]))
        assert late.ticks == 3
        sent = rng.normal(scale=5.0, size=(4, 3, robot.nv))
        made, older = rng.normal(scale=5.0, size=(4, robot.nv)), sent[:, :2].copy()
        seen, terms = look_ahead(late, made, sent, state, dynamics.terms(qpos, qvel))
        assert (sent[:, 0] == made).all() and (sent[:, 1:] == older).all()
        change = own * (made + older[:, 0] + 0.5 * older[:, 1])
        expected = qpos.copy()
        for place, rate in zip(expected, qvel + 0.5 * change, strict=True):
            mujoco.mj_integratePos(robot.model, place, rate, delay)
        np.testing.assert_allclose(seen.qpos, expected, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(seen.qvel, qvel + change, rtol=0.0, atol=1e-12)
        there = dynamics.terms(seen.qpos, seen.qvel)
        pairs = list(zip(terms, there, strict=True))[2:-2]  # M, h, J and Jdot v stay
        wrong.append([abs(one - other).max() for one, other in pairs])
    assert (np.less(wrong, 1e-12).all(axis=0) | (wrong[0] > 3.0 * np.array(wrong[1]))).all()


def test_a_law_that_is_told_of_the_delay_shakes_less():
    """By half: the squared angular velocity of bipeds that walk, 12 ms late."""
    shaken, late = [], {"randomisation": {"loop_delay": (0.012, 0.012)}}
    walk = ENVIRONMENTS["fbid_gym/BipedWalk-v0"] | {"action_layer": "base_acceleration"} | late
    for told in (0.0, 0.012):
        batch, spins = started(walk | {"layer_options": {"loop_delay": told}}, 16), []
        for _ in range(150):
            batch.step(np.zeros((16, len(batch.action_names))))
            spins.append(batch.simulation.qvel[:, 3:6].copy())
        shaken.append(np.square(spins).mean())
    assert shaken[1] < 0.6 * shaken[0], shaken
