"""Predict the state of robots at the time when the torque computed now reaches their motors.

Until then the torques act that are on their way, and the law knows the accelerations that it made
them for. With these it predicts the state at which the new torque begins to act, and answers that
state instead of the measured one, as a Smith predictor does (O. J. M. Smith 1957, "Closer control
of loops with dead time", Chemical Engineering Progress 53).
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at, turn_quaternion
from fbid_gym.dynamics.vectors import (
    Vector,
    add,
    cross,
    matrix,
    product,
    scale,
    store,
    store_matrix,
    turn,
    vector,
)
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.small_matrices import copy, dot


class Delay(NamedTuple):
    """Delay of a robot's torques, and the constants that predict its state after it."""

    seconds: float  # of the delay
    tick: float  # s, from torque to torque
    gravity: float  # m/s^2
    radius: np.ndarray  # (F,) m, of its feet

    @property
    def ticks(self) -> int:
        """Torques that are on their way."""
        return int(np.ceil(round(self.seconds / self.tick, 6)))


@kernel
def look_ahead(
    late: Delay, made: np.ndarray, sent: np.ndarray, state: RobotState, terms: DynamicsTerms
) -> tuple[RobotState, DynamicsTerms]:
    """Return state and terms of N robots after a delay; M, h, J and Jdot v stay those of now.

    The last torques were made for the accelerations `made` (N, nv), those on their way for `sent`
    (N, H, nv), newest first; `made` is put in front of these.
    """
    qpos, qvel = state.qpos.copy(), state.qvel.copy()
    base_position, world_from_base = terms.base_position.copy(), terms.world_from_base.copy()
    world_from_trunk, world_from_foot = terms.world_from_trunk.copy(), terms.world_from_foot.copy()
    com, com_velocity = terms.com.copy(), terms.com_velocity.copy()
    foot_position, foot_velocity = terms.foot_position.copy(), terms.foot_velocity.copy()
    (count, size), delay = qvel.shape, late.seconds
    change, mean = np.empty(size), np.empty(size)
    for i in range(count):
        for age in range(sent.shape[1] - 1, 0, -1):
            copy(sent[i, age - 1], sent[i, age])
        copy(made[i], sent[i, 0])
        change[:] = 0.0
        for age in range(sent.shape[1]):
            share = min(max(delay - age * late.tick, 0.0), late.tick)
            for k in range(size):
                change[k] += share * sent[i, age, k]
        for k in range(size):
            mean[k] = qvel[i, k] + 0.5 * change[k]
            qvel[i, k] += change[k]

        way = scale(delay, turn(matrix(terms.world_from_base, (i,)), vector(mean, (), 3)))
        turn_quaternion(qpos, i, 3, way)
        _turn(way, world_from_base, (i,))
        _turn(way, world_from_trunk, (i,))
        for k in range(3):
            qpos[i, k] += delay * mean[k]
            base_position[i, k] += delay * mean[k]
            faster = dot(terms.mass_matrix[i, k], change) + delay * terms.bias[i, k]
            faster = faster / terms.mass_matrix[i, 0, 0] - (delay * late.gravity if k == 2 else 0.0)
            com[i, k] += delay * (com_velocity[i, k] + 0.5 * faster)
            com_velocity[i, k] += faster
        for k in range(6, size):
            qpos[i, k + 1] += delay * mean[k]
        for foot in range(foot_position.shape[1]):
            for k in range(6):
                faster = dot(terms.foot_jacobian[i, foot, k], change)
                foot_velocity[i, foot, k] += faster + delay * terms.foot_bias[i, foot, k]
            both = add(vector(terms.foot_velocity, (i, foot)), vector(foot_velocity, (i, foot)))
            spin = add(
                vector(terms.foot_velocity, (i, foot), 3), vector(foot_velocity, (i, foot), 3)
            )
            # What is seen as the foot goes with its sphere, which rolls.
            both = add(both, cross(spin, (0.0, 0.0, late.radius[foot])))
            place = add(vector(foot_position, (i, foot)), scale(0.5 * delay, both))
            store(place, foot_position, (i, foot))
            _turn(scale(0.5 * delay, spin), world_from_foot, (i, foot))
    return (
        RobotState(qpos, qvel, state.contact_force, state.tick),
        DynamicsTerms(
            terms.mass_matrix, terms.bias, base_position, world_from_base, world_from_trunk, com,
            com_velocity, foot_position, world_from_foot, foot_velocity, terms.foot_jacobian,
            terms.foot_bias,
        ),
    )  # fmt: skip


@compiled
def _turn(by: Vector, rotations: np.ndarray, row: tuple[int, ...]) -> None:
    """Turn a rotation by a rotation vector (rad, world axes)."""
    quaternion = np.array([[1.0, 0.0, 0.0, 0.0]])
    turn_quaternion(quaternion, 0, 0, by)
    store_matrix(product(rotation_at(quaternion, 0, 0), matrix(rotations, row)), rotations, row)
