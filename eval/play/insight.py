"""What a robot does and what its layer wants of it, at one moment: what the overlays draw.

Nothing here changes a robot: the layer is asked again, on copies of what it remembers.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from eval.play.lane import Lane
from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.com_wrench import ComWrench
from fbid_gym.actions.layer import ActionLayer
from fbid_gym.actions.walking_base import WalkingBody
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.contacts import point_jacobian, point_positions
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.robots.polygon import convex_hull
from fbid_gym.tasks.body import TOUCHING_LOAD
from fbid_gym.tasks.task import Now

_FRICTION = 0.7  # of cones where the layer assumes none


class Insight(NamedTuple):
    """Of one robot; world axes. P points, F feet.

    Attributes:
        points: (P, 3) m, the contact points.
        measured: (P, 3) N, of the ground on them.
        commanded: (P, 3) N, what the layer's torques ask of contacts that hold, by the
            controller's model; zero where a foot is not planned to stand.
        friction: coefficient that the layer assumes, 0.7 where it assumes none.
        com: (3,) m.
        capture_point: (3,) m, where the robot would have to stand to come to rest, at the height of
            the feet.
        pressure: (3,) m, centre of it; NaN in the air.
        support: (K, 3) m, corners of the polygon of the points that carry.
        footholds: (L, 3) m, where feet in the air shall land.
        desired: (3,) m/s^2, of the body by the layer; NaN where it has none.
    """

    points: np.ndarray
    measured: np.ndarray
    commanded: np.ndarray
    friction: float
    com: np.ndarray
    capture_point: np.ndarray
    pressure: np.ndarray
    support: np.ndarray
    footholds: np.ndarray
    desired: np.ndarray


def insight(lane: Lane) -> Insight:
    """Look into a robot."""
    batch, kept = lane.batch, lane.state()
    memory, planned, plan = (_under(prefix, kept) for prefix in ("memory", "planned", "plan"))
    simulation = batch.simulation
    force = simulation.contact_force.copy()
    state = RobotState(simulation.qpos.copy(), simulation.qvel.copy(), force, kept["tick"])
    own = len(batch.layer.action_names)
    action, steering = lane.action[None, :own], batch.footholds.steering(lane.action[None, own:])
    terms = batch.plant.terms()
    reference = batch.task.reference(plan, Now(state, lambda: terms, steering, planned))
    desired = _desired(batch.layer, action, state, reference, terms)
    torque = batch.layer.torque(action, state, reference, lambda: terms, memory)
    limit = batch.robot.torque_limit
    commanded = _asked_of_contacts(
        batch, np.clip(torque, -limit, limit)[0], state.qvel[0], reference.planted[0]
    )
    stance = batch.task.body.stance
    points = point_positions(stance.geometry, simulation.terms())[0]
    measured = force[0]
    carrying = measured[:, 2] > TOUCHING_LOAD * batch.robot.weight
    support = points[carrying]
    ground = points[:, 2].min() if not carrying.any() else support[:, 2].mean()
    com, velocity = simulation.terms().com[0].copy(), simulation.terms().com_velocity[0]
    caught = com[:2] + velocity[:2] / stance.falling_rate
    load = np.maximum(measured[:, 2], 0.0)
    pressure = load @ points / load.sum() if carrying.any() else np.full(3, np.nan)
    landing = np.zeros((0, 3))
    if isinstance(reference, GaitTarget):
        landing = reference.foothold[0][~reference.planted[0]]
    return Insight(
        points=points,
        measured=measured,
        commanded=commanded,
        friction=float(lane.options.get("friction", _FRICTION)),
        com=com,
        capture_point=np.append(caught, ground),
        pressure=pressure,
        support=support[convex_hull(support[:, :2])] if carrying.any() else support,
        footholds=landing,
        desired=desired,
    )


def _desired(
    layer: ActionLayer,
    action: np.ndarray,
    state: RobotState,
    reference: Any,
    terms: DynamicsTerms,
) -> np.ndarray:
    """What the layer wants of the body: (3,) m/s^2, horizontally of the centre of mass."""
    if isinstance(layer, BaseAcceleration):
        return layer.acceleration(action, state, reference, terms)[0, :3]
    if isinstance(layer, ComWrench):
        body = centroidal_terms(terms, state.qvel)
        wrench = layer.wrench(action, state, reference, terms, body)[0, :3]
        return wrench / body.mass[0] - np.array([0.0, 0.0, layer.law.constants.gravity])
    if isinstance(layer, WalkingBody):
        added = layer.scale * action
        aim = layer.aim(layer.law.constants, added, state, reference, terms)
        return aim.task.acceleration[0, :3]
    return np.full(3, np.nan)


def _asked_of_contacts(
    batch: EnvBatch, torque: np.ndarray, qvel: np.ndarray, planted: np.ndarray
) -> np.ndarray:
    """Forces (P, 3) on the points of planted feet that neither slip nor sink under torques (n,).

    M a + h + D q' = S^T tau + J^T f and J a + Jdot v = 0 for the accelerations a and f; of the
    forces that do it those of least norm.
    """
    geometry, terms = batch.task.body.stance.geometry, batch.plant.terms()
    jacobian, bias = (value[0] for value in point_jacobian(geometry, terms))
    stands = np.repeat(planted[geometry.foot_of_point], 3)
    force = np.zeros(len(bias))
    if not stands.any():
        return force.reshape(-1, 3)
    applied = -terms.bias[0]
    applied[6:] += torque - batch.robot.joint_damping * qvel[6:]
    rows = jacobian[stands]
    response = np.linalg.solve(terms.mass_matrix[0], np.column_stack([rows.T, applied]))
    asked = -(rows @ response[:, -1] + bias[stands])
    force[stands] = np.linalg.pinv(rows @ response[:, :-1], rcond=1e-8, hermitian=True) @ asked
    return force.reshape(-1, 3)


def _under(prefix: str, state: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    start = prefix + "."
    return {k.removeprefix(start): v for k, v in state.items() if k.startswith(start)}
