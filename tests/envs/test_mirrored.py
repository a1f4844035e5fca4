"""What a policy sees and does in the mirror is what the mirrored robot sees and does."""

import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.mirrored import mirrored
from fbid_gym.errors import InvalidValueError
from fbid_gym.runtime.config import EnvConfig
from tests.pairs import pairs
from tests.postures import in_mirror

WALK = "QuadrupedWalk-v0"


def batch_of(env: str, layer: str, **arguments) -> EnvBatch:
    given = ENVIRONMENTS[f"fbid_gym/{env}"] | {"action_layer": layer, **arguments}
    return EnvBatch(EnvConfig.of(given), 2)


def in_the_mirror(plan, robot):
    """The same episode with its commands and pushes to the other side."""
    other = {name: np.array(value) for name, value in plan.items()}
    start = in_mirror(robot, plan["qpos"][None], plan["qvel"][None])
    other["qpos"], other["qvel"] = (each[0] for each in start)
    for name in ("push_force", "push_velocity"):  # and turning
        size = other[name].shape[-1]
        other[name] = other[name] * np.array([1, -1, 1, -1, 1, -1])[:size]
    if other["command"].shape[-1] == 3:
        other["command"] = other["command"] * [1, -1, -1]
    return other


@pytest.mark.parametrize(
    ("env", "layer", "arguments"),
    [
        (WALK, "base_acceleration", {"height_scan": True}),
        (WALK, "joint_position", {"history": 2}),
        (WALK, "task_space_position", {"observation": "body"}),
        ("BipedWalk-v0", "base_acceleration", {"priority_action": True}),
        ("HumanoidBalance-v0", "joint_position", {}),
    ],
)
def test_a_mirrored_episode_is_the_episode_in_the_mirror(env, layer, arguments, monkeypatch, rng):
    """Start, commands, pushes and actions are; then all that is seen and earned is."""
    if "priority_action" in arguments:
        arguments = {"layer_options": arguments}
    batch = batch_of(env, layer, **arguments)
    plans, (seen, done) = [], mirrored(batch)
    kind = type(batch.task)
    draw = kind.draw

    def both(task, generator):
        plans.append(in_the_mirror(plans[0], batch.robot) if plans else draw(task, generator))
        return plans[-1]

    monkeypatch.setattr(kind, "draw", both)
    for k in range(2):
        batch.seed(k, np.random.default_rng(3))
    batch.reset(np.arange(2))
    if env == WALK:  # from a stand they begin with the same pair of feet
        batch.loop.planned["walking"][:] = True
        batch.loop.planned["phase"][:] = 0.9, 0.4
    for k in range(40):
        action = (0.3 * rng.normal(size=len(batch.action_names))).clip(-1.0, 1.0)
        step = batch.step(np.array([action, done.of(action)]))
        if k < 1:  # the last observation was before they began to walk
            continue
        np.testing.assert_allclose(step.observation[1], seen.of(step.observation[0]), atol=1e-5)
        assert step.reward[1] == pytest.approx(step.reward[0], rel=1e-7)


@pytest.mark.parametrize(
    ("layer", "env"), pairs(LAYERS, ["QuadrupedWalk-v1", "BipedWalk-v1", "HumanoidBalance-v0"], 1)
)
def test_all_layers_are_known_and_what_is_mirrored_twice_is_the_same(env, layer):
    for reflection in mirrored(batch_of(env, layer)):
        twice = np.arange(len(reflection.entry))
        np.testing.assert_array_equal(reflection.entry[reflection.entry], twice)
        np.testing.assert_array_equal(reflection.sign[reflection.entry], reflection.sign)
        assert set(np.abs(reflection.sign)) == {1.0}


def test_the_clock_is_that_of_the_gait():
    for gait, sign in (("trot", -1.0), ("walk", -1.0), ("pace", -1.0), ("bound", 1.0)):
        observation, _ = mirrored(batch_of(WALK, "torque", gait=gait))
        np.testing.assert_array_equal(observation.sign[:2], sign)


def test_an_entry_that_is_not_known_is_named():
    batch = batch_of("QuadrupedBalance-v0", "torque")
    batch.observation_names = ("weather (1)", *batch.observation_names[1:])
    words = "Invalid entry of the observation to mirror: 'weather"
    with pytest.raises(InvalidValueError, match=words):
        mirrored(batch)
