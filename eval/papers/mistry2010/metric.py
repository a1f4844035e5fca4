"""Least torque where slides and hinges mix: eq. (15) in a metric that makes units homogeneous.

A sum of squares of N and N·m is a sum of nothing: a robot described in millimetres would get other
torques from [M10] eq. (15) than the same robot in metres. [M10] III-B.3 first projects the dynamics
into a space of homogeneous units, by a symmetric positive definite matrix B that measures
velocities, |v|^2 = v^T B v. With B = L L^T (Cholesky) and v' = L^T v the dynamics are

    M' = L^-1 M L^-T,   h' = L^-1 h,   J' = J L^-T,   a' = L^T a,   S^T tau' = L^-1 S^T tau,

of the same form as before, because L^T is upper triangular and the base comes first: v'_q depends
on joint velocities only. Eq. (15) there gives the torque that minimises, of all with the same
motion, |tau'|^2 = tau^T (S B^-1 S^T) tau, and takes "the nearest acceleration" in the metric B.

Two metrics whose results do not depend on units: one in which a radian counts as a characteristic
length, and M itself, the kinetic energy, which needs no such choice but brings the inertia, and its
errors, back into the choice among torques ([M10], footnote 1).
"""

import numpy as np

from eval.papers.mistry2010.force_feedback import Equation
from fbid_gym.control import InverseDynamics, orthogonal_inverse_dynamics


def metric_inverse_dynamics(equation: Equation, metric: np.ndarray) -> InverseDynamics:
    """Return torques of [M10] eq. (15), the orthogonal decomposition taken in a metric.

    Args:
        equation: of motion, with the desired accelerations.
        metric: B on velocities, (nv, nv) or (N, nv, nv) symmetric positive definite, such as M.

    Returns:
        InverseDynamics in the units of the arguments; NaN for a robot whose metric is not finite.
    """
    mass_matrix, bias, jacobian, acceleration, jacobian_bias = equation
    sick = ~np.isfinite(metric).all(axis=(-2, -1), keepdims=True)
    factor = np.linalg.cholesky(np.where(sick, np.eye(mass_matrix.shape[-1]), metric))
    factor = np.broadcast_to(np.where(sick, np.nan, factor), mass_matrix.shape)
    inverse = np.linalg.inv(factor)
    solution = orthogonal_inverse_dynamics(
        inverse @ mass_matrix @ inverse.mT,
        np.matvec(inverse, bias),
        jacobian @ inverse.mT,
        np.matvec(factor.mT, acceleration),
        jacobian_bias,
    )
    return solution._replace(
        torque=np.matvec(factor[:, 6:, 6:], solution.torque),
        acceleration=np.matvec(inverse.mT, solution.acceleration),
    )
