"""What the forces on the contact points of one robot do: wrenches and joint torques, compiled.

P points act through k contact rows, `point_map` (k, 3 P). Results are written to the last argument.
"""

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.small_matrices import multiply, times


@compiled
def com_wrench_of_points(
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
def torque_of_forces(
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
def torque_slope(
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
def turn_map(point_map: np.ndarray, rotation: np.ndarray, result: np.ndarray) -> None:
    """Write the map of point forces in contact axes, from that of forces in world axes."""
    for k in range(len(point_map)):
        for point in range(len(rotation)):
            for axis in range(3):
                total = 0.0
                for other in range(3):
                    total += point_map[k, 3 * point + other] * rotation[point, other, axis]
                result[k, 3 * point + axis] = total


@compiled
def turn_forces(rotation: np.ndarray, force: np.ndarray) -> None:
    """Turn point forces (P, 3) from contact axes to world axes, in place."""
    turned = np.empty(3)
    for point in range(len(force)):
        times(rotation[point], force[point], turned)
        force[point] = turned
