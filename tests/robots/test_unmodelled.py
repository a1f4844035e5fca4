"""What acts on a robot and stands in no law's equation of motion is refused by name."""

import numpy as np
import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import Robot
from fbid_gym.robots.home_check import contact_of_feet
from fbid_gym.runtime.config import EnvConfig
from tests.postures import posed
from tests.robots.test_robot_errors import GOOD, fails

BLIND = 'contype="0" conaffinity="0" '
FLOOR = f'<worldbody><geom name="floor" type="plane" size="0 0 1" {BLIND}/>'

STONE = '<geom name="stone" type="sphere" size="0.1" pos="5 0 0"/>'


def cord(attributes: str) -> str:
    joints = '<joint joint="hip" coef="1"/><joint joint="knee" coef="1"/>'
    tendon = f'<tendon><fixed name="cord" {attributes}>{joints}</fixed></tendon>'
    return GOOD.replace("</mujoco>", f"{tendon}</mujoco>")


def option(inside: str) -> str:
    return GOOD.replace("<worldbody>", f"<option {inside}<worldbody>")


def paired(geom: str, other: str = "floor") -> str:
    text = GOOD.replace(f'name="{geom}"', f'name="{geom}" {BLIND}').replace(STONE, "")
    pair = f'<contact><pair geom1="{other}" geom2="{geom}"/></contact></mujoco>'
    return text.replace("<worldbody>", FLOOR).replace("</mujoco>", pair)


@pytest.mark.parametrize(
    "attributes",
    [
        *('stiffness="9"', 'damping="2"', 'damping="0 2"', 'frictionloss="1"'),
        *('armature="0.1"', 'limited="true" range="-1 1"'),
    ],
)
def test_tendons_that_act_are_refused(attributes: str) -> None:
    with fails(RobotError, "Tendons that act are not supported: cord. Expected none with stiffn"):
        Robot.from_mjcf(cord(attributes), ["toe"])


def test_tendons_that_only_measure_are_none_of_them() -> None:
    """They move nothing: the same robot accelerates as it does without."""
    found = []
    for text in (GOOD, cord('margin="0.1"')):
        robot = Robot.from_mjcf(text, ["toe"])
        found.append(posed(robot, robot.home_qpos, 0.3).qacc)
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    "text, message",
    [
        (
            GOOD.replace('name="shank"', 'name="shank" gravcomp="0.5"'),
            "Compensated gravity is not supported: gravcomp of the bodies shank.",
        ),
        (option('><flag actuation="disable"/></option>'), "The file switches actuation off: "),
        (option('><flag gravity="disable"/></option>'), "The file switches gravity off: "),
        (
            option('actuatorgroupdisable="0 3"/>'),
            "The file switches actuators off: actuatorgroupdisable of the groups 0, 3.",
        ),
        (option('density="1.2"/>'), "A fluid about the robot is not supported: density 1.2 of <o"),
        (option('viscosity="0.1"/>'), "A fluid about the robot is not supported: viscosity 0.1"),
        (option('wind="1 0 0"/>'), "A fluid about the robot is not supported: wind [1. 0. 0.]"),
    ],
)
def test_what_acts_on_the_whole_robot_is_refused(text: str, message: str) -> None:
    with fails(RobotError, message):
        Robot.from_mjcf(text, ["toe"])


@pytest.mark.parametrize("floor", [FLOOR, "<worldbody>"])
def test_feet_that_touch_the_ground_by_pairs_touch_any_ground(floor: str) -> None:
    """By the pair's friction; no terrain is in a pair. The ground may be in another file."""
    pair = '<pair geom1="floor" geom2="toe" condim="3" friction="0.4 0.4"'
    text = paired("toe").replace(FLOOR, floor).replace('<pair geom1="floor" geom2="toe"', pair)
    robot = Robot.from_mjcf(text, ["toe"])
    assert robot.model.npair == 0
    assert "Touch any ground, not only that of a <pair>: toe." in robot.notes
    assert contact_of_feet(robot.at_home, robot.feet).friction == 0.4
    assert not any("carry nothing" in sentence for sentence in robot.check())


def test_pairs_of_the_robots_own_parts_are_no_touch_of_the_ground() -> None:
    robot = Robot.from_mjcf(paired("toe2", "bar"), ["toe"])
    assert robot.model.npair == 1
    assert any(robot.model.geom(i).name == "fbid_ground" for i in range(robot.model.ngeom))


@pytest.mark.parametrize("step", ["0", "-0.001", "1e-9"])
def test_the_files_own_time_step_means_nothing(step: str) -> None:
    """Environments have one of their own."""
    robot = Robot.from_mjcf(option(f'timestep="{step}"/>'), ["toe"])
    assert robot.check() == Robot.from_mjcf(GOOD, ["toe"]).check()


@pytest.mark.parametrize("gravity", ["0 0 0", "0 0 9.81", "0 -9.81 0"])
def test_who_stands_and_walks_is_pulled_down(gravity: str) -> None:
    robot = Robot.from_mjcf(option(f'gravity="{gravity}"/>'), ["toe"])
    with fails(RobotError, f'gravity="{gravity}" does not pull down. Expected "0 0 -9.81" or '):
        EnvConfig(robot=robot).load_robot()
