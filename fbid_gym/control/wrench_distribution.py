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

from fbid_gym.control.arrays import Array, check_shape, constant, matvec, namespace
from fbid_gym.control.contact_forces import (
    MAX_ITERATIONS,
    REGULARISATION,
    TOLERANCE,
    ContactLimits,
    check_contact_options,
    dual_problem,
    limit_values,
    solve_contact_forces,
    wrench_scale,
)
from fbid_gym.control.pseudo_inverse import symmetric_pseudo_inverse
from fbid_gym.control.torque_limits import STEPS, TorqueLimits, forces_within_torque_limits
from fbid_gym.errors import ShapeError

# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point.
_FREE_RTOL = 1e-6
_EXCESS = 1e-3  # share of a limit that may be exceeded without a second solution


class TorqueMap(NamedTuple):
    """Joint torques as a function of contact forces: tau = offset - J_q^T lambda + W w.

    Attributes:
        offset: (N, n) N m.
        jacobian: (N, k, nv) of the contact rows, whose joint columns are J_q.
        per_wrench: (N, n, 6) W, of the wrench at the centre of mass.
    """

    offset: Array
    jacobian: Array
    per_wrench: Array

    def torque(self, row_force: Array, wrench: Array) -> Array:
        """Return torques (N, n) from lambda (N, k) and w (N, 6)."""
        contact = matvec(self.jacobian[:, :, 6:].mT, row_force)
        return self.offset - contact + matvec(self.per_wrench, wrench)


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


def com_wrench_of_points(to_com: Array, jacobian: Array, point_map: Array) -> Array:
    """Return the map from point forces to their wrench at the centre of mass: (N, 6, 3 P).

    It is the left side of [G15] eqs. (37) and, but for the factor Lambda_h, (38).

    Args:
        to_com: (N, 6, 6) `CentroidalTerms.to_com`.
        jacobian: (N, k, nv) of the contact rows.
        point_map: (N, k, 3 P) `ReducedContacts.point_map`.
    """
    return (to_com @ jacobian[:, :, :6].mT) @ point_map


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
    xp = namespace(wrench)
    scale = wrench_scale(length, None, wrench)
    wrench_map = com_wrench_of_points(to_com, torque_map.jacobian, point_map)
    scaled = wrench_map * scale[:, None]
    inverse, _ = symmetric_pseudo_inverse(scaled @ scaled.mT, _FREE_RTOL)
    flat = matvec(scaled.mT, matvec(inverse, wrench * scale))
    delivered = matvec(wrench_map, flat)
    torque = torque_map.torque(matvec(point_map, flat), delivered)
    missing = (delivered - wrench) * scale
    residual = xp.sqrt(xp.vecdot(missing, missing)) / weight
    point_force = flat.reshape(flat.shape[0], flat.shape[1] // 3, 3)
    return Balance(torque, point_force, wrench, delivered, residual, xp.zeros_like(wrench))


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
    count, rows, velocities = torque_map.jacobian.shape
    columns, joints = point_map.shape[-1], velocities - 6
    if columns % 3:
        raise ShapeError("point_map", tuple(point_map.shape), "3 P columns")
    check_shape("point_map", point_map, (count, rows, columns), "(N, k, 3 P)")
    check_shape("wrench", wrench, (count, 6), "(N, 6)")
    check_shape("to_com", to_com, (count, 6, 6), "(N, 6, 6)")
    check_contact_options(limits, active, warm_start, count, columns // 3)
    xp = namespace(wrench)
    if torque_limit is not None:
        torque_limit = _as_array(torque_limit, wrench)
        shape = (count, joints)[2 - torque_limit.ndim :]
        check_shape("torque_limit", torque_limit, shape, "(N, n) or (n,)")
        torque_limit = xp.broadcast_to(torque_limit, (count, joints))

    if contact_rotation is not None:
        point_map = _turned(point_map, contact_rotation)
    wrench_map = com_wrench_of_points(to_com, torque_map.jacobian, point_map)
    scale = wrench_scale(length, wrench_cost, wrench)
    weight = _as_array(weight, wrench)
    scaled_map, scaled = wrench_map * scale[:, None], wrench * scale
    forces = solve_contact_forces(
        scaled_map,
        scaled,
        limits,
        weight=weight,
        active=active,
        warm_start=warm_start,
        regularisation=regularisation,
        tolerance=tolerance,
        max_iterations=max_iterations,
    )
    flat = forces.force.reshape(count, columns)
    delivered = wrench + forces.wrench / scale
    torque = torque_map.torque(matvec(point_map, flat), delivered)
    residual = forces.residual

    if torque_limit is not None:
        beyond = xp.any(xp.abs(torque) > (1.0 + _EXCESS) * torque_limit, axis=-1)
        if beyond.any():
            at = xp.nonzero(beyond)[0]
            values = limit_values(limits, active, wrench)
            problem = dual_problem(
                scaled_map, scaled, values, weight, regularisation, tolerance
            ).rows(at)
            contact = torque_map.jacobian[at, :, 6:].mT @ point_map[at]
            slope = torque_map.per_wrench[at] @ wrench_map[at] - contact
            torques = TorqueLimits(slope, torque_map.offset[at], torque_limit[at])
            own_weight = weight[at] if weight.ndim else weight
            flat[at] = forces_within_torque_limits(
                problem, torques, flat[at], own_weight, torque_steps
            )
            delivered[at] = matvec(wrench_map[at], flat[at])
            torque[at] = torques.offset + matvec(slope, flat[at])
            missing = (delivered - wrench) * scale
            residual = xp.where(beyond, xp.sqrt(xp.vecdot(missing, missing)) / weight, residual)

    point_force = flat.reshape(count, columns // 3, 3)
    if contact_rotation is not None:
        point_force = (contact_rotation @ point_force[..., None])[..., 0]
    return Balance(torque, point_force, wrench, delivered, residual, forces.dual)


def _as_array(value: float | Array, like: Array) -> Array:
    """A number, cached, or an array in the namespace and type of another."""
    if isinstance(value, int | float):
        return constant(float(value), like)
    if type(value) is type(like) and value.dtype == like.dtype:
        return value
    return namespace(like).asarray(value, dtype=like.dtype, device=like.device)


def _turned(point_map: Array, contact_rotation: Array) -> Array:
    """The map of point forces in contact axes, from that of forces in world axes."""
    count, rows, columns = point_map.shape
    split = point_map.reshape(count, rows, columns // 3, 1, 3)
    return (split @ contact_rotation[:, None]).reshape(count, rows, columns)
