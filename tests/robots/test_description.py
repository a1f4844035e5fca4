"""`robot.toml` says of a robot what its file does not."""

from pathlib import Path

import numpy as np
import pytest

from fbid_gym.errors import InvalidValueError, RobotError, UnknownOptionError
from fbid_gym.robots import Robot, zoo

ANIMAL = zoo.draw(26)  # of no actuators
TOML = """
mjcf = "zoo.xml"
name = "mine"
feet = ["foot0", "foot1", "foot2", "foot3"]
home = "stand"
armature = 0.05

[torque_limit]
"*" = 5.0
"*_knee" = 30
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "zoo.xml").write_text(zoo.mjcf(ANIMAL))
    (tmp_path / "robot.toml").write_text(TOML)
    return tmp_path


@pytest.mark.parametrize("file", ["robot.toml", "zoo.xml"])
def test_the_file_and_what_is_beside_it_are_one_robot(folder: Path, file: str) -> None:
    robot = Robot.load(folder / file)
    assert (robot.name, robot.foot_names) == ("mine", ANIMAL.foot_names)
    limit = dict(zip(robot.joint_names, robot.torque_limit, strict=True))
    assert limit["leg2_knee"] == 30.0 and limit["leg2_hip_roll"] == 5.0
    np.testing.assert_allclose(robot.model.dof_armature[6:], 0.05)
    asked = {"home": "stand", "torque_limit": {"*": 5.0, "*_knee": 30.0}, "armature": 0.05}
    told = Robot.from_mjcf(folder / "zoo.xml", ANIMAL.foot_names, **asked)
    np.testing.assert_array_equal(robot.home_qpos, told.home_qpos)


def test_without_a_name_of_a_file_it_is_about_the_one_beside_it(folder: Path) -> None:
    (folder / "robot.toml").write_text(TOML.replace('mjcf = "zoo.xml"\n', ""))
    np.testing.assert_allclose(Robot.load(folder / "zoo.xml").model.dof_armature[6:], 0.05)


def test_what_is_said_in_python_goes_first(folder: Path) -> None:
    robot = Robot.load(str(folder / "robot.toml"), {"all": "foot1"}, home=None, torque_limit=7)
    assert robot.foot_names == ("all",)
    np.testing.assert_allclose(robot.torque_limit, 7.0)
    assert robot.home_qpos[2] == pytest.approx(robot.model.qpos0[2], abs=1e-9)


def test_another_file_in_the_folder_is_not_meant(folder: Path) -> None:
    (folder / "other.xml").write_text(zoo.mjcf(ANIMAL))
    with pytest.raises(RobotError, match="Joints without an actuator"):
        Robot.load(folder / "other.xml")


@pytest.mark.parametrize(
    "text, kind, message",
    [
        ("# N·m".encode("latin-1"), RobotError, "robot.toml' is not valid TOML: .*utf-8"),
        ("feet = " + "[" * 3000, RobotError, "robot.toml' is not valid TOML: "),
        ("#" * (2**24 + 1), RobotError, "robot.toml: has more than 16 MB"),
        ("mjcf = 5", InvalidValueError, "Invalid mjcf in robot.toml: 5. Expected the path of"),
        (r'mjcf = "a\u0000"', InvalidValueError, "Invalid mjcf in robot.toml: .* the path of a"),
        ('mjcf = "zoo.xml"\nname = 5', InvalidValueError, "Invalid name: 5. Expected text"),
        ("feet = [", RobotError, "robot.toml' is not valid TOML: "),
        ("foot = 3", UnknownOptionError, "Unknown key 'foot' in robot.toml. Valid choices: mjcf"),
        ("", RobotError, "robot.xml' does not exist."),
        ('mjcf = "cat.xml"', RobotError, "cat.xml',? does not exist."),
    ],
)
def test_bad_descriptions(folder, text, kind, message):
    """Whether they are given, or stand beside what is."""
    content = text if isinstance(text, bytes) else text.encode()
    (folder / "robot.toml").write_bytes(content)
    for given in ("robot.toml", "zoo.xml" if content else "robot.toml"):
        with pytest.raises(kind, match=message):
            Robot.load(folder / given)
