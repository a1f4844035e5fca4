"""Random robots in contact, as the arrays that laws take: fair, degenerate, and beyond all measure.

They are made of rigid links, so that M has the structure that momentum gives it, in random poses on
random contacts. Everything follows from a `Problem`, a handful of numbers that can be written down.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.frames import skew
from fbid_gym.quantities import DynamicsTerms

DEPENDENCE = ("none", "repeated", "nearly repeated", "a row of zeros", "of rank two", "vanishing")


class Problem(NamedTuple):
    """What a batch of robots is made of.

    Attributes:
        seed: of all random numbers.
        robots: N.
        joints: n.
        points: contact points P, each with three rows of J.
        dependence: how the rows of J depend on each other, one of `DEPENDENCE`.
        mass: kg, of a robot.
        length: m, of a leg.
        effort: size of the commands, in units of gravity.
        stretch: decimal exponents by which M, h, J, the command, Jdot v and the wrench are blown up
            or shrunk, beyond what any robot has; zeros for none.
    """

    seed: int
    robots: int
    joints: int
    points: int
    dependence: str
    mass: float
    length: float
    effort: float
    stretch: tuple[float, ...] = (0.0,) * 6


class Robots(NamedTuple):
    """N robots, nv = 6 + n, k = 3 P.

    Attributes:
        terms: of the dynamics; no feet.
        velocity: (N, nv) m/s, rad/s.
        jacobian: (N, k, nv) J of the contact points.
        drift: (N, k) m/s^2, Jdot v.
        acceleration: (N, nv) m/s^2, rad/s^2, desired.
        task_jacobian: (N, 3, nv) of another point of the robot.
        task: (N, 3) m/s^2, its desired acceleration.
        wrench: (N, 6) N and N·m, desired at the centre of mass.
        torque: (N, n) N·m, of the tick before.
        base_priority: (6,) of linear and angular accelerations beside one for joints.
        length: m, which makes moments comparable to forces.
        gravity: m/s^2.
    """

    terms: DynamicsTerms
    velocity: np.ndarray
    jacobian: np.ndarray
    drift: np.ndarray
    acceleration: np.ndarray
    task_jacobian: np.ndarray
    task: np.ndarray
    wrench: np.ndarray
    torque: np.ndarray
    base_priority: np.ndarray
    length: float
    gravity: float


PER_ROBOT = Robots._fields[:-3]


def robots_of(problem: Problem) -> Robots:
    """Return the robots of a problem."""
    rng = np.random.default_rng(problem.seed)
    count, joints, length = problem.robots, problem.joints, problem.length
    rotation = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    rotation[:, 0] *= np.linalg.det(rotation)[:, None]
    mass_matrix, gravity, com = _of_links(rng, problem, rotation)
    jacobian = np.concatenate(
        [np.zeros((count, 0, 6 + joints))]
        + [_point(rng, rotation, joints, length, -1.0)[0] for _ in range(problem.points)],
        axis=1,
    )
    jacobian = _dependent(rng, problem.dependence, jacobian)
    size = np.r_[np.full(3, length), np.ones(3 + joints)]
    velocity = rng.normal(size=(count, 6 + joints)) * size * np.sqrt(9.81 / length)
    push = 9.81 * problem.effort
    weight = 9.81 * problem.mass
    m, h, j, a, d, w = 10.0 ** np.array(problem.stretch)
    wrench = weight * problem.effort * rng.normal(size=(count, 6)) * np.repeat([1, length], 3)
    wrench[:, 2] += weight
    position = rng.normal(size=(count, 3)) * length
    feet = np.empty((count, 0, 3)), np.empty((count, 0, 3, 3)), np.empty((count, 0, 6))
    return Robots(
        DynamicsTerms(
            m * mass_matrix,
            h * (gravity + 0.3 * weight * rng.normal(size=size.shape) * length / size),
            position,
            rotation,
            rotation,
            position + com,
            np.empty((count, 3)),
            *feet,
            np.empty((count, 0, 6, 6 + joints)),
            np.empty((count, 0, 6)),
        ),
        velocity,
        j * jacobian,
        d * push * rng.normal(size=jacobian.shape[:2]),
        a * push / length * size * rng.normal(size=velocity.shape),
        _point(rng, rotation, joints, length, 0.0)[0],
        push * rng.normal(size=(count, 3)),
        w * wrench,
        0.3 * weight * length * rng.normal(size=(count, joints)),
        10.0 ** rng.uniform(-1.0, 1.0) / size[:6] ** 2,
        length,
        9.81,
    )


def _point(
    rng: np.random.Generator, rotation: np.ndarray, joints: int, length: float, height: float
) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian (N, 3, nv) of a point of the robots, and its place (N, 3) m seen from the base."""
    place = length * (rng.normal(0.0, 0.4, (len(rotation), 3)) + [0.0, 0.0, height])
    levers = length * rng.normal(0.0, 0.5, (len(rotation), 3, joints))
    free = np.broadcast_to(np.eye(3), rotation.shape)
    return np.concatenate([free, -skew(place) @ rotation, levers], axis=2), place


def _of_links(
    rng: np.random.Generator, problem: Problem, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M (N, nv, nv), gravity's part of h (N, nv), the centre of mass (N, 3) seen from the base."""
    count, links = problem.robots, 2 + problem.joints
    share = problem.mass / links
    inertia = share * (0.2 * problem.length) ** 2
    size = 6 + problem.joints
    matrix, gravity = np.zeros((count, size, size)), np.zeros((count, size))
    com = np.zeros((count, 3))
    for _ in range(links):
        move, place = _point(rng, rotation, problem.joints, problem.length, 0.0)
        turn = np.zeros((count, 3, size))
        turn[:, :, 3:6] = rotation
        turn[:, :, 6:] = rng.normal(0.0, 0.7, (count, 3, problem.joints))
        matrix += share * move.mT @ move + inertia * turn.mT @ turn
        gravity += share * 9.81 * move[:, 2]
        com += place / links
    armature = np.arange(6, size)
    matrix[:, armature, armature] += 0.5 * inertia
    return 0.5 * (matrix + matrix.mT), gravity, com


def _dependent(rng: np.random.Generator, dependence: str, jacobian: np.ndarray) -> np.ndarray:
    """The Jacobian with rows that depend on each other."""
    count, rows, columns = jacobian.shape
    half = 3 * (rows // 6)
    if dependence == "of rank two" and rows:
        jacobian = rng.normal(size=(count, rows, 2)) @ jacobian[:, :2]
    elif dependence == "a row of zeros" and rows:
        jacobian[:, rng.integers(rows)] = 0.0
    elif dependence == "vanishing":
        jacobian *= 10.0 ** rng.uniform(-9, 0, (count, rows, 1))
    elif dependence != "none" and half:
        jacobian[:, -half:] = jacobian[:, :half]
        if dependence == "nearly repeated":
            noise = rng.normal(size=(count, half, columns))
            jacobian[:, -half:] *= 1.0 + 10.0 ** rng.uniform(-12, -3) * noise
    return jacobian


def chosen(robots: Robots, rows: slice | np.ndarray) -> Robots:
    """Return some of the robots."""
    own = {name: getattr(robots, name)[rows] for name in PER_ROBOT[1:]}
    return robots._replace(terms=DynamicsTerms(*(value[rows] for value in robots.terms)), **own)


class Units(NamedTuple):
    """How many new units are one kg, m and s."""

    mass: float
    length: float
    time: float

    @property
    def force(self) -> float:
        """Of one N."""
        return self.mass * self.length / self.time**2

    @property
    def moment(self) -> float:
        """Of one N·m."""
        return self.force * self.length

    @property
    def acceleration(self) -> float:
        """Of one m/s^2."""
        return self.length / self.time**2


def in_units(robots: Robots, units: Units) -> Robots:
    """Return the same robots in other units; all joints are hinges."""
    size = np.r_[np.full(3, units.length), np.ones(robots.velocity.shape[1] - 3)]
    terms, energy = robots.terms, units.moment * units.time**2
    return robots._replace(
        terms=terms._replace(
            mass_matrix=terms.mass_matrix * energy / (size * size[:, None]),
            bias=terms.bias * units.moment / size,
            base_position=terms.base_position * units.length,
            com=terms.com * units.length,
        ),
        velocity=robots.velocity * size / units.time,
        jacobian=robots.jacobian * units.length / size,
        drift=robots.drift * units.acceleration,
        acceleration=robots.acceleration * size / units.time**2,
        task_jacobian=robots.task_jacobian * units.length / size,
        task=robots.task * units.acceleration,
        wrench=robots.wrench * np.repeat([units.force, units.moment], 3),
        torque=robots.torque * units.moment,
        base_priority=robots.base_priority / size[:6] ** 2,
        length=robots.length * units.length,
        gravity=robots.gravity * units.acceleration,
    )
