"""Home poses: where a file has its robot, and which way it faces there, is no part of them."""

from typing import Any

import numpy as np
import pytest

from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots import ROBOTS, Robot, load
from tests.postures import posed
from tests.robots.test_robot_errors import GOOD

POSE = [0.3, -0.4]
HEADING_FIRST = 'angle="radian" eulerseq="zyx"'
KEYFRAME = '<keyframe><key name="home" {}/><key name="rest"/></keyframe></mujoco>'


def read(text: str = GOOD, **options: Any) -> Robot:
    return Robot.from_mjcf(text, ["toe"], **options)


def place(attributes: str) -> str:
    return GOOD.replace('name="trunk" pos="0 0 1"', f'name="trunk" {attributes}')


@pytest.mark.parametrize("tilt", ["", "0 0.3 0", "0.2 -0.3 0", "0 1.2 0"])
def test_place_and_heading_in_the_file_do_not_matter(tilt: str) -> None:
    """Turned about the vertical and moved, in a body or a keyframe, it is the same robot."""
    level = tilt.split() or ["0", "0", "0"]
    spec = "{} euler='{}'"
    text = place(spec.format('pos="0 0 1"', " ".join(["0", level[1], level[0]])))
    plain = read(text.replace('angle="radian"', HEADING_FIRST), home={})
    for heading in ("0.7", "-2.5", "3.1415926535897931"):
        turned = place(spec.format('pos="0.4 -0.3 1"', " ".join([heading, level[1], level[0]])))
        moved = read(turned.replace('angle="radian"', HEADING_FIRST), home={})
        np.testing.assert_allclose(moved.home_qpos, plain.home_qpos, atol=1e-12)
        ahead = posed(moved).xmat[moved.base_body]
        assert abs(ahead[3]) < 1e-12 < ahead[0]  # its x axis
        numbers = " ".join(f"{x:.17g}" for x in moved.model.qpos0)
        keyframe = KEYFRAME.format(f'qpos="{numbers}"')
        keyed = GOOD.replace("</mujoco>", keyframe)
        for text, home in ((keyed, None), (GOOD, moved.model.qpos0.tolist())):
            np.testing.assert_allclose(read(text, home=home).home_qpos, plain.home_qpos, atol=1e-9)
        np.testing.assert_allclose(Stance.of(moved).layout, Stance.of(plain).layout, atol=1e-12)


def test_a_base_whose_x_axis_is_vertical_keeps_its_orientation() -> None:
    upright = place('pos="1 2 3" euler="0.4 -1.5707963267948966 0"')
    robot = read(upright.replace('angle="radian"', HEADING_FIRST))
    np.testing.assert_allclose(robot.home_qpos[3:7], robot.model.qpos0[3:7], atol=1e-12)
    np.testing.assert_array_equal(robot.home_qpos[:2], 0.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_built_in_robots_stand_upright_above_the_origin(name: str) -> None:
    qpos = load(name).home_qpos
    assert qpos[:2].tobytes() == np.zeros(2).tobytes()
    assert qpos[3:7].tobytes() == np.array([1.0, 0.0, 0.0, 0.0]).tobytes()


def test_keyframes_of_a_fixed_file_are_joint_angles_of_the_floating_robot() -> None:
    fixed = place('pos="0 0 1.5" euler="0 0.3 0"').replace('<freejoint name="root"/>', "")
    angles = " ".join(map(str, POSE))
    text = fixed.replace("</mujoco>", KEYFRAME.format(f'qpos="{angles}" qvel="1 2"'))
    robot = read(text, base="trunk")
    np.testing.assert_allclose(robot.home_qpos[7:], POSE)
    asked = read(fixed, base="trunk", home={"hip": POSE[0], "knee": POSE[1]})
    np.testing.assert_allclose(robot.home_qpos, asked.home_qpos, atol=1e-12)
    keyframe = robot.model.key("home")
    np.testing.assert_allclose(keyframe.qpos, [*robot.model.qpos0[:7], *POSE])
    np.testing.assert_array_equal(keyframe.qvel, [0, 0, 0, 0, 0, 0, 1, 2])
    np.testing.assert_array_equal(robot.model.key("rest").qpos, robot.model.qpos0)
    assert "Its place was put before the joints of the keyframes home." in robot.notes
    np.testing.assert_allclose(robot.portable().home_qpos, robot.home_qpos, atol=1e-5)
    unposed = read(fixed.replace("</mujoco>", KEYFRAME.format("")), base="trunk")
    assert not any("keyframes" in note for note in unposed.notes)
