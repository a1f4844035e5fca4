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

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.arrays import (
    Array,
    as_flags,
    as_numpy,
    check_shape,
    from_numpy,
    on_host,
)
from fbid_gym.control.contact_forces import (
    MAX_ITERATIONS,
    REGULARISATION,
    TOLERANCE,
    ContactLimits,
    all_active,
    check_contact_options,
    limit_rows,
    limits_in_contact,
    wrench_scale,
)
from fbid_gym.control.dual_newton import deliver
from fbid_gym.control.point_forces import (
    com_wrench_of_points,
    torque_of_forces,
    torque_slope,
    turn_forces,
    turn_map,
)
from fbid_gym.control.torque_limits import STEPS, forces_within_torque_limits
from fbid_gym.control.torque_map import TorqueMap
from fbid_gym.errors import ShapeError
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    gram,
    pseudo_inverse,
    times,
)

# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point.
_FREE_RTOL = 1e-6
_EXCESS = 1e-3  # share of a limit that may be exceeded without a second solution
LEVEL = np.empty((0, 0, 3, 3))  # contact axes, where they are the world's

Results = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Torque, point_force, wrench, residual and warm_start of a `Balance`."""


class Balance(NamedTuple):
    """Joint torques, and the contact forces they are meant to produce.

    Attributes:
        torque: (N, n) N m.
        point_force: (N, P, 3) N, world, of the ground on each contact point.
        wrench_desired: (N, 6) N and N m at the centre of mass, world.
        wrench: (N, 6) what the point forces deliver.
        residual: (N,) weighted distance of the two, per weight.
        warm_start: (N, 6) for the next call. Zero the rows of robots that were reset.
    """

    torque: Array
    point_force: Array
    wrench_desired: Array
    wrench: Array
    residual: Array
    warm_start: Array


def distribute_freely(
    torque_map: TorqueMap,
    wrench: Array,
    *,
    to_com: Array,
    point_map: Array,
    weight: float | Array,
    length: float = 1.0,
) -> Balance:
    """Return the least contact forces that deliver a wrench if contacts can pull and never slip.

    Arguments as for `distribute`. Inactive points have zero columns in `point_map`.
    """
    points, weights = _check(torque_map, wrench, to_com, point_map, weight)
    results, own_map = _empty(torque_map, points), on_host(torque_map)
    fill_free_balance(
        own_map.offset,
        own_map.jacobian,
        own_map.per_wrench,
        as_numpy(to_com),
        as_numpy(point_map),
        as_numpy(wrench),
        weights,
        wrench_scale(length, None),
        *results,
    )
    return _balance(results, wrench)


def distribute(
    torque_map: TorqueMap,
    wrench: Array,
    limits: ContactLimits,
    *,
    to_com: Array,
    point_map: Array,
    weight: float | Array,
    torque_limit: Array | None = None,
    contact_rotation: Array | None = None,
    active: Array | None = None,
    length: float = 1.0,
    wrench_cost: tuple[float, ...] | None = None,
    warm_start: Array | None = None,
    regularisation: float = REGULARISATION,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
    torque_steps: int = STEPS,
) -> Balance:
    """Return the contact forces that best deliver a wrench, and the torques that go with them.

    With fewer contacts than it takes, down to none, or without friction, the forces deliver the
    part of the wrench that they can, and the residual says how much is missing.

    Torch tensors are computed on the host, in double precision, and come back as what they were.

    Args:
        torque_map: of the balancer.
        wrench: (N, 6) desired at the centre of mass, N and N m, world.
        limits: friction and normal force limits of the contact points.
        to_com: (N, 6, 6) `CentroidalTerms.to_com`.
        point_map: (N, k, 3 P) `ReducedContacts.point_map`.
        weight: N, of the robot; a number or (N,).
        torque_limit: (n,) or (N, n) N m, symmetric. Default: none.
        contact_rotation: (N, P, 3, 3) world from contact axes, whose third is the ground's normal.
            Default: level ground.
        active: (N, P) bool, points in contact; the others get zero force. Default: all.
        length: m, lever arm that makes moments comparable to forces.
        wrench_cost: six positive weights of the squared errors. Default: ones.
        warm_start: (N, 6) of the previous result. Default: zeros.
        regularisation: see `limited_contact_forces`.
        tolerance: see `limited_contact_forces`.
        max_iterations: see `limited_contact_forces`.
        torque_steps: see `torque_limits`.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `length` or `wrench_cost` is not positive and finite.
    """
    points, weights = _check(torque_map, wrench, to_com, point_map, weight)
    count, joints = torque_map.offset.shape
    check_contact_options(limits, active, warm_start, count, points)
    if torque_limit is None:
        bounds = np.full((1, joints), np.inf)
    else:
        bounds = np.array(as_numpy(torque_limit), ndmin=2)
        if torque_limit.shape != (joints,):
            check_shape("torque_limit", torque_limit, (count, joints), "(N, n) or (n,)")
    if contact_rotation is not None:
        check_shape("contact_rotation", contact_rotation, (count, points, 3, 3), "(N, P, 3, 3)")
    results, own_map = _empty(torque_map, points), on_host(torque_map)
    fill_balance(
        own_map.offset,
        own_map.jacobian,
        own_map.per_wrench,
        as_numpy(to_com),
        as_numpy(point_map),
        as_numpy(wrench),
        LEVEL if contact_rotation is None else as_numpy(contact_rotation),
        weights,
        limit_rows(limits, points),
        all_active(points) if active is None else as_flags(active),
        bounds,
        wrench_scale(length, wrench_cost),
        np.zeros((count, 6)) if warm_start is None else as_numpy(warm_start),
        regularisation,
        tolerance,
        max_iterations,
        torque_steps,
        *results,
    )
    return _balance(results, wrench)


def _check(
    torque_map: TorqueMap, wrench: Array, to_com: Array, point_map: Array, weight: float | Array
) -> tuple[int, np.ndarray]:
    """Number of points and weights (N or 1,), or the error that says what does not fit."""
    offset, jacobian, per_wrench = torque_map
    count, rows, velocities = jacobian.shape
    columns, joints = point_map.shape[-1], velocities - 6
    if columns % 3:
        raise ShapeError("point_map", tuple(point_map.shape), "3 P columns")
    check_shape("point_map", point_map, (count, rows, columns), "(N, k, 3 P)")
    check_shape("wrench", wrench, (count, 6), "(N, 6)")
    check_shape("to_com", to_com, (count, 6, 6), "(N, 6, 6)")
    check_shape("offset", offset, (count, joints), "(N, n)")
    check_shape("per_wrench", per_wrench, (count, joints, 6), "(N, n, 6)")
    if isinstance(weight, int | float | np.number):
        return columns // 3, np.array([float(weight)])
    weights = np.atleast_1d(as_numpy(weight))
    if weights.shape != (1,):
        check_shape("weight", weights, (count,), "(N,)")
    return columns // 3, weights


def _empty(torque_map: TorqueMap, points: int) -> Results:
    """Results to write to."""
    count, joints = torque_map.offset.shape
    return (
        np.empty((count, joints)),
        np.empty((count, points, 3)),
        np.empty((count, 6)),
        np.empty(count),
        np.empty((count, 6)),
    )


def _balance(results: Results, wrench: Array) -> Balance:
    """The result, in the kind of array that the wrench is."""
    torque, point_force, *rest = (
        results if isinstance(wrench, np.ndarray) else (from_numpy(x, like=wrench) for x in results)
    )
    return Balance(torque, point_force, wrench, *rest)


@kernel
def fill_free_balance(
    offset: np.ndarray,
    jacobian: np.ndarray,
    per_wrench: np.ndarray,
    to_com: np.ndarray,
    point_map: np.ndarray,
    wrench: np.ndarray,
    weight: np.ndarray,
    scale: np.ndarray,
    torque: np.ndarray,
    point_force: np.ndarray,
    delivered: np.ndarray,
    residual: np.ndarray,
    warm_start: np.ndarray,
) -> None:
    """Robot by robot; the last five arguments are to write to."""
    columns = point_map.shape[2]
    maps, scaled, missing = np.empty((6, columns)), np.empty((6, columns)), np.empty(6)
    product, inverse, dual = np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    row_wrench, row_force = np.empty((6, jacobian.shape[1])), np.empty(jacobian.shape[1])
    for robot in range(len(offset)):
        force = point_force[robot].reshape(columns)
        com_wrench_of_points(to_com[robot], jacobian[robot], point_map[robot], row_wrench, maps)
        for row in range(6):
            missing[row] = wrench[robot, row] * scale[row]
            for column in range(columns):
                scaled[row, column] = maps[row, column] * scale[row]
        gram(scaled, scaled, 0.0, product)
        pseudo_inverse(product, _FREE_RTOL, inverse)
        times(inverse, missing, dual)
        force[:] = 0.0
        add_transposed_times(scaled, dual, force)
        times(maps, force, delivered[robot])
        times(point_map[robot], force, row_force)
        torque_of_forces(
            offset[robot],
            jacobian[robot],
            per_wrench[robot],
            row_force,
            delivered[robot],
            torque[robot],
        )
        missing[:] = (delivered[robot] - wrench[robot]) * scale
        residual[robot] = np.sqrt(dot(missing, missing)) / weight[min(robot, len(weight) - 1)]
        warm_start[robot] = 0.0


@kernel
def fill_balance(
    offset: np.ndarray,
    jacobian: np.ndarray,
    per_wrench: np.ndarray,
    to_com: np.ndarray,
    point_map: np.ndarray,
    wrench: np.ndarray,
    contact_rotation: np.ndarray,
    weight: np.ndarray,
    limits: np.ndarray,
    active: np.ndarray,
    torque_limit: np.ndarray,
    scale: np.ndarray,
    start: np.ndarray,
    regularisation: float,
    tolerance: float,
    budget: int,
    steps: int,
    torque: np.ndarray,
    point_force: np.ndarray,
    delivered: np.ndarray,
    residual: np.ndarray,
    dual: np.ndarray,
) -> None:
    """Robot by robot; the last five arguments are to write to."""
    rows, columns = point_map.shape[1:]
    turned, values = np.empty((rows, columns)), np.empty((columns // 3, 3))
    maps, scaled = np.empty((6, columns)), np.empty((6, columns))
    wanted, missing = np.empty(6), np.empty(6)
    row_wrench, row_force = np.empty((6, rows)), np.empty(rows)
    for robot in range(len(offset)):
        own_map, own_weight = point_map[robot], weight[min(robot, len(weight) - 1)]
        force = point_force[robot].reshape(columns)
        if len(contact_rotation) > 0:
            turn_map(own_map, contact_rotation[robot], turned)
            own_map = turned
        com_wrench_of_points(to_com[robot], jacobian[robot], own_map, row_wrench, maps)
        for row in range(6):
            wanted[row] = wrench[robot, row] * scale[row]
            for column in range(columns):
                scaled[row, column] = maps[row, column] * scale[row]
        limits_in_contact(limits, active, robot, values)
        deliver(
            scaled,
            wanted,
            values,
            tolerance * own_weight,
            regularisation,
            budget,
            start[robot],
            point_force[robot],
            missing,
            dual[robot],
        )
        delivered[robot] = wrench[robot] + missing / scale
        times(own_map, force, row_force)
        torque_of_forces(
            offset[robot],
            jacobian[robot],
            per_wrench[robot],
            row_force,
            delivered[robot],
            torque[robot],
        )

        bound = torque_limit[min(robot, len(torque_limit) - 1)]
        if _exceeds(torque[robot], bound):
            slope = np.empty((len(bound), columns))
            torque_slope(jacobian[robot], per_wrench[robot], own_map, maps, slope)
            forces_within_torque_limits(
                scaled,
                wanted,
                values,
                slope,
                offset[robot],
                bound,
                own_weight,
                regularisation,
                steps,
                force,
            )
            times(maps, force, delivered[robot])
            times(slope, force, torque[robot])
            torque[robot] += offset[robot]
            missing[:] = (delivered[robot] - wrench[robot]) * scale
        residual[robot] = np.sqrt(dot(missing, missing)) / own_weight
        if len(contact_rotation) > 0:
            turn_forces(contact_rotation[robot], point_force[robot])


@compiled
def _exceeds(torque: np.ndarray, limit: np.ndarray) -> bool:
    for j in range(len(torque)):
        if abs(torque[j]) > (1.0 + _EXCESS) * limit[j]:
            return True
    return False
