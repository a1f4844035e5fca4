"""Standing poses of robots whose own are known, and of those that cannot stand."""

import numpy as np
import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import ROBOTS, Robot, load, zoo
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.stand import standing_pose
from tests.pairs import pairs
from tests.postures import points, posed
from tests.robots.test_source_urdf import urdf


def assert_stands(robot: Robot, qpos: np.ndarray, tolerance: float) -> None:
    """Its feet level, and its centre of mass over the middle of them."""
    data = posed(robot, qpos)
    touching = points(robot, data)
    assert np.ptp(touching[:, 2]) < tolerance
    com = data.subtree_com[robot.base_body]
    np.testing.assert_allclose(com[:2], touching.mean(axis=0)[:2], atol=tolerance)


@pytest.mark.parametrize("name", ROBOTS)
def test_built_in_robots_stand_up_from_straight_legs(name: str) -> None:
    """From the reference pose, on bent knees that point where those of their own home do."""
    robot = load(name)
    reference = robot.model.qpos0.copy()
    reference[7:] = np.clip(reference[7:], *robot.joint_range.T)
    pose = standing_pose(MeasuredModel(robot.model, reference), robot.feet)
    knees = [i for i, joint in enumerate(robot.joint_names) if "knee" in joint]
    assert np.all(np.abs(pose[7:][knees]) > 0.3)
    assert np.all(np.sign(pose[7:][knees]) == np.sign(robot.home_qpos[7:][knees]))
    assert_stands(robot, pose, 1e-3 * robot.home_qpos[2])


def test_a_keyframe_is_where_standing_up_begins() -> None:
    animal = zoo.draw(22)
    robot = Robot.from_mjcf(zoo.mjcf(animal), home="stand")
    pose = robot.home_qpos.copy()
    pose[3:7] = [np.cos(0.002), 0.0, np.sin(0.002), 0.0]  # leaning a little
    key = f'<keyframe><key name="home" qpos="{" ".join(map(str, pose))}"/></keyframe>'
    text = zoo.mjcf(animal).replace("</mujoco>", key + "</mujoco>")
    leaning = Robot.from_mjcf(text, home="stand")
    np.testing.assert_allclose(leaning.home_qpos[3:7], pose[3:7])
    np.testing.assert_allclose(leaning.home_qpos[7:], pose[7:], atol=0.02)


def test_straight_legs_bend_even_where_ranges_do_not_say_which_way() -> None:
    robot = Robot.from_mjcf(urdf(), home="stand")  # knees from -2 to 2 rad
    knees = [i for i, joint in enumerate(robot.joint_names) if "knee" in joint]
    assert np.all(robot.home_qpos[7:][knees] > 0.5)  # about y: the knees ahead of the feet
    assert robot.home_qpos[2] == pytest.approx(0.7 * 0.4 + 0.02, abs=0.02)


def test_a_urdf_stands_unless_told_otherwise_or_it_cannot() -> None:
    """Its reference pose is where all joints are at 0: straight legs, or folded ones."""
    given, reference = Robot.from_mjcf(urdf()), Robot.from_mjcf(urdf(), home={})
    np.testing.assert_array_equal(given.home_qpos, Robot.from_mjcf(urdf(), home="stand").home_qpos)
    assert "Home is a standing pose that was searched for." in given.notes
    assert np.all(reference.home_qpos[7:] == 0.0)
    ahead = '<inertial><origin xyz="1 0 0"/><mass value="5.0"/>'
    falls = Robot.from_mjcf(urdf().replace('<inertial><mass value="5.0"/>', ahead))
    assert any("reference pose. No standing pose found" in note for note in falls.notes)
    assert np.all(falls.home_qpos[7:] == 0.0)


def test_an_mjcf_whose_reference_pose_is_no_stance_stands_up() -> None:
    """Straight legs are none, nor feet behind the centre of mass; a keyframe is as it is."""
    straight, searched = two_legs(BOX), "Home is a standing pose that was searched for."
    joints = {"torque_limit": 100, "armature": 0.01}
    robot = Robot.from_mjcf(straight, **joints)
    assert searched in robot.notes
    assert_stands(robot, robot.home_qpos, 1e-3)
    key = '<keyframe><key name="home"/></keyframe></mujoco>'
    for drawn in (straight.replace("</mujoco>", key), zoo.mjcf(zoo.draw(22))):
        kept = Robot.from_mjcf(drawn, torque_limit=100)
        assert searched not in kept.notes
        np.testing.assert_array_equal(kept.home_qpos[7:], 0.0)


def test_other_legs_than_the_feet_do_not_end_in_the_ground() -> None:
    """Two of four feet are told: if their legs bend, the others are lower."""
    animal = zoo.draw(22)
    text = zoo.mjcf(animal)
    robot = Robot.from_mjcf(text, ["foot0", "foot1"], torque_limit=zoo.torque_limit(animal))
    assert any("would be" in note and "mm in the ground" in note for note in robot.notes)
    np.testing.assert_array_equal(robot.home_qpos[7:], 0.0)


def test_feet_that_no_hinge_moves() -> None:
    text = """
    <mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
      <body name="arm"><joint name="hip" axis="0 1 0"/><geom size="0.1" pos="1 0 0"/></body>
      <body name="stump"><geom size="0.1" pos="0 0 -1"/></body>
    </body></worldbody></mujoco>"""
    with pytest.raises(RobotError, match="No standing pose found: no hinge moves foot 'stump'"):
        Robot.from_mjcf(text, ["stump"], home="stand", torque_limit=1)


def test_a_robot_that_cannot_get_above_its_feet() -> None:
    animal = zoo.draw(3)  # on two legs
    trunk = f'size="{" ".join(f"{value:.17g}" for value in animal.trunk)}"'
    text = zoo.mjcf(animal).replace(trunk, f'{trunk} pos="{3 * animal.leg} 0 0"', 1)
    with pytest.raises(RobotError, match="No standing pose found: contact points differ by"):
        Robot.from_mjcf(text, home="stand", torque_limit=zoo.torque_limit(animal))


def test_feet_may_be_on_bodies_without_names() -> None:
    legs = "".join(
        f'<body pos="{x} 0 -0.2"><joint axis="0 1 0" range="-1 1"/><geom size="0.05"/>'
        f'<site name="{name}" pos="0 0 -0.05"/></body>'
        for x, name in ((-0.1, "hind"), (0.1, "front"))
    )
    trunk = '<body name="trunk" pos="0 0 1"><freejoint/><geom size="0.1"/>'
    text = f"<mujoco><worldbody>{trunk}{legs}</body></worldbody></mujoco>"
    robot = Robot.from_mjcf(text, ["hind", "front"], torque_limit=1)
    assert [foot.name for foot in robot.feet] == ["hind", "front"]


def two_legs(feet: str, knees: str = "-0.1 2", tilt: float = 0.0) -> str:
    """A biped on boxes of 0.2 m by 0.1 m; the range of its knees, and how its feet are drawn."""
    legs = "".join(
        f"""<body pos="0 {y} -0.05">
          <joint name="{side}_roll" axis="1 0 0" range="-1 1"/>
          <joint name="{side}_hip" axis="0 1 0" range="-2 2"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/>
          <body pos="0 0 -0.3"><joint name="{side}_knee" axis="0 1 0" range="{knees}"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/>
            <body name="{side}_foot" pos="0 0 -0.3" euler="0 {tilt} 0">
              <joint name="{side}_ankle" axis="0 1 0" range="-2 2"/>
              <joint name="{side}_ankle_roll" axis="1 0 0" range="-1 1"/>{feet}
            </body></body></body>"""
        for side, y in (("left", 0.12), ("right", -0.12))
    )
    return f"""<mujoco><compiler angle="radian"/><worldbody>
      <body name="trunk" pos="0 0 1"><freejoint/>
        <geom type="box" size="0.1 0.15 0.15" pos="0 0 0.15" mass="10"/>{legs}
      </body></worldbody></mujoco>"""


BOX = '<geom type="box" size="0.1 0.05 0.02" pos="0.03 0 -0.04" mass="0.5"/>'
BALLS = "".join(
    f'<geom size="0.02" pos="{x} {y} -0.04" mass="0.1"/>'
    for x in (-0.07, 0.13)
    for y in (-0.05, 0.05)
)


NAMED = ["left_foot", "right_foot"]


@pytest.mark.parametrize(
    ("knees", "tilt", "feet", "named"),
    pairs(
        [("-0.1 2", 0.0), ("1.1 2", 0.0), ("-0.1 2", 0.6), ("0.4 2", -0.4)],
        pairs([BOX, BALLS], [NAMED, None]),
    ),
)
def test_feet_stand_on_their_soles_however_they_are_tilted_before(knees, tilt, feet, named) -> None:
    joints = {"torque_limit": 100, "armature": 0.01}
    robot = Robot.from_mjcf(two_legs(feet, knees, tilt), named, home="stand", **joints)
    data = posed(robot)
    for foot in robot.feet:
        assert foot.num_points == 4
        assert np.ptp(foot.points, axis=0) == pytest.approx([0.2, 0.1, 0.0], abs=1e-6)
        assert data.xmat[foot.body][8] == pytest.approx(1.0, abs=1e-4)  # its z axis
    assert robot.check() == []


ARC = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
BELOW = np.column_stack([0.03 + 0.1 * np.cos(ARC), 0.05 * np.sin(ARC), np.full(24, -0.06)])
VERTICES = " ".join(f"{v:.6g}" for v in [*BELOW.ravel(), *(BELOW + [0, 0, 0.04]).ravel()])
ROUND = '<geom type="mesh" mesh="sole" mass="0.5"/>'
ASSET = f'<asset><mesh name="sole" vertex="{VERTICES}"/></asset>'
HEEL_TO_TOE = '<geom type="capsule" fromto="-0.07 0 -0.04 0.13 0 -0.04" size="0.02" mass="0.5"/>'


@pytest.mark.parametrize(
    ("knees", "tilt", "feet", "length"),
    pairs(
        [("0 2", 0.0), ("0.2 2", 0.0), ("0.7 2", 0.0), ("0.35 2", 0.6)],
        [(ROUND, 0.19), (HEEL_TO_TOE, 0.2), (BOX, 0.2)],
    ),
)
def test_feet_stand_on_all_of_their_length(knees, tilt, feet, length) -> None:
    text = two_legs(feet, knees, tilt).replace("<worldbody>", f"{ASSET}<worldbody>")
    robot = Robot.from_mjcf(text, NAMED, home="stand", torque_limit=100, armature=0.01)
    data = posed(robot)
    for foot in robot.feet:
        # A line's ends cannot be drawn tilted by more than it is told from where it touches.
        if feet != HEEL_TO_TOE or not tilt:
            assert np.ptp(foot.points[:, 0]) > length - 1e-6
            assert data.xmat[foot.body][8] == pytest.approx(1.0, abs=1e-3)  # its z axis
        facing = np.arctan2(data.xmat[foot.body][3], data.xmat[foot.body][0])
        assert abs(facing) < 0.05


def test_a_foot_on_its_edge_is_told() -> None:
    pitched = {f"{side}_ankle": 0.3 for side in ("left", "right")}
    robot = Robot.from_mjcf(two_legs(BOX), NAMED, home=pitched, torque_limit=100)
    told = [line for line in robot.check() if "edge" in line]
    edge = "an edge at home: the flat side nearest to the ground is tilted by 17 degrees."
    assert told == [f"Foot '{side}_foot' stands on {edge}" for side in ("left", "right")]
