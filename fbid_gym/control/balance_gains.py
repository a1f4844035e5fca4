"""Gains of the balancers: given, or derived from natural frequencies for any robot."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fbid_gym.checks import positive_numbers
from fbid_gym.errors import InvalidValueError
from fbid_gym.quantities import WrenchGains


@dataclass(frozen=True, eq=False)
class BalanceGains:
    """Gains of a balancer, each symmetric and positive semidefinite: zero leaves a direction free.

    Given as a number, a diagonal (3,), or a matrix (3, 3); kept as (3, 3).

    Attributes:
        stiffness: K_P, N/m, on the position of the centre of mass.
        damping: K_D on its motion: 1/s on the linear momentum in (38), N s/m on the velocity in
            (36).
        rotation_stiffness: K_R, N·m/rad, on the base's orientation, in the axes of the desired one.
        rotation_damping: D: 1/s on the angular momentum in (38), N·m·s/rad on the base's angular
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
            inertia: (3, 3) kg·m², symmetric, what resists the base's rotation in stance. Through
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
            rates.append(2.0 * np.pi * np.broadcast_to(positive_numbers(name, value, 1, 3), (3,)))
        positive_numbers("mass", mass, 1)
        ratio = float(positive_numbers("damping_ratio", damping_ratio, 1)[0])
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
            inertia: (3, 3) kg·m², angular momentum per angular velocity of the base.
        """
        root = _root(self.rotation_damping)
        return BalanceGains(
            stiffness=self.stiffness,
            damping=mass * self.damping,
            rotation_stiffness=self.rotation_stiffness,
            # D I where the two commute, and symmetric where they do not
            rotation_damping=root @ _gain("inertia", inertia) @ root,
        )

    def on_errors(self, *, of_velocity: bool) -> WrenchGains:
        """Return what (36), of velocities, or (38), of momenta, makes of errors."""
        own = self.stiffness, self.damping, self.rotation_damping, self.rotation_map
        return WrenchGains(*own, of_velocity)


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
        [matrix[1, 2] - matrix[2, 1], matrix[2, 0] - matrix[0, 2], matrix[0, 1] - matrix[1, 0]]
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


def _root(matrix: np.ndarray) -> np.ndarray:
    """The symmetric square root of a symmetric positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
