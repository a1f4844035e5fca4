"""Gains of joints for a loop whose torques come late."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions.joint_gains import JointGains, sampled_growth
from fbid_gym.actions.ranges import Falling
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.loop_delay import LoopDelay
from fbid_gym.errors import FbidError
from tests.actions.cases import layer_of

HZ = 250


def played(robot, gains, share, seconds, ticks, rng):
    """The largest coordinate or rate of a robot in the air, held by a share of gains, by ticks."""
    mobility = np.linalg.inv(Stance.of(robot).terms.mass_matrix[0])[6:, 6:]
    late = LoopDelay.of(1, robot.num_joints, HZ, seconds)
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


def test_delays_beyond_any_are_refused():
    robot = robots.load("biped")
    with pytest.raises(FbidError, match="loop_delay"):
        layer_of("joint_position", robot, loop_delay=0.1)
    with pytest.raises(FbidError, match=r"at most .* and 0.03 s of delay"):
        layer_of("joint_position", robot, natural_frequency=30.0, loop_delay=0.03)
