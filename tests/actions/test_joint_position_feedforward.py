"""Feedforward, feedback and balance: [M10] eqs. (18)-(20), with a target that moves smoothly."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from fbid_gym.actions.joint_position_feedforward import SmoothTarget, acceleration_of, move_on
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import point_jacobian
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import in_world, periodic_squat
from fbid_gym.quantities import RobotState
from fbid_gym.robots import load
from fbid_gym.runtime.rates import Rates
from tests.actions.cases import home_of, layer_of, moving, without_self_motion
from tests.control.systems import equation_15
from tests.postures import posed, turned

NAME = "joint_position_feedforward"
UNLIMITED = {"contact_limits": "none"}


def second_order(frequency, tick):
    """Exact step of x'' = w^2 (u - x) - 2 w x' for state (x, x', u)."""
    w = 2 * np.pi * frequency
    return expm(tick * np.array([[0, 1, 0], [-(w**2), -2 * w, w**2], [0, 0, 0]]))


def standing(layer, state, robot):
    """The state and its dynamics without the velocities that would move the feet."""
    qvel = state.qvel.copy()
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    jacobian, _ = point_jacobian(Stance.of(robot).geometry, terms)
    for row, matrix in enumerate(jacobian):
        qvel[row] -= np.linalg.pinv(matrix, rcond=1e-9) @ matrix @ qvel[row]
    return state._replace(qvel=qvel), MuJoCoDynamics(robot).terms(state.qpos, qvel)


def com_jacobian(robot, qpos):
    """MuJoCo's own (3, nv), which the layer does not use."""
    jacobian = np.empty((3, robot.nv))
    mujoco.mj_jacSubtreeCom(robot.model, posed(robot, qpos), jacobian, robot.base_body)
    return jacobian


def test_the_target_is_the_exact_critically_damped_response(rng):
    """Goals that change at any tick, against the matrix exponential."""
    scale, tick = 0.4, 0.002
    smooth = SmoothTarget(scale, 2 * np.pi * 3.0, tick)
    place, rate, state = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((3, 4, 3))
    exact, w = second_order(3.0, tick), 2 * np.pi * 3.0
    for k in range(120):
        if k % 7 == 0:
            action = rng.uniform(-1.0, 1.0, size=(4, 3))
        state[2] = scale * action
        found = acceleration_of(smooth, action, place, rate)
        np.testing.assert_allclose(place, state[0], atol=1e-12)
        np.testing.assert_allclose(rate, state[1], atol=1e-11)
        expected = w**2 * (state[2] - state[0]) - 2 * w * state[1]
        np.testing.assert_allclose(found, expected, atol=1e-9)
        move_on(smooth, action, place, rate)
        state = np.einsum("ij,jkl->ikl", exact, state)


@pytest.mark.parametrize("balance", [0.0, 0.8])
def test_the_torque_is_equation_18(robot, states, rng, balance):
    """Literally, with eqs. (19)-(20) for balance, at random states while the action changes."""
    options = {"natural_frequency": 0.7, "damping_ratio": 0.9, "scale": 0.2}
    options |= {"target_frequency": 1.5, "balance_frequency": balance}
    layer = layer_of(NAME, robot, **options, **UNLIMITED)
    state, terms = standing(layer, states(3)[0], robot)
    target = moving(robot, terms, rng)
    jacobian, bias = point_jacobian(Stance.of(robot).geometry, terms)
    memory, offset = layer.memory(3), np.zeros((3, 3, robot.num_joints))
    exact, w = second_order(1.5, 1 / 500), 2 * np.pi * 1.5
    # The base follows the joints; its position counts in heights of the centre of mass.
    weight = np.sqrt(np.r_[np.full(6, 1e-3), np.ones(robot.num_joints)])
    weight[:3] /= Stance.of(robot).home_com[2]
    for _ in range(4):
        action = rng.uniform(-1, 1, (3, robot.num_joints))
        found = layer.torque(action, state, target, lambda: terms, memory)
        offset[2] = 0.2 * action
        for row in range(3):
            rows = jacobian[row]
            motion = target.qacc[row].copy()
            motion[6:] += w**2 * (offset[2, row] - offset[0, row]) - 2 * w * offset[1, row]
            error = rows @ motion + bias[row]
            motion -= np.linalg.pinv(rows / weight, rcond=1e-9) @ error / weight
            if balance > 0.0:
                k = 2 * np.pi * balance
                com = com_jacobian(robot, state.qpos[row])
                wanted = target.com_acceleration[row] + k**2 * (target.com[row] - terms.com[row])
                wanted = wanted + 2 * k * (target.com_velocity[row] - com @ state.qvel[row])
                # The rate of the Jacobian times v, by a step along the motion.
                ahead = state.qpos[row].copy()
                mujoco.mj_integratePos(robot.model, ahead, state.qvel[row], 1e-6)
                com_bias = (com_jacobian(robot, ahead) - com) @ state.qvel[row] / 1e-6
                # Balance moves base and waist, and the legs with them; no leg by itself.
                stack = np.vstack([rows, without_self_motion(com[:2], robot, terms, row)])
                asked = np.append(np.zeros(len(rows)), (wanted - com_bias)[:2] - com[:2] @ motion)
                motion += np.linalg.pinv(stack / weight, rcond=1e-9) @ asked / weight
            expected, _ = equation_15(terms.mass_matrix[row], terms.bias[row], rows, motion)
            expected += robot.joint_damping * state.qvel[row, 6:]
            error = target.qpos[row, 7:] + offset[0, row] - state.qpos[row, 7:]
            rate = target.qvel[row, 6:] + offset[1, row] - state.qvel[row, 6:]
            expected += layer.gains.stiffness * error + layer.gains.damping * rate
            np.testing.assert_allclose(found[row], expected, atol=1e-5 * robot.weight)
        offset = np.einsum("ij,jkl->ikl", exact, offset)


def test_feedback_is_as_soft_as_the_robot_falls(robot):
    layer = layer_of(NAME, robot)
    pendulum = np.sqrt(9.81 / Stance.of(robot).home_com[2])
    assert layer.natural_frequency == pytest.approx(pendulum / (2 * np.pi))
    stiff = layer_of("joint_position", robot, natural_frequency=1.0)
    expected = stiff.gains.stiffness * layer.natural_frequency**2
    np.testing.assert_allclose(layer.gains.stiffness, expected)


def on_the_motion(motion, ticks, angle=1.1):
    """Robots that are where the motion has them, facing elsewhere; the feet's frame turns along."""
    reference = motion.reference(ticks)
    parts = reference.qpos, reference.qvel, reference.qacc
    qpos, qvel, qacc = (part.copy() for part in parts)
    qpos, rotation = turned(qpos, angle)
    for part in (qvel, qacc):
        part[:, :3] = part[:, :3] @ rotation.T
    return RobotState(qpos, qvel, np.zeros((len(ticks), motion.robot.num_points, 3)), ticks), qacc


def test_on_the_motion_it_is_equation_15_alone():
    """Neither feedback nor balance has anything to add, whatever their gains."""
    motion = periodic_squat(load("biped"), frequency=1.0)
    robot, ticks = motion.robot, np.array([0, 60, 130, 333])
    state, qacc = on_the_motion(motion, ticks)
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    target = in_world(Stance.of(robot).heading, motion.reference(ticks), terms)
    layer = layer_of(NAME, robot, **UNLIMITED)
    none = np.zeros(robot.num_joints)
    bare = replace(layer, gains=layer.gains._replace(stiffness=none, damping=none))
    jacobian, _ = point_jacobian(Stance.of(robot).geometry, terms)
    still = np.zeros((4, robot.num_joints))
    for one in (layer, bare):
        found = one.torque(still, state, target, lambda: terms, one.memory(4))
        for row in range(4):
            own = terms.mass_matrix[row], terms.bias[row], jacobian[row], qacc[row]
            expected, _ = equation_15(*own)
            expected += robot.joint_damping * state.qvel[row, 6:]
            np.testing.assert_allclose(found[row], expected, atol=1e-6 * robot.weight)


def test_a_squat_is_followed():
    """1 s of a squat a second from its beginning: the joints stay within 2 mrad, no foot moves."""
    motion = periodic_squat(load("biped"), frequency=1.0)
    robot = motion.robot
    state, _ = on_the_motion(motion, np.zeros(1, np.int64))
    simulation = Simulation(robot, 1, Rates())
    simulation.place(np.zeros(1, int), state.qpos, state.qvel)
    layer = layer_of(NAME, robot)
    memory, still = layer.memory(1), np.zeros((1, robot.num_joints))
    feet = simulation.terms().foot_position.copy()
    worst = 0.0
    for k in range(500):
        tick = np.array([k])
        planned, terms = motion.reference(tick), simulation.terms()
        target = in_world(Stance.of(robot).heading, planned, terms)
        force = simulation.contact_force
        now = RobotState(simulation.qpos.copy(), simulation.qvel.copy(), force, tick)
        worst = max(worst, np.abs(target.qpos[:, 7:] - now.qpos[:, 7:]).max())
        simulation.step(layer.torque(still, now, target, simulation.terms, memory))
    assert worst < 2e-3
    np.testing.assert_allclose(simulation.terms().foot_position, feet, atol=2e-3)


def test_balance_brings_the_centre_of_mass_back(robot):
    """Pushed with a tenth of the weight from four sides, as the law says: without overshoot."""
    layer, home_com = layer_of(NAME, robot), Stance.of(robot).home_com
    simulation = Simulation(robot, 4, Rates())
    simulation.place(np.arange(4), np.tile(robot.home_qpos, (4, 1)), np.zeros((4, robot.nv)))
    memory, still = layer.memory(4), np.zeros((4, robot.num_joints))
    side = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    away = []
    for k in range(700):
        tick = np.full(4, k)
        force = simulation.contact_force
        now = RobotState(simulation.qpos.copy(), simulation.qvel.copy(), force, tick)
        simulation.push(0.1 * robot.weight * side * (k < 75))
        home = home_of(robot, simulation.terms())
        simulation.step(layer.torque(still, now, home, simulation.terms, memory))
        terms = simulation.terms()
        frame = Stance.of(robot).frame(terms)
        shift = np.vecmat(terms.com - frame.centre, frame.world_from_support) - home_com
        away.append(np.vecdot(shift[:, :2], side[:, :2]))
    height = home_com[2]
    largest = np.max(away, axis=0)
    assert (largest > 0.005 * height).all()
    assert (np.abs(away[-1]) < 0.1 * largest).all()
    assert np.min(away) > -0.2 * largest.min()
