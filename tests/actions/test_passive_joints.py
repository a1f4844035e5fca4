"""What springs, damping and friction take of the joints, layers give back."""

from typing import Any

import mujoco
import numpy as np
import pytest

from fbid_gym.actions.joint_gains import holding_torque
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.passive_joints import PassiveJoints, give_back
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.insight import insight
from fbid_gym.robots import Robot, zoo
from tests.actions.cases import at_rest, home_of, layer_of, state_at, torque_of
from tests.batches import started, upright

ANIMAL = zoo.draw(22)
MODEL_BASED = "joint_position_feedforward joint_acceleration base_acceleration com_wrench".split()


def animal(limit: float | None = None, **joints: Any) -> Robot:
    """A robot of the zoo, all its joints with these attributes; `limit` N·m of their motors."""
    spec = mujoco.MjSpec.from_string(zoo.mjcf(ANIMAL))
    for joint in spec.joints:
        if joint.type != mujoco.mjtJoint.mjJNT_FREE:
            for name, value in joints.items():
                polynomial = name in ("stiffness", "damping")
                setattr(joint, name, np.pad(value, (0, 3 - len(value))) if polynomial else value)
    if limit is None and ANIMAL.actuators == "none":
        limit = zoo.torque_limit(ANIMAL)
    return Robot.from_mjcf(spec, ANIMAL.foot_names, torque_limit=limit)


def pull(robot: Robot) -> float:
    """A stiffness that makes springs, 0.1 rad off, as strong as the legs' work: N·m/rad."""
    return float(np.abs(holding_torque(robot)).max()) / 0.1


def test_what_is_given_back_is_what_is_lost(rng):
    """Polynomials as well, as MuJoCo computes them."""
    robot = animal(stiffness=[30.0, -4.0, 9.0], damping=[2.0, 1.0, 0.3], springref=0.4)
    passive = PassiveJoints.of(robot)
    data = mujoco.MjData(robot.model)
    for _ in range(20):
        data.qpos[:] = robot.home_qpos + np.r_[np.zeros(7), rng.normal(size=robot.num_joints)]
        data.qvel[:] = rng.normal(size=robot.nv)
        mujoco.mj_forward(robot.model, data)
        nothing = np.zeros((1, robot.num_joints))
        found = give_back(passive, nothing, data.qpos[None], data.qvel[None])
        np.testing.assert_allclose(found[0], -data.qfrc_passive[6:], rtol=1e-12, atol=1e-12)
    assert np.abs(data.qfrc_spring[6:]).min() > 0.1 and np.abs(data.qfrc_damper[6:]).min() > 0.1


def test_friction_given_back_never_drives(rng):
    """It is no more than friction takes, along the motion, and all of it once joints move."""
    robot = animal(frictionloss=3.0)
    passive = PassiveJoints.of(robot, friction=True)
    qvel = rng.normal(size=(200, robot.nv)) * 10.0 ** rng.uniform(-4, 1, (200, 1))
    zeros, qpos = np.zeros((200, robot.num_joints)), np.tile(robot.home_qpos, (200, 1))
    both = passive, PassiveJoints.of(robot)
    found = np.subtract(*(give_back(each, zeros.copy(), qpos, qvel) for each in both))
    speed = qvel[:, 6:]
    assert (found * speed >= 0.0).all() and (np.abs(found) <= 3.0 * (1 + 1e-12)).all()
    fast = np.abs(speed) >= (1.0 / passive.steepness)
    assert fast.any() and not fast.all()
    np.testing.assert_allclose(found[fast], 3.0 * np.sign(speed[fast]))


@pytest.mark.parametrize(
    ("name", "limits"), [*zip(MODEL_BASED, ["none", "friction", "none", "friction"], strict=True)]
)
def test_springs_and_damping_are_added_to_the_same_torque(name, limits, rng):
    strong = 1e4  # N·m: no motor comes to its limit
    plain = animal(strong, damping=[0.0])
    sprung = animal(strong, stiffness=[pull(plain)], damping=[0.05 * pull(plain)], springref=0.2)
    count, joints = 5, plain.num_joints
    qpos, qvel = np.tile(plain.home_qpos, (count, 1)), 0.2 * rng.normal(size=(count, plain.nv))
    qpos[:, 7:] += 0.1 * rng.normal(size=(count, joints))
    state, _ = state_at(plain, qpos, qvel)
    torques = []
    for robot in (plain, sprung):
        layer = layer_of(name, robot, contact_limits=limits)
        terms = MuJoCoDynamics(robot).terms(qpos, qvel)
        torques.append(torque_of(layer, state, home_of(robot, terms), terms))
    lost = give_back(PassiveJoints.of(sprung), np.zeros((count, joints)), qpos, qvel)
    assert np.abs(lost).max() > 0.3 * np.abs(torques[0]).max()
    np.testing.assert_allclose(torques[1], torques[0] + lost, atol=1e-8 * np.abs(lost).max())


def test_motors_that_springs_work_against_are_not_asked_for_more_than_they_can():
    """The balancer's torque limits hold for what the motors give, springs' part included."""
    plain = animal(damping=[0.0])
    limit = 1.1 * float(np.abs(holding_torque(plain)).max())
    stretched = float(np.abs(plain.home_qpos[7:] + 3.0).min())
    strong = animal(limit, damping=[0.0], stiffness=[0.5 * limit / stretched], springref=-3.0)
    state, terms = at_rest(strong)
    layer = layer_of("com_wrench", strong, balancer="garofalo2015")
    torque = torque_of(layer, state, home_of(strong, terms), terms)[0]
    lost = give_back(PassiveJoints.of(strong), np.zeros((1, plain.num_joints)), *state[:2])[0]
    assert np.abs(holding_torque(plain) + lost).max() > 1.3 * limit
    assert np.abs(torque).max() < 1.05 * limit


def played(robot: Robot, task: str, name: str, seconds: float, **options: Any) -> EnvBatch:
    """Some robots under the zero action, none of which has fallen."""
    arguments = {"robot": robot, "task": task, "action_layer": name, "push_force": (0.0, 0.0)}
    arguments |= {"episode_seconds": seconds + 1.0, "layer_options": options}
    batch = started(arguments, 4)
    upright(batch, seconds)
    return batch


@pytest.mark.slow
@pytest.mark.parametrize("name", ["joint_position", *MODEL_BASED])
def test_sprung_robots_stand_as_high_as_others(name):
    plain = animal()
    heights = []
    for robot in (plain, animal(stiffness=[pull(plain)], springref=-0.5)):
        batch = played(robot, "balance", name, 3.0)
        heights.append(batch.simulation.qpos[:, 2])
    np.testing.assert_allclose(heights[1], heights[0], rtol=0.01)
    np.testing.assert_allclose(heights[1], plain.home_qpos[2], rtol=0.02)


def test_sprung_and_rubbing_robots_walk():
    plain = animal()
    strength = pull(plain)
    robot = animal(stiffness=[strength], frictionloss=0.01 * strength)
    played(robot, "walk", "base_acceleration", 4.0, compensate_friction=True)


def test_what_is_asked_of_contacts_is_what_springs_leave():
    """Of a robot at rest, the ground gives just that."""
    sprung = animal(stiffness=[0.2 * pull(animal())], damping=[0.01], springref=0.2)
    still = {"push_force": (0.0, 0.0), "height_range": (1.0, 1.0)}
    batch = started({"robot": sprung, "action_layer": "base_acceleration"} | still, 1)
    upright(batch, 2.0)
    seen = insight(batch)
    np.testing.assert_allclose(seen.commanded, seen.measured, atol=0.02 * sprung.weight)
