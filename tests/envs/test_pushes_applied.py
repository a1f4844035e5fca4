"""Pushes as physics sees them: momentum in flight, and an end with the episode."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.robots import load
from tests.batches import begun
from tests.pairs import pairs

ARGUMENTS = {"action_layer": "torque", "push_interval": (0.15, 0.25), "episode_seconds": 1.0}


# At the light physics of walking a tick is too long for the law to hold this well.
@pytest.mark.parametrize(
    ("name", "rates"),
    pairs(
        [name for name, given in ENVIRONMENTS.items() if given["task"] != "walk"],
        [{}, {"physics_hz": 500, "control_hz": 250, "policy_hz": 50}],
        1,
    ),
)
def test_a_push_in_flight_changes_momentum_by_force_times_duration(name, rates):
    """Without gravity and far above the ground nothing else acts on the robot.

    A jump of the base's velocity takes the whole robot along.
    """
    # Gentle pushes: a robot turned over would be reset.
    weight = load(ENVIRONMENTS[name]["robot"]).weight
    arguments = ARGUMENTS | rates | {"push_force": (0.01 * weight, 0.1 * weight)}
    arguments["push_velocity"] = (0.02, 0.1)
    env = begun(name, 3, 1, **arguments)
    batch = env.chunks.batches[0]
    simulation, robot = batch.simulation, batch.robot
    simulation.batch.expand("opt.gravity")[:] = 0.0
    simulation.batch.expand("dof_damping")[:] = 0.0
    simulation.qpos[:, 2] += 10.0
    simulation.qvel[:] = 0.0
    simulation.batch.forward()
    plan = {k.removeprefix("plan."): v for k, v in batch.state_dict().items()}
    hz = batch.rates.control

    # The holding torque is meant for gravity: take it away.
    action = np.tile(-batch.layer.hold / robot.torque_limit, (3, 1))
    momentum = np.zeros((3, 3))
    for step in range(40):
        _, _, terminated, _, info = env.step(action)
        assert not terminated.any()
        before, momentum = momentum, robot.mass * simulation.terms().com_velocity
        # The force times the ticks of this step during which some push was on. Not to the bit:
        # time is discrete.
        expected, jumped = np.zeros((2, 3, 3))
        for tick in range(step * batch.rates.ticks, (step + 1) * batch.rates.ticks):
            since = tick - plan["push_start"]
            on = (since >= 0) & (since < round(0.15 * hz))
            expected += (on[..., None] * plan["push_force"]).sum(axis=1) / hz
            jumped += ((since == 0)[..., None] * plan["push_velocity"]).sum(axis=1)
        np.testing.assert_allclose(info["push_velocity"], jumped, atol=1e-15)
        expected += robot.mass * jumped
        np.testing.assert_allclose(momentum - before, expected, atol=5e-5 * robot.weight)
    assert np.abs(momentum).max() > 0.05 * robot.weight * 0.15


def test_every_push_in_info_and_on_the_base_ends_with_the_episode():
    env = gym.make("fbid_gym/BipedBalance-v0", **(ARGUMENTS | {"action_layer": "joint_position"}))
    simulation = env.unwrapped.batch.simulation
    zero = np.zeros(16, np.float32)
    for seed in range(3):
        env.reset(seed=seed)
        # What an earlier episode left behind does not act.
        assert (simulation.batch.xfrc_applied == 0.0).all()
        pushed, done = 0, False
        while not done:
            *_, terminated, truncated, info = env.step(zero)
            base = env.unwrapped.batch.robot.base_body
            np.testing.assert_array_equal(simulation.batch.xfrc_applied[0, base, :3], info["push"])
            assert np.count_nonzero(simulation.batch.xfrc_applied) <= 2
            pushed, done = pushed + info["push"].any(), terminated or truncated
        assert pushed >= 10


@pytest.mark.slow
def test_the_zero_action_survives_pushes_of_100_newtons_from_any_side():
    """5 s under pushes of 100 N for 150 ms, at least 95 of 100 episodes: of 60, three may fall."""
    given = {"num_threads": 2, "action_layer": "base_acceleration", "episode_seconds": 5.0}
    given |= {"push_force": (100.0, 100.0), "push_duration": 0.15}
    env = begun("fbid_gym:fbid_gym/BipedBalance-v0", 60, **given)
    fallen, pushes = np.zeros(60, bool), []
    for _ in range(250):
        *_, terminated, _, info = env.step(np.zeros(env.action_space.shape))
        fallen |= terminated
        pushes.append(info["push"])
    assert fallen.sum() <= 3
    sizes = np.linalg.norm(pushes, axis=2)
    np.testing.assert_allclose(sizes[sizes > 0], 100.0)
    # Everyone was pushed for at least once 150 ms, which is seven or eight policy steps.
    assert ((sizes > 0).sum(axis=0) >= 7).all()
