"""A robot in Bullet is the robot of its model."""

import copy
import sys

import mujoco
import numpy as np
import pytest

from eval.engines.bullet import BulletWorld
from eval.engines.trial import in_bullet
from eval.rollout import Player
from fbid_gym.errors import FbidError, InvalidValueError, RobotError
from fbid_gym.robots import load
from fbid_gym.runtime import Controller
from tests.postures import sensed

HZ = 100_000


@pytest.fixture(scope="module", autouse=True)
def bullet():
    remedy = "pip install -c constraints.txt 'fbid_gym[bullet]'"
    pytest.importorskip("pybullet", reason=f"pybullet is not installed: {remedy}")


@pytest.mark.parametrize("name", ["go1", "biped", "humanoid"])
def test_it_accelerates_as_in_mujoco(name):
    """In the air, at random states, with torques and a push; the joints' armature aside."""
    robot = load(name)
    world, model = BulletWorld(robot, HZ, armature=False), copy.copy(robot.model)
    model.dof_armature[:], model.opt.timestep = 0.0, 1.0 / HZ
    data, draw = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(5):
        qpos, qvel = robot.home_qpos.copy(), draw.normal(size=robot.nv)
        qpos[:3] += [0.3, 0.2, 2.0]
        qpos[3:7] = (turn := draw.normal(size=4)) / np.linalg.norm(turn)
        qpos[7:] += draw.uniform(-0.2, 0.2, robot.num_joints)
        torque, push = draw.uniform(-0.1, 0.1, robot.num_joints) * robot.torque_limit, np.ones(3)
        data.qpos[:], data.qvel[:], data.ctrl[robot.actuator] = qpos, qvel, torque / robot.gear
        data.xfrc_applied[robot.base_body, :3] = push
        mujoco.mj_forward(model, data)
        world.place(qpos, qvel)
        found, moving = world.state()
        found[3:7] *= np.sign(found[3] * qpos[3])
        np.testing.assert_allclose(found, qpos, rtol=0, atol=1e-12)
        np.testing.assert_allclose(moving, qvel, rtol=0, atol=1e-12)
        world.step(torque, push)
        acceleration = (world.state()[1] - moving) * HZ
        # What is left is what changes within the step.
        size = 1.0 + np.abs(data.qacc).max()
        np.testing.assert_allclose(acceleration, data.qacc, rtol=0, atol=1e-4 * size)
        world.step(torque, np.zeros(3))  # without contacts, nothing is left of the push
    world.close()


@pytest.mark.parametrize("name", ["QuadrupedWalk-v0", "BipedWalk-v0"])
def test_feet_feel_the_weight_of_a_robot_that_stands(name):
    controller = Controller.load(f"shipped:{name}/base_acceleration")
    robot, hz = controller.robot, controller.rates.control
    world = BulletWorld(robot, 4 * hz)
    world.place(robot.home_qpos, np.zeros(robot.nv))
    forces = []
    for _ in range(2 * hz):
        torque = controller.tick(world.sensors())
        for _ in range(4):
            world.step(torque, np.zeros(3))
        forces.append(world.contact_force())
    stands = np.mean(forces[hz:], axis=0)
    np.testing.assert_allclose(stands.sum(axis=0), [0, 0, robot.weight], atol=0.02 * robot.weight)
    loads = stands.reshape(robot.num_feet, -1, 3).sum(axis=1)[:, 2]
    assert (loads > 0.5 * robot.weight / robot.num_feet).all()
    world.close()


def at_their_limit(controller: Controller, read, step, ticks: int) -> float:
    """Share of the ticks at which a motor of a robot that shall stand is at its limit."""
    controller.reset()
    full = 0
    for _ in range(ticks):
        torque = controller.tick(read())
        full += (abs(torque) >= controller.robot.torque_limit).any()
        step(torque)
    return full / ticks


def test_rotors_in_links_and_not_contacts_shake_a_biped_on_stiff_joints():
    """With its rotors' inertia moved into links as in Bullet, MuJoCo's biped is shaken as well."""
    own = {"action_layer": "joint_position"}
    controller = Controller.of_environment("fbid_gym/BipedWalk-v0", own)
    robot, ticks = controller.robot, 60
    shaken = {}
    for moved in (False, True):
        model = copy.copy(robot.model)
        model.opt.timestep = 0.001
        if moved:
            for joint in range(1, model.njnt):
                body, dof = model.jnt_bodyid[joint], model.jnt_dofadr[joint]
                axes, axis = np.zeros(9), model.jnt_axis[joint]
                mujoco.mju_quat2Mat(axes, model.body_iquat[body])
                axes = axes.reshape(3, 3)
                tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
                tensor += model.dof_armature[dof] * np.outer(axis, axis)
                model.body_inertia[body], axes = np.linalg.eigh(tensor)
                axes[:, 2] *= np.linalg.det(axes)
                mujoco.mju_mat2Quat(model.body_iquat[body], np.ascontiguousarray(axes).ravel())
            model.dof_armature[:] = 0.0
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        mujoco.mj_resetData(model, data)
        data.qpos[:] = robot.home_qpos
        mujoco.mj_forward(model, data)

        def read(data=data):
            return sensed(data.qpos, data.qvel, data.sensordata[robot.contact_sensor])

        def step(torque, model=model, data=data):
            data.ctrl[robot.actuator] = torque / robot.gear
            mujoco.mj_step(model, data, 4)

        shaken[moved] = at_their_limit(controller, read, step, ticks)
    world = BulletWorld(robot, 1000)
    world.place(robot.home_qpos, np.zeros(robot.nv))
    in_bullet = at_their_limit(
        controller, world.sensors, lambda u: [world.step(u, np.zeros(3)) for _ in range(4)], ticks
    )
    world.close()
    assert shaken[False] < 0.2 < 0.8 < min(shaken[True], in_bullet)


def test_who_sees_the_ground_sees_that_bullets_is_level():
    own = {"action_layer": "joint_position", "episode_seconds": 0.2}
    found = [
        in_bullet(Player("own", "fbid_gym/QuadrupedWalk-v0", own | sees, None), 1, 0, 1000)
        for sees in ({}, {"height_scan": True})
    ]
    assert abs(found[0].velocity_error - found[1].velocity_error).max() < 0.05


def test_what_bullet_cannot_do_is_one_error(monkeypatch):
    own = {"action_layer": "joint_position", "terrain": "obstacles"}
    for arguments, hz in ((own, 1000), ({"action_layer": "joint_position"}, 300)):
        player = Player("own", "fbid_gym/QuadrupedWalk-v0", arguments, None)
        with pytest.raises(InvalidValueError, match="flat ground|a multiple of control_hz"):
            in_bullet(player, 1, 0, hz)
    robot = copy.copy(load("go1"))
    tied = copy.copy(robot.model)
    tied.geom_type[1] = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    changed = object.__new__(type(robot))
    vars(changed).update(vars(robot) | {"model": tied})
    with pytest.raises(RobotError, match="trunk_bumper.*no shape for Bullet"):
        BulletWorld(changed, 1000)
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(FbidError, match=r"pip install 'fbid_gym\[bullet\]'"):
        BulletWorld(load("go1"), 1000)
