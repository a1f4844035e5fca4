"""What the body of a robot that walks shall do: as accelerations, or as a wrench.

Both hold the centre of mass where the gait wants it, and the base at its height, upright and in its
heading. `base_aim` says how the base accelerates. `wrench_aim` says how the momentum changes,
[G15] (38), (39), with a reference that moves: the momentum h_d that the robot as it stands has if
its feet go as the gait wants and its base is carried along evenly,

    h' = h_d' + K e + D (h_d - h) + action,    K = w^2 I,

with springs on the base's height and rotation error e. I is the mass, and for the rotation what a
moment has to overcome to turn the base between feet that stay: a sixth to a third of the locked
robot's inertia on long legs, which turn against the trunk. For the same reason h_d' is no detail: a
moment that ignored what the legs' swing takes would turn the trunk instead.
"""

import numpy as np

from fbid_gym.actions.walking_law import (
    BodyAim,
    WalkingConstants,
    all_points,
    feet_on_their_way,
    posture,
    with_foot_bias,
)
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.operational_space import serve_task
from fbid_gym.dynamics.centroidal import find_centroidal_terms
from fbid_gym.dynamics.contacts import reduce_contacts
from fbid_gym.motions.gait.heading import along, axes_of, in_world, lean, share_within
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import (
    CentroidalTerms,
    Constraint,
    DynamicsTerms,
    RobotState,
    TaskCommand,
)
from fbid_gym.small_matrices import dot, times


@kernel
def base_aim(
    law: WalkingConstants,
    added: np.ndarray,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
) -> BodyAim:
    """The centre of mass (horizontally) and the base (height, rotation) accelerate as they shall.

    Args:
        law: of the robot.
        added: (N, 6) to add: m/s^2 along the heading, and rad/s^2 in the base's axes.
        state: of the robots.
        target: of the gait.
        terms: of the robots.
    """
    return BodyAim(base_task(law, added, state, target, terms), posture(law, state))


@kernel
def base_task(
    law: WalkingConstants,
    added: np.ndarray,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
) -> TaskCommand:
    """What the centre of mass (horizontally) and the base (its height and rotation) shall do.

    Args:
        law: of the robot.
        added: (N, 6) to add: m/s^2 along the heading, and rad/s^2 in the base's axes.
        state: of the robots.
        target: of the gait.
        terms: of the robots.
    """
    gains, (count, size) = law.gains, state.qvel.shape
    jacobian, bias = np.zeros((count, 6, size)), np.zeros((count, 6))
    acceleration = np.empty((count, 6))
    for i in range(count):
        mass = terms.mass_matrix[i, 0, 0]
        for k in range(2):
            for j in range(size):
                jacobian[i, k, j] = terms.mass_matrix[i, k, j] / mass
            bias[i, k] = terms.bias[i, k] / mass
        for k in range(2, 6):
            jacobian[i, k, k] = 1.0
        east, north = in_world(axes_of(target.heading[i]), added[i, 0], added[i, 1])
        x = target.velocity[i, 0] - terms.com_velocity[i, 0]
        y = target.velocity[i, 1] - terms.com_velocity[i, 1]
        gain = law.velocity_gain * share_within(law.small_error, x, y)
        acceleration[i, 0] = target.com_acceleration[i, 0] + east + gain * x
        acceleration[i, 1] = target.com_acceleration[i, 1] + north + gain * y
        rise = target.height[i] - terms.base_position[i, 2]
        acceleration[i, 2] = gains.height * rise - gains.height_damping * state.qvel[i, 2]
        acceleration[i, 2] += added[i, 2]
        error = lean(target.heading[i], terms, i)
        for k in range(3):
            rate = terms.world_from_base[i, 2, k] * target.turning[i] - state.qvel[i, 3 + k]
            acceleration[i, 3 + k] = gains.rotation * error[k] + gains.rotation_damping * rate
            acceleration[i, 3 + k] += added[i, 3 + k]
    return TaskCommand(jacobian, bias, acceleration)


@kernel
def wrench_aim(
    law: WalkingConstants,
    push: np.ndarray,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
) -> BodyAim:
    """The momentum changes as it shall, see the module, near the motion that the gait plans.

    Args:
        law: of the robot.
        push: (N, 6) N and N·m to add, along the heading.
        state: of the robots.
        target: of the gait.
        terms: of the robots.
    """
    gains = law.gains
    body = find_centroidal_terms(terms, state.qvel)
    jacobian, bias = _momentum_rows(law.gravity, body, terms)
    velocity, acceleration = _carried(law, state, target, terms)
    rate, late = np.empty(6), np.empty(6)
    wanted, moment, turned = np.empty((len(terms.com), 6)), np.empty(3), np.empty(3)
    for i in range(len(wanted)):
        axes = axes_of(target.heading[i])
        times(jacobian[i], acceleration[i], rate)
        times(jacobian[i], velocity[i] - state.qvel[i], late)
        east, north = in_world(axes, push[i, 0] / body.mass[i], push[i, 1] / body.mass[i])
        wanted[i, 0] = rate[0] + bias[i, 0] + east
        wanted[i, 1] = rate[1] + bias[i, 1] + north
        rise = target.height[i] - terms.base_position[i, 2]
        wanted[i, 2] = rate[2] + bias[i, 2] + gains.height * rise + gains.height_damping * late[2]
        wanted[i, 2] += push[i, 2] / body.mass[i]

        # Spring and action ahead, to the left and up, then in the world.
        rotation = terms.world_from_base[i]
        error = lean(target.heading[i], terms, i)
        for k in range(3):
            turned[k] = rotation[k, 0] * error[0] + rotation[k, 1] * error[1]
            turned[k] += rotation[k, 2] * error[2]
        turned[0], turned[1] = along(axes, turned[0], turned[1])
        times(law.turning_inertia, turned, moment)
        for k in range(3):
            moment[k] = gains.rotation * moment[k] + push[i, 3 + k]
        moment[0], moment[1] = in_world(axes, moment[0], moment[1])
        for k in range(3):
            wanted[i, 3 + k] = rate[3 + k] + bias[i, 3 + k]
            wanted[i, 3 + k] += dot(body.inverse_inertia[i, k], moment)
            wanted[i, 3 + k] += gains.rotation_damping * late[3 + k]
    return BodyAim(TaskCommand(jacobian, bias, wanted), acceleration)


@compiled
def _momentum_rows(
    gravity: float, body: CentroidalTerms, terms: DynamicsTerms
) -> tuple[np.ndarray, np.ndarray]:
    """Momentum per mass, and per inertia of the locked robot: (N, 6, nv) of v, (N, 6) "Jdot v"."""
    count, _, size = body.matrix.shape
    jacobian, bias, turn = np.empty((count, 6, size)), np.empty((count, 6)), np.empty(3)
    for i in range(count):
        mass, inverse = body.mass[i], body.inverse_inertia[i]
        for k in range(3):
            for j in range(size):
                jacobian[i, k, j] = body.matrix[i, k, j] / mass
                total = 0.0
                for axis in range(3):
                    total += inverse[k, axis] * body.matrix[i, 3 + axis, j]
                jacobian[i, 3 + k, j] = total
        # Adot v: what the base's bias force says of it, less gravity's share.
        for k in range(6):
            bias[i, k] = dot(body.to_com[i, k], terms.bias[i, :6])
        bias[i, 2] -= gravity * mass
        for k in range(3):
            bias[i, k] /= mass
        for k in range(3):
            turn[k] = dot(inverse[k], bias[i, 3:])
        bias[i, 3:] = turn
    return jacobian, bias


@compiled
def _carried(
    law: WalkingConstants, state: RobotState, target: GaitTarget, terms: DynamicsTerms
) -> tuple[np.ndarray, np.ndarray]:
    """What the gait plans with the base carried along: velocities and accelerations, (N, nv).

    The feet go as they shall, the centre of mass as it does and accelerates as it shall, the base
    keeps its height and turns as commanded; the joints go with the least motion that takes, in the
    accelerations least far from their posture's.
    """
    count, size = state.qvel.shape
    even = base_task(law, np.zeros((count, 6)), state, target, terms)
    even.acceleration[:, 2:] = 0.0
    feet = feet_on_their_way(law, target, terms)
    acceleration = serve_task(feet, even, posture(law, state), law.mobility, law.least_gain).motion

    steady = np.zeros((count, 6))
    for i in range(count):
        steady[i, 0], steady[i, 1] = terms.com_velocity[i, 0], terms.com_velocity[i, 1]
        for k in range(3):
            steady[i, 3 + k] = terms.world_from_base[i, 2, k] * target.turning[i]
    goes = with_foot_bias(terms, -target.foot_velocity)
    rows = reduce_contacts(law.geometry, all_points(law), goes)
    still = np.zeros((count, size))
    velocity = serve_task(
        Constraint(rows.jacobian, rows.bias),
        TaskCommand(even.jacobian, np.zeros((count, 6)), steady),
        still,
        law.mobility,
        law.least_gain,
    ).motion
    return velocity, acceleration
