"""Laws that hold for every motion, whatever made it."""

import numpy as np

from fbid_gym.dynamics.contacts import contact_geometry, point_jacobian, point_velocities
from fbid_gym.dynamics.frames import skew
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import MotionTable
from fbid_gym.quantities import Target


def hold_laws(motion: MotionTable, rows: np.ndarray) -> None:
    """Assert what a planned `Target` promises, with Pinocchio's dynamics as the witness.

    Planted feet neither move nor accelerate; the origin is the feet's centre and x their forward
    direction; the centre of mass moves as the posture says.
    """
    robot, geometry = motion.robot, contact_geometry(motion.robot)
    qpos, qvel, qacc = motion.rows.qpos[rows], motion.rows.qvel[rows], motion.rows.qacc[rows]
    terms = PinocchioDynamics(robot).terms(qpos, qvel)
    planted = motion.rows.planted[rows]
    active = planted[:, geometry.foot_of_point]

    velocity = point_velocities(geometry, terms)[active]
    assert np.abs(velocity).max() < 1e-9
    jacobian, bias = point_jacobian(geometry, terms)
    acceleration = (np.matvec(jacobian, qacc) + bias).reshape(len(rows), -1, 3)[active]
    assert np.abs(acceleration).max() < 1e-7

    frame = Stance.of(robot).frame(terms)
    np.testing.assert_allclose(frame.centre, 0.0, atol=1e-9)
    level = np.tile(np.eye(3), (len(rows), 1, 1))
    np.testing.assert_allclose(frame.world_from_support, level, atol=1e-9)

    np.testing.assert_allclose(motion.rows.com[rows], terms.com, atol=1e-9)
    np.testing.assert_allclose(motion.rows.com_velocity[rows], terms.com_velocity, atol=1e-9)
    # Newton: the wrench that the motion needs is mass times the acceleration of its centre.
    force = np.matvec(terms.mass_matrix[:, :3], qacc) + terms.bias[:, :3]
    needed = robot.mass * (motion.rows.com_acceleration[rows] - robot.model.opt.gravity)
    np.testing.assert_allclose(force, needed, rtol=0, atol=1e-7)


def hold_foot_rates(rows: list[Target], tick: float, share: float) -> None:
    """Assert that the first foot has the rates of its way in the air, by differences.

    Footholds move a little: the median error is less than a share of the greatest rate.
    """
    in_air = ~np.array([row.planted[0] for row in rows])
    swings = in_air[:-1] & in_air[1:]
    for value, rate in (("foot_position", "foot_velocity"), ("foot_velocity", "foot_acceleration")):
        values, rates = (
            np.array([getattr(row, n)[0, :, :3] for row in rows]) for n in (value, rate)
        )
        made, said = np.diff(values, axis=0)[swings] / tick, 0.5 * (rates[1:] + rates[:-1])[swings]
        error = np.linalg.norm(made - said, axis=1)
        assert np.median(error) < share * np.linalg.norm(said, axis=1).max()


def heading_of(target: Target) -> np.ndarray:
    """(N,) rad, of bases that are upright."""
    return 2.0 * np.arctan2(target.qpos[:, 6], target.qpos[:, 3])


def centre_of_pressure(motion: MotionTable, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where (K, 2), in m, the ground must push for the motion, and how (K, 3)."""
    terms = PinocchioDynamics(motion.robot).terms(motion.rows.qpos[rows], motion.rows.qvel[rows])
    wrench = np.matvec(terms.mass_matrix[:, :6], motion.rows.qacc[rows]) + terms.bias[:, :6]
    force = wrench[:, :3]
    moment = np.matvec(terms.world_from_base, wrench[:, 3:])
    moment = moment + np.matvec(skew(terms.base_position), force)
    return np.stack([-moment[:, 1], moment[:, 0]], axis=1) / force[:, 2:], force
