"""From the target of a gait to joint torques: what the layers share whose feet are tasks.

All feet, standing and swinging, are held to accelerations of their own, J a + Jdot v = a_feet:
those that stand come to rest, those in the air go where the gait wants them. Forces come from the
feet that stand alone. The body follows in the null space of that, eq. (19) of [M10], the joints in
what it leaves; then come forces within the friction cones and torques, as without a gait. What the
body shall do is said in `walking_tasks`.

Where a foot lands or lifts, what is asked of it changes at once, and so do the forces that may act
on it. On soles the torque goes on from where it was, and what is new fades in (`ContactRamp`). On
points the gait's ramp of the load has to do: their steps are too short to go on braking a leg that
the ground has stopped (on a 12 kg quadruped that costs a tenth of the velocity's accuracy).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.law_memory import LawMemory, diagnostics_of, fresh_memory, remember
from fbid_gym.actions.passive_joints import PassiveJoints, give_back
from fbid_gym.actions.walking_gains import WalkingGains, has_spare_joints
from fbid_gym.compiled import bind, compiled, kernel
from fbid_gym.control import ContactLimits
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY, limit_rows, wrench_scale
from fbid_gym.control.inverse_dynamics import invert_dynamics
from fbid_gym.control.limited_inverse_dynamics import limit_dynamics
from fbid_gym.control.operational_space import LEAST_GAIN, serve_task
from fbid_gym.control.underactuation import underactuation
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry, reduce_contacts
from fbid_gym.dynamics.rotations import rotation_left
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
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
    ReducedContacts,
    RobotState,
    TaskCommand,
)
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import copy

_SOLE = 0.9  # of a flat foot, that carries: its edges are where it tips
_LEAST_LOAD = 0.02  # of a foot's greatest force, so that it is held down
_MOST_LOAD = 1.5  # of the weight, on a point foot
_SMALL = 0.03  # of sqrt(gravity times height); where greater ones count as more, robots slip sooner


class WalkingConstants(NamedTuple):
    """Of the law on one robot, see `WalkingLaw`."""

    gains: WalkingGains
    velocity_gain: float  # 1/s, beside the gait's
    small_error: float  # m/s, of the horizontal velocity, as which it counts at most
    geometry: ContactGeometry
    limits: np.ndarray  # (1, P, 3) of `limit_rows`
    most_load: float  # of the weight, on one foot
    mobility: np.ndarray  # (nv,) how readily each coordinate gives way to feet and body
    least_gain: np.ndarray  # (6,) of the body's task
    nearness: Nearness  # and to the limits of the contact forces
    gravity: float
    passive: PassiveJoints  # to be given back
    home: np.ndarray  # (nq,)
    turning_inertia: np.ndarray  # (3, 3), see `_turning_inertia`


class BodyAim(NamedTuple):
    """What the body shall do once the feet do theirs, and how all moves that this leaves free.

    Attributes:
        task: of the body.
        reference: (N, nv) accelerations that the robot stays near to.
    """

    task: TaskCommand
    reference: np.ndarray


@dataclass(frozen=True, eq=False)
class WalkingLaw:
    """The law on one robot.

    Attributes:
        robot: whose joints.
        constants: of the law.
        ramp: leads the torque through touchdowns and lift-offs; None where it may jump.
        limited: whether contact forces have limits; else they can pull and never slip.
    """

    robot: Robot
    constants: WalkingConstants
    ramp: ContactRamp | None
    limited: bool

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        omega: float,
        contact: ContactOptions,
        velocity_gain: float = 0.0,
    ) -> "WalkingLaw":
        """Build the law on what `contact` says of the contacts.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            omega: 1/s, rate at which the robot falls, see `Gait`.
            contact: the options; which points are on the ground is the gait's to say.
            velocity_gain: of small errors of the horizontal velocity, beside the gait's, in units
                of omega.

        Raises:
            InvalidValueError: a gain on soles.
        """
        stance, limits = Stance.of(robot), contact.limits(robot)
        soles = robot.has_soles
        if soles and velocity_gain:
            expected = "0 on soles, where the velocity is to swing about the commanded one"
            raise InvalidValueError("velocity_gain", velocity_gain, expected)
        # On soles the centre of pressure balances: the horizontal force goes before the moment. On
        # points there is little of a moment to give away.
        cost = (1.0, 1.0, 1.0, 0.05, 0.05, 0.05) if soles else None
        length = stance.length if soles else 0.3 * stance.length
        # Where joints are free, what forces cannot do must not be taken out of all of them.
        priority = 1.0 if soles or has_spare_joints(robot) else 1e5
        constants = WalkingConstants(
            gains=WalkingGains.of(robot, omega),
            velocity_gain=velocity_gain * omega,
            small_error=_SMALL * robot.gravity / omega,
            geometry=contact_geometry(robot, share=_SOLE),
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            most_load=math.inf if soles else _MOST_LOAD,
            mobility=stance.mobility(1.0),
            least_gain=LEAST_GAIN * np.repeat([stance.home_com[2], 1.0], 3),
            nearness=Nearness(stance.mobility(priority), wrench_scale(length, cost)),
            gravity=robot.gravity,
            passive=contact.passive(robot),
            home=robot.home_qpos,
            turning_inertia=_turning_inertia(robot),
        )
        return cls(robot, constants, contact.ramp(control_hz), limits is not None)

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """What of its memory it reports."""
        return diagnostics_of(self.limited)

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, the diagnostics, and what the ramp goes on from."""
        feet, joints = self.robot.num_feet, self.robot.num_joints
        memory = fresh_memory(num_robots, self.ramp, feet, joints)
        if self.ramp is not None:
            memory["sudden_torque"] = np.zeros((num_robots, joints))
        return memory

    def torque(
        self,
        aim: BodyAim,
        state: RobotState,
        target: GaitTarget,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            aim: of the body, see `walking_tasks`.
            state: of the robots.
            target: of the gait.
            terms: of the robots.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m.
        """
        torque = self._walk(aim, state, target, terms, LawMemory.of(memory))
        if self.ramp is None:
            return torque
        # What a foot would do had it not landed or lifted nobody plans: its last torque stands
        # for that.
        before = memory["sudden_torque"].copy()
        memory["sudden_torque"][:] = torque
        return self.ramp.torque(torque, target.planted, lambda rows, _: before[rows], memory)

    @cached_property
    def _walk(self) -> Callable[..., np.ndarray]:
        return bind(_walk_within_limits if self.limited else _walk_without_limits, self.constants)


def _turning_inertia(robot: Robot) -> np.ndarray:
    """What a moment has to overcome to turn the base: (3, 3) kg·m², ahead, to the left and up.

    In the home stance, the angular momentum per angular velocity of the base while the feet, the
    centre of mass and the base's height stay and the joints move as little as this law lets them.
    """
    stance = Stance.of(robot)
    terms, body = stance.terms, centroidal_terms(stance.terms, np.zeros((1, robot.nv)))
    rows = 6 if robot.has_soles else 3
    feet = terms.foot_jacobian[0, :, :rows].reshape(-1, robot.nv)
    held = np.concatenate([feet, terms.mass_matrix[0, :2] / robot.mass, np.eye(6, robot.nv)[2:]])
    turn = np.zeros((len(held), 3))
    turn[-3:] = terms.world_from_base[0].T
    inertia = body.matrix[0, 3:] @ np.linalg.pinv(held, rcond=1e-6) @ turn
    return 0.5 * (inertia + inertia.T)


@compiled
def posture(law: WalkingConstants, state: RobotState) -> np.ndarray:
    """Accelerations (N, nv) that lead the joints home; of the base none."""
    count, size = state.qvel.shape
    result = np.zeros((count, size))
    for i in range(count):
        for k in range(6, size):
            error = law.home[k + 1] - state.qpos[i, k + 1]
            rate = law.gains.posture_damping * state.qvel[i, k]
            result[i, k] = law.gains.posture * error - rate
    return result


class _Wanted(NamedTuple):
    """What the robots shall do at a tick, and on what.

    Attributes:
        contacts: all feet, with what is asked of them.
        standing: those that stand alone.
        limits: of the forces on them.
        acceleration: (N, nv) desired.
    """

    contacts: ReducedContacts
    standing: ReducedContacts
    limits: PointLimits
    acceleration: np.ndarray


@compiled
def _want(
    law: WalkingConstants,
    aim: BodyAim,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
) -> _Wanted:
    """The feet first, the body in what they leave, eq. (19), then the joints."""
    count, points = len(state.qvel), len(law.geometry.offset)
    moving = with_foot_bias(terms, _moving_feet(law.gains, target, terms))
    contacts = reduce_contacts(law.geometry, all_points(law), moving)
    constraint = Constraint(contacts.jacobian, contacts.bias)
    desired = serve_task(constraint, aim.task, aim.reference, law.mobility, law.least_gain).motion
    mask, rows = np.empty((count, points), np.bool_), np.empty((count, points, 3))
    for i in range(count):
        weight = law.gravity * terms.mass_matrix[i, 0, 0]
        for point in range(points):
            foot = law.geometry.foot_of_point[point]
            mask[i, point] = target.planted[i, foot]
            load = max(target.load[i, foot], _LEAST_LOAD)
            friction, least, most = law.limits[0, point]
            most = min(most, load * law.most_load * weight)
            rows[i, point, 0], rows[i, point, 1] = friction, min(least, most)
            rows[i, point, 2] = most
    standing = reduce_contacts(law.geometry, ActivePoints(mask, True), moving)
    return _Wanted(contacts, standing, PointLimits(rows, mask), desired)


@kernel
def _walk_within_limits(
    law: WalkingConstants,
    aim: BodyAim,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for an aim of the body; updates the memory."""
    wanted = _want(law, aim, state, target, terms)
    found = limit_dynamics(
        EquationOfMotion(terms.mass_matrix, terms.bias),
        wanted.contacts,
        wanted.acceleration,
        wanted.limits,
        law.nearness,
        DEFAULT_ACCURACY,
        law.gravity,
        memory.warm_start,
    )
    remember(found.warm_start, found.residual, memory)
    copy(underactuation(wanted.standing.jacobian), memory.underactuation)
    return give_back(law.passive, found.torque, state.qpos, state.qvel)


@kernel
def _walk_without_limits(
    law: WalkingConstants,
    aim: BodyAim,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """The same by eq. (15), whose contact forces have no limits."""
    wanted = _want(law, aim, state, target, terms)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    standing = Constraint(wanted.standing.jacobian, wanted.standing.bias)
    alike = np.empty((0, state.qvel.shape[1] - 6))
    found = invert_dynamics(motion, standing, wanted.acceleration, alike, law.nearness.mobility)
    copy(found.underactuation, memory.underactuation)
    return give_back(law.passive, found.torque, state.qpos, state.qvel)


@compiled
def feet_on_their_way(
    law: WalkingConstants, target: GaitTarget, terms: DynamicsTerms
) -> Constraint:
    """What all feet shall do, J a + "Jdot v" = 0 with what is asked of them in the bias."""
    moving = with_foot_bias(terms, _moving_feet(law.gains, target, terms))
    contacts = reduce_contacts(law.geometry, all_points(law), moving)
    return Constraint(contacts.jacobian, contacts.bias)


@compiled
def all_points(law: WalkingConstants) -> ActivePoints:
    """All points of all feet."""
    return ActivePoints(np.ones((1, len(law.geometry.offset)), np.bool_), False)


@compiled
def _moving_feet(gains: WalkingGains, target: GaitTarget, terms: DynamicsTerms) -> np.ndarray:
    """The feet's "Jdot v", (N, F, 6), short of the acceleration that each shall have."""
    count, feet = target.planted.shape
    bias = terms.foot_bias.copy()
    for i in range(count):
        for foot in range(feet):
            turn = rotation_left(target.world_from_foot[i, foot], terms.world_from_foot[i, foot])
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
    return bias


@compiled
def with_foot_bias(terms: DynamicsTerms, foot_bias: np.ndarray) -> DynamicsTerms:
    """The terms with another "Jdot v" of the feet, (N, F, 6)."""
    return DynamicsTerms(
        terms.mass_matrix,
        terms.bias,
        terms.base_position,
        terms.world_from_base,
        terms.world_from_trunk,
        terms.com,
        terms.com_velocity,
        terms.foot_position,
        terms.world_from_foot,
        terms.foot_velocity,
        terms.foot_jacobian,
        foot_bias,
    )
