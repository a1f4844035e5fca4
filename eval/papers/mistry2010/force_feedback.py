"""Inverse dynamics that know the contact forces, and the inertia-weighted one: eq. (15)'s rivals.

[M10] III-A multiplies the dynamics M a + h = S^T tau + J^T lambda by Sbar^T = (S M^-1 S^T)^-1 S
M^-1, which leaves the actuated rows. With the base first, and blocks b and q of M,

    Sbar^T = [-M_qb M_bb^-1   1],     (S M^-1 S^T)^-1 = M_qq - M_qb M_bb^-1 M_bq,

so that eq. (8) is nothing but the joint rows of the dynamics, taken at the base acceleration that
the given contact forces cause,

    a_b = M_bb^-1 (J_b^T F - h_b - M_bq a_q),     tau = (M [a_b; a_q] + h - J^T F)_q.

The base rows of a command do not enter eq. (8): where the base goes is left to the forces, which
are measured before the torque takes effect. Any torque that has been applied, put through forward
dynamics, comes back from eq. (8); a wrong force F + dF gives a torque wrong by -Sbar^T J^T dF.

The projection of Sentis and Khatib, eq. (7), has in place of the measured force that of eq. (6). It
reads O tau = ..., with the operator O = Sbar^T (1 - J^T Jbar^T) S^T = (S M^-1 S^T)^-1 C,

    C = S P S^T,     P = M^-1 - M^-1 J^T (J M^-1 J^T)^+ J M^-1.

C is symmetric, and its rank is n - rank J + rank J_b (J_b: base columns): it lacks the directions
in which joints only press the contacts against each other, six of them for two flat feet. Wherever
the contacts can push the base in every direction (rank J_b = 6) and the command respects them, the
solutions of eq. (7) are those of eq. (11), and its smallest is the torque of eq. (15), whatever
inertia the model has: the two differ in rounding and in what they do with other commands.

Eq. (8) with F from eq. (6) at the previous tick's torque is one step of the iteration tau <-
tau + (right side of (7) - O tau). The eigenvalues of O lie in [0, 1]. So at a fixed state the
iteration converges to a solution of eq. (7), slowly where an eigenvalue is small; in the directions
that O lacks it does not move at all, and keeps, or adds up, whatever torque it finds there.

Eqs. (5) to (8) are right as printed, signs included (J there has independent rows; here it need
not). Velocities are base first, v = [base (6), joints (n)], nv = 6 + n; k counts the rows of J.
"""

from typing import NamedTuple

import numpy as np

# Eigenvalues at or below this share of the largest count as zero.
_RTOL = 1e-10


class Equation(NamedTuple):
    """The equation of motion of N robots with k rows of contacts: how any law's arguments begin."""

    mass_matrix: np.ndarray  # (N, nv, nv) M, symmetric positive definite
    bias: np.ndarray  # (N, nv) h
    jacobian: np.ndarray  # (N, k, nv) J of the contacts; its rows may repeat
    acceleration: np.ndarray  # (N, nv) desired; of these the laws here use the joint rows
    jacobian_bias: np.ndarray  # (N, k) Jdot v


class KnownForces(NamedTuple):
    """Torques, and what they rest on."""

    torque: np.ndarray  # (N, n) N·m
    contact_force: np.ndarray
    """(N, k) generalized forces of the rows of J; the least in norm where rows are redundant."""
    acceleration: np.ndarray  # (N, nv) the robot will have if these are the forces


def contact_force_of_torque(equation: Equation, torque: np.ndarray) -> np.ndarray:
    """Return the forces that a torque (N, n) causes if the contacts hold, (N, k), [M10] eq. (6).

    They are the least in norm where rows of J repeat; zero for zero rows.
    """
    mass_matrix, bias, jacobian, _, jacobian_bias = equation
    load = bias - _joint_rows(torque)
    # M^-1 [J^T, h - S^T tau]
    response = np.linalg.solve(mass_matrix, np.concatenate([jacobian.mT, load[..., None]], axis=-1))
    projected = jacobian @ response
    inverse, _ = _pseudo_inverse(projected[..., :-1])
    return np.matvec(inverse, projected[..., -1] - jacobian_bias)


def force_feedback(equation: Equation, contact_force: np.ndarray) -> KnownForces:
    """Return torques for desired joint accelerations under given forces (N, k), [M10] eq. (8).

    Measured forces of contact points are brought to reduced rows of J by their point map.
    """
    mass_matrix, bias, jacobian, acceleration, _ = equation
    load = bias - np.matvec(jacobian.mT, contact_force)
    joints = acceleration[:, 6:]
    push = load[:, :6] + np.matvec(mass_matrix[:, :6, 6:], joints)
    base = np.linalg.solve(mass_matrix[:, :6, :6], -push[..., None])[..., 0]
    caused = np.concatenate([base, joints], axis=-1)
    torque = np.matvec(mass_matrix[:, 6:, :], caused) + load[:, 6:]
    return KnownForces(torque, contact_force, caused)


def estimated_force(equation: Equation, previous_torque: np.ndarray) -> KnownForces:
    """Return torques by eq. (8), with the forces that eq. (6) ascribes to the previous tick's.

    If `previous_torque` (N, n) is all that was applied, a feedback added to this law's is taken for
    a cause of the contact forces: held at a fixed state, it is magnified by 1 / mu along an
    eigenvector of O with eigenvalue mu, and sums up without bound where mu is zero.
    """
    return force_feedback(equation, contact_force_of_torque(equation, previous_torque))


def actuated_projection(equation: Equation) -> tuple[np.ndarray, np.ndarray]:
    """Return the operator O of [M10] eq. (7), (N, n, n), and its rank, (N,) integers."""
    inverse, response, _, _ = _projector(equation)
    compliance = _without_rounding(response[:, 6:, 6:], inverse[:, 6:, 6:])
    _, rank = _pseudo_inverse(compliance)
    return np.linalg.solve(inverse[:, 6:, 6:], compliance), rank


def inertia_weighted(equation: Equation) -> KnownForces:
    """Return the least torques for desired joint accelerations by the projection of eq. (7).

    Eq. (7) is multiplied by S M^-1 S^T, which makes it symmetric, C tau = a_q + S (P h + Jbar Jdot
    v), and solved by the pseudo-inverse of C. Joint accelerations that the contacts do not allow
    are met in the sense of least squares.
    """
    _, bias, _, acceleration, jacobian_bias = equation
    inverse, response, through, inertia = _projector(equation)
    compliance = _without_rounding(response[:, 6:, 6:], inverse[:, 6:, 6:])
    # Jbar = M^-1 J^T (J M^-1 J^T)^+
    drift = -np.matvec(response, bias) - np.matvec(through.mT, np.matvec(inertia, jacobian_bias))
    torque = np.matvec(_pseudo_inverse(compliance)[0], acceleration[:, 6:] - drift[:, 6:])
    achieved = np.matvec(response[:, :, 6:], torque) + drift
    load = bias - _joint_rows(torque)
    contact_force = np.matvec(inertia, np.matvec(through, load) - jacobian_bias)
    return KnownForces(torque, contact_force, achieved)


def _projector(equation: Equation) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """M^-1, P, J M^-1 and (J M^-1 J^T)^+."""
    inverse = np.linalg.inv(equation.mass_matrix)
    through = equation.jacobian @ inverse
    inertia, _ = _pseudo_inverse(through @ equation.jacobian.mT)
    response = inverse - through.mT @ inertia @ through
    return inverse, 0.5 * (response + response.mT), through, inertia


def _pseudo_inverse(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moore-Penrose inverse (N, k, k) and rank (N,) of positive semidefinite matrices.

    A matrix that is not finite gets NaN and rank 0, and harms no other.
    """
    sick = ~np.isfinite(matrix).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(np.where(sick[:, None, None], 0.0, 0.5 * (matrix + matrix.mT)))
    present = values > _RTOL * values[:, -1:]
    reciprocal = np.divide(1.0, values, out=np.zeros_like(values), where=present)
    reciprocal[sick] = np.nan
    return (vectors * reciprocal[:, None]) @ vectors.mT, present.sum(axis=1)


def _without_rounding(compliance: np.ndarray, free: np.ndarray) -> np.ndarray:
    """The joints' compliance; zero where contacts leave nothing of the free one but rounding."""
    left, whole = (np.abs(part).max(axis=(1, 2), initial=0.0) for part in (compliance, free))
    return np.where((left <= _RTOL * whole)[:, None, None], 0.0, compliance)


def _joint_rows(torque: np.ndarray) -> np.ndarray:
    """S^T tau: (N, nv)."""
    return np.pad(torque, [(0, 0), (6, 0)])
