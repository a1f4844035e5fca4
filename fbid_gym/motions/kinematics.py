"""Kinematics for planning: where the base is when the planted feet stay where they are."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.frames import matrix_to_quaternion
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.curves import Curve
from fbid_gym.motions.reference import Reference
from fbid_gym.robots import Robot

CHUNK = 256
"""Rows of a motion that are computed at once: a whole motion would fill the memory."""

_STAYS = 1e-7  # m
_BASE_RTOL = 1e-9


class States(NamedTuple):
    """T states of one robot along a motion.

    Attributes:
        qpos: (T, nq).
        qvel: (T, nv).
        qacc: (T, nv).
    """

    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray


def chunked_terms(
    robot: Robot, qpos: np.ndarray, qvel: np.ndarray
) -> Iterator[tuple[slice, DynamicsTerms]]:
    """Yield the dynamics terms of T states, in chunks of rows.

    Args:
        robot: the robot.
        qpos: (T, nq).
        qvel: (T, nv).

    Yields:
        Which rows, and their terms.
    """
    dynamics = MuJoCoDynamics(robot)
    for start in range(0, len(qpos), CHUNK):
        rows = slice(start, min(start + CHUNK, len(qpos)))
        yield rows, dynamics.terms(qpos[rows], qvel[rows])


def home_points(robot: Robot) -> np.ndarray:
    """Return where the contact points are at home: (P, 3) m, from the centre of the contacts.

    A sphere's point is its centre. z counts from the ground, a radius below that.
    """
    qpos = robot.home_qpos[None]
    terms = MuJoCoDynamics(robot).terms(qpos, np.zeros((1, robot.nv)))
    points = sphere_centres(robot, ContactGeometry.of(robot), terms)[0]
    radius = foot_radius(robot)[ContactGeometry.of(robot).foot_of_point]
    centre = (points - radius[:, None] * [0, 0, 1]).mean(axis=0)
    return points - centre


def foot_radius(robot: Robot) -> np.ndarray:
    """Return the radius of each foot's contact spheres, (F,) m."""
    return np.array([foot.radius for foot in robot.feet])


def sphere_centres(robot: Robot, geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return the contact points fixed in the feet, (N, P, 3) m: centres of spheres, or sites."""
    foot = geometry.foot_of_point
    arm = np.matvec(terms.foot_rotation[:, foot], geometry.offset)
    centres = terms.foot_position[:, foot] + arm
    centres[..., 2] += foot_radius(robot)[foot]
    return centres


def base_on_feet(
    robot: Robot, joints: Curve, points: np.ndarray, planted: np.ndarray | None = None
) -> States:
    """Base motion that keeps the planted feet in place while the joints move; exact derivatives.

    [M10] eqs. (3)-(4): the base is what J_C qdot = 0 and J_C qddot + Jdot_C qdot = 0 leave of it.
    Feet with spheres may not turn while planted: a sphere that turns rolls away from its place.

    Args:
        robot: the robot.
        joints: (T, n) rad.
        points: (P, 3) or (T, P, 3) m, where the contact points (sphere centres) of planted feet
            are, world.
        planted: (T, F) bool; None for all feet.

    Returns:
        States, in the world of `points`.

    Raises:
        InvalidValueError: the joints would move planted feet against each other, or too few points
            are planted to tell where the base is.
    """
    geometry = ContactGeometry.of(robot)
    steps = len(joints.value)
    if planted is None:
        planted = np.ones((steps, robot.num_feet), bool)
    active = planted[:, geometry.foot_of_point]
    points = np.broadcast_to(points, (steps, robot.num_points, 3))
    qpos, qvel, qacc = np.zeros((steps, robot.nq)), np.zeros((steps, robot.nv)), None
    qacc = np.zeros_like(qvel)
    qpos[:, 3], qpos[:, 7:], qvel[:, 6:], qacc[:, 6:] = 1.0, *joints

    for rows, terms in chunked_terms(robot, qpos, np.zeros_like(qvel)):
        seen = sphere_centres(robot, geometry, terms)
        rotation, position, gap = _aligned(seen, points[rows], active[rows])
        if gap.max() > _STAYS:
            tick = rows.start + int(gap.argmax())
            raise InvalidValueError(
                "joint motion",
                f"planted feet part by {gap.max():.2g} m at tick {tick}",
                "joint angles that keep planted feet where they are",
            )
        qpos[rows, :3], qpos[rows, 3:7] = position, matrix_to_quaternion(rotation)
    for rows, terms in chunked_terms(robot, qpos, np.zeros_like(qvel)):
        contacts = reduced_contacts(geometry, terms, active[rows])
        base = _base_inverse(contacts.jacobian, rows.start)
        qvel[rows, :6] = -np.matvec(base, np.matvec(contacts.jacobian[:, :, 6:], qvel[rows, 6:]))
    for rows, terms in chunked_terms(robot, qpos, qvel):
        contacts = reduced_contacts(geometry, terms, active[rows])
        base = _base_inverse(contacts.jacobian, rows.start)
        drift = np.matvec(contacts.jacobian[:, :, 6:], qacc[rows, 6:]) + contacts.bias
        qacc[rows, :6] = -np.matvec(base, drift)
    return States(qpos, qvel, qacc)


def _base_inverse(jacobian: np.ndarray, start: int) -> np.ndarray:
    """Pseudo-inverse (N, 6, k) of the base columns of contact rows, or an error below rank 6."""
    base = jacobian[:, :, :6]
    gram = base.mT @ base
    size = np.linalg.eigvalsh(gram)
    poor = size[:, 0] < _BASE_RTOL * size[:, -1]
    if poor.any():
        raise InvalidValueError(
            "planted feet",
            f"too few contact points at tick {start + int(poor.argmax())}",
            "three planted points at least, not on one line",
        )
    return np.linalg.solve(gram, base.mT)


def _aligned(
    seen: np.ndarray, wanted: np.ndarray, active: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rigid motion that takes the active points `seen` to `wanted` (Kabsch).

    Args:
        seen: (N, P, 3).
        wanted: (N, P, 3).
        active: (N, P) bool.

    Returns:
        Rotation (N, 3, 3), translation (N, 3), largest remaining distance (N,).
    """
    weight = active / np.maximum(active.sum(axis=1, keepdims=True), 1)
    from_centre, to_centre = np.vecmat(weight, seen), np.vecmat(weight, wanted)
    source = (seen - from_centre[:, None]) * active[..., None]
    target = (wanted - to_centre[:, None]) * active[..., None]
    left, _, right = np.linalg.svd(target.mT @ source)
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]  # a rotation and no reflection
    rotation = left @ right
    gap = np.linalg.norm(target - source @ rotation.mT, axis=2).max(axis=1)
    return rotation, to_centre - np.matvec(rotation, from_centre), gap


def seen_from_feet(robot: Robot, states: States, planted: np.ndarray | None = None) -> Reference:
    """Express states of the world in the support frame of each instant, as `Reference` wants it.

    Args:
        robot: the robot.
        states: T of them, in a world with z up.
        planted: (T, F) bool; None for all feet.

    Returns:
        T rows.
    """
    support = Support.of(robot)
    gravity, armature = robot.model.opt.gravity, robot.model.dof_armature[:3]
    qpos, qvel, qacc = (part.copy() for part in states)
    com = np.zeros((3, len(qpos), 3))
    for rows, terms in chunked_terms(robot, states.qpos, states.qvel):
        frame = support.frame(terms)
        to_frame = frame.rotation.mT
        force = np.matvec(terms.mass_matrix[:, :3], states.qacc[rows]) + terms.bias[:, :3]
        force -= armature * states.qacc[rows, :3]
        qpos[rows, :3] = np.matvec(to_frame, terms.base_position - frame.centre)
        qpos[rows, 3:7] = matrix_to_quaternion(to_frame @ terms.base_rotation)
        qvel[rows, :3] = np.matvec(to_frame, states.qvel[rows, :3])
        qacc[rows, :3] = np.matvec(to_frame, states.qacc[rows, :3])
        com[0, rows] = np.matvec(to_frame, terms.com - frame.centre)
        com[1, rows] = np.matvec(to_frame, terms.com_velocity)
        com[2, rows] = np.matvec(to_frame, force / robot.mass + gravity)
    return Reference(qpos, qvel, qacc, com[0], com[1], com[2], planted)
