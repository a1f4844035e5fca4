"""What a control law needs to know about the dynamics of a batch of robots at one instant."""

from typing import NamedTuple

import numpy as np


class DynamicsTerms(NamedTuple):
    """The terms of `M vdot + h = S^T tau + J^T lambda` ([M10] eq. (2)) and the frames beside it.

    Coordinates are MuJoCo's, base first: v = [base linear velocity (world), base angular velocity
    (base frame), joint velocities]. N robots, nv = 6 + n coordinates, F feet. All arrays are
    C-contiguous and of float64, as compiled loops want them.

    A foot's *reference* is the centre of its contact points, fixed in the foot's body, lowered
    along the world's vertical by the radius of its contact spheres (0 for contact sites). For a
    spherical foot this is the point that touches level ground, and it rolls: its offset from the
    sphere's centre stays vertical, so `foot_bias` holds that offset fixed in the world.

    Attributes:
        mass_matrix: (N, nv, nv), with the joints' armature.
        bias: (N, nv) Coriolis, centrifugal and gravity forces; no joint damping, no friction.
        base_position: (N, 3) m, world.
        base_rotation: (N, 3, 3) world from base.
        com: (N, 3) m, world.
        com_velocity: (N, 3) m/s, world.
        foot_position: (N, F, 3) m, world, of each foot's reference.
        foot_rotation: (N, F, 3, 3) world from foot body.
        foot_velocity: (N, F, 6) of the reference: linear (m/s), then angular (rad/s), world axes.
        foot_jacobian: (N, F, 6, nv) with foot_velocity = foot_jacobian @ v.
        foot_bias: (N, F, 6) rate of foot_velocity at vdot = 0 (m/s^2, rad/s^2), "Jdot v".
    """

    mass_matrix: np.ndarray
    bias: np.ndarray
    base_position: np.ndarray
    base_rotation: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    foot_position: np.ndarray
    foot_rotation: np.ndarray
    foot_velocity: np.ndarray
    foot_jacobian: np.ndarray
    foot_bias: np.ndarray
