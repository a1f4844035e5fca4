"""What an environment's arguments mean, spelled out: complete, and JSON can hold it."""

import json
from dataclasses import fields

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.registered import resolved_arguments
from fbid_gym.errors import UnknownOptionError
from fbid_gym.robots.terrain import LEVELLED
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks import task_options
from tests.pairs import pairs


@pytest.mark.parametrize(("name", "layer"), pairs(ENVIRONMENTS, LAYERS, 1))
def test_every_argument_has_a_value_that_json_keeps(name, layer):
    resolved = resolved_arguments(name, {"action_layer": layer})
    own = {field.name for field in fields(EnvConfig)} - {"task_options"}
    assert resolved.keys() == own | task_options(ENVIRONMENTS[name]["task"]).keys()
    assert resolved["layer_options"].keys() == layer_options(layer).keys()
    unset = {key for key, value in resolved.items() if value is None}
    assert unset == ({"terrain_height"} if resolved["terrain"] in LEVELLED else set())
    assert None not in resolved["layer_options"].values()
    assert json.loads(json.dumps(resolved, allow_nan=False)) == resolved


BASE = {"action_layer": "base_acceleration"}


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("QuadrupedBalance-v0", {"action_layer": "joint_position"}),
        ("QuadrupedBalance-v0", BASE | {"randomisation": {"mass": 0.2}}),
        ("BipedWalk-v0", BASE),
        ("QuadrupedWalk-v0", {"action_layer": "com_wrench"}),
        ("BipedStep-v0", {"action_layer": "joint_position_feedforward"}),
        ("BipedStep-v0", {"action_layer": "com_wrench", "layer_options": {"balancer": "ott2011"}}),
        ("QuadrupedTerrain-v0", {}),  # ground by difficulty
    ],
)
def test_what_is_resolved_is_the_same_environment(name, arguments):
    """Said explicitly, the resolved arguments make the environment that the defaults make."""
    name = f"fbid_gym/{name}"
    resolved = resolved_arguments(name, arguments)
    given = {"layer_options": arguments.get("layer_options", {})}
    assert resolved_arguments(name, resolved | given) == resolved
    explicit = json.loads(json.dumps(resolved))
    options = explicit["layer_options"]
    options |= {key: np.inf for key, value in options.items() if value == "inf"}
    seen = []
    for given in (arguments, explicit):
        env = gym.make(name, **given)
        found = [env.reset(seed=3)[0]]
        action = np.full(env.action_space.shape, 0.3)
        found += [env.step(action)[0] for _ in range(20)]
        seen.append(found)
    np.testing.assert_allclose(*seen, atol=1e-5)


def test_what_was_said_stays_and_a_changed_default_shows(monkeypatch):
    given = {"push_force": (3, 4), "layer_options": {"scale": 0.1}, "action_layer": "other"}

    def version(default):
        def other(robot, control_hz, kind, *, scale=0.3, damping_ratio=default):
            own = {"scale": scale, "damping_ratio": damping_ratio}
            return JointPosition.of(robot, control_hz, kind, **own)

        return other

    monkeypatch.setitem(LAYERS, "other", version(0.5))
    resolved = resolved_arguments("fbid_gym/BipedBalance-v0", given)
    assert resolved["push_force"] == [3, 4]
    added = {"footholds": False, "step_rate": False, "residual_torque": 0.0}
    assert resolved["layer_options"] == {"scale": 0.1, "damping_ratio": 0.5} | added
    monkeypatch.setitem(LAYERS, "other", version(0.7))
    again = resolved_arguments("fbid_gym/BipedBalance-v0", given)
    assert again == resolved | {"layer_options": {"scale": 0.1, "damping_ratio": 0.7} | added}


def test_how_it_is_drawn_or_stepped_is_not_what_it_is():
    name = "fbid_gym/BipedBalance-v0"
    drawn = {"render_mode": "rgb_array", "render_options": {"com": True}, "num_threads": 2}
    assert resolved_arguments(name, drawn) == resolved_arguments(name, {})


def test_other_environments_are_unknown_and_wrong_arguments_are_named():
    assert resolved_arguments("CartPole-v1", {}) is None
    assert resolved_arguments("fbid_gym/Nothing-v0", {}) is None
    with pytest.raises(UnknownOptionError, match="Did you mean 'push_force'"):
        resolved_arguments("fbid_gym/BipedBalance-v0", {"push_forces": [1, 2]})
