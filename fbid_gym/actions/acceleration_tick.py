"""One tick of the limited acceleration law, from the dynamics to the torques, in one call.

As in `balance_tick`: to Python every call and every array costs a fraction of a microsecond, which
for one robot adds up to more than the computation.
"""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.control.contact_forces import MAX_ITERATIONS, REGULARISATION, TOLERANCE
from fbid_gym.control.limited_inverse_dynamics import fill_limited
from fbid_gym.control.operational_space import LEAST_GAIN, fill_motion
from fbid_gym.control.underactuation import fill_underactuation
from fbid_gym.dynamics.contacts import fill_contacts


@kernel
def acceleration_tick(
    foot_of_point: np.ndarray,
    slot_of_point: np.ndarray,
    offset: np.ndarray,
    motion: np.ndarray,
    spread: np.ndarray,
    switching: bool,
    active: np.ndarray,
    foot_rotation: np.ndarray,
    foot_velocity: np.ndarray,
    foot_jacobian: np.ndarray,
    foot_bias: np.ndarray,
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    velocity: np.ndarray,
    wanted: np.ndarray,
    task_jacobian: np.ndarray,
    task_bias: np.ndarray,
    task: np.ndarray,
    limits: np.ndarray,
    scale: np.ndarray,
    base_mobility: float,
    length: float,
    viscosity: np.ndarray,
    start: np.ndarray,
    torque: np.ndarray,
    residual: np.ndarray,
    warm_start: np.ndarray,
    missing: np.ndarray,
) -> None:
    """Fill torques (N, n), residuals (N,), warm starts (N, 6), and directions beyond reach (N,).

    The arguments, N robots each; of `limits` and `active` a single row may stand for all robots:

    - foot_of_point ... spread: of the `ContactGeometry`;
    - switching: whether contacts come and go, and active: (N, P) bool, points in contact;
    - foot_rotation ... bias: of the `DynamicsTerms`;
    - velocity: (N, nv) of the robots;
    - wanted: (N, nv) accelerations to come nearest to;
    - task_jacobian ... task: of the `Task` that goes first, with no rows for none;
    - limits: (N, P, 3) of `limit_rows`, and scale: (6,) of `wrench_scale`;
    - base_mobility: of the base beside 1 of the joints, where contacts do not allow all;
    - length: m, lever arm that makes moments comparable to forces;
    - viscosity: (n,) N m s/rad of the joints, to be compensated;
    - start: (N, 6), the last warm starts;
    - torque, residual, warm_start, missing: to be filled; `missing` only if contacts switch.
    """
    count, velocities = velocity.shape
    points, rows = active.shape[1], len(motion) * motion.shape[2]
    jacobian, jacobian_bias = np.empty((count, rows, velocities)), np.empty((count, rows))
    point_map = np.empty((count, rows, 3 * points))
    fill_contacts(
        foot_of_point,
        slot_of_point,
        offset,
        motion,
        spread,
        switching,
        active,
        foot_rotation,
        foot_velocity,
        foot_jacobian,
        foot_bias,
        jacobian,
        jacobian_bias,
        point_map,
    )
    desired = wanted
    if task.shape[1] > 0:
        desired = np.empty((count, velocities))
        fill_motion(
            jacobian,
            jacobian_bias,
            task_jacobian,
            task - task_bias,
            wanted,
            np.ones(velocities),
            LEAST_GAIN,
            desired,
            np.empty(task.shape),
        )
    fill_limited(
        mass_matrix,
        bias,
        jacobian,
        desired,
        jacobian_bias,
        point_map,
        limits,
        active,
        start,
        scale,
        base_mobility,
        length,
        REGULARISATION,
        TOLERANCE,
        MAX_ITERATIONS,
        torque,
        np.empty((count, rows)),
        np.empty((count, velocities)),
        np.empty((count, points, 3)),
        residual,
        np.empty(count, np.int64),
        warm_start,
    )
    if switching:
        fill_underactuation(jacobian, missing)
    for i in range(count):
        for j in range(len(viscosity)):
            torque[i, j] += viscosity[j] * velocity[i, 6 + j]
