"""Layers in the simulation: thrown into the air, landing, and what they report."""

import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.robots import ROBOTS
from tests.batches import begun
from tests.pairs import pairs

ENV = "fbid_gym/BipedBalance-v0"
CASES = [
    *((layer, {}) for layer in LAYERS),
    ("joint_position_feedforward", {"contact_limits": "none", "contacts": "measured"}),
    ("base_acceleration", {"contacts": "measured"}),
    ("com_wrench", {"contact_limits": "none", "contacts": "measured"}),
    ("com_wrench", {"balancer": "ott2011", "contacts": "measured"}),
]


@pytest.mark.parametrize(("layer", "options", "robot"), pairs(CASES, ROBOTS), indirect=["robot"])
def test_thrown_half_a_metre_up(robot, layer, options):
    """Everything stays finite, in the air, at touchdown, and lying about."""
    own = {"robot": robot.name, "action_layer": layer, "layer_options": options}
    env = begun(ENV, 4, **own, autoreset_mode="DISABLED", velocity_noise=0.5)
    batch = env.chunks.batches[0]
    batch.simulation.qpos[:, 2] += 0.5
    batch.simulation.batch.forward()
    airborne = touched = False
    for _ in range(40):
        # One level below the environment, which would end the episode of a robot that fell.
        step = batch.step(np.zeros((4, len(batch.layer.action_names))))
        assert (np.abs(step.info["torque"]) <= robot.torque_limit * (1 + 1e-12)).all()
        for key, value in step.info.items():
            if value.dtype != object:
                assert np.isfinite(value).all(), key
        assert not (step.info["termination"] == 2).any()
        loaded = step.info["contact_force"][..., 2].any(axis=1)
        if "measured" in options.values() and not (touched | loaded).any():
            assert (step.info["layer_underactuation"] == 6).all()
        airborne, touched = airborne | ~loaded, touched | (airborne & loaded)
    # Without feedback a quadruped may turn over and never set foot on the ground.
    assert airborne.all() and (touched.all() or layer == "torque")


@pytest.mark.parametrize(
    ("env_id", "layer", "options", "misses"),
    [
        (ENV, "joint_acceleration", {}, False),
        ("fbid_gym/QuadrupedWalk-v0", "base_acceleration", {}, False),
        (ENV, "com_wrench", {}, False),
        (ENV, "com_wrench", {"balancer": "garofalo2015"}, True),
    ],
)
def test_nothing_is_reported_that_is_not_measured(env_id, layer, options, misses):
    """Forces without limits miss no command of an acceleration; a wrench they can miss."""
    options = {"contact_limits": "none", **options}
    env = begun(env_id, action_layer=layer, layer_options=options)
    *_, info = env.step(np.zeros(env.action_space.shape, np.float32))
    assert "layer_underactuation" in info
    assert ("layer_residual" in info) == misses


def test_saturation_is_the_share_of_joints_at_their_limit(robot):
    env = begun(ENV, robot=robot.name, action_layer="torque")
    action = np.zeros(robot.num_joints, np.float32)
    hold = env.unwrapped.batch.layer.hold
    action[:3] = np.where(hold[:3] >= 0.0, 1.0, -1.0)
    *_, info = env.step(action)
    at_limit = np.abs(info["torque"]) >= robot.torque_limit
    assert at_limit[:3].all() and not at_limit[3:].any()
    assert info["layer_saturation"] == pytest.approx(3 / robot.num_joints)
