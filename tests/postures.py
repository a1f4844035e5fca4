"""Robots on bent legs, turned about the vertical, and without some of their joints."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fbid_gym import robots
from fbid_gym.motions import squat_bow
from fbid_gym.robots import Robot
from fbid_gym.robots.built_in import asset_path
from fbid_gym.robots.mirror import mirror_of


def posed(
    robot: Robot, qpos: np.ndarray | None = None, qvel: np.ndarray | float = 0.0
) -> mujoco.MjData:
    """A robot's own model at a state, at home if none is given; all that follows is computed."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.home_qpos if qpos is None else qpos
    data.qvel[:] = qvel
    mujoco.mj_forward(robot.model, data)
    return data


def fallen(model: mujoco.MjModel, robot: Robot, ctrl: np.ndarray, steps: int) -> np.ndarray:
    """(steps, nq + nv + sensors): a model of a robot falls from its home, its motors pulling."""
    data, path = mujoco.MjData(model), []
    data.qpos[:], data.ctrl[:] = robot.home_qpos, ctrl
    for _ in range(steps):
        mujoco.mj_step(model, data)
        path.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
    return np.array(path)


def sensed(qpos: np.ndarray, qvel: np.ndarray, force: np.ndarray) -> dict[str, np.ndarray]:
    """What perfect sensors read of one robot; `force` is that of its contact points (P, 3)."""
    place = {"position": qpos[:3], "orientation": qpos[3:7], "joint_position": qpos[7:]}
    rates = {"velocity": qvel[:3], "angular_velocity": qvel[3:6], "joint_velocity": qvel[6:]}
    return place | rates | {"contact_force": force}


def in_mirror(robot: Robot, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States (N, nq), (N, nv) in the mirror, the world's plane of x and z."""
    joints, home, across = mirror_of(robot).joints, robot.home_qpos[7:], np.array([1.0, -1.0, 1.0])
    turned, angles = qpos[:, 3:7] * [1.0, -1.0, 1.0, -1.0], home + joints.of(qpos[:, 7:] - home)
    speed = [qvel[:, :3] * across, -qvel[:, 3:6] * across, joints.of(qvel[:, 6:])]
    return np.hstack([qpos[:, :3] * across, turned, angles]), np.hstack(speed)


def points(robot: Robot, data: mujoco.MjData) -> np.ndarray:
    """Where the contact points of all feet are (P, 3), the lowest points of their spheres."""
    turned = [foot.points @ data.xmat[foot.body].reshape(3, 3).T for foot in robot.feet]
    centres = [data.xpos[foot.body] - [0.0, 0.0, foot.radius] for foot in robot.feet]
    return np.concatenate([each + at for each, at in zip(turned, centres, strict=True)])


def point_jacobians(robot: Robot, data: mujoco.MjData) -> np.ndarray:
    """Of these places, as points of the feet's bodies: (P, 3, nv)."""
    bodies = [foot.body for foot in robot.feet for _ in foot.points]
    jacobians = np.zeros((len(bodies), 3, robot.nv))
    for rows, place, body in zip(jacobians, points(robot, data), bodies, strict=True):
        mujoco.mj_jac(robot.model, data, rows, None, place, body)
    return jacobians


def bent(robot: Robot) -> np.ndarray:
    """(nq,) a posture on bent legs, on soles half-way down a squat."""
    if not robot.has_soles:
        return robot.home_qpos
    squat = squat_bow(robot, speed=20).rows.qpos
    height = squat[:, 2]
    return squat[np.abs(height - 0.5 * (height.min() + height.max())).argmin()]


def turned(
    qpos: np.ndarray, angle: float, shift: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Configurations (..., nq) turned about the vertical, then moved; and the rotation (3, 3)."""
    turn, found = Rotation.from_rotvec([0.0, 0.0, angle]), qpos.copy()
    found[..., :3] = qpos[..., :3] @ turn.as_matrix().T + shift
    base = turn * Rotation.from_quat(qpos[..., 3:7], scalar_first=True)
    found[..., 3:7] = base.as_quat(scalar_first=True)
    return found, turn.as_matrix()


def without(name: str, joint: str) -> Robot:
    """A built-in robot without one joint of each leg, by the end of its name."""
    whole, spec = robots.load(name), mujoco.MjSpec.from_file(str(asset_path(f"{name}.xml")))
    lost = [own for own in whole.joint_names if own.endswith(joint)]
    for motor in list(spec.actuators):
        if motor.target in lost:
            spec.delete(motor)
    for sensor in list(spec.sensors):
        if sensor.objname in lost:
            spec.delete(sensor)
    for part in [*spec.keys, *map(spec.joint, lost)]:
        spec.delete(part)
    kept = [own not in lost for own in whole.joint_names]
    spec.add_key(name="home", qpos=np.append(whole.home_qpos[:7], whole.home_qpos[7:][kept]))
    return Robot.from_mjcf(spec)
