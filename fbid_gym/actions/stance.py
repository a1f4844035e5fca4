"""What the model-free layers know of a robot: constants of its home stance, computed once."""

from functools import lru_cache

import numpy as np

from fbid_gym.control.inverse_dynamics import orthogonal_inverse_dynamics
from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.robots import Robot

_OTHERS_DAMPED = 1.5


@lru_cache(maxsize=32)
def _home_terms(robot: Robot) -> DynamicsTerms:
    return MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))


def holding_torque(robot: Robot) -> np.ndarray:
    """Return the least joint torques that keep the home stance in equilibrium: (n,) N·m."""
    terms = _home_terms(robot)
    contacts = reduced_contacts(ContactGeometry.of(robot), terms)
    rest = np.zeros((1, robot.nv))
    solution = orthogonal_inverse_dynamics(
        terms.mass_matrix, terms.bias, contacts.jacobian, rest, contacts.bias
    )
    return solution.torque[0]


def stance_inertia(robot: Robot) -> np.ndarray:
    """Return the inertia each joint moves at home while its own foot stays put: (n,) kg·m².

    A leg's joint that turns by itself swings everything beyond it about its axis; with the foot on
    the ground that is the rest of the robot. The feet share the load, hence the division by their
    number. A joint that no foot hangs from moves what it carries, its diagonal entry of M.
    """
    terms = _home_terms(robot)
    matrix = terms.mass_matrix[0]
    inertia = np.diag(matrix)[6:].copy()
    for jacobian in terms.foot_jacobian[0]:
        for joint in np.flatnonzero(np.abs(jacobian[:, 6:]).max(axis=0) > 0.0):
            velocity = np.zeros(robot.nv)
            velocity[6 + joint] = 1.0
            # The base moves so that the foot does not.
            velocity[:6] = np.linalg.solve(jacobian[:, :6], -jacobian[:, 6 + joint])
            inertia[joint] = velocity @ matrix @ velocity / robot.num_feet
    return inertia


def own_inertia(robot: Robot) -> np.ndarray:
    """Return the inertia that bounds each joint's damping in the air: (n,) kg·m².

    Damping that is sampled once a tick and held oscillates by itself beyond twice the inertia it
    acts on, divided by the tick. That inertia lies between two: the diagonal of M, with the base
    and all other joints held, and the inverse of the diagonal of M^-1, with all of them giving way.
    The first alone is too much where a heavy shank hangs from a light pelvis. The second counts one
    and a half times, since the others are damped, too.
    """
    matrix = _home_terms(robot).mass_matrix[0]
    held = np.diag(matrix)
    giving_way = 1.0 / np.diag(np.linalg.inv(matrix))
    return np.minimum(held, _OTHERS_DAMPED * giving_way)[6:]


def sampled_growth(
    robot: Robot, stiffness: np.ndarray, damping: np.ndarray, control_hz: int
) -> float:
    """Return how much a joint PD controller's motion grows from tick to tick, at worst.

    The robot hangs in the air in its home posture, and torques are held for a tick: the spectral
    radius of that linear system, below 1 if every mode decays.

    Args:
        robot: the robot.
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad.
        control_hz: control ticks per second.
    """
    mobility = np.linalg.inv(_home_terms(robot).mass_matrix[0])[6:, 6:]
    tick, one = 1.0 / control_hz, np.eye(robot.num_joints)
    stiff, damp = mobility * stiffness, mobility * damping
    step = np.block(
        [
            [one - tick**2 / 2 * stiff, tick * one - tick**2 / 2 * damp],
            [-tick * stiff, one - tick * damp],
        ]
    )
    return float(np.abs(np.linalg.eigvals(step)).max())
