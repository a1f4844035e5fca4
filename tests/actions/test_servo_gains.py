"""`joint_position` holds a robot as the servos of its file would have, if that is steady."""

import re

import numpy as np
import pytest

from fbid_gym.actions.joint_gains import JointGains, missing_damping, sampled_growth
from fbid_gym.actions.ranges import Falling
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.verdict import survival
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots import Robot, zoo
from fbid_gym.robots.built_in import GO1, asset_path
from fbid_gym.runtime.config import EnvConfig
from tests.actions.cases import layer_of

ANIMAL = zoo.draw(14)  # on four legs, with servos
STIFF = 8.0 * ANIMAL.mass * 9.81 * ANIMAL.leg / ANIMAL.legs


def with_servos(stiffness: float, damping: float) -> Robot:
    servos = f'kp="{stiffness:.9g}" kv="{damping:.9g}"'
    return Robot.from_mjcf(re.sub('kp="[^"]*"', servos, zoo.mjcf(ANIMAL)), ANIMAL.foot_names)


def test_steady_servos_give_the_default_gains():
    robot = with_servos(STIFF, 0.02 * STIFF)
    layer = layer_of("joint_position", robot)
    np.testing.assert_allclose(layer.gains.stiffness, STIFF)
    np.testing.assert_allclose(layer.gains.damping, 0.02 * STIFF)
    assert layer.natural_frequency == "servo"
    named = layer_of("joint_position", robot, natural_frequency="servo")
    np.testing.assert_array_equal(named.gains.stiffness, layer.gains.stiffness)


def test_a_frequency_that_is_given_goes_first():
    robot = with_servos(STIFF, 0.02 * STIFF)
    layer = layer_of("joint_position", robot, natural_frequency=0.5)
    assert layer.natural_frequency == 0.5
    assert not np.allclose(layer.gains.stiffness, STIFF)


def test_servos_that_oscillate_when_sampled_are_left_alone():
    robot = with_servos(100.0 * STIFF, 0.0)
    assert robot.servo_gains is not None
    damping = robot.servo_gains.damping + robot.joint_damping
    assert sampled_growth(robot, robot.servo_gains.stiffness, damping, 500) > 1.0
    layer = layer_of("joint_position", robot)
    assert isinstance(layer.natural_frequency, float)
    with pytest.raises(InvalidValueError, match="sampled at 500 Hz, the servos of zoo"):
        layer_of("joint_position", robot, natural_frequency="servo")


def test_servos_too_soft_to_carry_the_robot_are_left_alone():
    robot = with_servos(0.1 * STIFF, 0.02 * STIFF)
    assert isinstance(layer_of("joint_position", robot).natural_frequency, float)
    named = layer_of("joint_position", robot, natural_frequency="servo")
    np.testing.assert_allclose(named.gains.stiffness, 0.1 * STIFF)


def test_servos_whose_damping_is_in_the_joints_are_as_stiff_on_a_gait() -> None:
    """On soles stiffness is what damping allows, wherever the file has it."""
    animal = zoo.draw(5, "biped")
    stiffness, damping = 4.0 * zoo.torque_limit(animal), 0.06 * zoo.torque_limit(animal)
    gains = []
    for own, servo in ((damping, 0.0), (0.0, damping)):
        text = re.sub('damping="[^"]*"', f'damping="{own}"', zoo.mjcf(animal))
        text = re.sub('kp="[^"]*"', f'kp="{stiffness}" kv="{servo}"', text)
        robot = Robot.from_mjcf(text, animal.foot_names)
        walk = {"task": "walk", "robot": robot, "action_layer": "joint_position"}
        config = EnvConfig.of({**walk, "layer_options": {"natural_frequency": "servo"}})
        layer, _ = config.layer(robot, config.make_task(robot))
        gains.append(layer.gains.stiffness)
    np.testing.assert_allclose(*gains, rtol=1e-6)
    assert 0.0 < gains[0].min() < 0.5 * stiffness


MODEL = asset_path("go1.xml").read_text()
DAMPED = re.sub(r'damping="[^"]*"', 'damping="1.5"', MODEL)
LIGHT = re.sub(r'armature="[^"]*"', 'armature="0"', MODEL)


def dog(text: str, home: dict[str, float] | str = GO1.home) -> Robot:
    return Robot.from_mjcf(text, GO1.feet, home=home)


def test_what_is_fed_on_and_what_is_calmed_is_nothing_where_joints_are_damped_well():
    """Joints' own damping is overcome where it counts; light legs have the base damped."""
    plain, damped, light = (dog(text) for text in (MODEL, DAMPED, LIGHT))
    for robot, drag, calm in ((plain, 0.0, False), (damped, 1.5, False), (light, 0.0, True)):
        layer = layer_of("joint_position", robot)
        np.testing.assert_array_equal(layer.gains.drag, drag)
        gains = JointGains.of(robot, 250, Falling(3.4), 1.0)
        assert (missing_damping(gains) > 0.0) == calm


@pytest.mark.slow
@pytest.mark.parametrize("text, home", [(DAMPED, GO1.home), (LIGHT, GO1.home), (LIGHT, "stand")])
def test_they_walk_by_the_zero_action(text: str, home: dict[str, float] | str) -> None:
    """With damped joints, without armature, and from a pose that was searched for."""
    arguments = ENVIRONMENTS["fbid_gym/QuadrupedWalk-v0"] | {"action_layer": "joint_position"}
    assert survival(dog(text, home), arguments) >= 0.8


def test_what_is_saved_says_servo():
    robot = with_servos(STIFF, 0.02 * STIFF)
    saved = EnvConfig.of({"robot": robot, "action_layer": "joint_position"}).resolved()
    assert saved["layer_options"]["natural_frequency"] == "servo"
    again = layer_of("joint_position", robot, **saved["layer_options"])
    np.testing.assert_allclose(again.gains.stiffness, STIFF)
