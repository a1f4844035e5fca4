"""Tables of motors: what they mean for a robot, and what is refused."""

import copy
import json

import numpy as np
import pytest

from fbid_gym.errors import FbidError, InvalidValueError, UnknownOptionError
from fbid_gym.robots import ROBOTS, Robot, load
from fbid_gym.robots.built_in import GO1
from fbid_gym.robots.data_sheets import motor_sheet
from fbid_gym.robots.drives import complete_table, least_and_most, torque_line, with_motors
from fbid_gym.runtime.config import EnvConfig


@pytest.mark.parametrize("name", ROBOTS)
def test_every_built_in_robot_has_a_data_sheet_that_fits(name: str) -> None:
    robot = load(name)
    own = with_motors(robot, "data_sheet", motor_sheet(robot))
    assert own.drives is not None
    line = own.drives.line
    assert (line.fading > 0.0).all() and np.isfinite(line.fading).all()
    np.testing.assert_array_equal(line.torque, robot.torque_limit)
    assert own.model is robot.model and own.joint_names == robot.joint_names
    assert with_motors(robot, "data_sheet", motor_sheet(robot)) is own
    assert copy.copy(own) is own and with_motors(robot, "ideal") is robot
    told = complete_table(robot, "data_sheet", motor_sheet(robot))
    assert with_motors(robot, json.loads(json.dumps(told))) is own


def test_torque_falls_along_the_line_while_driving_and_not_while_braking() -> None:
    robot = load("go1")
    table = {"no_load_speed": {"*": 30.0, "*_knee": 20.0}, "full_speed": 10.0, "strength": 0.5}
    own = with_motors(robot, table)
    line, knee = torque_line(own), robot.joint_names.index("hind_left_knee")
    limit = 0.5 * robot.torque_limit[knee]
    assert own.torque_limit[knee] == line.torque[knee] == limit
    for speed, share in ((0.0, 1.0), (10.0, 1.0), (15.0, 0.5), (20.0, 0.0), (99.0, 0.0)):
        forwards = least_and_most(line, knee, speed, 1.0)
        np.testing.assert_allclose(forwards, (-limit, share * limit), atol=1e-12)
        backwards = least_and_most(line, knee, -speed, 1.0)
        np.testing.assert_allclose(backwards, (-share * limit, limit), atol=1e-12)
        # A fuller battery stretches the speeds.
        stretched = least_and_most(line, knee, 1.2 * speed, 1.2)
        np.testing.assert_allclose(stretched, forwards, atol=1e-12)
    ideal = torque_line(robot)
    whole = robot.torque_limit[knee]
    assert least_and_most(ideal, knee, 1e6, 1.0) == (-whole, whole)


@pytest.mark.parametrize(
    ("motors", "error", "words"),
    [
        ("perfect", UnknownOptionError, "'perfect'.*ideal, data_sheet"),
        (3, InvalidValueError, "motors: 3"),
        ({"no_load": 3.0}, UnknownOptionError, "'no_load'.*Did you mean|no_load_speed"),
        ({"lag": -0.1}, InvalidValueError, "motors lag: -0.1"),
        ({"lag": float("nan")}, InvalidValueError, "motors lag: nan"),
        ({"no_load_speed": {"*_knee": "fast"}}, InvalidValueError, r"no_load_speed of \*_knee"),
        ({"no_load_speed": {"*_wheel": 3.0}}, UnknownOptionError, r"'\*_wheel'.*joint|joint"),
        ({"full_speed": 3.0}, InvalidValueError, "full_speed: 3.0.*no_load_speed"),
        (
            {"no_load_speed": 3.0, "full_speed": {"*_knee": 5.0}},
            InvalidValueError,
            "full_speed: 5.0.*3 rad/s, at joint",
        ),
        ({"strength": 1.5}, InvalidValueError, "strength: 1.5"),
        ({"battery_power": 0.0}, InvalidValueError, "battery_power: 0.0"),
        ({"base": "mine"}, InvalidValueError, "base: 'mine'"),
    ],
)
def test_bad_tables_get_one_error_by_name(
    motors: object, error: type[FbidError], words: str
) -> None:
    with pytest.raises(error, match=words):
        EnvConfig.of({"robot": "go1", "motors": motors}).load_robot()


def test_a_robot_of_the_users_has_no_data_sheet_whatever_its_name() -> None:
    built_in = load("go1")
    own = Robot.from_mjcf(built_in.spec.to_xml(), GO1.feet, name="go1", home=GO1.home)
    with pytest.raises(InvalidValueError, match="'go1' has no data sheet"):
        EnvConfig.of({"robot": own, "motors": "data_sheet"}).load_robot()
    assert EnvConfig.of({"robot": own, "motors": {"lag": 0.01}}).load_robot().drives is not None


def test_the_resolved_table_means_the_same() -> None:
    told = EnvConfig.of({"robot": "g1", "motors": {"base": "data_sheet", "lag": 0.002}}).resolved()
    assert "base" not in told["motors"] and told["motors"]["no_load_speed"]["*_knee"] == 22.7
    again = EnvConfig.of({"robot": "g1", "motors": told["motors"]})
    assert again.resolved()["motors"] == told["motors"]
    assert EnvConfig.of({"robot": "g1"}).resolved()["motors"] == "ideal"
