"""Kinematics for planning: where the base is when the planted feet stay where they are."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.frames import matrix_to_quaternion, rotation_vector, skew
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.curves import Curve
from fbid_gym.motions.target import planned_target
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, Target
from fbid_gym.robots import Robot

CHUNK = 125
"""Rows of a motion that are computed at once: a whole motion would fill the memory."""

_STAYS = 1e-7  # m
_BASE_RTOL = 1e-9
_MOST_STEPS = 40
_LONGEST_STEP = 0.2  # rad
_NEAR = 1e-3  # m, rad
_REACHED = 1e-11  # m, rad
_SETTLED = 1e-8  # m/s, rad/s
_UP = np.array([0.0, 0.0, 1.0])


class States(NamedTuple):
    """T states of one robot along a motion."""

    qpos: np.ndarray  # (T, nq)
    qvel: np.ndarray  # (T, nv)
    qacc: np.ndarray  # (T, nv)


def chunked(
    dynamics: MuJoCoDynamics, qpos: np.ndarray, qvel: np.ndarray
) -> Iterator[tuple[slice, DynamicsTerms]]:
    """Yield chunks of the rows of T states, (T, nq) and (T, nv), and their terms."""
    for start in range(0, len(qpos), CHUNK):
        rows = slice(start, start + CHUNK)
        yield rows, dynamics.terms(qpos[rows], qvel[rows])


def home_points(robot: Robot) -> np.ndarray:
    """Return where the contact points are at home: (P, 3) m, from the centre of the contacts.

    A sphere's point is its centre. z counts from the ground, a radius below that.
    """
    stance = Stance.of(robot)
    points = sphere_centres(robot, stance.geometry, stance.terms)[0]
    radius = foot_radius(robot)[stance.geometry.foot_of_point]
    centre = (points - radius[:, None] * [0, 0, 1]).mean(axis=0)
    return points - centre


def foot_radius(robot: Robot) -> np.ndarray:
    """Return the radius of each foot's contact spheres, (F,) m."""
    return np.array([foot.radius for foot in robot.feet])


def sphere_centres(robot: Robot, geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return the contact points fixed in the feet, (N, P, 3) m: centres of spheres, or sites."""
    foot = geometry.foot_of_point
    arm = np.matvec(terms.world_from_foot[:, foot], geometry.offset)
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
    geometry = Stance.of(robot).geometry
    steps = len(joints.value)
    if planted is None:
        planted = np.ones((steps, robot.num_feet), bool)
    active = planted[:, geometry.foot_of_point]
    points = np.broadcast_to(points, (steps, robot.num_points, 3))
    qpos, (qvel, qacc) = np.zeros((steps, robot.nq)), np.zeros((2, steps, robot.nv))
    qpos[:, 3], qpos[:, 7:], qvel[:, 6:], qacc[:, 6:] = 1.0, *joints

    dynamics = MuJoCoDynamics(robot)
    for rows, terms in chunked(dynamics, qpos, np.zeros_like(qvel)):
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
    # First the velocities, for which there is no bias: that of a robot at rest is zero.
    for moving, rates in ((np.zeros_like(qvel), qvel), (qvel, qacc)):
        for rows, terms in chunked(dynamics, qpos, moving):
            contacts = reduced_contacts(geometry, terms, active[rows])
            base = _base_inverse(contacts.jacobian, rows.start)
            drift = np.matvec(contacts.jacobian[:, :, 6:], rates[rows, 6:]) + contacts.bias
            rates[rows, :6] = -np.matvec(base, drift)
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
    """Rigid motion that takes those points `seen` (N, P, 3) that are active to `wanted` (Kabsch).

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


def joints_on_feet(
    robot: Robot,
    base: States,
    centres: Callable[[np.ndarray, np.ndarray], Curve],
    planted: np.ndarray,
    moving: Sequence[int],
    guess: np.ndarray,
) -> States:
    """Joint motion that puts the feet where they shall be under a moving base; exact derivatives.

    Damped Gauss-Newton steps on all T instants at once. Feet with three points or more keep the
    orientation they have at home.

    Args:
        robot: the robot.
        base: T states of which the base's part counts.
        centres: from the feet's angular velocity and acceleration, (T, F, 3) rad/s and rad/s^2,
            world: where the centre of each foot's points (sphere centres) shall be, (T, F, 3) m. A
            planted sphere rolls, hence the argument. The rates of planted feet do not count.
        planted: (T, F) bool: the contact of such a foot does not move.
        moving: joints to find, as many as the feet have coordinates (3, or 6 with an orientation);
            the others keep their `guess`.
        guess: (T, n) rad to begin with.

    Returns:
        States, with the base's part of `base`.

    Raises:
        InvalidValueError: `moving` has another length, or a foot cannot get where it shall be.
    """
    columns = 6 + np.asarray(moving)
    away = [foot.points - foot.points.mean(axis=0) for foot in robot.feet]
    rows_of = [slice(0, 6 if np.linalg.matrix_rank(a, tol=1e-6) >= 2 else 3) for a in away]
    if len(columns) != (size := sum(rows.stop for rows in rows_of)):
        raise InvalidValueError("moving", len(columns), f"{size} joints")
    radius, dynamics = foot_radius(robot), MuJoCoDynamics(robot)
    home = Stance.of(robot).terms
    qpos, qvel, qacc = base.qpos.copy(), base.qvel.copy(), base.qacc.copy()
    qpos[:, 7:], qvel[:, 6:], qacc[:, 6:] = guess, 0.0, 0.0
    lift, going = np.where(planted, 0.0, radius), ~planted[..., None]
    spin, spin_rate = np.zeros((*planted.shape, 3)), np.zeros((*planted.shape, 3))

    def of_feet(per_foot: np.ndarray) -> np.ndarray:
        parts = [per_foot[:, foot, rows] for foot, rows in enumerate(rows_of)]
        return np.concatenate(parts, axis=1)

    def solved(jacobian: np.ndarray, motion: np.ndarray) -> np.ndarray:
        return np.linalg.solve(jacobian[:, :, columns], motion[..., None])[..., 0]

    missing = np.zeros((len(qpos), len(columns)))
    for _ in range(_MOST_STEPS):
        wanted, before = centres(spin, spin_rate), qvel.copy()
        for rows, terms in chunked(dynamics, qpos, qvel):
            error = np.zeros((*terms.foot_position.shape[:2], 6))
            error[..., :3] = wanted.value[rows] - terms.foot_position
            error[..., 2] -= radius
            error[..., 3:] = rotation_vector(home.world_from_foot @ terms.world_from_foot.mT)
            missing[rows] = of_feet(error)
            whole, _ = _raised(terms, np.broadcast_to(radius, lift[rows].shape))
            qpos[rows, 1 + columns] += _damped_step(of_feet(whole)[:, :, columns], missing[rows])
            # Far from its place a leg may be stretched, and its rates would have no bounds.
            if np.abs(missing[rows]).max() > _NEAR:
                continue
            # The contact of a planted foot stands still; the centres of others move as told.
            jacobian, bias = _raised(terms, lift[rows])
            motion = np.zeros_like(error)
            motion[..., :3] = wanted.rate[rows] * going[rows]
            stacked, qvel[rows, columns] = of_feet(jacobian), 0.0
            left = of_feet(motion) - np.matvec(stacked, qvel[rows])
            qvel[rows, columns] = solved(stacked, left)
            motion[..., :3] = wanted.acceleration[rows] * going[rows]
            qacc[rows, columns] = 0.0
            left = of_feet(motion - bias) - np.matvec(stacked, qacc[rows])
            qacc[rows, columns] = solved(stacked, left)
            turning = terms.foot_jacobian[:, :, 3:]
            spin[rows] = np.matvec(turning, qvel[rows, None])
            spin_rate[rows] = np.matvec(turning, qacc[rows, None]) + terms.foot_bias[:, :, 3:]
        settled = np.abs(qvel - before).max() < _SETTLED
        if settled and np.abs(missing).max() < _REACHED:
            return States(qpos, qvel, qacc)
    tick, worst = np.unravel_index(np.abs(missing).argmax(), missing.shape)
    foot = int(np.searchsorted(np.cumsum([part.stop for part in rows_of]), worst, "right"))
    raise InvalidValueError(
        f"motion of foot {robot.feet[foot].name!r}",
        f"{np.abs(missing).max():.2g} m out of reach at tick {int(tick)}",
        "places that the foot can reach",
    )


def _raised(terms: DynamicsTerms, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian and bias of the points (N, F) m above the feet's references."""
    arm = skew(height[..., None] * _UP)
    jacobian, bias = terms.foot_jacobian.copy(), terms.foot_bias.copy()
    jacobian[:, :, :3] -= arm @ jacobian[:, :, 3:]
    bias[:, :, :3] -= np.matvec(arm, bias[:, :, 3:])
    return jacobian, bias


def _damped_step(jacobian: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Gauss-Newton step (N, m), damped and short far away, so that no knee bends the other way."""
    damping = np.vecdot(error, error)[:, None, None] * np.eye(jacobian.shape[2])
    gram = jacobian.mT @ jacobian + damping
    step = np.linalg.solve(gram, np.matvec(jacobian.mT, error)[..., None])[..., 0]
    return step / np.maximum(np.abs(step).max(axis=1, keepdims=True) / _LONGEST_STEP, 1.0)


def seen_from_feet(robot: Robot, states: States, planted: np.ndarray | None = None) -> Target:
    """Express T states of a world with z up in the support frame of each instant.

    So planned motions are given. Feet are planted (T, F) bool, or None for all feet.
    """
    stance = Stance.of(robot)
    gravity, armature = robot.model.opt.gravity, robot.model.dof_armature[:3]
    qpos, qvel, qacc = (part.copy() for part in states)
    com, feet = np.zeros((3, len(qpos), 3)), robot.num_feet
    place, turned = np.zeros((len(qpos), feet, 3)), np.zeros((len(qpos), feet, 3, 3))
    rates = np.zeros((2, len(qpos), feet, 2, 3))
    for rows, terms in chunked(MuJoCoDynamics(robot), states.qpos, states.qvel):
        frame = stance.frame(terms)
        to_frame = frame.world_from_support.mT
        force = np.matvec(terms.mass_matrix[:, :3], states.qacc[rows]) + terms.bias[:, :3]
        force -= armature * states.qacc[rows, :3]
        qpos[rows, :3] = np.matvec(to_frame, terms.base_position - frame.centre)
        qpos[rows, 3:7] = matrix_to_quaternion(to_frame @ terms.world_from_base)
        qvel[rows, :3] = np.matvec(to_frame, states.qvel[rows, :3])
        qacc[rows, :3] = np.matvec(to_frame, states.qacc[rows, :3])
        com[0, rows] = np.matvec(to_frame, terms.com - frame.centre)
        com[1, rows] = np.matvec(to_frame, terms.com_velocity)
        com[2, rows] = np.matvec(to_frame, force / robot.mass + gravity)
        each = to_frame[:, None]
        place[rows] = np.matvec(each, terms.foot_position - frame.centre[:, None])
        turned[rows] = each @ terms.world_from_foot
        acceleration = np.matvec(terms.foot_jacobian, states.qacc[rows, None]) + terms.foot_bias
        for found, rate in zip(rates, (terms.foot_velocity, acceleration), strict=True):
            found[rows] = np.matvec(each[:, None], rate.reshape(-1, feet, 2, 3))
    if planted is None:
        planted = np.ones((len(qpos), feet), bool)
    velocity, acceleration = rates.reshape(2, len(qpos), feet, 6)
    return planned_target(
        planted, place, turned, velocity, acceleration, com[0], com[1], com[2], qpos, qvel, qacc
    )
