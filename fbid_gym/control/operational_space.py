"""Joint-space motion and operational-space tasks in one command, on a floating base in contact.

[M10] eq. (19) stacks a task under the contact constraints and takes the least motion that does
both. With a joint-space motion as reference it superposes the two:

    a = a_ref + [J_C; J_t]^+ ([0; task] - [Jdot_C v; Jdot_t v] - [J_C; J_t] a_ref),

which is eq. (19) to the letter for a_ref = 0, and their floating-base inverse kinematics [11] on
the level of velocities. Here the contacts come first and the task acts in their null space, with
P = 1 - J_C^+ J_C:

    a_0 = a_ref - J_C^+ (J_C a_ref + Jdot_C v),    a = a_0 + (J_t P)^+ (task - Jdot_t v - J_t a_0).

Wherever contacts and task can both be met that is the same motion, to rounding: a - a_0 and
a_0 - a_ref are orthogonal. Where they cannot, the stacked pseudo-inverse would lift the feet to
serve the task; this one keeps them.

Near a singularity (a knee almost straight under a vertical task) the pseudo-inverse of J_t P grows
without bound, and one that truncates jumps. So a direction of the task that the robot can move by
less than `least_gain` per unit of motion is damped: with y = gain / least_gain < 1 it is met to the
share y^2 / (1 - y^2 + y^4), continuous with its derivative at y = 1, and no unit of task error asks
for a motion greater than 1.07 / least_gain. Tasks with all gains above `least_gain` are met
exactly.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_positive, contiguous, positive_numbers
from fbid_gym.compiled import kernel
from fbid_gym.control.equations import contact_sizes, fitted
from fbid_gym.control.held import Held, hold, make_consistent
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import Constraint
from fbid_gym.small_matrices import (
    add_transposed_times,
    copy,
    dot,
    factor_damped,
    multiply_by_transpose,
    solve_factored,
    solve_factored_columns,
    times,
)

LEAST_GAIN = 0.05


class TaskMotion(NamedTuple):
    """A motion that keeps the contacts and serves a task.

    Attributes:
        motion: (N, nv) accelerations, or velocities for inverse kinematics. They keep the contacts
            but where hardly any motion would: such directions give way, sooner where the base
            costs much more than the joints, and what they miss is J_C a + Jdot_C v.
        task_error: (N, m) by how much the task is missed, wanted less achieved; zero to rounding
            unless the robot is near a singularity of the task.
    """

    motion: np.ndarray
    task_error: np.ndarray


def task_acceleration(
    desired: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    stiffness: float | np.ndarray,
    damping: float | np.ndarray,
    *,
    desired_velocity: np.ndarray | None = None,
    desired_acceleration: np.ndarray | None = None,
) -> np.ndarray:
    """Acceleration that returns a task's position to where it shall be, [M10] eq. (20).

    xdd = desired_acceleration + K_P (desired - position) + K_D (desired_velocity - velocity). The
    paper has no desired velocity and acceleration: its target jumps from foot to foot.

    Args:
        desired: (N, m) wanted position.
        position: (N, m) of now.
        velocity: (N, m) of now.
        stiffness: K_P, 1/s^2; a number or (m,).
        damping: K_D, 1/s; a number or (m,).
        desired_velocity: (N, m). Default: zeros.
        desired_acceleration: (N, m). Default: zeros.

    Returns:
        (N, m).
    """
    rate = -velocity if desired_velocity is None else desired_velocity - velocity
    command = stiffness * (desired - position) + damping * rate
    return command if desired_acceleration is None else command + desired_acceleration


def operational_space_acceleration(
    jacobian: np.ndarray,
    jacobian_bias: np.ndarray,
    task_jacobian: np.ndarray,
    task_bias: np.ndarray | None,
    task: np.ndarray,
    reference: np.ndarray | None = None,
    *,
    motion_cost: np.ndarray | None = None,
    least_gain: float = LEAST_GAIN,
) -> TaskMotion:
    """Accelerations that keep the contacts, serve a task and stay near a reference, eq. (19).

    With velocities for accelerations, and zeros for Jdot_C v and Jdot_t v, it is the floating-base
    inverse kinematics of the paper's reference [11].

    Args:
        jacobian: (N, k, nv) J_C of the contacts; repeated and zero rows are fine.
        jacobian_bias: (N, k) Jdot_C v.
        task_jacobian: (N, m, nv) J_t, or (m, nv) where it is the same for all robots. In
            coordinates with the base's position first, `eye(nv)[:2]` is J_b,xy of the paper.
        task_bias: (N, m) Jdot_t v; None for zeros, as for the base's position.
        task: (N, m) wanted acceleration of the task, see `task_acceleration`.
        reference: (N, nv) acceleration a_ref of the joint-space motion. Default: zeros, the
            paper's eq. (19).
        motion_cost: (nv,) positive weights of squared deviations from the reference. A larger entry
            leaves more of the coordinate's reference. Default: ones.
        least_gain: smallest singular value of J_t P (times motion_cost^-1/2) that is met exactly,
            in units of the task per unit of motion.

    Returns:
        TaskMotion, whose motion has J_C a + Jdot_C v = 0.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `motion_cost` or `least_gain` is not positive and finite.
    """
    part = task_jacobian[None] if task_jacobian.ndim == 2 else task_jacobian
    if part.ndim != 3:
        raise ShapeError("task_jacobian", tuple(part.shape), "(N, m, nv) or (m, nv)")
    sizes = contact_sizes(jacobian) | {"m": part.shape[1]}
    robots = len(part) if task_jacobian.ndim == 2 else sizes["N"]
    part = fitted("task_jacobian", part, "(N, m, nv)", {**sizes, "N": robots})
    task = fitted("task", task, "(N, m)", sizes)
    bias = fitted("task_bias", task_bias, "(N, m)", sizes, np.zeros(task.shape))
    near = fitted("reference", reference, "(N, nv)", sizes, np.zeros((1, sizes["nv"])))
    cost = fitted("motion_cost", motion_cost, "(nv,)", sizes, np.ones(sizes["nv"]))
    positive_numbers("motion_cost", cost, len(cost))
    check_positive(least_gain=least_gain)
    own = fitted("jacobian_bias", jacobian_bias, "(N, k)", sizes)
    gains = np.full(sizes["m"], float(least_gain))
    constraint = Constraint(contiguous(jacobian), own)
    return serve_task(constraint, part, bias, task, near, 1.0 / cost, gains)


@kernel
def serve_task(
    constraint: Constraint,
    parts: np.ndarray,
    bias: np.ndarray,
    task: np.ndarray,
    reference: np.ndarray,
    mobility: np.ndarray,
    least_gain: np.ndarray,
) -> TaskMotion:
    """The law of the module, robot by robot.

    Args:
        constraint: of the contacts.
        parts: (N, m, nv) or (1, m, nv) J_t.
        bias: (N, m) or (1, m) Jdot_t v.
        task: (N, m) wanted acceleration.
        reference: (N, nv) or (1, nv) motion to stay near to.
        mobility: (nv,) how readily each coordinate departs from it.
        least_gain: (m,) of each row of the task, see the module.
    """
    count, rows, velocities = constraint.jacobian.shape
    size = task.shape[1]
    motion, task_error = np.empty((count, velocities)), np.empty((count, size))
    held = Held(np.empty((rows, velocities)), np.empty((rows, rows)), np.empty(rows))
    moved, free = np.empty((rows, size)), np.empty((size, velocities))
    gains, lower, share = np.empty((size, size)), np.empty((size, size)), np.empty(size)
    for i in range(count):
        contact, part = constraint.jacobian[i], parts[min(i, len(parts) - 1)]
        hold(contact, mobility, held)
        copy(reference[min(i, len(reference) - 1)], motion[i])
        make_consistent(held, contact, constraint.bias[i], motion[i])

        # Rows of J_t A^-1 less the part that would move the contacts; A^-1 = diag(mobility).
        for m in range(size):
            for j in range(velocities):
                free[m, j] = part[m, j] * mobility[j]
        multiply_by_transpose(contact, free, moved)
        solve_factored_columns(held.factor, moved)
        for m in range(size):
            for k in range(rows):
                for j in range(velocities):
                    free[m, j] -= moved[k, m] * held.weighted[k, j]
        multiply_by_transpose(part, free, gains)
        times(part, motion[i], share)
        error, drift = task_error[i], bias[min(i, len(bias) - 1)]
        for m in range(size):
            error[m] = task[i, m] - drift[m] - share[m]
        for m in range(size):
            share[m] = error[m] / least_gain[m]
            for k in range(size):
                lower[m, k] = gains[m, k] / (least_gain[m] * least_gain[k])
        factor_damped(lower, 1.0)
        solve_factored(lower, share)
        share /= least_gain
        add_transposed_times(free, share, motion[i])
        for m in range(size):
            error[m] -= dot(gains[m], share)
    return TaskMotion(motion, task_error)
