"""From a wrench at the centre of mass to contact forces, and from those to joint torques.

All balancers share this optimisation. The contact forces are those within the friction cones and
normal force limits of the contact points that come nearest to the wrench; with a foot's corners as
contact points that keeps the centre of pressure inside the foot, and its yaw moment within what
friction can hold. "Nearest" weighs squared errors of force (per weight) and moment (per weight and
`length`) by `wrench_cost`: six numbers that say which of force and moment, vertical and horizontal,
goes first when not all can be had. What is missing is reported.

Every balancer's torque is affine in the contact forces, tau = offset - J_q^T lambda + W w, with
lambda the generalized forces of the contact rows and w the wrench at the centre of mass. So torque
limits are linear in the forces. They are looked at only where the first solution breaks one, see
`torque_limits`. There they come before the wrench, as the friction cones do; where not even the
limits agree with each other, as for a robot too weak to stand, the torques exceed them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_shape, contiguous
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.contact_forces import (
    DEFAULT_ACCURACY,
    ContactLimits,
    fitted_point_map,
    limits_in_contact,
    point_limits,
    wrench_scale,
)
from fbid_gym.control.dual_newton import Forces, Problem, deliver
from fbid_gym.control.equations import contact_sizes, fitted, fitted_all, numbers_of_robots
from fbid_gym.control.point_forces import (
    com_wrench_of_points,
    torque_of_forces,
    torque_slope,
    turn_forces,
    turn_map,
)
from fbid_gym.control.torque_limits import AffineTorque, forces_within_torque_limits
from fbid_gym.quantities import Accuracy, ForcePath, Limits, TorqueMap
from fbid_gym.small_matrices import add_transposed_times, dot, gram, pseudo_inverse, times

# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point.
_FREE_RTOL = 1e-6
_EXCESS = 1e-3  # share of a limit that may be exceeded without a second solution


class Distribution(NamedTuple):
    """Joint torques, and the contact forces they are meant to produce.

    Attributes:
        torque: (N, n) N·m.
        point_force: (N, P, 3) N, world, of the ground on each contact point.
        wrench_desired: (N, 6) N and N·m at the centre of mass, world.
        wrench: (N, 6) what the point forces deliver.
        residual: (N,) weighted distance of the two, per weight.
        warm_start: (N, 6) for the next call. Zero the rows of robots that were reset.
    """

    torque: np.ndarray
    point_force: np.ndarray
    wrench_desired: np.ndarray
    wrench: np.ndarray
    residual: np.ndarray
    warm_start: np.ndarray


def distribute_freely(
    torque_map: TorqueMap,
    wrench: np.ndarray,
    *,
    to_com: np.ndarray,
    point_map: np.ndarray,
    weight: float | np.ndarray,
    length: float = 1.0,
) -> Distribution:
    """Return the least contact forces that deliver a wrench if contacts can pull and never slip.

    Arguments as for `distribute`. Inactive points have zero columns in `point_map`.
    """
    start = _checked(torque_map, wrench, (to_com, point_map, None), weight)
    return share_freely(*start[:3], wrench_scale(length, None), start[3])


def distribute(
    torque_map: TorqueMap,
    wrench: np.ndarray,
    limits: ContactLimits,
    *,
    to_com: np.ndarray,
    point_map: np.ndarray,
    weight: float | np.ndarray,
    torque_limit: np.ndarray | None = None,
    contact_rotation: np.ndarray | None = None,
    active: np.ndarray | None = None,
    length: float = 1.0,
    wrench_cost: Sequence[float] | np.ndarray | None = None,
    warm_start: np.ndarray | None = None,
    accuracy: Accuracy = DEFAULT_ACCURACY,
) -> Distribution:
    """Return the contact forces that best deliver a wrench, and the torques that go with them.

    With fewer contacts than it takes, down to none, or without friction, the forces deliver the
    part of the wrench that they can, and the residual says how much is missing.

    Args:
        torque_map: of the balancer.
        wrench: (N, 6) desired at the centre of mass, N and N·m, world.
        limits: friction and normal force limits of the contact points.
        to_com: (N, 6, 6) `CentroidalTerms.to_com`.
        point_map: (N, k, 3 P) `ReducedContacts.point_map`.
        weight: N, of the robot, positive; a number or (N,).
        torque_limit: (n,) or (N, n) N·m, symmetric. Default: none.
        contact_rotation: (N, P, 3, 3) world from contact axes, whose third is the ground's normal.
            Default: level ground.
        active: (N, P) bool, points in contact; the others get zero force. Default: all.
        length: m, lever arm that makes moments comparable to forces.
        wrench_cost: six positive weights of the squared errors. Default: ones.
        warm_start: (N, 6) of the previous result. Default: zeros.
        accuracy: of the contact forces, see `contact_forces` and `torque_limits`.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `length` or `wrench_cost` is not positive and finite, or `weight` not
            positive.
    """
    path = to_com, point_map, contact_rotation
    own_map, own_path, own_wrench, weights = _checked(torque_map, wrench, path, weight)
    (count, joints), points = own_map.offset.shape, own_path.point_map.shape[2] // 3
    bound = np.full(joints, np.inf) if torque_limit is None else torque_limit
    if bound.shape != (joints,):
        check_shape("torque_limit", bound, (count, joints), "(N, n) or (n,)")
    return share_within_limits(
        own_map,
        own_path,
        own_wrench,
        Limits(point_limits(limits, active, count, points), contiguous(np.atleast_2d(bound))),
        wrench_scale(length, wrench_cost),
        weights,
        accuracy,
        fitted("warm_start", warm_start, "(N, 6)", {"N": count}, np.zeros((count, 6))),
    )


def _checked(
    torque_map: TorqueMap,
    wrench: np.ndarray,
    path: tuple[np.ndarray, np.ndarray, np.ndarray | None],
    weight: float | np.ndarray,
) -> tuple[TorqueMap, ForcePath, np.ndarray, np.ndarray]:
    """What both laws start from, the weights last, or the error that says what does not fit."""
    to_com, point_map, rotation = path
    sizes = contact_sizes(torque_map.jacobian)
    own_map = fitted_point_map(point_map, sizes)
    sizes |= {"P": own_map.shape[2] // 3}
    level = np.empty((0, sizes["P"], 3, 3))
    rotation = fitted("contact_rotation", rotation, "(N, P, 3, 3)", sizes, level)
    return (
        fitted_all("", torque_map, ("(N, n)", "(N, k, nv)", "(N, n, 6)"), sizes),
        ForcePath(fitted("to_com", to_com, "(N, 6, 6)", sizes), own_map, rotation),
        fitted("wrench", wrench, "(N, 6)", sizes),
        numbers_of_robots("weight", weight, sizes["N"]),
    )


@kernel
def share_freely(
    torque_map: TorqueMap,
    path: ForcePath,
    wrench: np.ndarray,
    scale: np.ndarray,
    weight: np.ndarray,
) -> Distribution:
    """`distribute_freely`, robot by robot; weights (N,) or (1,) N, wrenches (N, 6)."""
    count, rows, columns = path.point_map.shape
    found = _empty(torque_map, wrench, columns // 3)
    maps, scaled, missing = np.empty((6, columns)), np.empty((6, columns)), np.empty(6)
    product, inverse, dual = np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    row_wrench, row_force = np.empty((6, rows)), np.empty(rows)
    for robot in range(count):
        own_map, jacobian = path.point_map[robot], torque_map.jacobian[robot]
        force, delivered = found.point_force[robot].reshape(columns), found.wrench[robot]
        com_wrench_of_points(path.to_com[robot], jacobian, own_map, row_wrench, maps)
        for row in range(6):
            missing[row] = wrench[robot, row] * scale[row]
            for column in range(columns):
                scaled[row, column] = maps[row, column] * scale[row]
        gram(scaled, scaled, 0.0, product)
        pseudo_inverse(product, _FREE_RTOL, inverse)
        times(inverse, missing, dual)
        force[:] = 0.0
        add_transposed_times(scaled, dual, force)
        times(maps, force, delivered)
        times(own_map, force, row_force)
        torque_of_forces(
            torque_map.offset[robot],
            jacobian,
            torque_map.per_wrench[robot],
            row_force,
            delivered,
            found.torque[robot],
        )
        for row in range(6):
            missing[row] = (delivered[row] - wrench[robot, row]) * scale[row]
        found.residual[robot] = np.sqrt(dot(missing, missing)) / weight[min(robot, len(weight) - 1)]
        found.warm_start[robot] = 0.0
    return found


@kernel
def share_within_limits(
    torque_map: TorqueMap,
    path: ForcePath,
    wrench: np.ndarray,
    limits: Limits,
    scale: np.ndarray,
    weight: np.ndarray,
    accuracy: Accuracy,
    start: np.ndarray,
) -> Distribution:
    """`distribute`, robot by robot; weights (N,) or (1,) N, wrenches and starts (N, 6)."""
    count, rows, columns = path.point_map.shape
    found = _empty(torque_map, wrench, columns // 3)
    turned, values = np.empty((rows, columns)), np.empty((columns // 3, 3))
    maps, scaled = np.empty((6, columns)), np.empty((6, columns))
    wanted, missing = np.empty(6), np.empty(6)
    row_wrench, row_force = np.empty((6, rows)), np.empty(rows)
    for robot in range(count):
        own_map, own_weight = path.point_map[robot], weight[min(robot, len(weight) - 1)]
        jacobian, per_wrench = torque_map.jacobian[robot], torque_map.per_wrench[robot]
        offset, torque = torque_map.offset[robot], found.torque[robot]
        point_force, delivered = found.point_force[robot], found.wrench[robot]
        force = point_force.reshape(columns)
        if len(path.world_from_contact) > 0:
            turn_map(own_map, path.world_from_contact[robot], turned)
            own_map = turned
        com_wrench_of_points(path.to_com[robot], jacobian, own_map, row_wrench, maps)
        for row in range(6):
            wanted[row] = wrench[robot, row] * scale[row]
            for column in range(columns):
                scaled[row, column] = maps[row, column] * scale[row]
        limits_in_contact(limits.points, robot, values)
        problem = Problem(scaled, wanted, values)
        forces = Forces(point_force, missing, found.warm_start[robot])
        deliver(problem, accuracy, own_weight, start[robot], forces)
        for row in range(6):
            delivered[row] = wrench[robot, row] + missing[row] / scale[row]
        times(own_map, force, row_force)
        torque_of_forces(offset, jacobian, per_wrench, row_force, delivered, torque)

        bound = limits.torque[min(robot, len(limits.torque) - 1)]
        if _exceeds(torque, bound):
            slope = np.empty((len(bound), columns))
            torque_slope(jacobian, per_wrench, own_map, maps, slope)
            motors = AffineTorque(slope, offset, bound)
            forces_within_torque_limits(problem, motors, own_weight, accuracy, force)
            times(maps, force, delivered)
            times(slope, force, torque)
            torque += offset
            for row in range(6):
                missing[row] = (delivered[row] - wrench[robot, row]) * scale[row]
        found.residual[robot] = np.sqrt(dot(missing, missing)) / own_weight
        if len(path.world_from_contact) > 0:
            turn_forces(path.world_from_contact[robot], point_force)
    return found


@compiled
def _empty(torque_map: TorqueMap, wrench: np.ndarray, points: int) -> Distribution:
    """A result to write to."""
    count, joints = torque_map.offset.shape
    return Distribution(
        np.empty((count, joints)),
        np.empty((count, points, 3)),
        wrench,
        np.empty((count, 6)),
        np.empty(count),
        np.empty((count, 6)),
    )


@compiled
def _exceeds(torque: np.ndarray, limit: np.ndarray) -> bool:
    for j in range(len(torque)):
        # A limit that is no number makes torques that are none.
        if abs(torque[j]) > (1.0 + _EXCESS) * limit[j] or np.isnan(limit[j]):
            return True
    return False
