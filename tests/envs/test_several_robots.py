"""Several robots in one vector environment, and what of an observation they share."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.chunks import Chunks
from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot, load, several, zoo
from fbid_gym.robots.built_in import BUILT_IN, asset_path
from fbid_gym.robots.by_place import by_place
from fbid_gym.runtime.config import EnvConfig
from tests.batches import assert_same, begun, started
from tests.pairs import pairs

ENV = "fbid_gym/QuadrupedWalk-v0"
BODY = {"observation": "body", "action_layer": "base_acceleration", "episode_seconds": 0.3}
WALK = gym.registry[ENV].kwargs | BODY
ROBOTS = ["go1", "zoo:quadruped:0", "zoo:quadruped:3"]  # of 12, 16 and 24 joints


def test_several_robots_do_as_each_does_alone() -> None:
    envs = begun(ENV, 7, 5, robots=ROBOTS, num_threads=2, **without_robot())
    rng, rows = np.random.default_rng(0), []
    for _ in range(20):  # episodes end and begin
        action = rng.uniform(-1.0, 1.0, envs.action_space.shape)
        rows.append((action, *envs.step(action)[:4]))
    kinds = envs.unwrapped.chunks.kinds
    assert [sum(batch.num_envs for batch in kind) for kind in kinds] == [2, 2, 3]
    for name, first, count in zip(ROBOTS, (0, 2, 4), (2, 2, 3), strict=True):
        alone = begun(ENV, count, 5 + first, robot=name, **without_robot())
        own = slice(first, first + count)
        for action, *expected in rows:
            for got, value in zip(alone.step(action[own])[:4], expected, strict=True):
                np.testing.assert_array_equal(got, value[own])
        alone.close()
    envs.close()


def without_robot() -> dict[str, object]:
    return {name: value for name, value in WALK.items() if name != "robot"}


def test_a_state_of_several_robots_goes_on_to_the_bit() -> None:
    configs = [EnvConfig.of(WALK | {"robot": robot}) for robot in several(ROBOTS[:2])]
    one, other = Chunks(configs, 4), Chunks(configs, 4, num_threads=2)
    for chunks, seed in ((one, 1), (other, 2)):
        for env in range(4):
            chunks.seed(env, np.random.default_rng(seed + env))
        chunks.reset()
    zero = np.zeros((4, len(one.batches[0].action_names)))
    one.step(zero)
    other.load_state_dict(one.state_dict())
    one.step(zero)
    other.step(zero)
    assert_same(one.state_dict(), other.state_dict())


def test_feet_in_another_order_are_seen_and_steered_alike() -> None:
    given, (asset, feet, home) = load("go1"), BUILT_IN["go1"]
    mirrored = {foot: feet[foot] for foot in reversed(feet)}
    other = Robot.from_mjcf(asset_path(asset), mirrored, name="go1", home=home)
    assert other.foot_names == given.foot_names[::-1]
    batches = [started(WALK | {"robot": robot}, 2) for robot in (given, other)]
    assert batches[0].robot.foot_names == batches[1].robot.foot_names
    assert batches[0].action_names == batches[1].action_names
    action = np.random.default_rng(3).uniform(-0.5, 0.5, (2, len(batches[0].action_names)))
    for _ in range(5):
        seen = [batch.step(action).observation for batch in batches]
        np.testing.assert_allclose(seen[0], seen[1], atol=1e-5)


@pytest.mark.parametrize(
    ("robot", "layer"), pairs([*ROBOTS, "quadruped"], ["base_acceleration", "com_wrench"], 1)
)
def test_units_are_the_robots_own(robot, layer) -> None:
    """Heights are from the gait's: a robot whose legs are straight at home walks lower."""
    own = {"robot": robot, "action_layer": layer, "layer_options": {"action_units": "robot"}}
    batch = started(WALK | own, 2)
    given = batch.robot
    height = Stance.of(given).home_com[2]
    place = [name.startswith("height of the base") for name in batch.observation_names].index(True)
    for _ in range(5):
        step = batch.step(np.zeros((2, len(batch.action_names))))
        error = step.info["height_error"] / height
        np.testing.assert_allclose(step.observation[:, place], error, atol=1e-6)
    force, moment = given.weight, given.weight * height
    if layer == "base_acceleration":
        force, moment = given.gravity, 4.0 * given.gravity / height
    np.testing.assert_allclose(batch.loop.layer.scale, np.repeat([0.5 * force, 0.5 * moment], 3))


def test_forces_follow_the_feet_into_their_order() -> None:
    """Sensors, points and feet: where a robot leans, there it is heavy."""
    for name in ("go1", "biped"):
        robot = load(name)
        sorted_ = by_place(robot)
        assert by_place(sorted_) is sorted_ and sorted_.as_loaded is robot
        ends = np.cumsum([foot.num_points for foot in robot.feet])
        for foot, end in zip(robot.feet, ends, strict=True):
            k = sorted_.foot_names.index(foot.name)
            first = sum(other.num_points for other in sorted_.feet[:k])
            own = sorted_.contact_sensor[first : first + foot.num_points, 0]
            before = robot.contact_sensor[end - foot.num_points : end, 0]
            for ours, theirs in zip(own, before, strict=True):
                matched = [
                    (model.sensor_reftype[s], model.sensor_refid[s])
                    for model, column in ((sorted_.model, ours), (robot.model, theirs))
                    for s in [int(np.flatnonzero(model.sensor_adr == column)[0])]
                ]
                assert matched[0] == matched[1]
        angle = np.unwrap(np.arctan2(*sorted_.points_at_home.T[1::-1]))
        assert angle[0] < angle[-1]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"robots": []}, "at least one"),
        ({"robots": [7]}, "names, paths"),
        ({"robots": ["go1", "biped"]}, "as many feet"),
        ({"robots": ROBOTS[:2], "action_layer": "joint_position"}, "12 and 16 entries"),
        ({"robots": ROBOTS[:2], "observation": "full"}, "observation='body'"),
        ({"robots": ROBOTS, "num_envs": 2}, "3 robots"),
        ({"robots": ["zoo:quadruped:9-3"]}, "seeds"),
        ({"robots": ["zoo:dog:1"]}, "zoo:quadruped:7"),
        ({"robot": "zoo:quadruped:1-2"}, "one robot"),
    ],
)
def test_what_cannot_be_side_by_side_is_refused(given, said) -> None:
    with pytest.raises(FbidError, match=said):
        gym.make_vec(ENV, **({"num_envs": 4} | WALK | given))


def test_families_of_drawn_robots() -> None:
    """Four feet on one point each, at most 28 joints, the same by name as by seed."""
    for family, legs in (("biped", 2), ("quadruped", 4), ("hexapod", 6)):
        drawn = [zoo.draw(seed, family) for seed in range(200)]
        assert {animal.legs for animal in drawn} == {legs}
        assert max(animal.joints * legs for animal in drawn) in (14, 24, 28)
        assert {animal.foot for animal in drawn} == {"box" if legs == 2 else "sphere"}
        masses = np.array([animal.mass for animal in drawn])
        assert masses.min() < 2.0 and masses.max() > 100.0
    assert zoo.drawn("zoo:quadruped:5-7") == tuple(f"zoo:quadruped:{k}" for k in (5, 6, 7))
    robot = load("zoo:quadruped:5")
    assert load("zoo:quadruped:5") is robot and robot.name == "zoo:quadruped:5"
    assert robot.mass == pytest.approx(zoo.draw(5, "quadruped").mass)
    assert [zoo.is_held_out(f"zoo:biped:{seed}") for seed in (999, 1000)] == [False, True]
