"""From the target of a gait to joint torques: what the layers share whose feet are tasks.

All feet, standing and swinging, are held to accelerations of their own, J a + Jdot v = a_feet:
those that stand come to rest, those in the air go where the gait wants them. Forces come from the
feet that stand alone. The body follows in the null space of that, eq. (19) of [M10], the joints in
what it leaves; then come forces within the friction cones and torques, as without a gait.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.law_memory import LawMemory
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control import ContactLimits
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY, limit_rows, wrench_scale
from fbid_gym.control.inverse_dynamics import invert_dynamics
from fbid_gym.control.limited_inverse_dynamics import limit_dynamics
from fbid_gym.control.operational_space import LEAST_GAIN, serve_task
from fbid_gym.control.underactuation import underactuation
from fbid_gym.dynamics.contacts import contact_geometry, reduce_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import (
    ActivePoints,
    Constraint,
    ContactGeometry,
    DynamicsTerms,
    EquationOfMotion,
    Memory,
    Nearness,
    PointLimits,
    RobotState,
    TaskCommand,
)
from fbid_gym.robots import Robot

_SOLE = 0.9  # of a flat foot, that carries: its edges are where it tips
_LEAST_LOAD = 0.02  # of a foot's greatest force, so that it is held down
_MOST_LOAD = 1.5  # of the weight, on a point foot


class WalkingGains(NamedTuple):
    """Of a robot that walks: stiffness 1/s^2, damping 1/s.

    Attributes:
        height: of the base.
        height_damping: of the base.
        rotation: of the base.
        rotation_damping: of the base.
        swing: of feet in the air.
        swing_damping: of feet in the air.
        hold: 1/s, of feet that stand, on what they move.
        posture: of the joints.
        posture_damping: of the joints.
    """

    height: float
    height_damping: float
    rotation: float
    rotation_damping: float
    swing: float
    swing_damping: float
    hold: float
    posture: float
    posture_damping: float

    @classmethod
    def of(cls, robot: Robot, omega: float) -> "WalkingGains":
        """Derive the gains from the rate omega (1/s) at which the robot falls."""
        of_kind = _ON_SOLES if _has_soles(robot) else _ON_POINTS
        powers = cls(2, 1, 2, 1, 2, 1, 1, 2, 1)
        return cls(*(gain * omega**power for gain, power in zip(of_kind, powers, strict=True)))


# In units of omega, to the power of the unit. On points a robot has no ankles: what it does with
# its joints is all in its feet and its body.
_ON_POINTS = WalkingGains(4.4, 3.4, 5.9, 4.3, 26.0, 10.0, 5.0, 0.0, 0.34)
_ON_SOLES = WalkingGains(7.84, 5.6, 6.25, 5.0, 49.0, 14.0, 2.9, 4.84, 4.4)


class _Constants(NamedTuple):
    """Of the law on one robot, see `WalkingLaw`."""

    gains: WalkingGains
    geometry: ContactGeometry
    limited: bool
    limits: np.ndarray  # (1, P, 3) of `limit_rows`
    most_load: float  # of the weight, on one foot
    nearness: Nearness
    gravity: float
    damping: np.ndarray  # (n,)
    home: np.ndarray  # (nq,)


@dataclass(frozen=True, eq=False)
class WalkingLaw:
    """The law on one robot.

    Attributes:
        robot: whose joints.
        constants: of the law.
    """

    robot: Robot
    constants: _Constants

    @classmethod
    def of(cls, robot: Robot, omega: float, contact: ContactOptions) -> "WalkingLaw":
        """Build the law on what `contact` says of the contacts.

        Args:
            robot: whose joints.
            omega: 1/s, rate at which the robot falls, see `Gait`.
            contact: the options; which points are on the ground is the gait's to say.
        """
        stance, limits = Stance.of(robot), contact.limits(robot)
        soles = _has_soles(robot)
        # On soles the centre of pressure balances: the horizontal force goes before the moment. On
        # points there is little of a moment to give away.
        cost = (1.0, 1.0, 1.0, 0.05, 0.05, 0.05) if soles else None
        length = stance.length if soles else 0.3 * stance.length
        constants = _Constants(
            gains=WalkingGains.of(robot, omega),
            geometry=contact_geometry(robot, share=_SOLE),
            limited=limits is not None,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            most_load=math.inf if soles else _MOST_LOAD,
            nearness=Nearness(1.0 if soles else 1e-5, length, wrench_scale(length, cost)),
            gravity=robot.gravity,
            damping=contact.damping(robot),
            home=robot.home_qpos,
        )
        return cls(robot, constants)

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, and the diagnostics."""
        return LawMemory.fresh(num_robots)._asdict()

    def torque(
        self,
        task: TaskCommand,
        state: RobotState,
        target: GaitTarget,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            task: of the body, from `base_task` or a law of another kind.
            state: of the robots.
            target: of the gait.
            terms: of the robots.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m.
        """
        return _walk(self.constants, task, state, target, terms, LawMemory.of(memory))


def _has_soles(robot: Robot) -> bool:
    """Whether a foot has more than a point to stand on."""
    return robot.num_points > robot.num_feet


@kernel
def base_task(
    gains: WalkingGains,
    added: np.ndarray,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
) -> TaskCommand:
    """What the centre of mass (horizontally) and the base (its height and rotation) shall do.

    Args:
        gains: of the robot.
        added: (N, 6) to add: m/s^2 along the heading, and rad/s^2 in the base's axes.
        state: of the robots.
        target: of the gait.
        terms: of the robots.
    """
    count, size = state.qvel.shape
    jacobian, bias = np.zeros((count, 6, size)), np.zeros((count, 6))
    acceleration = np.empty((count, 6))
    for i in range(count):
        mass = terms.mass_matrix[i, 0, 0]
        for k in range(2):
            for j in range(size):
                jacobian[i, k, j] = terms.mass_matrix[i, k, j] / mass
            bias[i, k] = terms.bias[i, k] / mass
        for k in range(2, 6):
            jacobian[i, k, k] = 1.0
        cosine, sine = math.cos(target.heading[i]), math.sin(target.heading[i])
        ahead, left = added[i, 0], added[i, 1]
        acceleration[i, 0] = target.com_acceleration[i, 0] + cosine * ahead - sine * left
        acceleration[i, 1] = target.com_acceleration[i, 1] + sine * ahead + cosine * left
        rise = target.height[i] - terms.base_position[i, 2]
        acceleration[i, 2] = gains.height * rise - gains.height_damping * state.qvel[i, 2]
        acceleration[i, 2] += added[i, 2]
        error = lean(target, terms, i)
        for k in range(3):
            rate = terms.world_from_base[i, 2, k] * target.turning[i] - state.qvel[i, 3 + k]
            acceleration[i, 3 + k] = gains.rotation * error[k] + gains.rotation_damping * rate
            acceleration[i, 3 + k] += added[i, 3 + k]
    return TaskCommand(jacobian, bias, acceleration)


@compiled
def lean(target: GaitTarget, terms: DynamicsTerms, i: int) -> tuple[float, float, float]:
    """Axis times sine of the rotation from the base to upright in its heading; base axes."""
    cosine, sine = math.cos(target.heading[i]), math.sin(target.heading[i])
    base = terms.world_from_base
    # E = R^T D, D the turn about the vertical; its axial vector.
    ahead = (cosine, sine, 0.0)
    left = (-sine, cosine, 0.0)
    e10 = base[i, 0, 1] * ahead[0] + base[i, 1, 1] * ahead[1]
    e20 = base[i, 0, 2] * ahead[0] + base[i, 1, 2] * ahead[1]
    e01 = base[i, 0, 0] * left[0] + base[i, 1, 0] * left[1]
    e21 = base[i, 0, 2] * left[0] + base[i, 1, 2] * left[1]
    e02, e12 = base[i, 2, 0], base[i, 2, 1]
    return 0.5 * (e21 - e12), 0.5 * (e02 - e20), 0.5 * (e10 - e01)


@kernel
def _walk(
    law: _Constants,
    task: TaskCommand,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for a task of the body; updates the memory."""
    count, size = state.qvel.shape
    points = len(law.geometry.offset)
    moving = _with_moving_feet(law.gains, target, terms)
    every = ActivePoints(np.ones((1, points), np.bool_), False)
    contacts = reduce_contacts(law.geometry, every, moving)
    constraint = Constraint(contacts.jacobian, contacts.bias)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    posture = np.zeros((count, size))
    for i in range(count):
        for k in range(6, size):
            error = law.home[k + 1] - state.qpos[i, k + 1]
            rate = law.gains.posture_damping * state.qvel[i, k]
            posture[i, k] = law.gains.posture * error - rate
    desired = serve_task(constraint, task, posture, np.ones(size), LEAST_GAIN).motion

    mask, rows = np.empty((count, points), np.bool_), np.empty((count, points, 3))
    for i in range(count):
        weight = law.gravity * terms.mass_matrix[i, 0, 0]
        for point in range(points):
            foot = law.geometry.foot_of_point[point]
            mask[i, point] = target.planted[i, foot]
            load = max(target.load[i, foot], _LEAST_LOAD)
            rows[i, point] = law.limits[0, point]
            rows[i, point, 2] = min(rows[i, point, 2], load * law.most_load * weight)
            rows[i, point, 1] = min(rows[i, point, 1], rows[i, point, 2])
    standing = reduce_contacts(law.geometry, ActivePoints(mask, True), moving)
    if law.limited:
        found = limit_dynamics(
            motion,
            contacts,
            desired,
            PointLimits(rows, mask),
            law.nearness,
            DEFAULT_ACCURACY,
            law.gravity,
            memory.warm_start,
        )
        torque = found.torque
        memory.warm_start[:], memory.residual[:] = found.warm_start, found.residual
        memory.underactuation[:] = underactuation(standing.jacobian)
    else:
        alike = np.empty((0, size - 6))
        own = Constraint(standing.jacobian, standing.bias)
        free = invert_dynamics(motion, own, desired, alike, law.nearness.base_mobility)
        torque = free.torque
        memory.underactuation[:] = free.underactuation
    for i in range(count):
        for j in range(torque.shape[1]):
            torque[i, j] += law.damping[j] * state.qvel[i, 6 + j]
    return torque


@compiled
def _with_moving_feet(
    gains: WalkingGains, target: GaitTarget, terms: DynamicsTerms
) -> DynamicsTerms:
    """The terms with feet whose "Jdot v" is short of the acceleration that each shall have."""
    count, feet = target.planted.shape
    bias = terms.foot_bias.copy()
    for i in range(count):
        for foot in range(feet):
            turn = _rotation_left(target.world_from_foot[i, foot], terms.world_from_foot[i, foot])
            for k in range(6):
                rate = target.foot_velocity[i, foot, k] - terms.foot_velocity[i, foot, k]
                if target.planted[i, foot]:
                    bias[i, foot, k] -= gains.hold * rate
                    continue
                error = turn[k - 3]
                if k < 3:
                    error = target.foot_position[i, foot, k] - terms.foot_position[i, foot, k]
                bias[i, foot, k] -= target.foot_acceleration[i, foot, k]
                bias[i, foot, k] -= gains.swing * error + gains.swing_damping * rate
    return DynamicsTerms(
        terms.mass_matrix,
        terms.bias,
        terms.base_position,
        terms.world_from_base,
        terms.com,
        terms.com_velocity,
        terms.foot_position,
        terms.world_from_foot,
        terms.foot_velocity,
        terms.foot_jacobian,
        bias,
    )


@compiled
def _rotation_left(target: np.ndarray, now: np.ndarray) -> tuple[float, float, float]:
    """Axis times sine of the rotation from `now` to `target`, both (3, 3), world axes."""
    x, y, z = 0.0, 0.0, 0.0
    # 1/2 sum over columns of now × target.
    for k in range(3):
        x += now[1, k] * target[2, k] - now[2, k] * target[1, k]
        y += now[2, k] * target[0, k] - now[0, k] * target[2, k]
        z += now[0, k] * target[1, k] - now[1, k] * target[0, k]
    return 0.5 * x, 0.5 * y, 0.5 * z
