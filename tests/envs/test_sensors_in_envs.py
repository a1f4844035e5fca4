"""Environments whose robots sense: what reads the truth, what the estimate; seeds; resuming."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.estimation.sensors import ESTIMATORS
from fbid_gym.runtime.config import EnvConfig
from tests.batches import started

WALK = "fbid_gym/QuadrupedWalk-v0"


def arguments(**more):
    return {**gym.registry[WALK].kwargs, "action_layer": "base_acceleration", **more}


def played(batch, steps=20):
    zero = np.zeros((batch.num_envs, len(batch.action_names)))
    return [batch.step(zero) for _ in range(steps)]


def test_perfect_sensors_are_none():
    plain, perfect = started(arguments(), 2), started(arguments(sensors="perfect"), 2)
    assert plain.perception is None and perfect.perception is None
    assert plain.state_dict().keys() == perfect.state_dict().keys()
    assert not any("perception" in name for name in plain.state_dict())
    assert plain.plant.terms() is plain.simulation.terms()


def test_who_knows_the_true_state_does_not_feel_the_sensors():
    plain = started(arguments(), 3)
    truth = started(arguments(sensors="mems", state="true"), 3)
    for expected, found in zip(played(plain), played(truth), strict=True):
        np.testing.assert_array_equal(found.observation, expected.observation)
        np.testing.assert_array_equal(found.reward, expected.reward)
        for name, value in expected.info.items():
            np.testing.assert_array_equal(found.info[name], value, err_msg=name)
        assert found.info["estimate_tilt_error"].max() > 0.0


def test_reward_and_metrics_are_those_of_the_truth_and_the_policy_sees_the_estimate():
    batch = started(arguments(sensors="raw"), 4)
    step = played(batch, 30)[-1]
    terms, state = batch.simulation.terms(), batch._state
    rotation = terms.world_from_trunk
    ahead = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    x, y = state.qvel[:, 0], state.qvel[:, 1]
    np.testing.assert_allclose(step.info["speed"], np.hypot(x, y))
    names = batch.observation_names
    column = names.index("base velocity ahead (m/s, heading)")
    true = np.cos(ahead) * x + np.sin(ahead) * y
    wrong = np.abs(step.observation[:, column] - true)
    assert 1e-4 < wrong.max() < 0.1
    up = batch.observation_columns["up"]
    own = batch.perception.estimator.state.qpos
    assert np.abs(own[:, 3:7] - state.qpos[:, 3:7]).max() > 1e-4
    seen, actual = step.observation[:, up], terms.world_from_base[:, 2]
    tilt = np.arccos(np.clip(np.vecdot(seen, actual), -1.0, 1.0))
    np.testing.assert_allclose(tilt, step.info["estimate_tilt_error"], atol=2e-3)


def test_groups_of_an_observation_for_robots():
    more = {"sensors": "mems", "randomisation": {"friction": (0.5, 1.0)}}
    few = started(arguments(observation="measured", history=3, **more), 3)
    many = started(arguments(observation="measured+estimate", **more), 3)
    for batch in (few, many):
        policy, critic = (batch.observation_columns[name] for name in ("policy", "critic"))
        names = np.array(batch.observation_names)
        assert len(set(names)) == len(names) == len(batch.observation_bound) == critic.stop
        assert policy.start == 0 and policy.stop == critic.start
        assert "plant friction" in names[critic] and "plant friction" not in names[policy]
    unseen = ("base velocity", "normal force", "height of the base", "up direction")
    names = np.array(few.observation_names)[few.observation_columns["policy"]]
    assert not any(name.startswith(unseen) for name in names)
    names = np.array(many.observation_names)[many.observation_columns["policy"]]
    assert not any(name.startswith("normal force") for name in names)
    assert any(name.startswith("base velocity") for name in names)
    # What was observed moves back, newest first.
    size = few.observation_columns["policy"].stop // 3
    steps = played(few, 4)
    rows, last = [step.observation[:, :size] for step in steps], steps[-1].observation
    np.testing.assert_array_equal(last[:, : 3 * size], np.concatenate(rows[:0:-1], axis=1))
    # The critic's part is the truth.
    actual = last[:, few.observation_columns["actual_velocity"]]
    np.testing.assert_allclose(np.hypot(*actual.T[:2]), steps[-1].info["speed"], atol=1e-6)


@pytest.mark.parametrize("own", [{}, {"contact": "torque"}, {"estimator": "linear"}])
def test_walking_by_an_estimate(own):
    batch = started(arguments(sensors={"like": "mems", **own}), 8)
    steps = played(batch, 150)
    assert not any(step.terminated.any() for step in steps)
    errors = [step.info["estimate_velocity_error"] for step in steps[20:]]
    assert np.sqrt(np.mean(np.square(errors))) < 0.04
    assert max(step.info["estimate_restarts"].max() for step in steps) == 0
    wrong = np.mean([step.info["estimate_contact_error"] for step in steps[20:]])
    assert wrong < 0.15


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_slipping_feet_and_wrong_contacts_are_survived(estimator):
    slippery = {"randomisation": {"friction": (0.3, 0.3)}}
    sensors = {"like": "mems", "contact_errors": 0.1, "estimator": estimator}
    batch = started(arguments(sensors=sensors, **slippery), 8)
    steps = played(batch, 100)
    errors = np.array([step.info["estimate_velocity_error"] for step in steps])
    assert np.isfinite(errors).all() and np.median(errors) < 0.15


def test_what_diverges_is_begun_anew_and_told():
    batch = started(arguments(sensors="mems"), 3)
    played(batch, 3)
    batch.perception.estimator.belief.velocity[1] = np.nan
    step = played(batch, 10)[-1]
    assert step.info["estimate_restarts"].tolist() == [0, 1, 0]
    assert np.isfinite(step.observation).all()
    assert "imu" in batch.notes[-1]


def test_a_map_moves_with_the_estimate():
    ground = {"terrain": "stairs", "height_scan": True, "difficulty": 0.3}
    batch = started(arguments(sensors="mems", **ground), 4)
    played(batch, 30)
    # An estimate that is far away in place and heading sees the same ground.
    before = batch.task._foreseen
    assert before is not None
    step = played(batch, 1)[-1]
    scan = step.observation[:, batch.observation_columns["scan"]]
    assert np.isfinite(scan).all() and np.abs(scan).max() < 1.0


def test_what_sensors_mean_is_saved_in_full():
    given = {"action_layer": "torque", "sensors": {"like": "good", "scale": 2.0}}
    config = EnvConfig.of(arguments(**given))
    again = EnvConfig.of(config.resolved())
    assert again.perceived() == config.perceived()
    assert again.resolved() == config.resolved()
    assert config.resolved()["state"] == "estimated"
