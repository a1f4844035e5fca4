"""Random floating-base systems in contact, built from rigid bodies so that ranks are physical."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest

from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics.frames import skew


class System(NamedTuple):
    """M, h, J, a command and Jdot v of N robots, with what their contacts imply."""

    mass_matrix: np.ndarray
    bias: np.ndarray
    jacobian: np.ndarray
    acceleration: np.ndarray
    jacobian_bias: np.ndarray
    rank: int
    underactuation: int

    @property
    def law(self) -> tuple[np.ndarray, ...]:
        """The arguments every law starts with."""
        return self[:5]

    def achievable(self) -> "System":
        """The same with the nearest command that contacts and underactuation allow."""
        return self._replace(acceleration=orthogonal_inverse_dynamics(*self.law).acceleration)

    def forward(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What comes of a torque: see `forward`."""
        return forward(self.mass_matrix, self.bias, self.jacobian, self.jacobian_bias, torque)


def forward(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    drift: np.ndarray,
    torque: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations and least contact forces of N robots under a torque, by dense least squares."""
    nv, solutions = bias.shape[1], []
    for i, rows in enumerate(jacobian):
        kkt = np.block([[mass_matrix[i], -rows.T], [rows, np.zeros((len(rows), len(rows)))]])
        right = np.concatenate([-bias[i], -drift[i]])
        right[6:nv] += torque[i]
        solutions.append(np.linalg.lstsq(kkt, right, rcond=1e-11)[0])
    return np.array(solutions)[:, :nv], np.array(solutions)[:, nv:]


def null_space(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span the null space of one matrix."""
    _, sizes, right = np.linalg.svd(matrix)
    rank = int((sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-300)).sum())
    return right[rank:].T


def equation_15(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    acceleration: np.ndarray,
    torque_cost: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Torque and contact force of one robot by [M10] eqs. (9)-(17), SVD in place of QR."""
    select = np.eye(len(bias))[6:]
    force = mass_matrix @ acceleration + bias
    unconstrained = null_space(jacobian) if len(jacobian) else np.eye(len(bias))  # S_u Q^T
    reduced = unconstrained.T @ select.T
    root = np.ones(len(select)) if torque_cost is None else 1.0 / np.sqrt(torque_cost)
    # (16): A# = W^-1 A^T (A W^-1 A^T)^-1 = W^-1/2 (A W^-1/2)^+.
    torque = root * (np.linalg.pinv(reduced * root, rcond=1e-9) @ unconstrained.T @ force)
    contact_force = np.linalg.pinv(jacobian.T, rcond=1e-9) @ (force - select.T @ torque)
    return torque, contact_force


# name: (points of each foot (N x 3, m, from the foot's origin), rank of J, underactuation)
_SOLE = np.array([[x, y, -0.05] for x in (-0.08, 0.12) for y in (-0.04, 0.05)])
_TIP = np.array([[0.0, 0.0, -0.02]])
CONTACTS = {
    "two flat feet": ((_SOLE, _SOLE), 12, 0),
    "one flat foot": ((_SOLE, None), 6, 0),
    "flat foot and toe": ((_SOLE, _TIP), 9, 0),
    "line contact": ((_SOLE[:2], None), 5, 1),
    "two edges": ((_SOLE[:2], _SOLE[2:]), 10, 0),
    "four point feet": ((_TIP, _TIP, _TIP, _TIP), 12, 0),
    "trot pair": ((_TIP, None, None, _TIP), 6, 1),
    "one point": ((None, _TIP), 3, 3),
    "flight": ((None, None), 0, 6),
}
_LEG = 5


def _system(
    rng: np.random.Generator,
    contacts: str = "two flat feet",
    count: int = 4,
    drop_rows: bool = False,
) -> System:
    feet, rank, underactuation = CONTACTS[contacts]
    joints = _LEG * len(feet) + 2
    nv = 6 + joints

    # Links: mass at r from the base origin, moving with the base and some joints.
    mass_matrix, gravity, total = np.zeros((count, nv, nv)), np.zeros((count, nv)), 40.0
    for _ in range(10):
        move = np.zeros((count, 3, nv))
        move[:, :, :3] = np.eye(3)
        move[:, :, 3:6] = -skew(rng.normal(0.0, 0.25, (count, 3)))
        move[:, :, 6:] = rng.normal(0.0, 0.25, (count, 3, joints))
        turn = np.zeros((count, 3, nv))
        turn[:, :, 3:6] = np.eye(3)
        turn[:, :, 6:] = rng.normal(0.0, 0.7, (count, 3, joints))
        mass_matrix += total / 10 * (move.mT @ move) + 0.05 * (turn.mT @ turn)
        gravity += total / 10 * 9.81 * move[:, 2]
    mass_matrix[:, 6:, 6:] += 0.03 * np.eye(joints)

    rows = []
    for foot, points in enumerate(feet):
        # The foot's origin, 0.8 m below the base, and its twist as a function of v.
        origin = np.array([0.3 * (foot // 2), 0.2 * (foot % 2), -0.8])
        origin = origin + rng.normal(0.0, 0.05, (count, 3))
        leg = slice(6 + foot * _LEG, 6 + (foot + 1) * _LEG)
        twist = np.zeros((count, 6, nv))
        twist[:, :3, :3] = twist[:, 3:, 3:6] = np.eye(3)
        twist[:, :3, 3:6] = -skew(origin)
        twist[:, :3, leg] = rng.normal(0.0, 0.5, (count, 3, _LEG))
        twist[:, 3:, leg] = rng.normal(0.0, 0.7, (count, 3, _LEG))
        for point in _TIP if points is None else points:
            jacobian = twist[:, :3] - skew(np.broadcast_to(point, (count, 3))) @ twist[:, 3:]
            if points is not None:
                rows.append(jacobian)
            elif not drop_rows:
                rows.append(np.zeros_like(jacobian))
    jacobian = np.concatenate(rows, axis=1) if rows else np.zeros((count, 0, nv))
    bias, command = gravity + rng.normal(0.0, 5.0, (count, nv)), rng.normal(0.0, 2.0, (count, nv))
    drift = np.matvec(jacobian, rng.normal(0.0, 1.0, (count, nv)))
    return System(mass_matrix, bias, jacobian, command, drift, rank, underactuation)


MakeSystem = Callable[..., System]


@pytest.fixture
def make_system(rng: np.random.Generator) -> MakeSystem:
    """`make_system(contacts, count, drop_rows)`: see `CONTACTS` for the names."""
    return partial(_system, rng)


@pytest.fixture(params=CONTACTS)
def contacts(request: pytest.FixtureRequest) -> str:
    """Every contact case in turn."""
    return request.param
