"""A proportional law, as a policy by its name."""

from pathlib import Path

import numpy as np
import pytest

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import FbidError
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks.body_view import own_units
from tests.robots.similar import similar
from train.runs.environment import load_policy
from train.runs.proportional import gain_of, matrix_of, proportional

WALK = "fbid_gym/QuadrupedWalk-v0"
BODY = ("base_acceleration", "com_wrench", "task_space_position")


def asked(layer: str, lack: np.ndarray, gain: float) -> tuple[EnvBatch, np.ndarray]:
    """The environments of a layer, and the law's actions for velocities (2, 2) that lack."""
    batch = EnvBatch(EnvConfig.of(ENVIRONMENTS[WALK] | {"action_layer": layer}), 2)
    policy = proportional(WALK, {"action_layer": layer}, gain)
    seen = np.random.default_rng(2).normal(size=(2, len(batch.observation_names)))
    names = [f"velocity {way} short of the command (m/s)" for way in ("ahead", "to the left")]
    seen[:, [batch.observation_names.index(name) for name in names]] = lack
    action = policy(seen)
    expected = np.clip(seen @ matrix_of(batch, gain).T, -1.0, 1.0)
    np.testing.assert_allclose(action, expected, atol=1e-6)
    return batch, action


def test_all_layers_are_asked_for_the_same_acceleration():
    lack, gain = np.array([[0.1, -0.05], [-0.02, 0.03]]), 2.0
    for layer in BODY:
        batch, action = asked(layer, lack, gain)
        found = action[:, :2] * batch.layer.scale[:2]
        if layer == "com_wrench":
            found = found / batch.robot.mass
        if layer == "task_space_position":
            # Two of four feet push the body there.
            found = found * 2.0 * batch.layer.reach.stiffness[0] / batch.robot.mass
        np.testing.assert_allclose(found, gain * lack, rtol=1e-5)
        np.testing.assert_array_equal(action[:, 2:], 0.0)
    _, action = asked("base_acceleration", 100.0 * lack, gain)
    assert np.abs(action).max() == 1.0


@pytest.mark.parametrize("layer", BODY)
def test_over_the_view_of_bodies_it_is_the_same_law_on_similar_robots(layer):
    """K counts in sqrt(g / h): as many m/s^2 for each m/s as that is in 1/s."""
    found = []
    for size in (1.0, 4.0):
        robot = similar("go1", size)
        own = {"action_layer": layer, "robot": robot}
        hz = {"physics_hz": round(500 / size**0.5), "control_hz": round(500 / size**0.5)}
        rates = {**hz, "policy_hz": round(50 / size**0.5)}
        seen = EnvBatch(EnvConfig.of(ENVIRONMENTS[WALK] | own | rates | {"observation": "body"}), 1)
        plain = EnvBatch(EnvConfig.of(ENVIRONMENTS[WALK] | own | rates), 1)
        rate, speed = own_units(seen.task.body).rate, own_units(seen.task.body).speed
        k = seen.observation_names.index("velocity ahead short of the command (sqrt(g h))")
        j = plain.observation_names.index("velocity ahead short of the command (m/s)")
        found.append(matrix_of(seen, 4.0))
        np.testing.assert_allclose(found[-1][0, k], speed * matrix_of(plain, 4.0 * rate)[0, j])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-5)


def test_it_is_loaded_by_its_name():
    view = load_policy(Path("proportional:6/QuadrupedWalk-v0/com_wrench/body")).env_args
    assert view == {"action_layer": "com_wrench", "observation": "body"}
    policy = load_policy(Path("proportional:6/QuadrupedWalk-v0/com_wrench"))
    assert (policy.env_id, policy.env_args) == (WALK, {"action_layer": "com_wrench"})
    law = proportional(WALK, policy.env_args, 6.0)
    np.testing.assert_array_equal(policy.weights[0], law.weights[0])


def test_shipped_policies_keep_the_layers_of_before():
    for name, option in (
        ("BipedWalk-v0/joint_position_gait", ("pendulum", False)),
        ("QuadrupedWalk-v0/com_wrench", ("velocity_of", "com")),
    ):
        policy = load_policy(Path(f"assets/policies/{name}.safetensors"))
        assert option in policy.env_args["layer_options"].items()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("proportional:6", "GAIN/ENVIRONMENT/LAYER"),
        ("proportional:6/QuadrupedWalk-v0/com_wrench/head", "/body for the body's view"),
        ("proportional:x/QuadrupedWalk-v0/com_wrench", "a number from 0 to"),
        ("proportional:-1/QuadrupedWalk-v0/com_wrench", "a number from 0 to"),
        ("proportional:nan/QuadrupedWalk-v0/com_wrench", "a number from 0 to"),
        ("proportional:6/Walk-v0/com_wrench", "QuadrupedWalk-v0"),
        ("proportional:6/QuadrupedWalk-v0/wrench", "com_wrench"),
        ("proportional:6/QuadrupedWalk-v0/joint_position", "moves the body"),
        ("proportional:6/QuadrupedBalance-v0/com_wrench", "commands velocities"),
    ],
)
def test_other_names_are_refused_in_words(name, said):
    with pytest.raises(FbidError, match=said):
        load_policy(Path(name))


def test_another_policy_has_no_gain():
    with pytest.raises(FbidError, match="proportional:GAIN"):
        gain_of("24")
