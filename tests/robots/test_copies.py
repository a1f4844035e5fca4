"""A robot is its own copy, and pickling makes it again; so it makes environments."""

import copy
import pickle
from dataclasses import replace
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from fbid_gym.errors import RobotError
from fbid_gym.robots import ROBOTS, Robot, load, zoo

ENV = "fbid_gym/QuadrupedBalance-v0"


def an_own_robot() -> Robot:
    animal = zoo.draw(22)
    return Robot.from_mjcf(zoo.mjcf(animal), animal.foot_names, home="stand")


def make(robot: Robot | None = None) -> gym.Env:
    return gym.make(ENV, robot=robot or an_own_robot(), action_layer="torque")


def same(one: Robot, other: Robot) -> bool:
    arrays = ("home_qpos", "torque_limit", "joint_range", "contact_sensor")
    models = ("body_mass", "body_inertia", "geom_size", "geom_quat", "dof_armature")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in arrays) and all(
        np.array_equal(getattr(one.model, name), getattr(other.model, name)) for name in models
    )


def test_a_copy_is_the_robot_itself() -> None:
    robot = an_own_robot()
    assert copy.copy(robot) is robot
    assert copy.deepcopy({"robot": [robot]})["robot"][0] is robot


@pytest.mark.parametrize("name", ROBOTS)
def test_pickling_makes_the_same_robot_again(name: str) -> None:
    assert same(pickle.loads(pickle.dumps(load(name))), load(name))


def test_own_robots_are_pickled_with_all_that_was_asked_of_them(tmp_path: Path) -> None:
    animal = zoo.draw(26)  # of no actuators
    path = tmp_path / "zoo.xml"
    path.write_text(zoo.mjcf(animal))
    robot = Robot.from_mjcf(path, torque_limit=3.0, armature={"*knee": 0.1}, name="mine")
    again = pickle.loads(pickle.dumps(robot))
    assert same(robot, again)
    assert (again.name, again.foot_names, again.notes) == ("mine", robot.foot_names, robot.notes)


def test_a_robot_changed_by_hand_is_not_pickled() -> None:
    with pytest.raises(RobotError, match="Robot 'other' was changed after it was loaded"):
        pickle.dumps(replace(an_own_robot(), name="other"))


def test_a_file_that_has_changed_is_another_robot(tmp_path: Path) -> None:
    path = tmp_path / "zoo.xml"
    path.write_text(zoo.mjcf(zoo.draw(22)))
    pickled = pickle.dumps(Robot.from_mjcf(path))
    path.write_text(zoo.mjcf(zoo.draw(22)).replace("0.8 0.01", "0.9 0.01"))
    with pytest.raises(RobotError, match="zoo.xml' has changed since the robot was loaded."):
        pickle.loads(pickled)


def test_environments_of_own_robots_can_be_made_again() -> None:
    """Gymnasium's own check, from the environment's specification, and that one pickled."""
    env = make()
    check_env(env.unwrapped, skip_render_check=True)
    first, _ = env.reset(seed=3)
    for spec in (env.spec, pickle.loads(pickle.dumps(env.spec))):
        again, _ = gym.make(spec).reset(seed=3)
        np.testing.assert_array_equal(again, first)


@pytest.mark.slow
def test_environments_of_own_robots_run_in_processes_of_their_own() -> None:
    vector = pytest.importorskip("stable_baselines3.common.vec_env")
    make_mine = partial(make, an_own_robot())  # pickled with it
    first, _ = make_mine().reset(seed=3)
    spawned = gym.vector.AsyncVectorEnv([make_mine], context="spawn")
    parallel = vector.SubprocVecEnv([make_mine], start_method="spawn")
    try:
        np.testing.assert_array_equal(spawned.reset(seed=3)[0][0], first)
        parallel.seed(3)
        np.testing.assert_array_equal(parallel.reset()[0], first)
    finally:
        spawned.close()
        parallel.close()
