"""The wrench at the centre of mass that brings a robot back into balance.

Two laws: (36) of Ott, Roa, Hirzinger 2011 as [G15] states it, and [G15] eqs. (38), (39). Both are
a PD law on the centre of mass and a rotational spring on the base. They differ in what is damped:
(36) the velocity of the centre of mass and the base's angular velocity, (38) the linear and the
angular momentum. Only the second is the rate of something: if the contacts deliver the wrench,
hdot = -K_D h + ..., exactly, whatever the joints do.

The spring's moment is that of the potential 2 eps^T K_R eps, with (delta, eps) the quaternion of
the orientation error. [G15] prints -tau_P with tau_P = -2 (delta K_R eps + eps x K_R eps) and the
error R_d^T R; of these, one sign must be turned for the spring to restore: either the error is
R^T R_d and the moment is in the base's axes, or the error is R_d^T R, the moment is +tau_P and in
the axes of the desired orientation. Both are the same moment. It is linear in the entries of the
error's rotation matrix, so no quaternion and none of their signs appears here.

[G15] eq. (38) multiplies both sides by Lambda_h, since Jbar_b^T w = Lambda_h (wrench at the centre
of mass). Where the contacts can deliver the wrench that changes nothing; where they cannot, the
error is weighed as a wrench, in N and N·m (see `wrench_distribution`).
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.balance_gains import BalanceGains
from fbid_gym.control.equations import fitted, fitted_all, numbers_of_robots
from fbid_gym.dynamics.rotations import rotation_at
from fbid_gym.dynamics.vectors import (
    Rotation,
    Vector,
    add,
    matrix,
    product,
    scale,
    store,
    store_matrix,
    subtract,
    transposed,
    turn,
    vector,
)
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import (
    BodyMotion,
    CentroidalTerms,
    DynamicsTerms,
    RobotState,
    SupportFrame,
    Target,
    WrenchGains,
)
from fbid_gym.small_matrices import dot

GRAVITY = 9.81


class BalanceTarget(NamedTuple):
    """Desired pose and motion of a robot; world axes.

    Attributes:
        com: (N, 3) m.
        world_from_base: (N, 3, 3).
        com_velocity: (N, 3) m/s.
        angular_velocity: (N, 3) rad/s, of the base; (36) damps the difference to it.
        angular_momentum: (N, 3) kg·m²/s, about the centre of mass; (38) damps the difference.
        momentum_rate: (N, 6) N and N·m, feedforward.
    """

    com: np.ndarray
    world_from_base: np.ndarray
    com_velocity: np.ndarray
    angular_velocity: np.ndarray
    angular_momentum: np.ndarray
    momentum_rate: np.ndarray


def resting_target(com: np.ndarray, rotation: np.ndarray) -> BalanceTarget:
    """Return the target of robots that shall stand still at com (N, 3), rotation (N, 3, 3)."""
    still = np.zeros_like(com)
    return BalanceTarget(com, rotation, still, still, still, np.zeros((len(com), 6)))


@kernel
def desired_wrench(
    gains: WrenchGains,
    gravity: float,
    push: np.ndarray,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    body: CentroidalTerms,
    frame: SupportFrame,
) -> np.ndarray:
    """Return the wrench at the centre of mass that leads robots back to their target in the world.

    In the world's axes, (N, 6) N and N·m, by [G15] (36) or (38). Gains, all but K_R, and the push
    (N, 6) that is added are along the axes of the feet's frame; gravity (m/s^2) is along -z. The
    momentum of the target is that of the robot as it stands, moving at the target's velocities.
    """
    count = len(terms.com)
    rotation, momentum_rate = np.empty((count, 3, 3)), np.empty((count, 6))
    spin, own_spin, angular_momentum = np.empty((3, count, 3))
    for i in range(count):
        rows, own_rows = rotation_at(target.qpos, i, 3), matrix(terms.world_from_base, (i,))
        store_matrix(rows, rotation, (i,))
        store(turn(rows, vector(target.qvel, (i,), 3)), spin, (i,))
        store(turn(own_rows, vector(state.qvel, (i,), 3)), own_spin, (i,))
        store(scale(body.mass[i], vector(target.com_acceleration, (i,))), momentum_rate, (i,))
        for k in range(3):
            angular_momentum[i, k] = dot(body.matrix[i, 3 + k], target.qvel[i])
            momentum_rate[i, 3 + k] = dot(body.matrix[i, 3 + k], target.qacc[i])
    asked = BalanceTarget(
        target.com, rotation, target.com_velocity, spin, angular_momentum, momentum_rate
    )
    moving = BodyMotion(
        *(terms.com, terms.com_velocity, terms.world_from_base, own_spin, body.momentum, body.mass)
    )
    wrench = balance_wrench(gains, asked, moving, frame.world_from_support, gravity)
    for i in range(count):
        for axis in range(3):
            wrench[i, axis] += dot(frame.world_from_support[i, axis], push[i, :3])
            wrench[i, 3 + axis] += dot(frame.world_from_support[i, axis], push[i, 3:])
    return wrench


def desired_wrench_ott2011(
    gains: BalanceGains,
    target: BalanceTarget,
    *,
    com: np.ndarray,
    com_velocity: np.ndarray,
    rotation: np.ndarray,
    angular_velocity: np.ndarray,
    mass: float | np.ndarray,
    axes: np.ndarray | None = None,
    gravity: float = GRAVITY,
) -> np.ndarray:
    """Return the desired wrench at the centre of mass, [G15] eq. (36).

    Args:
        gains: of velocities, see `BalanceGains.on_velocity`.
        target: of the robots.
        com: (N, 3) m, world.
        com_velocity: (N, 3) m/s, world.
        rotation: (N, 3, 3) world from base.
        angular_velocity: (N, 3) rad/s, of the base, world axes.
        mass: kg, positive; a number or (N,).
        axes: (N, 3, 3) world from the axes of all gains but K_R. Default: the world's.
        gravity: m/s^2, along -z.

    Returns:
        (N, 6) N and N·m, world axes, what the contacts shall do to the robot.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `mass` is not positive.
    """
    momentum = np.zeros((len(com), 6))  # (36) does not look at it
    motion = com, com_velocity, rotation, angular_velocity, momentum
    return _wrench(gains.on_errors(of_velocity=True), target, motion, mass, axes, gravity)


def desired_wrench_garofalo2015(
    gains: BalanceGains,
    target: BalanceTarget,
    *,
    com: np.ndarray,
    rotation: np.ndarray,
    momentum: np.ndarray,
    mass: float | np.ndarray,
    axes: np.ndarray | None = None,
    gravity: float = GRAVITY,
) -> np.ndarray:
    """Return the desired wrench at the centre of mass, [G15] eqs. (38), (39).

    That is w_CoM - blkdiag(K_D, D) h, the right side of (38) without the factor Lambda_h. The gains
    are of momenta; `momentum` is (N, 6) kg·m/s and kg·m²/s, world axes. All else is as for
    `desired_wrench_ott2011`.
    """
    still = np.zeros(com.shape)  # (38) does not look at velocities
    motion = com, still, rotation, still, momentum
    return _wrench(gains.on_errors(of_velocity=False), target, motion, mass, axes, gravity)


def _wrench(
    gains: WrenchGains,
    target: BalanceTarget,
    motion: tuple[np.ndarray, ...],
    mass: float | np.ndarray,
    axes: np.ndarray | None,
    gravity: float,
) -> np.ndarray:
    """Bring arrays into order, or say what does not fit, and compute."""
    if motion[0].ndim != 2:
        raise ShapeError("com", tuple(motion[0].shape), "(N, 3)")
    sizes = {"N": len(motion[0])}
    masses = numbers_of_robots("mass", mass, sizes["N"])
    own_axes = np.broadcast_to(np.eye(3), (sizes["N"], 3, 3)) if axes is None else axes
    place, pose, rates = "(N, 3)", "(N, 3, 3)", "(N, 6)"
    names = ("com", "com_velocity", "rotation", "angular_velocity", "momentum")
    ours = zip(names, motion, (place, place, pose, place, rates), strict=True)
    return balance_wrench(
        gains,
        fitted_all("target.", target, (place, pose, place, place, place, rates), sizes),
        BodyMotion(*(*(fitted(*each, sizes) for each in ours), masses)),
        fitted("axes", own_axes, pose, sizes),
        gravity,
    )


@kernel
def balance_wrench(
    gains: WrenchGains, target: BalanceTarget, motion: BodyMotion, axes: np.ndarray, gravity: float
) -> np.ndarray:
    """Return the desired wrench at the centre of mass, (36) or (38): (N, 6) N and N·m, world.

    `axes` (N, 3, 3), world from these, are those of all gains but K_R; gravity (m/s^2) is along -z.
    """
    count = len(motion.com)
    wrench = np.empty((count, 6))
    stiffness, damping = matrix(gains.stiffness, ()), matrix(gains.damping, ())
    rotation_damping = matrix(gains.rotation_damping, ())
    for i in range(count):
        to_world, mass = matrix(axes, (i,)), motion.mass[i]
        to_axes = transposed(to_world)
        error = subtract(vector(target.com, (i,)), vector(motion.com, (i,)))
        rate = vector(target.com_velocity, (i,))
        if gains.on_velocity:
            rate = subtract(rate, vector(motion.com_velocity, (i,)))
            spin = vector(target.angular_velocity, (i,))
            spin = subtract(spin, vector(motion.angular_velocity, (i,)))
        else:
            rate = subtract(scale(mass, rate), vector(motion.momentum, (i,)))
            spin = vector(target.angular_momentum, (i,))
            spin = subtract(spin, vector(motion.momentum, (i,), 3))
        force = add(turn(stiffness, turn(to_axes, error)), turn(damping, turn(to_axes, rate)))
        force = add(turn(to_world, force), vector(target.momentum_rate, (i,)))
        store((force[0], force[1], force[2] + gravity * mass), wrench, (i,))

        desired, base = matrix(target.world_from_base, (i,)), matrix(motion.world_from_base, (i,))
        spring = _spring(gains.rotation_map, product(transposed(desired), base))
        moment = turn(to_world, turn(rotation_damping, turn(to_axes, spin)))
        moment = add(add(turn(desired, spring), moment), vector(target.momentum_rate, (i,), 3))
        store(moment, wrench, (i,), 3)
    return wrench


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
