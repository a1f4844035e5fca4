"""Every way a robot description can be wrong, and the one message each of them gives."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    RobotError,
    ShapeError,
    UnknownOptionError,
)
from fbid_gym.robots import Robot, load
from fbid_gym.robots.built_in import asset_path

GOOD = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <site name="mark"/>
    <geom name="stone" type="sphere" size="0.1" pos="5 0 0"/>
    <body name="trunk" pos="0 0 1">
      <freejoint name="root"/>
      <geom name="box" type="box" size="0.1 0.1 0.1" mass="2"/>
      <body name="thigh" pos="0 0 -0.2">
        <joint name="hip" axis="0 1 0" range="-1 1"/>
        <geom name="bar" type="capsule" size="0.02 0.1" mass="1"/>
        <site name="heel" pos="0 0 -0.1"/>
        <site name="heel_twin" pos="0 0 -0.1"/>
        <body name="shank" pos="0 0 -0.2">
          <joint name="knee" axis="0 1 0" range="-1 1"/>
          <geom name="toe" type="sphere" size="0.03" mass="0.5" pos="0 0 -0.2"/>
          <geom name="toe2" type="sphere" size="0.03" mass="0.5" pos="0.1 0 -0.2"/>
          <geom name="big" type="sphere" size="0.04" mass="0.5" pos="-0.1 0 -0.2"/>
          <site name="tip" pos="0 0 -0.25"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="hip" joint="hip" ctrlrange="-5 5"/>
    <motor name="knee" joint="knee" ctrlrange="-5 5"/>
  </actuator>
</mujoco>
"""
KNEE = '<motor name="knee" joint="knee" ctrlrange="-5 5"/>'
POINTS = "bar, big, heel, heel_twin, tip, toe, toe2"


def build(folder: Path, text: str = GOOD, feet: Any = ("toe",), **arguments: Any) -> Robot:
    path = folder / "robot.xml"
    path.write_text(text)
    return Robot.from_mjcf(path, feet, **arguments)


def fails(kind: type[FbidError], message: str) -> Any:
    return pytest.raises(kind, match=re.escape(message))


def test_what_is_not_there(tmp_path: Path) -> None:
    assert build(tmp_path).joint_names == ("hip", "knee")  # the file the others are spoilt from
    choices = "biped, quadruped, humanoid, go1, g1"
    with fails(UnknownOptionError, f"Unknown robot 'cat'. Valid choices: {choices}."):
        load("cat")
    with fails(RobotError, "Asset 'cat.xml' not found. Looked at: "):
        asset_path("cat.xml")
    with fails(RobotError, "no.xml' does not exist. Expected the path of an MJCF or URDF."):
        Robot.from_mjcf(tmp_path / "no.xml", ["toe"])
    with fails(RobotError, " is a folder. Expected the path of an MJCF or URDF."):
        Robot.load(tmp_path)


def change(*parts: str) -> str:
    """The good file with parts replaced: old, new, old, new."""
    text = GOOD
    for old, new in zip(parts[::2], parts[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    return text


HINGE, ROOT = 'name="knee" axis="0 1 0" range="-1 1"', '<freejoint name="root"/>'
MOTOR, END = '<motor name="hip" joint="hip" ctrlrange="-5 5"/>', "</worldbody>"
BALL = '<body name="ball"><freejoint/><geom size="0.1"/></body></worldbody>'
DOOR = '<body name="door"><joint name="hinge"/><geom size="0.1"/></body></worldbody>'
TIE = '<equality><joint name="tie" joint1="hip" joint2="knee"/></equality></mujoco>'
CORD = '<tendon><fixed name="cord"><joint joint="knee" coef="1"/></fixed></tendon></mujoco>'
AFFINE = '<general name="knee" joint="knee" gaintype="affine" biastype="affine" ctrlrange="-1 1"/>'
FILTER = '<general name="knee" joint="knee" dyntype="filter" dynprm="0.1"/>'
GLUE = KNEE + '<adhesion name="glue" body="shank" ctrlrange="0 1" gain="1"/>'


@pytest.mark.parametrize(
    "text, message",
    [
        ("<mujoco><worldbody>", "robot.xml' is not a valid MJCF: "),
        ("not xml", "robot.xml' is not a valid MJCF: "),
        (change('mass="2"', 'mass="-2"'), "robot.xml' does not compile: "),
        (change(ROOT, ""), "no free joint, so its base does not float. Add one to the base body"),
        (change(END, BALL), "has 2 free joints, on bodies trunk, ball. Expected exactly one."),
        (change(HINGE, 'name="knee" type="free"'), "free joint can only be used on top level"),
        (change(HINGE, 'name="knee" type="ball"', KNEE, ""), "not supported: knee. Expected hinge"),
        (
            change(END, DOOR, KNEE, KNEE + '<motor joint="hinge"/>'),
            "Joints hinge do not belong to the floating tree of 'trunk'.",
        ),
        (change("</mujoco>", TIE), "not supported: tie (joint of hip, knee). Expected a tree"),
        (change(KNEE, ""), "Joints without an actuator: knee. Expected one motor per joint."),
        (change(KNEE, "", MOTOR, ""), "Joints without an actuator: hip, knee."),
        (
            change(KNEE, KNEE + '<motor name="more" joint="knee" ctrlrange="-1 1"/>'),
            "Joint 'knee' has 2 actuators: knee, more. Expected one motor per joint.",
        ),
        (
            change(KNEE, '<position name="knee" joint="knee" kp="5"/>'),
            "Motor 'knee' has no torque limit. Give it a ctrlrange or forcerange, or its joint an",
        ),
        (change(KNEE, AFFINE), "Actuator 'knee' is a servo: its torque depends on the joint's"),
        (change(KNEE, FILTER), "Actuator 'knee' has activation dynamics. Expected plain torque"),
        (change(KNEE, GLUE), "Actuator 'glue' acts on a body, not on a joint."),
        (
            change(KNEE, KNEE + '<motor name="jet" site="tip" ctrlrange="-1 1"/>'),
            "Actuator 'jet' acts on a site, not on a joint.",
        ),
        (
            change('joint="knee" ctrlrange', 'tendon="cord" ctrlrange', "</mujoco>", CORD),
            "Actuator 'knee' acts on a tendon, not on a joint.",
        ),
        (
            change(KNEE, KNEE + '<motor name="lift" joint="root" ctrlrange="-1 1"/>'),
            "Actuator 'lift' acts on the free joint of the base.",
        ),
        (change(KNEE, KNEE.replace("/>", ' gear="0"/>')), "Actuator 'knee' has gear 0."),
        (
            change(KNEE, KNEE.replace("/>", ' armature="0.1"/>')),
            "Actuator 'knee' has armature or damping of its own; give them to the joint instead.",
        ),
        (
            change(KNEE, KNEE.replace("-5 5", "0 5")),
            "Motor 'knee' has the torque range [0, 5]. Expected a finite range on both sides of 0.",
        ),
    ],
)
def test_bad_file(tmp_path: Path, text: str, message: str) -> None:
    with fails(RobotError, message):
        build(tmp_path, text)


@pytest.mark.parametrize(
    "feet, message",
    [
        (["toes"], f"No site or geom 'toes'. Valid choices: {POINTS}."),
        (["box"], "Geom 'box' is a box, which has no single contact point. Name sites at its"),
        (["mark"], f"Contact point 'mark' is fixed to the world. Valid choices: {POINTS}."),
        (["stone"], "Contact point 'stone' is fixed to the world."),
        (["toe", "toe"], "Foot 'toe' is given twice. Expected distinct feet."),
        ({"a": ["toe", "toe"]}, "Contact point 'toe' is given twice. Expected distinct points."),
        ({"a": ["toe"], "b": ["toe"]}, "Contact point 'toe' is given twice."),
        ({"a": []}, "Foot 'a' has 0 contact points. Expected 1 to 8."),
        ({"a": [f"p{i}" for i in range(9)]}, "Foot 'a' has 9 contact points. Expected 1 to 8."),
        (
            {"a": ["tip", "heel"]},
            "Foot 'a' has points on different bodies: tip (shank), heel (thigh).",
        ),
        ({"a": ["tip", "toe"]}, "Foot 'a' mixes sites and geoms: tip (site), toe (geom)."),
        (
            {"a": ["heel", "heel_twin"]},
            "Foot 'a' has points at the same place: heel, heel_twin. Expected distinct points.",
        ),
        (
            {"a": ["toe", "toe2", "big"]},
            "Foot 'a' has spheres of different radii: toe (0.03 m), toe2 (0.03 m), big (0.04 m).",
        ),
    ],
)
def test_bad_feet(tmp_path: Path, feet: Any, message: str) -> None:
    with fails(RobotError, message):
        build(tmp_path, feet=feet)


def test_feet_and_names_of_another_form(tmp_path: Path) -> None:
    for feet in (
        *("toe", [], {}, 3, [1], {"a": [1]}, {1: ["toe"]}, [["toe"], ["toe2"]], [None]),
        *({"a": 3}, {"a": None}, {"a": [["toe"]]}, {"a": b"toe"}, [{"a": "toe"}]),
    ):
        with fails(InvalidValueError, f"Invalid feet: {feet!r}. Expected "):
            build(tmp_path, feet=feet)
    for name in (5, ["dog"], b"dog"):
        with fails(InvalidValueError, f"Invalid name: {name!r}. Expected text."):
            build(tmp_path, name=name)


QPOS = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.2, -0.3]


@pytest.mark.parametrize(
    "home, kind, message",
    [
        ("crouch", UnknownOptionError, "Unknown keyframe 'crouch'. Valid choices: stand."),
        (
            {"ankle": 0.1},
            UnknownOptionError,
            "Unknown joint 'ankle' in home. Valid choices: hip, knee.",
        ),
        ({"hip": "up"}, InvalidValueError, "Invalid home of hip: 'up'. Expected a number."),
        ({"hip": np.nan}, InvalidValueError, "Invalid home of hip: nan. Expected a number."),
        (QPOS[:-1], ShapeError, "home has shape (8,). Expected a whole qpos, (nq,) = (9,)."),
        ([*QPOS[:-1], np.inf], NonFiniteError, "home is not finite: first NaN or infinity at"),
        (["a", "b"], InvalidValueError, "Invalid home: ['a', 'b']. Expected a mapping joint"),
        (
            {"hip": 1.5, "knee": -2.0},
            RobotError,
            "Home joints outside their range: hip = 1.5 not in [-1, 1]; knee = -2 not in [-1, 1].",
        ),
        (
            [0, 0, 1, 0, 0, 0, 0, 0, 0],
            RobotError,
            "The base quaternion home[3:7] is zero. Expected a unit quaternion.",
        ),
    ],
)
def test_bad_home(tmp_path: Path, home: Any, kind: type[FbidError], message: str) -> None:
    with fails(kind, message):
        build(tmp_path, home=home)


def test_a_joint_without_a_name_gets_one_that_no_other_has(tmp_path: Path) -> None:
    """The third joint has none, and the second the one that it would get."""
    text = GOOD.replace(KNEE, "").replace('<joint name="knee" axis', "<joint axis")
    text = text.replace('joint="hip"', 'joint="joint_2"').replace('name="hip"', 'name="joint_2"')
    robot = build(tmp_path, text, torque_limit=5.0)
    assert robot.joint_names == ("joint_2", "joint_2_")


def test_bad_base(tmp_path: Path) -> None:
    with fails(RobotError, "The free joint is on body 'trunk', not on base='thigh'."):
        build(tmp_path, base="thigh")
    fixed = change('<freejoint name="root"/>', "")
    with fails(RobotError, "No top-level body 'thigh'. Valid choices: trunk."):
        build(tmp_path, fixed, base="thigh")
    hinged = change('<freejoint name="root"/>', '<joint name="swing"/>')
    with fails(RobotError, "Body 'trunk' cannot be made to float: it already has the joints swing"):
        build(tmp_path, hinged, base="trunk")


def test_equality_constraints_that_are_off_tie_nothing(tmp_path: Path) -> None:
    tie = '<equality><joint name="tie" joint1="hip" joint2="knee" active="false"/></equality>'
    assert build(tmp_path, change("</mujoco>", tie + "</mujoco>")).num_joints == 2
