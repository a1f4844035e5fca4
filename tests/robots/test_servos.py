"""Servos become motors of the same strength, and their gains are what MuJoCo made of them."""

import re
from typing import Any

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot
from tests.robots.test_robot_errors import KNEE, ROOT, change
from tests.robots.test_robot_errors import MOTOR as HIP

DEFAULTS = """<default><joint {default}/>
  <default class="strong"><position kp="40" kv="3" forcerange="-8 8" ctrlrange="-1 1"/></default>
</default>"""
LEG = change(
    *('angle="radian"/>', f'angle="radian" autolimits="true"/><option gravity="0 0 0"/>{DEFAULTS}'),
    *(ROOT, "{root}", 'name="hip" axis', 'name="hip" {hip} axis', 'name="knee" axis'),
    *('name="knee" {knee} axis', HIP, "{actuators}", KNEE, "", "</mujoco>", "{keyframe}</mujoco>"),
)
# Of the knee; all but two of them have a torque limit of 8 N·m.
SERVOS = {
    "position": 'position kp="40" kv="3" forcerange="-8 8" ctrlrange="-1 1"',
    "position by default": 'position class="strong"',
    "position with a gear": 'position kp="4" kv="0.5" gear="3" forcerange="-2 2"',
    "position with a damping ratio": 'position kp="40" dampratio="1" forcerange="-8 8"',
    "position with a filter": 'position kp="40" kv="1" timeconst="0.02"',
    "affine": 'general gainprm="30" biastype="affine" biasprm="0 -30 -2" forcerange="-8 9"',
    "velocity": 'velocity kv="4" forcerange="-8 8"',
    "integrated velocity": 'intvelocity kp="40" kv="2" forcerange="-8 8" actrange="-1 1"',
}
LIMITS = {"position with a gear": 6.0, "position with a filter": 9.0}
USUAL = {"hip": "", "knee": "", "keyframe": "", "default": 'armature="0.01"'}


def text(actuators: str, root: str = "<freejoint/>", **parts: str) -> str:
    return LEG.format(actuators=actuators, root=root, **USUAL | parts)


def servo_of(kind: str) -> str:
    return f'<{SERVOS[kind]} joint="knee"/>'


def torque(robot: Robot, values: np.ndarray) -> np.ndarray:
    """(n,) N·m that act on the joints when `values` are asked for."""
    data = mujoco.MjData(robot.model)
    data.qpos[2] = 3.0
    data.qvel[6:] = 0.3
    data.ctrl[robot.actuator] = values / robot.gear
    mujoco.mj_forward(robot.model, data)
    return data.qfrc_actuator[6:].copy()


@pytest.mark.parametrize("kind", SERVOS)
def test_a_servo_becomes_a_motor_with_its_force_limits(kind: str) -> None:
    limit = LIMITS.get(kind, 8.0)
    knee = 'actuatorfrcrange="-9 9"' if limit == 9.0 else ""
    robot = Robot.from_mjcf(text(HIP + servo_of(kind), knee=knee), ["toe"], home={})
    np.testing.assert_allclose(robot.torque_limit, [5.0, limit])
    for share in (0.5, -1.0, 3.0):
        expected = np.clip(share * robot.torque_limit, -robot.torque_limit, robot.torque_limit)
        if kind == "affine" and share == 3.0:
            expected[1] = 9.0
        np.testing.assert_allclose(torque(robot, share * robot.torque_limit), expected)
    assert robot.notes == ("Torque motors in place of 1 servos: see servo_gains.",)
    assert robot.notes[0] in repr(robot)


@pytest.mark.parametrize("kind", SERVOS)
def test_gains_are_what_the_servo_did(kind: str) -> None:
    """Against MuJoCo's own servo, by differences of its torque."""
    unlimited = re.sub('(forcerange|ctrlrange|actrange)="[^"]*"', "", servo_of(kind))
    if kind == "integrated velocity":
        unlimited = unlimited.replace("/>", ' actrange="-1 1"/>')
    model = mujoco.MjModel.from_xml_string(text(unlimited))
    found = Robot.from_mjcf(text(HIP + unlimited), ["toe"], torque_limit={"knee": 9.0}).servo_gains

    def servo_torque(angle: float, rate: float) -> float:
        data = mujoco.MjData(model)
        data.qpos[8], data.qvel[7] = angle, rate
        mujoco.mj_forward(model, data)
        return float(data.qfrc_actuator[7])

    rest = servo_torque(0.0, 0.0)
    assert found.stiffness == pytest.approx([0.0, (rest - servo_torque(0.01, 0.0)) / 0.01])
    assert found.damping == pytest.approx([0.0, (rest - servo_torque(0.0, 0.01)) / 0.01])


def test_a_file_without_servos_has_no_gains() -> None:
    motors = HIP + '<motor joint="knee" ctrlrange="-5 5"/>'
    assert Robot.from_mjcf(text(motors), ["toe"]).servo_gains is None


@pytest.mark.parametrize("knee", ["", 'actuatorfrcrange="-3 3"'])
def test_missing_motors_are_added_where_limits_are_known(knee: str) -> None:
    given = None if knee else {"kn*": 3.0}
    robot = Robot.from_mjcf(text(HIP, knee=knee), ["toe"], home={}, torque_limit=given)
    np.testing.assert_allclose(robot.torque_limit, [5.0, 3.0])
    np.testing.assert_allclose(torque(robot, np.array([9.0, 9.0])), [5.0, 3.0])
    assert robot.notes == ("Torque motors added on knee.",)


def test_without_any_actuator_one_number_will_do() -> None:
    robot = Robot.from_mjcf(text(""), ["toe"], home={}, torque_limit=7)
    np.testing.assert_allclose(robot.torque_limit, 7.0)
    assert robot.notes == ("Torque motors added on all joints.",)


def test_limits_that_are_given_replace_those_of_the_file() -> None:
    strong = '<motor joint="knee" gear="10" ctrlrange="-0.1 0.1" forcerange="-0.2 0.2"/>'
    told, limits = text(HIP + strong, knee='actuatorfrcrange="-1 1"'), {"*": 20.0, "hip": 4.0}
    robot = Robot.from_mjcf(told, ["toe"], torque_limit=limits, home={})
    np.testing.assert_allclose(robot.torque_limit, [4.0, 20.0])
    np.testing.assert_allclose(torque(robot, np.array([-9.0, 90.0])), [-4.0, 20.0])
    assert robot.notes == ("Torque limits as given on all joints.",)


def test_armature_by_name_and_pattern() -> None:
    given = {"torque_limit": 7, "armature": {"*": 0.02, "hip": 0.03}}
    robot = Robot.from_mjcf(text("", default=""), ["toe"], **given)
    np.testing.assert_allclose(robot.model.dof_armature, [0.0] * 6 + [0.03, 0.02])
    assert "Armature as given on hip, knee." in robot.notes


def test_keyframes_keep_their_poses_when_actuators_come() -> None:
    key = '<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0.2 -0.3" ctrl="1"/></keyframe>'
    robot = Robot.from_mjcf(text(HIP, keyframe=key), ["toe"], torque_limit={"knee": 3.0})
    np.testing.assert_allclose(robot.home_qpos[7:], [0.2, -0.3])


@pytest.mark.parametrize("loss", ["armature", "damping", "frictionloss", "stiffness"])
def test_the_free_joint_loses_what_falsifies_the_momentum(loss: str) -> None:
    """It comes from defaults; the other joints keep it."""
    free = text("", default=f'{loss}="0.1"', root='<joint type="free"/>')
    robot = Robot.from_mjcf(free, ["toe"], torque_limit=5)
    note = f"Removed from the free joint, where it would falsify the momentum: {loss} 0.1."
    assert note in robot.notes
    model, data = robot.model, mujoco.MjData(robot.model)
    for field in (model.dof_armature, model.dof_damping, model.dof_frictionloss):
        assert not np.any(field[:6])
    assert not np.any(model.jnt_stiffness[0])
    mujoco.mj_forward(model, data)
    mass = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    np.testing.assert_allclose(mass[:3, :3], robot.mass * np.eye(3), atol=1e-9)


def test_a_solver_that_stops_early_is_told_to_go_on() -> None:
    mjx = text("").replace("<option", '<option iterations="1" ls_iterations="5"')
    robot = Robot.from_mjcf(mjx, ["toe"], torque_limit=5)
    assert (robot.model.opt.iterations, robot.model.opt.ls_iterations) == (100, 50)
    assert "Solver iterations raised from 1 to 100." in robot.notes


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"torque_limit": {"ankle*": 3.0}}, "Unknown joint 'ankle*' in torque_limit. Valid choi"),
        ({"torque_limit": {"knee": "strong"}}, "torque_limit of knee: 'strong'. Expected a pos"),
        ({"torque_limit": -3}, "torque_limit of *: -3. Expected a positive finite number."),
        ({"torque_limit": 3, "armature": {"knee": 0.0}}, "armature of knee: 0.0. Expected a pos"),
        ({"torque_limit": {"knee": 3.0}}, "Joints without an actuator: hip. Expected one motor"),
    ],
)
def test_bad_motors(options: dict[str, Any], message: str) -> None:
    with pytest.raises(FbidError, match=re.escape(message)):
        Robot.from_mjcf(text(""), ["toe"], **options)


def test_motors_that_are_added_take_nothing_from_the_files_defaults() -> None:
    """These are meant for the actuators that the file has itself."""
    limited = text("", default="", **dict.fromkeys(("hip", "knee"), 'actuatorfrcrange="-50 50"'))
    usual = '<position kp="100" ctrlrange="-1 1" forcerange="-20 20"/><motor gear="3"/>'
    robot = Robot.from_mjcf(limited.replace("<default>", f"<default>{usual}", 1), ["toe"])
    np.testing.assert_array_equal(robot.torque_limit, 50.0)
    data = mujoco.MjData(robot.model)
    data.ctrl[:] = 30.0
    mujoco.mj_forward(robot.model, data)
    np.testing.assert_allclose(data.qfrc_actuator[6:], 30.0)
