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

from fbid_gym.control.arrays import Array, check_shape, matvec, namespace
from fbid_gym.control.pseudo_inverse import symmetric_pseudo_inverse
from fbid_gym.errors import InvalidValueError, ShapeError

LEAST_GAIN = 0.05
# As in eq. (15): singular values of J_C at or below 1e-5 of the largest are treated as absent.
_CONTACT_RTOL = 1e-10


class TaskMotion(NamedTuple):
    """A motion that keeps the contacts and serves a task.

    Attributes:
        motion: (N, nv) accelerations, or velocities for inverse kinematics.
        task_error: (N, m) by how much the task is missed, wanted less achieved; zero to rounding
            unless the robot is near a singularity of the task.
    """

    motion: Array
    task_error: Array


def task_acceleration(
    desired: Array,
    position: Array,
    velocity: Array,
    stiffness: float | Array,
    damping: float | Array,
    *,
    desired_velocity: Array | None = None,
    desired_acceleration: Array | None = None,
) -> Array:
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
    jacobian: Array,
    jacobian_bias: Array,
    task_jacobian: Array,
    task_bias: Array | None,
    task: Array,
    reference: Array | None = None,
    *,
    motion_cost: Array | None = None,
    least_gain: float = LEAST_GAIN,
) -> TaskMotion:
    """Accelerations that keep the contacts, serve a task and stay near a reference, eq. (19).

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
        InvalidValueError: `least_gain` is not positive and finite.
    """
    count, velocities, task_jacobian = _check(jacobian, task_jacobian, task, motion_cost)
    check_shape("jacobian_bias", jacobian_bias, (count, jacobian.shape[1]), "(N, k)")
    if task_bias is not None:
        check_shape("task_bias", task_bias, tuple(task.shape), "(N, m)")
        task = task - task_bias
    if reference is not None:
        check_shape("reference", reference, (count, velocities), "(N, nv)")
    return _constrained(
        jacobian, -jacobian_bias, task_jacobian, task, reference, motion_cost, least_gain
    )


def floating_base_inverse_kinematics(
    jacobian: Array,
    task_jacobian: Array,
    task: Array,
    reference: Array | None = None,
    *,
    motion_cost: Array | None = None,
    least_gain: float = LEAST_GAIN,
) -> TaskMotion:
    """Velocities that keep the contacts, serve a task and stay near a reference, [M10]'s [11].

    v = v_ref + [J_C; J_t]^+ ([0; task] - [J_C; J_t] v_ref): joints and base move together so that
    the feet stand still, the task moves as wanted, and what is left follows the reference.

    Args:
        jacobian: (N, k, nv) J_C of the contacts; repeated and zero rows are fine.
        task_jacobian: (N, m, nv) J_t, or (m, nv) where it is the same for all robots.
        task: (N, m) wanted velocity of the task.
        reference: (N, nv) velocity v_ref. Default: zeros.
        motion_cost: (nv,) positive weights of squared deviations from the reference. Default: ones.
        least_gain: see `operational_space_acceleration`.

    Returns:
        TaskMotion, whose motion has J_C v = 0.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `least_gain` is not positive and finite.
    """
    count, velocities, task_jacobian = _check(jacobian, task_jacobian, task, motion_cost)
    if reference is not None:
        check_shape("reference", reference, (count, velocities), "(N, nv)")
    return _constrained(jacobian, None, task_jacobian, task, reference, motion_cost, least_gain)


def _check(
    jacobian: Array, task_jacobian: Array, task: Array, motion_cost: Array | None
) -> tuple[int, int, Array]:
    """Raise ShapeError unless the arrays fit; return N, nv and the task Jacobian (N, m, nv)."""
    shape = tuple(jacobian.shape)
    if len(shape) != 3:
        raise ShapeError("jacobian", shape, "(N, k, nv)")
    count, _, velocities = shape
    if task_jacobian.ndim == 2:
        xp = namespace(jacobian)
        task_jacobian = xp.broadcast_to(task_jacobian, (count, *task_jacobian.shape))
    rows = task_jacobian.shape[-2]
    check_shape("task_jacobian", task_jacobian, (count, rows, velocities), "(N, m, nv)")
    check_shape("task", task, (count, rows), "(N, m)")
    if motion_cost is not None:
        check_shape("motion_cost", motion_cost, (velocities,), "(nv,)")
    return count, velocities, task_jacobian


def _constrained(
    jacobian: Array,
    contact: Array | None,
    task_jacobian: Array,
    task: Array,
    reference: Array | None,
    motion_cost: Array | None,
    least_gain: float,
) -> TaskMotion:
    """The motion u nearest to the reference with J_C u = contact, and J_t u = task if it can be.

    Args:
        jacobian: (N, k, nv).
        contact: (N, k); None for zeros.
        task_jacobian: (N, m, nv).
        task: (N, m).
        reference: (N, nv); None for zeros.
        motion_cost: (nv,); None for ones.
        least_gain: see there.

    Returns:
        TaskMotion.
    """
    if not 0.0 < least_gain < np.inf:
        raise InvalidValueError("least_gain", least_gain, "a positive, finite number")
    weighted = jacobian if motion_cost is None else jacobian / motion_cost
    inverse, _ = symmetric_pseudo_inverse(weighted @ jacobian.mT, _CONTACT_RTOL)

    # Columns of A^-1 J_t^T less the part that would move the contacts; A = diag(motion_cost).
    columns = task_jacobian.mT if motion_cost is None else (task_jacobian / motion_cost).mT
    free = columns - weighted.mT @ (inverse @ (jacobian @ columns))

    violation = contact if contact is None else -contact
    if reference is not None:
        held = matvec(jacobian, reference)
        violation = held if violation is None else held + violation
    base = reference
    if violation is not None:
        correction = matvec(weighted.mT, matvec(inverse, violation))
        base = -correction if reference is None else reference - correction
    error = task if base is None else task - matvec(task_jacobian, base)

    gram = task_jacobian @ free
    share = matvec(_damped_inverse(gram, least_gain), error)
    motion = matvec(free, share)
    return TaskMotion(motion if base is None else base + motion, error - matvec(gram, share))


def _damped_inverse(gram: Array, least_gain: float) -> Array:
    """Inverse of Gram matrices (N, m, m), bounded as the module says.

    Plain inversion serves all that are certified to have no gain below `least_gain`.
    """
    xp = namespace(gram)
    inverse, rank = symmetric_pseudo_inverse(gram)
    bound = xp.sum(inverse * inverse, axis=(-2, -1))
    exact = (rank == gram.shape[-1]) & (bound < least_gain**-4)
    if not exact.all():
        rows = xp.nonzero(~exact)[0]
        doubtful = gram[rows]
        finite = xp.all(xp.isfinite(doubtful), axis=(-2, -1))[:, None, None]
        values, vectors = xp.linalg.eigh(xp.where(finite, doubtful, 0.0))
        values = xp.clip(values / least_gain**2, 0.0, None)  # squared gains in units of the least
        damping = xp.clip(1.0 - values, 0.0, None) ** 2
        damped = (vectors / ((values + damping) * least_gain**2)[:, None, :]) @ vectors.mT
        inverse[rows] = xp.where(finite, damped, xp.nan)
    return inverse
