"""The quantities that laws, motions and layers speak of, for a batch of robots: read this first.

Every array has the batch axis first: N robots. nv = 6 + n coordinates, base first, n joints; nq =
7 + n; F feet; P contact points; k contact rows. Coordinates are MuJoCo's: v = [base linear velocity
(world), base angular velocity (base frame), joint velocities]. SI units, radians.

Each tuple passes through compiled code as it is, hence three promises of whoever makes one: arrays
are C-contiguous, of float64 unless said otherwise; a field is always of one type, never None; and
where a single row stands for all robots, the type says so ("(N, n) or (1, n)").

Words. The *reference* is what the task plans, seen from the robot's own feet. A *target* is where
something shall be here and now, in the world. *Desired* quantities are commanded: accelerations,
wrenches. *Achieved* ones are what limits leave of them. A *warm start* is where an iteration of the
next tick begins. The *support frame* lies level in the middle of the contact points, x the feet's
forward direction, z up. A rotation `a_from_b` takes vectors in b to vectors in a.
"""

from typing import Any, NamedTuple, TypeVar

import numpy as np

Memory = dict[str, np.ndarray]
"""What is remembered from tick to tick, a row a robot: to reset a robot is to reset its row."""


class RobotState(NamedTuple):
    """The state of robots and what their sensors read.

    Attributes:
        qpos: (N, nq) m, unit quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s.
        contact_force: (N, P, 3) N, world, of the ground on each point in the last physics step.
        tick: (N,) int64, control ticks since the episode began.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    contact_force: np.ndarray
    tick: np.ndarray


class DynamicsTerms(NamedTuple):
    """The terms of `M vdot + h = S^T tau + J^T lambda` ([M10] eq. (2)) and the frames beside it.

    A foot's *reference* is the centre of its contact points, fixed in the foot's body, lowered
    along the world's vertical by the radius of its contact spheres (0 for contact sites). For a
    spherical foot this is the point that touches level ground, and it rolls: its offset from the
    sphere's centre stays vertical, so `foot_bias` holds that offset fixed in the world.

    Attributes:
        mass_matrix: (N, nv, nv) M, with the joints' armature.
        bias: (N, nv) h, Coriolis, centrifugal and gravity forces; no joint damping, no friction.
        base_position: (N, 3) m, world.
        world_from_base: (N, 3, 3).
        world_from_trunk: (N, 3, 3) of the body's axes ahead, to the left and up; at home they are
            the world's, however those of the base lie.
        com: (N, 3) m, world.
        com_velocity: (N, 3) m/s, world.
        foot_position: (N, F, 3) m, world, of each foot's reference.
        world_from_foot: (N, F, 3, 3) of the foot's body.
        foot_velocity: (N, F, 6) of the reference: linear (m/s), then angular (rad/s), world axes.
        foot_jacobian: (N, F, 6, nv) with foot_velocity = foot_jacobian @ v.
        foot_bias: (N, F, 6) rate of foot_velocity at vdot = 0 (m/s^2, rad/s^2), "Jdot v".
    """

    mass_matrix: np.ndarray
    bias: np.ndarray
    base_position: np.ndarray
    world_from_base: np.ndarray
    world_from_trunk: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    foot_position: np.ndarray
    world_from_foot: np.ndarray
    foot_velocity: np.ndarray
    foot_jacobian: np.ndarray
    foot_bias: np.ndarray


class EquationOfMotion(NamedTuple):
    """Terms of the dynamics that the laws of [M10] need.

    Attributes:
        mass_matrix: (N, nv, nv) M, symmetric positive definite.
        bias: (N, nv) h, Coriolis, centrifugal and gravity forces.
    """

    mass_matrix: np.ndarray
    bias: np.ndarray


class CentroidalTerms(NamedTuple):
    """A robot's momentum from the first six rows of M, [G15].

    Attributes:
        matrix: (N, 6, nv) A of [G15] eq. (2), the centroidal momentum matrix.
        momentum: (N, 6) h = A v: linear (kg·m/s), angular about the centre of mass (kg·m²/s),
            world axes.
        mass: (N,) kg.
        inertia: (N, 3, 3) kg·m², of the robot with locked joints about its centre of mass, world
            axes; the inverse of Lambda_l.
        inverse_inertia: (N, 3, 3) Lambda_l of [G15] eq. (24).
        to_com: (N, 6, 6) P, takes a generalized force on the base to a wrench at the centre of
            mass, see `fbid_gym.dynamics.centroidal`.
        wrench_map: (N, nv, 6) T^T = A^T Lambda_h of [G15] eqs. (30), (32). It takes a wrench at the
            centre of mass (N, N·m, world axes) to the generalized force that does the same to the
            momentum and nothing else.
    """

    matrix: np.ndarray
    momentum: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    inverse_inertia: np.ndarray
    to_com: np.ndarray
    wrench_map: np.ndarray


class SupportFrame(NamedTuple):
    """The level frame of the robots' feet.

    Attributes:
        centre: (N, 3) m, world, the mean of the contact points.
        world_from_support: (N, 3, 3).
    """

    centre: np.ndarray
    world_from_support: np.ndarray


class Heading(NamedTuple):
    """Constants of the home stance by which the feet make the support frame.

    The forward direction of the feet is the heading for which the contact points, seen from above,
    lie nearest to where they are in the home stance (planar Procrustes).

    Attributes:
        weight: (F,) of the foot references in the centre of the contact points.
        by_position: (3F, 2) and
        by_rotation: (9F, 2): linear maps from the feet's poses to the heading's cosine and sine,
            up to a common factor.
    """

    weight: np.ndarray
    by_position: np.ndarray
    by_rotation: np.ndarray


class ContactGeometry(NamedTuple):
    """The constant part of a robot's contacts; at most p points on one foot.

    Attributes:
        foot_of_point: (P,) int64, which foot a point belongs to.
        slot_of_point: (P,) int64, its place among the foot's points, in 0 … p - 1.
        offset: (P, 3) m from the foot's reference, in the foot's axes.
        motion: (F, 2^p, r, 6) the matrix S of `fbid_gym.dynamics.contacts`, for every subset of
            active points.
        spread: (F, 2^p, r, 3p) the matrix U^T there; columns of inactive points are zero.
    """

    foot_of_point: np.ndarray
    slot_of_point: np.ndarray
    offset: np.ndarray
    motion: np.ndarray
    spread: np.ndarray

    @property
    def num_points(self) -> int:
        """Number of contact points P."""
        return len(self.offset)


class Constraint(NamedTuple):
    """Constraint of the contacts on the acceleration: J a + Jdot v = 0, [M10] eq. (4).

    Attributes:
        jacobian: (N, k, nv) J. Rows may repeat each other, or be zero.
        bias: (N, k) Jdot v, m/s^2.
    """

    jacobian: np.ndarray
    bias: np.ndarray


class ReducedContacts(NamedTuple):
    """The active contact points in k rows.

    Attributes:
        jacobian: (N, k, nv). Zero rows where a foot has fewer active directions than k allows.
        bias: (N, k) m/s^2, "Jdot v" of the same rows.
        point_map: (N, k, 3P) takes stacked point forces (world axes) to the rows, so that
            J_points^T f = jacobian^T (point_map f). Zero columns for inactive points.
    """

    jacobian: np.ndarray
    bias: np.ndarray
    point_map: np.ndarray


class PointLimits(NamedTuple):
    """Limits of the force at each contact point.

    Attributes:
        rows: (N, P, 3) or (1, P, 3): friction coefficient, least and greatest normal force (N).
        active: (N, P) or (1, P) bool; the others transmit nothing.
    """

    rows: np.ndarray
    active: np.ndarray


class Limits(NamedTuple):
    """Limits of contacts and motors.

    Attributes:
        points: of the contacts.
        torque: (N, n) or (1, n) N·m, of the motors.
    """

    points: PointLimits
    torque: np.ndarray


class ForcePath(NamedTuple):
    """Maps of forces on contact points to the contact rows and to the centre of mass.

    Attributes:
        to_com: (N, 6, 6) of `CentroidalTerms`.
        point_map: (N, k, 3P) of `ReducedContacts`.
        world_from_contact: (N, P, 3, 3) of contact axes, whose third is the ground's normal;
            (0, P, 3, 3) on level ground.
    """

    to_com: np.ndarray
    point_map: np.ndarray
    world_from_contact: np.ndarray


class Accuracy(NamedTuple):
    """Accuracy of the contact forces' solver, see `fbid_gym.control.contact_forces`.

    Attributes:
        regularisation: eps, dimensionless, on the squared forces.
        tolerance: share of the weight, of the optimality condition.
        max_iterations: Newton steps before a cold start.
        torque_steps: steps of the iteration that brings in torque limits, where they bind.
    """

    regularisation: float
    tolerance: float
    max_iterations: int
    torque_steps: int


class PostureCommand(NamedTuple):
    """Desired accelerations of the joints, and how firmly they are held.

    Attributes:
        acceleration: (N, n) or (1, n) rad/s^2.
        mobility: (N, n) or (1, n) positive, how readily each joint departs from its own.
    """

    acceleration: np.ndarray
    mobility: np.ndarray


class TorqueMap(NamedTuple):
    """Joint torques as a function of contact forces: tau = offset - J_q^T lambda + W w.

    Attributes:
        offset: (N, n) N·m.
        jacobian: (N, k, nv) of the contact rows, whose joint columns are J_q.
        per_wrench: (N, n, 6) W, of the wrench w at the centre of mass.
    """

    offset: np.ndarray
    jacobian: np.ndarray
    per_wrench: np.ndarray

    def torque(self, row_force: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Return torques (N, n) from lambda (N, k) and w (N, 6)."""
        contact = np.vecmat(row_force, self.jacobian[:, :, 6:])
        return self.offset - contact + np.matvec(self.per_wrench, wrench)


class BodyMotion(NamedTuple):
    """Pose and motion of whole robots; world axes.

    Attributes:
        com: (N, 3) m.
        com_velocity: (N, 3) m/s.
        world_from_base: (N, 3, 3).
        angular_velocity: (N, 3) rad/s, of the base.
        momentum: (N, 6) kg·m/s, and kg·m²/s about the centre of mass.
        mass: (N,) kg.
    """

    com: np.ndarray
    com_velocity: np.ndarray
    world_from_base: np.ndarray
    angular_velocity: np.ndarray
    momentum: np.ndarray
    mass: np.ndarray


class BodyGains(NamedTuple):
    """Gains of a robot's body, feet and joints: stiffness in 1/s^2, damping in 1/s.

    Attributes:
        balance, balance_damping: of the centre of mass, horizontally.
        height, height_damping: of the base.
        rotation, rotation_damping: of the base.
        posture, posture_damping: of the joints.
        swing, swing_damping: of feet in the air.
        hold: damping of feet that stand.
        small_errors: damping beside `balance_damping`, for small errors of the velocity.
        small_error: m/s, as which greater ones count.
        give: how soft standing feet hold the base in directions in which their leg has no joints.
            Two such feet hold it twice, and what they disagree about is rounding and contacts that
            are soft. On a gait balance goes before.
        of_base: 1 where `balance_damping` and `small_errors` damp the velocity of the base, else 0.
    """

    balance: float
    balance_damping: float
    height: float
    height_damping: float
    rotation: float
    rotation_damping: float
    posture: float
    posture_damping: float
    swing: float
    swing_damping: float
    hold: float
    small_errors: float
    small_error: float
    give: float
    of_base: float = 0.0


class WrenchGains(NamedTuple):
    """Gains from errors to a wrench, see `fbid_gym.control.BalanceGains`.

    Attributes:
        stiffness: (3, 3).
        damping: (3, 3).
        rotation_damping: (3, 3).
        rotation_map: (3, 9).
        on_velocity: whether velocities are damped, [G15] (36), and not momenta, (38).
    """

    stiffness: np.ndarray
    damping: np.ndarray
    rotation_damping: np.ndarray
    rotation_map: np.ndarray
    on_velocity: bool


class Target(NamedTuple):
    """Desired motion of robots now: filled by the home posture, by planned motions and by gaits.

    Positions and rotations are those of the world. The rows of a planned motion are seen from the
    support frame of its own feet instead, until `fbid_gym.motions.in_world` has placed them; all
    its arrays may have a single row, N = 1, that stands for all robots.

    Attributes:
        planted: (N, F) bool, feet that shall stand. The law holds them where they are.
        load: (N, F) share of its greatest force that a foot may take: 0 in the air, and on the way
            to 0 or 1 before it lifts and after it lands.
        foot_position: (N, F, 3) m, of each foot's reference.
        world_from_foot: (N, F, 3, 3).
        foot_velocity: (N, F, 6) m/s, rad/s; for point feet the first three count.
        foot_acceleration: (N, F, 6) m/s^2, rad/s^2.
        foothold: (N, F, 3) m, where a foot in the air shall land; that of a foot that stands.
        clipped: (N, F) bool, the foothold would have to be farther away than the leg reaches.
        com: (N, 3) m, centre of mass.
        com_velocity: (N, 3) m/s.
        com_acceleration: (N, 3) m/s^2.
        qpos: (N, nq) m, unit quaternion wxyz, rad: of base and joints.
        qvel: (N, nv) m/s, rad/s; the angular part in the base's frame.
        qacc: (N, nv) m/s^2, rad/s^2, rate of qvel.
        cycle: (N,) share of the motion's cycle that has passed.
        moment: (N, 3) factors on weights of the base's moment beside the force, see `BodyLaw.of`.
    """

    planted: np.ndarray
    load: np.ndarray
    foot_position: np.ndarray
    world_from_foot: np.ndarray
    foot_velocity: np.ndarray
    foot_acceleration: np.ndarray
    foothold: np.ndarray
    clipped: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    com_acceleration: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    cycle: np.ndarray
    moment: np.ndarray


Robots = TypeVar("Robots", bound=tuple[Any, ...])


def some_of(robots: Robots, rows: np.ndarray) -> Robots:
    """Return copies of some rows, given by their indices, of a named tuple of arrays (N, ...)."""
    return type(robots)(*(value[rows] for value in robots))
