"""Measured and commanded motion and forces of a robot at one moment, for overlays.

Nothing here changes a robot: its layer is asked again, with copies of what it remembers.
"""

from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.layer import ActionLayer
from fbid_gym.dynamics.contacts import point_jacobian, point_positions
from fbid_gym.dynamics.passive_joints import PassiveJoints, give_back
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.saved import rows_of
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, Memory, RobotState, some_of
from fbid_gym.robots import Robot
from fbid_gym.robots.polygon import convex_hull
from fbid_gym.tasks.body import TOUCHING_LOAD
from fbid_gym.tasks.task import Now

_FRICTION = 0.7  # of cones where the layer assumes none


@dataclass(frozen=True, eq=False)
class Insight:
    """Measured and commanded quantities of one robot; world axes. P points."""

    points: np.ndarray  # (P, 3) m, the contact points
    measured: np.ndarray  # (P, 3) N, of the ground on them
    # (P, 3) N, what the layer's torques ask of contacts that hold, by the controller's model; zero
    # where a foot is not planned to stand.
    commanded: np.ndarray
    friction: float  # coefficient that the layer counts on, 0.7 where it assumes none
    com: np.ndarray  # (3,) m
    # (3,) m, where the robot would have to stand to come to rest, at the height of the feet.
    capture_point: np.ndarray
    pressure: np.ndarray  # (3,) m, centre of it; NaN in the air
    support: np.ndarray  # (K, 3) m, corners of the polygon of the points that carry
    footholds: np.ndarray  # (L, 3) m, where feet in the air shall land
    desired: np.ndarray  # (3,) m/s^2, of the body by the layer; NaN where it has none
    # (3,) m/s^2, of the centre of mass in the last policy step, on average; NaN before the first.
    achieved: np.ndarray


def insight(batch: EnvBatch, env: int = 0) -> Insight:
    """Look into one robot of a batch."""
    batch.look()
    robot, loop, stance, only = batch.robot, batch.loop, batch.task.body.stance, np.array([env])
    action, steering, _ = loop.arrived(loop.rates.ticks - 1)  # that held last; zeros before that
    terms, actual = some_of(batch.plant.terms(), only), some_of(batch.simulation.terms(), only)
    state, planned = some_of(batch.known, only), rows_of(loop.planned, only)
    now = Now(state, lambda: terms, some_of(steering, only), planned, lambda: actual)
    target = batch.task.target(rows_of(loop.plan, only), now)
    action, memory = action[only], rows_of(loop.memory, only)
    # What the layer wants of the body, horizontally of the centre of mass; a user's need not say.
    desired = getattr(batch.layer, "desired", lambda *given: np.full((1, 3), np.nan))
    torque = batch.layer.torque(action, state, target, lambda: terms, memory)
    torque = np.clip(torque[0], -robot.torque_limit, robot.torque_limit)
    points = point_positions(stance.geometry, actual)[0]
    measured = state.contact_force[0]
    carrying = measured[:, 2] > TOUCHING_LOAD * robot.weight
    support = points[carrying]
    ground = support[:, 2].mean() if carrying.any() else points[:, 2].min()
    com, velocity = actual.com[0], actual.com_velocity[0]
    caught = com[:2] + velocity[:2] / stance.falling_rate
    load = np.maximum(measured[:, 2], 0.0)
    commanded = _asked_of_contacts(robot, stance.geometry, state, terms, target.planted[0], torque)
    return Insight(
        points=points,
        measured=measured,
        commanded=commanded,
        friction=_friction(batch.layer, memory),
        com=com,
        capture_point=np.append(caught, ground),
        pressure=load @ points / load.sum() if carrying.any() else np.full(3, np.nan),
        support=support[convex_hull(support[:, :2])] if carrying.any() else support,
        footholds=target.foothold[0][~target.planted[0]],
        desired=desired(action, state, target, terms)[0],
        achieved=(velocity - batch.com_velocity[env]) * batch.rates.policy,
    )


def _friction(layer: ActionLayer, memory: Memory) -> float:
    contact = getattr(layer, "contact", None)
    if contact is None or contact.friction is None:
        return _FRICTION
    return float(contact.friction * memory["grip"][0]) if "grip" in memory else contact.friction


def _asked_of_contacts(
    robot: Robot,
    geometry: ContactGeometry,
    state: RobotState,
    terms: DynamicsTerms,
    planted: np.ndarray,
    torque: np.ndarray,
) -> np.ndarray:
    """Forces (P, 3) on points of `planted` (F,) feet that neither slip nor sink under torques (n,).

    M a + h = S^T (tau - what springs and damping take) + J^T f and J a + Jdot v = 0 for the
    accelerations a and f; of the forces that do it those of least norm.
    """
    jacobian, bias = (value[0] for value in point_jacobian(geometry, terms))
    stands = np.repeat(planted[geometry.foot_of_point], 3)
    force = np.zeros(len(bias))
    if not stands.any():
        return force.reshape(-1, 3)
    applied = -terms.bias[0]
    taken = np.zeros((1, robot.num_joints))
    give_back(PassiveJoints.of(robot), taken, state.qpos, state.qvel)
    applied[6:] += torque - taken[0]
    rows = jacobian[stands]
    response = np.linalg.solve(terms.mass_matrix[0], np.column_stack([rows.T, applied]))
    asked = -(rows @ response[:, -1] + bias[stands])
    force[stands] = np.linalg.pinv(rows @ response[:, :-1], rcond=1e-8, hermitian=True) @ asked
    return force.reshape(-1, 3)
