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
from fbid_gym.control.torque_limits import AffineTorque, forces_within_torque_limits
from fbid_gym.quantities import Accuracy, ForcePath, Limits, TorqueMap
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    gram,
    multiply,
    pseudo_inverse,
    rank_of,
    times,
)

# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point.
_RTOL = 1e-6
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
    own_map, path, own_wrench, weights = _checked(
        torque_map, wrench, (to_com, point_map, None), weight
    )
    (count, joints), points = own_map.offset.shape, path.point_map.shape[2] // 3
    none = Limits(point_limits(ContactLimits(), None, count, points), np.empty((1, joints)))
    scale, start = wrench_scale(length, None), np.empty((count, 6))
    return share(own_map, path, own_wrench, none, scale, weights, DEFAULT_ACCURACY, start, False)


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
    own = Limits(point_limits(limits, active, count, points), contiguous(np.atleast_2d(bound)))
    scale = wrench_scale(length, wrench_cost)
    start = fitted("warm_start", warm_start, "(N, 6)", {"N": count}, np.zeros((count, 6)))
    return share(own_map, own_path, own_wrench, own, scale, weights, accuracy, start, True)


def _checked(
    torque_map: TorqueMap,
    wrench: np.ndarray,
    path: tuple[np.ndarray, np.ndarray, np.ndarray | None],
    weight: float | np.ndarray,
) -> tuple[TorqueMap, ForcePath, np.ndarray, np.ndarray]:
    """Check the arguments of both laws, the weights last; one error names what does not fit."""
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
def share(
    torque_map: TorqueMap,
    path: ForcePath,
    wrench: np.ndarray,
    limits: Limits,
    scale: np.ndarray,
    weight: np.ndarray,
    accuracy: Accuracy,
    start: np.ndarray,
    limited: bool,
) -> Distribution:
    """`distribute`, or else `distribute_freely`, robot by robot.

    Weights are (N,) or (1,) N, wrenches and starts (N, 6).
    """
    count, rows, columns = path.point_map.shape
    joints = torque_map.offset.shape[1]
    found = Distribution(
        *(np.empty((count, joints)), np.empty((count, columns // 3, 3)), wrench),
        *(np.empty((count, 6)), np.empty(count), np.empty((count, 6))),
    )
    turned, values = np.empty((rows, columns)), np.empty((columns // 3, 3))
    maps, scaled = np.empty((6, columns)), np.empty((6, columns))
    wanted, missing, dual = np.empty(6), np.empty(6), np.empty(6)
    product, inverse = np.empty((6, 6)), np.empty((6, 6))
    row_wrench, row_force = np.empty((6, rows)), np.empty(rows)
    for robot in range(count):
        own_map, own_weight = path.point_map[robot], weight[min(robot, len(weight) - 1)]
        jacobian, per_wrench = torque_map.jacobian[robot], torque_map.per_wrench[robot]
        offset, torque = torque_map.offset[robot], found.torque[robot]
        point_force, delivered = found.point_force[robot], found.wrench[robot]
        force, next_start = point_force.reshape(columns), found.warm_start[robot]
        if len(path.world_from_contact) > 0:
            _turn_map(own_map, path.world_from_contact[robot], turned)
            own_map = turned
        _com_wrench_of_points(path.to_com[robot], jacobian, own_map, row_wrench, maps)
        for row in range(6):
            wanted[row] = wrench[robot, row] * scale[row]
            for column in range(columns):
                scaled[row, column] = maps[row, column] * scale[row]
        problem = Problem(scaled, wanted, values)
        if limited:
            limits_in_contact(limits.points, robot, values)
            forces = Forces(point_force, missing, next_start)
            deliver(problem, accuracy, own_weight, start[robot], forces)
            for row in range(6):
                delivered[row] = wrench[robot, row] + missing[row] / scale[row]
        else:
            gram(scaled, scaled, 0.0, product)
            pseudo_inverse(product, _RTOL, inverse)
            times(inverse, wanted, dual)
            force[:] = next_start[:] = 0.0
            add_transposed_times(scaled, dual, force)
            times(maps, force, delivered)
            for row in range(6):
                missing[row] = (delivered[row] - wrench[robot, row]) * scale[row]
        times(own_map, force, row_force)
        _torque_of_forces(offset, jacobian, per_wrench, row_force, delivered, torque)

        bound = limits.torque[min(robot, len(limits.torque) - 1)]
        if limited and _exceeds(torque, bound):
            slope = np.empty((len(bound), columns))
            _torque_slope(jacobian, per_wrench, own_map, maps, slope)
            motors = AffineTorque(slope, offset, bound)
            forces_within_torque_limits(problem, motors, own_weight, accuracy, force)
            times(maps, force, delivered)
            times(slope, force, torque)
            torque += offset
            for row in range(6):
                missing[row] = (delivered[row] - wrench[robot, row]) * scale[row]
        found.residual[robot] = np.sqrt(dot(missing, missing)) / own_weight
        if len(path.world_from_contact) > 0:
            _turn_forces(path.world_from_contact[robot], point_force)
    return found


@compiled
def _exceeds(torque: np.ndarray, limit: np.ndarray) -> bool:
    for j in range(len(torque)):
        # A limit that is no number makes torques that are none.
        if abs(torque[j]) > (1.0 + _EXCESS) * limit[j] or np.isnan(limit[j]):
            return True
    return False


@compiled
def _com_wrench_of_points(
    to_com: np.ndarray,
    jacobian: np.ndarray,
    point_map: np.ndarray,
    row_wrench: np.ndarray,
    result: np.ndarray,
) -> None:
    """Write the map from point forces to their wrench at the centre of mass to `result` (6, 3 P).

    It is the left side of [G15] eqs. (37) and, but for the factor Lambda_h, (38). `row_wrench`
    (6, k) gets that of the forces on the contact rows.
    """
    for row in range(6):
        for k in range(len(jacobian)):
            total = 0.0
            for axis in range(6):
                total += to_com[row, axis] * jacobian[k, axis]
            row_wrench[row, k] = total
    multiply(row_wrench, point_map, result)


@compiled
def _torque_of_forces(
    offset: np.ndarray,
    jacobian: np.ndarray,
    per_wrench: np.ndarray,
    row_force: np.ndarray,
    wrench: np.ndarray,
    torque: np.ndarray,
) -> None:
    """`TorqueMap.torque` of one robot."""
    for j in range(len(torque)):
        total = offset[j]
        for axis in range(6):
            total += per_wrench[j, axis] * wrench[axis]
        torque[j] = total
    for k in range(len(row_force)):
        for j in range(len(torque)):
            torque[j] -= row_force[k] * jacobian[k, 6 + j]


@compiled
def _torque_slope(
    jacobian: np.ndarray,
    per_wrench: np.ndarray,
    point_map: np.ndarray,
    maps: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Write how point forces change torques to `slope` (n, 3 P)."""
    multiply(per_wrench, maps, slope)
    for j in range(len(slope)):
        for k in range(len(jacobian)):
            share = jacobian[k, 6 + j]
            for column in range(slope.shape[1]):
                slope[j, column] -= share * point_map[k, column]


@compiled
def _turn_map(point_map: np.ndarray, rotation: np.ndarray, result: np.ndarray) -> None:
    """Write the map of point forces in contact axes, from that of forces in world axes."""
    for k in range(len(point_map)):
        for point in range(len(rotation)):
            for axis in range(3):
                total = 0.0
                for other in range(3):
                    total += point_map[k, 3 * point + other] * rotation[point, other, axis]
                result[k, 3 * point + axis] = total


@compiled
def _turn_forces(rotation: np.ndarray, force: np.ndarray) -> None:
    """Turn point forces (P, 3) from contact axes to world axes, in place."""
    turned = np.empty(3)
    for point in range(len(force)):
        times(rotation[point], force[point], turned)
        force[point] = turned


@kernel
def underactuation(jacobian: np.ndarray) -> np.ndarray:
    """Six less the rank of the base columns of J: (N,) float; six if not finite.

    Args:
        jacobian: (N, k, nv) of the contacts.
    """
    count, rows, _ = jacobian.shape
    missing = np.empty(count)
    base, push = np.empty((6, rows)), np.empty((6, 6))
    for i in range(count):
        for row in range(6):
            for k in range(rows):
                base[row, k] = jacobian[i, k, row]
        gram(base, base, 0.0, push)
        missing[i] = 6.0 - rank_of(push, _RTOL)
    return missing
