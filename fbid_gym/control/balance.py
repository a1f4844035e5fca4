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
error is weighed as a wrench, in N and N m (see `wrench_distribution`).
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fbid_gym.control.arrays import Array, matvec, namespace
from fbid_gym.errors import InvalidValueError

GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class BalanceGains:
    """Gains of a balancer, each symmetric and positive semidefinite: zero leaves a direction free.

    Given as a number, a diagonal (3,), or a matrix (3, 3); kept as (3, 3).

    Attributes:
        stiffness: K_P, N/m, on the position of the centre of mass.
        damping: K_D on its motion: 1/s on the linear momentum in (38), N s/m on the velocity in
            (36).
        rotation_stiffness: K_R, N m/rad, on the base's orientation, in the axes of the desired one.
        rotation_damping: D: 1/s on the angular momentum in (38), N m s/rad on the base's angular
            velocity in (36).
        rotation_map: (3, 9) takes the nine entries of R_d^T R, row by row, to the moment of the
            rotational spring, in the axes of the desired orientation.

    Raises:
        InvalidValueError: a gain is not finite, not symmetric, or has a negative eigenvalue.
    """

    stiffness: Any
    damping: Any
    rotation_stiffness: Any
    rotation_damping: Any
    rotation_map: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the gains and make them matrices."""
        for name in ("stiffness", "damping", "rotation_stiffness", "rotation_damping"):
            object.__setattr__(self, name, _gain(name, getattr(self, name)))
        object.__setattr__(self, "rotation_map", _rotation_map(self.rotation_stiffness))

    @classmethod
    def from_frequencies(
        cls,
        mass: float,
        inertia: np.ndarray,
        *,
        linear: Any,
        rotation: Any,
        damping_ratio: float = 1.0,
    ) -> "BalanceGains":
        """Gains of (38) for any robot, from natural frequencies and a damping ratio.

        Args:
            mass: kg.
            inertia: (3, 3) kg m^2, symmetric, what resists the base's rotation in stance. Through
                full inverse dynamics: angular momentum per angular velocity of the base while feet
                and centre of mass stay, less than the locked robot's because the legs turn less
                than the base. Through [G15]'s quasi-static map: the locked robot's, because there
                a moment does its work on the average angular velocity Lambda_l l.
            linear: Hz, of the centre of mass; a number or one for x, y and z.
            rotation: Hz, of the base's orientation; likewise.
            damping_ratio: of all of them.

        Raises:
            InvalidValueError: one of them is not positive and finite, or `inertia` not symmetric
                and positive definite.
        """
        rates = []
        for name, value in (("linear", linear), ("rotation", rotation)):
            rates.append(2.0 * np.pi * np.broadcast_to(_positive(name, value, (1, 3)), (3,)))
        _positive("mass", mass, (1,))
        ratio = float(_positive("damping_ratio", damping_ratio, (1,))[0])
        inertia = _gain("inertia", inertia)
        return cls(
            stiffness=mass * rates[0] ** 2,
            damping=2.0 * ratio * rates[0],
            rotation_stiffness=rates[1][:, None] * inertia * rates[1],
            rotation_damping=2.0 * ratio * rates[1],
        )

    def on_velocity(self, mass: float, inertia: np.ndarray) -> "BalanceGains":
        """Return gains of (36) that damp a rigid body as these do in (38).

        Args:
            mass: kg.
            inertia: (3, 3) kg m^2, angular momentum per angular velocity of the base.
        """
        root = _root(self.rotation_damping)
        return BalanceGains(
            stiffness=self.stiffness,
            damping=mass * self.damping,
            rotation_stiffness=self.rotation_stiffness,
            # D I where the two commute, and symmetric where they do not
            rotation_damping=root @ _gain("inertia", inertia) @ root,
        )


class BalanceTarget(NamedTuple):
    """Where a robot shall be, and how it shall move there; world axes.

    Attributes:
        com: (N, 3) m.
        rotation: (N, 3, 3) world from base.
        com_velocity: (N, 3) m/s.
        angular_velocity: (N, 3) rad/s, of the base; (36) damps the difference to it.
        angular_momentum: (N, 3) kg m^2/s, about the centre of mass; (38) damps the difference.
        momentum_rate: (N, 6) N and N m, feedforward.
    """

    com: Array
    rotation: Array
    com_velocity: Array
    angular_velocity: Array
    angular_momentum: Array
    momentum_rate: Array


def resting_target(com: Array, rotation: Array) -> BalanceTarget:
    """Return the target of robots that shall stand still at com (N, 3), rotation (N, 3, 3)."""
    still = namespace(com).zeros_like(com)
    rate = namespace(com).concat((still, still), axis=-1)
    return BalanceTarget(com, rotation, still, still, still, rate)


def orientation_moment(gains: BalanceGains, rotation: Array, desired: Array) -> Array:
    """Return the moment of the rotational spring between the base and where it should be.

    It pulls towards `desired` from every orientation but those 180 degrees away, where it may
    vanish. In quaternions it is 2 (delta K eps + eps x K eps) in the base's axes, with (delta, eps)
    that of R^T R_d.

    Args:
        gains: their `rotation_stiffness`, in the axes of the desired orientation.
        rotation: (N, 3, 3) world from base.
        desired: (N, 3, 3) world from base.

    Returns:
        (N, 3) N m, world axes.
    """
    error = desired.mT @ rotation
    flat = error.reshape(error.shape[0], 9)
    return matvec(desired, matvec(_like(gains.rotation_map, flat), flat))


def desired_wrench_ott2011(
    gains: BalanceGains,
    target: BalanceTarget,
    *,
    com: Array,
    com_velocity: Array,
    rotation: Array,
    angular_velocity: Array,
    mass: Array,
    axes: Array | None = None,
    gravity: float = GRAVITY,
) -> Array:
    """Return the desired wrench at the centre of mass, [G15] eq. (36).

    Args:
        gains: of velocities, see `BalanceGains.on_velocity`.
        target: of the robots.
        com: (N, 3) m, world.
        com_velocity: (N, 3) m/s, world.
        rotation: (N, 3, 3) world from base.
        angular_velocity: (N, 3) rad/s, of the base, world axes.
        mass: (N,) kg.
        axes: (N, 3, 3) world from the axes of all gains but K_R. Default: the world's.
        gravity: m/s^2, along -z.

    Returns:
        (N, 6) N and N m, world axes, what the contacts shall do to the robot.
    """
    force = _apply(gains.stiffness, axes, target.com - com)
    force = force + _apply(gains.damping, axes, target.com_velocity - com_velocity)
    moment = orientation_moment(gains, rotation, target.rotation)
    spin = target.angular_velocity - angular_velocity
    moment = moment + _apply(gains.rotation_damping, axes, spin)
    return _with_weight(force, moment, target, mass, gravity)


def desired_wrench_garofalo2015(
    gains: BalanceGains,
    target: BalanceTarget,
    *,
    com: Array,
    rotation: Array,
    momentum: Array,
    mass: Array,
    axes: Array | None = None,
    gravity: float = GRAVITY,
) -> Array:
    """Return the desired wrench at the centre of mass, [G15] eqs. (38), (39).

    That is w_CoM - blkdiag(K_D, D) h, the right side of (38) without the factor Lambda_h.

    Args:
        gains: of momenta.
        target: of the robots.
        com: (N, 3) m, world.
        rotation: (N, 3, 3) world from base.
        momentum: (N, 6) kg m/s and kg m^2/s, world axes.
        mass: (N,) kg.
        axes: (N, 3, 3) world from the axes of all gains but K_R. Default: the world's.
        gravity: m/s^2, along -z.

    Returns:
        (N, 6) N and N m, world axes, what the contacts shall do to the robot.
    """
    force = _apply(gains.stiffness, axes, target.com - com)
    excess = mass[:, None] * target.com_velocity - momentum[:, :3]
    force = force + _apply(gains.damping, axes, excess)
    moment = orientation_moment(gains, rotation, target.rotation)
    spin = target.angular_momentum - momentum[:, 3:]
    moment = moment + _apply(gains.rotation_damping, axes, spin)
    return _with_weight(force, moment, target, mass, gravity)


def _with_weight(
    force: Array, moment: Array, target: BalanceTarget, mass: Array, gravity: float
) -> Array:
    """Feedback, feedforward, and what carries the weight."""
    wrench = namespace(force).concat((force, moment), axis=-1) + target.momentum_rate
    wrench[:, 2] += gravity * mass
    return wrench


def _apply(gain: np.ndarray, axes: Array | None, error: Array) -> Array:
    """Gain times error (N, 3), the gain in its own axes."""
    matrix = _like(gain, error)
    if axes is None:
        return matvec(matrix, error)
    return matvec(axes, matvec(matrix, matvec(axes.mT, error)))


def _like(value: np.ndarray, array: Array) -> Array:
    """A constant in the namespace, type and device of an array."""
    if isinstance(array, np.ndarray):
        return value
    return namespace(array).asarray(value, dtype=array.dtype, device=array.device)


def _rotation_map(stiffness: np.ndarray) -> np.ndarray:
    """The linear map of `BalanceGains.rotation_map`.

    With E = R_d^T R and its quaternion, 2 delta eps is the axial vector of E, and eps eps^T is half
    the symmetric part of E up to a multiple of the identity, which has no part in eps x K eps.
    """
    result = np.zeros((3, 9))
    for entry in range(9):
        error = np.zeros((3, 3))
        error[entry // 3, entry % 3] = 1.0
        twice_sine = -0.5 * _antisymmetric(error)
        product = _antisymmetric(0.5 * (error + error.T) @ stiffness)
        result[:, entry] = -(stiffness @ twice_sine + product)
    return result


def _antisymmetric(matrix: np.ndarray) -> np.ndarray:
    """The vector e_ijk X_jk: minus twice the axial vector."""
    return np.array(
        [
            matrix[1, 2] - matrix[2, 1],
            matrix[2, 0] - matrix[0, 2],
            matrix[0, 1] - matrix[1, 0],
        ]
    )


def _gain(name: str, given: Any) -> np.ndarray:
    """A symmetric positive semidefinite (3, 3), or the error that says why not."""
    expected = (
        "a number, a diagonal (3,) or a matrix (3, 3), symmetric, without negative eigenvalue"
    )
    try:
        value: np.ndarray = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise InvalidValueError(name, given, expected) from None
    if value.shape not in ((), (3,), (3, 3)) or not np.isfinite(value).all():
        raise InvalidValueError(name, given, expected)
    if value.ndim < 2:
        value = value * np.eye(3)
    size = np.abs(value).max()
    if np.abs(value - value.T).max() > 1e-9 * size:
        raise InvalidValueError(name, given, expected)
    value = 0.5 * (value + value.T)
    if np.linalg.eigvalsh(value)[0] < -1e-12 * size:
        raise InvalidValueError(name, given, expected)
    return value


def _positive(name: str, given: Any, sizes: tuple[int, ...]) -> np.ndarray:
    """Positive finite numbers, as many as one of `sizes`, or the error that says why not."""
    expected = " or ".join(str(size) for size in sizes) + " positive finite numbers"
    try:
        value: np.ndarray = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        raise InvalidValueError(name, given, expected) from None
    if value.ndim != 1 or len(value) not in sizes or not ((value > 0) & (value < np.inf)).all():
        raise InvalidValueError(name, given, expected)
    return value


def _root(matrix: np.ndarray) -> np.ndarray:
    """The symmetric square root of a symmetric positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


TABLE_1 = BalanceGains(
    stiffness=(6000.0, 2000.0, 4000.0),
    damping=(7.0, 1.0, 0.05),
    rotation_stiffness=(500.0, 400.0, 100.0),
    rotation_damping=(20.0, 20.0, 2.0),
)
"""Gains of [G15], table 1, for TORO, with (38). Its damping is printed in N s/(kg m): it multiplies
momentum, and the unit is 1/s."""
