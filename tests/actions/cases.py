"""Layers of motions that are planned, and what robots shall do in them."""

from typing import Any

import numpy as np

from fbid_gym.actions import ActionLayer, make_layer
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import home_target, in_world
from fbid_gym.motions.target import planned_kind
from fbid_gym.quantities import DynamicsTerms, RobotState, Target
from fbid_gym.robots import Robot


def layer_of(name: str, robot: Robot, hz: int = 500, **options: Any) -> ActionLayer:
    """A layer for a motion that is planned."""
    layer, _ = make_layer(name, robot, hz, planned_kind(robot), options)
    return layer


def home_of(robot: Robot, terms: DynamicsTerms) -> Target:
    """The home stance, above the feet of these robots."""
    return in_world(Stance.of(robot).heading, home_target(robot), terms)


def planned(robot: Robot, count: int, rng: np.random.Generator) -> Target:
    """A motion in all coordinates, seen from the feet, which stand."""
    home = Target(*(np.repeat(value, count, axis=0) for value in home_target(robot)))
    qpos = home.qpos + 0.1 * rng.normal(size=home.qpos.shape)
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qvel, qacc = rng.normal(size=(2, count, robot.nv))
    velocity, acceleration = rng.normal(size=(2, count, 3))
    moved = {"com_velocity": velocity, "com_acceleration": acceleration}
    moved |= {"com": home.com + 0.05 * rng.normal(size=(count, 3))}
    return home._replace(qpos=qpos, qvel=qvel, qacc=qacc, **moved)


def moving(robot: Robot, terms: DynamicsTerms, rng: np.random.Generator) -> Target:
    """The same in the world, above the feet of these robots."""
    return in_world(Stance.of(robot).heading, planned(robot, len(terms.com), rng), terms)


def state_at(
    robot: Robot, qpos: np.ndarray, qvel: np.ndarray | None = None, carried: float = 1.0
) -> tuple[RobotState, DynamicsTerms]:
    """Robots at rest if not told otherwise, their points loaded alike by a share of the weight."""
    qvel = np.zeros((len(qpos), robot.nv)) if qvel is None else qvel
    contact = np.zeros((len(qpos), robot.num_points, 3))
    contact[:, :, 2] = carried * robot.weight / robot.num_points
    state = RobotState(qpos, qvel, contact, np.zeros(len(qpos), np.int64))
    return state, MuJoCoDynamics(robot).terms(qpos, qvel)


def at_rest(robot: Robot, count: int = 1) -> tuple[RobotState, DynamicsTerms]:
    """Robots that stand at home."""
    return state_at(robot, np.tile(robot.home_qpos, (count, 1)))


def torque_of(
    layer: ActionLayer,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    action: np.ndarray | None = None,
) -> np.ndarray:
    """Torques at the first tick, for the zero action unless told otherwise."""
    count = len(state.qpos)
    if action is None:
        action = np.zeros((count, len(layer.action_names)))
    return layer.torque(action, state, target, lambda: terms, layer.memory(count))


def without_self_motion(
    rows: np.ndarray, robot: Robot, terms: DynamicsTerms, row: int
) -> np.ndarray:
    """Rows (m, nv) of a task, without what legs do to it while their foot and the base stay."""
    rows, size = rows.copy(), 6 if robot.has_soles else 3
    for foot, leg in enumerate(Stance.of(robot).legs):
        joints = 6 + np.flatnonzero(leg)
        placed = terms.foot_jacobian[row, foot, :size][:, joints]
        rows[:, joints] = rows[:, joints] @ np.linalg.pinv(placed, rcond=1e-9) @ placed
    return rows
