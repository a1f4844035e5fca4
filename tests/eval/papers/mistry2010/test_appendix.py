"""[M10]'s appendix, eqs. (21) to (33): the rows without contact forces are the whole dynamics."""

from collections.abc import Callable

import mujoco
import numpy as np

from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.robots import load

STEP = 1e-4  # s, of the differences that give the rates of J and Q


def test_eqs_21_to_33_along_a_motion_that_the_contacts_allow(rng: np.random.Generator) -> None:
    """Point feet, so that J has independent rows, as the paper takes it; Q moves with the robot."""
    robot = load("quadruped")
    count, nv = 4, robot.nv
    qpos = np.tile(robot.home_qpos, (count, 1))
    qpos[:, 7:] += 0.1 * rng.normal(size=(count, robot.num_joints))
    dynamics, geometry = MuJoCoDynamics(robot), contact_geometry(robot)

    def jacobian_at(time: float, velocity: np.ndarray) -> np.ndarray:
        moved = qpos.copy()
        for row, rate in zip(moved, velocity, strict=True):
            mujoco.mj_integratePos(robot.model, row, rate, time)
        terms = dynamics.terms(moved, np.zeros_like(velocity))
        return reduced_contacts(geometry, terms).jacobian

    jacobian = jacobian_at(0.0, np.zeros((count, nv)))
    k = jacobian.shape[1]
    wild = rng.normal(size=(count, nv))
    velocity = wild - np.matvec(np.linalg.pinv(jacobian), np.matvec(jacobian, wild))
    basis = np.linalg.qr(jacobian.mT, mode="complete")[0][:, :, k:]

    def decomposed(time: float) -> tuple[np.ndarray, np.ndarray]:
        """Q and R of eq. (9), R with a positive diagonal, the null space nearest to `basis`."""
        q, r = np.linalg.qr(jacobian_at(time, velocity).mT)
        signs = np.sign(np.diagonal(r, axis1=1, axis2=2))
        q, r = q * signs[:, None], r * signs[:, :, None]
        left, _, right = np.linalg.svd(basis - q @ (q.mT @ basis), full_matrices=False)
        return np.concatenate([q, left @ right], axis=2), r

    def rate(of: Callable[[float], np.ndarray]) -> np.ndarray:
        one, two = (of(h) - of(-h) for h in (STEP, 2 * STEP))
        return np.asarray((8.0 * one - two) / (12.0 * STEP))

    q, r = decomposed(0.0)
    q_rate = rate(lambda time: decomposed(time)[0])
    drift = np.matvec(rate(lambda time: jacobian_at(time, velocity)), velocity)
    terms = dynamics.terms(qpos, velocity)
    mass, bias = terms.mass_matrix, terms.bias
    wanted = 3.0 * rng.normal(size=(count, nv))
    found = orthogonal_inverse_dynamics(mass, bias, jacobian, wanted, drift)
    torque, acceleration = found.torque, found.acceleration
    size = float(np.abs(bias).max())

    def same(left: np.ndarray, right: np.ndarray) -> None:
        np.testing.assert_allclose(left, right, rtol=0.0, atol=1e-7 * size)

    # (9), (21): R lambda in the upper rows, nothing in the lower.
    same(q[:, :, :k] @ r, jacobian.mT)
    same(q.mT @ q, np.broadcast_to(np.eye(nv), q.shape))
    forces = np.pad(np.matvec(r, found.contact_force), [(0, 0), (0, nv - k)])
    selection = q.mT[:, :, 6:]  # D^T = Q^T S^T of (25)
    felt = np.matvec(mass, acceleration) + bias
    same(np.matvec(q.mT, felt), np.matvec(selection, torque) + forces)
    # (22), (28) to (30): what the contacts hold does not move in the new coordinates.
    p_rate = np.matvec(q.mT, velocity)
    p_acceleration = np.matvec(q.mT, acceleration - np.matvec(q_rate, p_rate))
    same(p_rate[:, :k], np.zeros((count, k)))
    same(p_acceleration[:, :k], np.zeros((count, k)))
    # (23) to (27)
    inertia, swung = q.mT @ mass @ q, q.mT @ mass @ q_rate
    whole = np.matvec(inertia, p_acceleration) + np.matvec(swung, p_rate)
    same(whole + np.matvec(q.mT, bias), np.matvec(selection, torque) + forces)
    # (31): the lower rows alone, of the free coordinates alone, although the blocks are coupled.
    assert np.abs(inertia[:, :k, k:]).max() > 0.01 * np.abs(inertia).max()
    lower = np.matvec(inertia[:, k:, k:], p_acceleration[:, k:])
    lower += np.matvec(swung[:, k:, k:], p_rate[:, k:]) + np.matvec(q[:, :, k:].mT, bias)
    same(lower, np.matvec(selection[:, k:], torque))
    # (32), and (33) without the rate of Q: the least torque.
    inverse = np.linalg.pinv(selection[:, k:])
    same(np.matvec(inverse, lower), torque)
    same(np.matvec(inverse, np.matvec(q[:, :, k:].mT, felt)), torque)
