"""The wrench that brings robots back to their reference, from that to the push of the action.

The laws are those of `fbid_gym.control.balance`, [G15] eqs. (36) and (38), (39), for a reference
seen from the robots' own feet. All gains but K_R are along the axes of the feet's frame. One
compiled loop over robots: as some thirty array operations it would cost as much as all else in the
layer.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control import BalanceGains
from fbid_gym.dynamics import CentroidalTerms
from fbid_gym.dynamics.rotations import rotation_of
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import SupportFrame
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.dynamics.vectors import Vector, add, matrix, scale, store, subtract, turn, vector
from fbid_gym.motions import Reference

Rotation = tuple[Vector, Vector, Vector]


class Feedback(NamedTuple):
    """What makes a wrench of errors, see `BalanceGains`.

    Attributes:
        stiffness: (3, 3).
        damping: (3, 3).
        rotation_damping: (3, 3).
        rotation_map: (3, 9).
        on_velocity: whether velocities are damped, (36), and not momenta, (38).
    """

    stiffness: np.ndarray
    damping: np.ndarray
    rotation_damping: np.ndarray
    rotation_map: np.ndarray
    on_velocity: bool

    @classmethod
    def of(cls, gains: BalanceGains, on_velocity: bool) -> "Feedback":
        """From the gains of (36) or (38)."""
        return cls(
            gains.stiffness,
            gains.damping,
            gains.rotation_damping,
            gains.rotation_map,
            on_velocity,
        )


def desired_wrench(
    feedback: Feedback,
    gravity: float,
    push: np.ndarray,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
    body: CentroidalTerms,
    frame: SupportFrame,
) -> np.ndarray:
    """Return the desired wrench at the centre of mass: (N, 6) N and N·m, world.

    Args:
        feedback: gains of (36) or (38).
        gravity: m/s^2, along -z.
        push: (N, 6) N and N·m, to add; in the frame of the feet.
        state: of the robots.
        reference: what they shall do.
        terms: of the robots.
        body: of the robots.
        frame: of their feet.
    """
    wrench = np.empty((len(push), 6))
    fill_wrenches(
        *feedback,
        gravity,
        np.ascontiguousarray(push),
        np.ascontiguousarray(state.qvel),
        np.ascontiguousarray(reference.qpos),
        np.ascontiguousarray(reference.qvel),
        np.ascontiguousarray(reference.qacc),
        np.ascontiguousarray(reference.com),
        np.ascontiguousarray(reference.com_velocity),
        np.ascontiguousarray(reference.com_acceleration),
        np.ascontiguousarray(terms.base_rotation),
        np.ascontiguousarray(terms.com),
        np.ascontiguousarray(terms.com_velocity),
        body.matrix,
        body.momentum,
        body.mass,
        frame.centre,
        frame.rotation,
        wrench,
    )
    return wrench


@kernel
def fill_wrenches(
    stiffness: np.ndarray,
    damping: np.ndarray,
    rotation_damping: np.ndarray,
    rotation_map: np.ndarray,
    on_velocity: bool,
    gravity: float,
    push: np.ndarray,
    velocity: np.ndarray,
    wanted_position: np.ndarray,
    wanted_velocity: np.ndarray,
    wanted_acceleration: np.ndarray,
    wanted_com: np.ndarray,
    wanted_com_velocity: np.ndarray,
    wanted_com_acceleration: np.ndarray,
    base_rotation: np.ndarray,
    com: np.ndarray,
    com_velocity: np.ndarray,
    momentum_matrix: np.ndarray,
    momentum: np.ndarray,
    mass: np.ndarray,
    centre: np.ndarray,
    level: np.ndarray,
    wrench: np.ndarray,
) -> None:
    """Robot by robot, in the axes of its feet. "Wanted" rows are one for each or one for all."""
    upright = np.empty((3, 3))
    gain, linear_gain = matrix(stiffness, ()), matrix(damping, ())
    spin_gain = matrix(rotation_damping, ())
    for i in range(len(wrench)):
        to_world, base = matrix(level, (i,)), matrix(base_rotation, (i,))
        to_feet = _transposed(to_world)

        error = subtract(vector(com, (i,)), vector(centre, (i,)))
        error = subtract(_row(wanted_com, i), turn(to_feet, error))
        rate = _row(wanted_com_velocity, i)
        if on_velocity:
            rate = subtract(rate, turn(to_feet, vector(com_velocity, (i,))))
        else:
            rate = subtract(scale(mass[i], rate), turn(to_feet, vector(momentum, (i,))))
        force = add(turn(gain, error), turn(linear_gain, rate))
        force = add(force, scale(mass[i], _row(wanted_com_acceleration, i)))
        force = turn(to_world, add(force, vector(push, (i,))))
        store((force[0], force[1], force[2] + gravity * mass[i]), wrench, (i,))

        rotation_of(wanted_position[min(i, len(wanted_position) - 1), 3:7], upright)
        desired = _product(to_world, matrix(upright, ()))
        moment = turn(desired, _spring(rotation_map, _product(_transposed(desired), base)))
        rate = _angular_momentum(momentum_matrix, i, to_world, wanted_acceleration)
        moment = add(moment, rate)
        if on_velocity:
            spin = turn(desired, _row(wanted_velocity, i, 3))
            spin = subtract(spin, turn(base, vector(velocity, (i,), 3)))
        else:
            spin = _angular_momentum(momentum_matrix, i, to_world, wanted_velocity)
            spin = subtract(spin, vector(momentum, (i,), 3))
        along_feet = add(turn(spin_gain, turn(to_feet, spin)), vector(push, (i,), 3))
        store(add(moment, turn(to_world, along_feet)), wrench, (i,), 3)


@compiled
def _row(array: np.ndarray, robot: int, first: int = 0) -> Vector:
    """Three numbers of a robot's row, or of the one that stands for all."""
    return vector(array, (min(robot, len(array) - 1),), first)


@compiled
def _spring(rotation_map: np.ndarray, error: Rotation) -> Vector:
    """The moment of the rotational spring, see `BalanceGains.rotation_map`."""
    moment = (0.0, 0.0, 0.0)
    for k in range(3):
        for j in range(3):
            entry = 3 * k + j
            column = rotation_map[0, entry], rotation_map[1, entry], rotation_map[2, entry]
            moment = add(moment, scale(error[k][j], column))
    return moment


@compiled
def _angular_momentum(
    momentum_matrix: np.ndarray, robot: int, to_world: Rotation, rates: np.ndarray
) -> Vector:
    """Of the robot as it stands, at generalized rates (nv,) whose linear part is seen from feet."""
    row, linear = min(robot, len(rates) - 1), turn(to_world, _row(rates, robot))
    total = (0.0, 0.0, 0.0)
    for j in range(rates.shape[1]):
        rate = linear[j] if j < 3 else rates[row, j]
        column = (
            momentum_matrix[robot, 3, j],
            momentum_matrix[robot, 4, j],
            momentum_matrix[robot, 5, j],
        )
        total = add(total, scale(rate, column))
    return total


@compiled
def _product(left: Rotation, right: Rotation) -> Rotation:
    """Left times right, row by row."""
    columns = _transposed(right)
    return turn(columns, left[0]), turn(columns, left[1]), turn(columns, left[2])


@compiled
def _transposed(rows: Rotation) -> Rotation:
    return (
        (rows[0][0], rows[1][0], rows[2][0]),
        (rows[0][1], rows[1][1], rows[2][1]),
        (rows[0][2], rows[1][2], rows[2][2]),
    )
