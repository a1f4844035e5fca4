"""One tick of the layer com_wrench, from the dynamics to the torques, in one call.

To Python every call and every array costs a fraction of a microsecond, which for one robot adds up
to more than the computation. So this passes the arrays of one compiled loop on to the next.
"""

import numpy as np

from fbid_gym.actions.desired_wrench import fill_wrenches
from fbid_gym.compiled import kernel
from fbid_gym.control.balancers import RIDGE, fill_torque_map
from fbid_gym.control.contact_forces import MAX_ITERATIONS, REGULARISATION, TOLERANCE
from fbid_gym.control.torque_limits import STEPS
from fbid_gym.control.underactuation import fill_underactuation
from fbid_gym.control.wrench_distribution import LEVEL, fill_balance, fill_free_balance
from fbid_gym.dynamics.centroidal import fill_centroidal_terms
from fbid_gym.dynamics.contacts import fill_contacts
from fbid_gym.dynamics.support import fill_frame

# A swinging leg follows its own command; the other joints make up for what that does to contacts
# and momentum.
_SWING_MOBILITY = 1e-3


@kernel
def balance_tick(
    stiffness: np.ndarray,
    damping: np.ndarray,
    rotation_damping: np.ndarray,
    rotation_map: np.ndarray,
    on_velocity: bool,
    gravity: float,
    push: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    wanted_position: np.ndarray,
    wanted_velocity: np.ndarray,
    wanted_acceleration: np.ndarray,
    wanted_com: np.ndarray,
    wanted_com_velocity: np.ndarray,
    wanted_com_acceleration: np.ndarray,
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    base_position: np.ndarray,
    base_rotation: np.ndarray,
    com: np.ndarray,
    com_velocity: np.ndarray,
    foot_position: np.ndarray,
    foot_rotation: np.ndarray,
    foot_velocity: np.ndarray,
    foot_jacobian: np.ndarray,
    foot_bias: np.ndarray,
    middle: np.ndarray,
    by_position: np.ndarray,
    by_rotation: np.ndarray,
    foot_of_point: np.ndarray,
    slot_of_point: np.ndarray,
    point_offset: np.ndarray,
    motion: np.ndarray,
    spread: np.ndarray,
    switching: bool,
    active: np.ndarray,
    legs: np.ndarray,
    joint_stiffness: float,
    joint_damping: float,
    swing_stiffness: float,
    swing_damping: float,
    balancer: int,
    limited: bool,
    limits: np.ndarray,
    torque_limit: np.ndarray,
    weight: np.ndarray,
    scale: np.ndarray,
    viscosity: np.ndarray,
    start: np.ndarray,
    torque: np.ndarray,
    residual: np.ndarray,
    warm_start: np.ndarray,
    missing: np.ndarray,
) -> None:
    """Fill torques (N, n), residuals (N,), warm starts (N, 6), and directions beyond reach (N,).

    The arguments, N robots each; of `limits`, `torque_limit`, `weight`, `active` and all that is
    wanted a single row may stand for all robots:

    - stiffness ... push: of the desired wrench, see `desired_wrench`;
    - position, velocity: qpos and qvel of the robots;
    - wanted_position ... wanted_com_acceleration: of the `Reference`;
    - mass_matrix ... foot_bias: of the `DynamicsTerms`;
    - middle ... by_rotation: of the `Support`;
    - foot_of_point ... spread: of the `ContactGeometry`;
    - switching: whether contacts come and go, and active: (N, P) bool, points in contact;
    - legs: (F, n) joints that move this foot and no other, 0 or 1;
    - joint_stiffness ... swing_damping: of the joints, 1/s^2 and 1/s, and of legs that swing;
    - balancer: one of those in `fbid_gym.control.balancers`;
    - limited: whether there are limits, and limits: (N, P, 3) of `limit_rows`;
    - torque_limit: (N, n) N m;
    - weight: (N,) N;
    - scale: (6,) of `wrench_scale`;
    - viscosity: (n,) N m s/rad of the joints, to be compensated;
    - start: (N, 6), the last warm starts;
    - torque, residual, warm_start, missing: to be filled; `missing` only if contacts switch.
    """
    count, joints = torque.shape
    size, points = 6 + joints, active.shape[1]
    matrix, momentum, mass = np.empty((count, 6, size)), np.empty((count, 6)), np.empty(count)
    inertia, inverse_inertia = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    to_com, wrench_map = np.empty((count, 6, 6)), np.empty((count, size, 6))
    fill_centroidal_terms(
        mass_matrix,
        base_position,
        base_rotation,
        com,
        velocity,
        matrix,
        momentum,
        mass,
        inertia,
        inverse_inertia,
        to_com,
        wrench_map,
    )
    centre, level = np.empty((count, 3)), np.empty((count, 3, 3))
    fill_frame(middle, by_position, by_rotation, foot_position, foot_rotation, centre, level)
    rows = len(motion) * motion.shape[2]
    jacobian, contact_bias = np.empty((count, rows, size)), np.empty((count, rows))
    point_map = np.empty((count, rows, 3 * points))
    fill_contacts(
        foot_of_point,
        slot_of_point,
        point_offset,
        motion,
        spread,
        switching,
        active,
        foot_rotation,
        foot_velocity,
        foot_jacobian,
        foot_bias,
        jacobian,
        contact_bias,
        point_map,
    )
    if switching:
        fill_underactuation(jacobian, missing)
    wrench = np.empty((count, 6))
    fill_wrenches(
        stiffness,
        damping,
        rotation_damping,
        rotation_map,
        on_velocity,
        gravity,
        push,
        velocity,
        wanted_position,
        wanted_velocity,
        wanted_acceleration,
        wanted_com,
        wanted_com_velocity,
        wanted_com_acceleration,
        base_rotation,
        com,
        com_velocity,
        matrix,
        momentum,
        mass,
        centre,
        level,
        wrench,
    )
    posture, mobility = np.empty((count, joints)), np.empty((count, joints))
    _fill_posture(
        position,
        velocity,
        wanted_position,
        wanted_velocity,
        wanted_acceleration,
        active,
        foot_of_point,
        legs,
        joint_stiffness,
        joint_damping,
        swing_stiffness,
        swing_damping,
        posture,
        mobility,
    )
    offset, per_wrench = np.empty((count, joints)), np.empty((count, joints, 6))
    fill_torque_map(
        balancer,
        RIDGE,
        matrix,
        to_com,
        mass,
        inverse_inertia,
        wrench_map,
        mass_matrix,
        bias,
        jacobian,
        contact_bias,
        posture,
        mobility,
        offset,
        per_wrench,
    )
    force, delivered = np.empty((count, points, 3)), np.empty((count, 6))
    if limited:
        fill_balance(
            offset,
            jacobian,
            per_wrench,
            to_com,
            point_map,
            wrench,
            LEVEL,
            weight,
            limits,
            active,
            torque_limit,
            scale,
            start,
            REGULARISATION,
            TOLERANCE,
            MAX_ITERATIONS,
            STEPS,
            torque,
            force,
            delivered,
            residual,
            warm_start,
        )
    else:
        fill_free_balance(
            offset,
            jacobian,
            per_wrench,
            to_com,
            point_map,
            wrench,
            weight,
            scale,
            torque,
            force,
            delivered,
            residual,
            warm_start,
        )
    for i in range(count):
        for j in range(joints):
            torque[i, j] += viscosity[j] * velocity[i, 6 + j]


@kernel
def _fill_posture(
    position: np.ndarray,
    velocity: np.ndarray,
    wanted_position: np.ndarray,
    wanted_velocity: np.ndarray,
    wanted_acceleration: np.ndarray,
    active: np.ndarray,
    foot_of_point: np.ndarray,
    legs: np.ndarray,
    stiffness: float,
    damping: float,
    swing_stiffness: float,
    swing_damping: float,
    posture: np.ndarray,
    mobility: np.ndarray,
) -> None:
    """Desired accelerations of the joints, and how readily each departs from its own."""
    in_the_air = np.empty(len(legs), np.bool_)
    for i in range(len(posture)):
        place = wanted_position[min(i, len(wanted_position) - 1), 7:]
        speed = wanted_velocity[min(i, len(wanted_velocity) - 1), 6:]
        change = wanted_acceleration[min(i, len(wanted_acceleration) - 1), 6:]
        contacts = active[min(i, len(active) - 1)]
        in_the_air[:] = True
        for point in range(len(contacts)):
            if contacts[point]:
                in_the_air[foot_of_point[point]] = False
        for j in range(posture.shape[1]):
            error = place[j] - position[i, 7 + j]
            rate = speed[j] - velocity[i, 6 + j]
            swings = False
            for foot in range(len(legs)):
                swings |= in_the_air[foot] and legs[foot, j] > 0.0
            pull = swing_stiffness * error + swing_damping * rate
            if not swings:
                pull = stiffness * error + damping * rate
            posture[i, j] = change[j] + pull
            mobility[i, j] = _SWING_MOBILITY if swings else 1.0
