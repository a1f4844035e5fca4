"""From a desired wrench at the centre of mass to joint torques, while some feet may swing."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp, through_contact_switches
from fbid_gym.actions.law_memory import LawMemory, fresh_memory, remember
from fbid_gym.actions.passive_joints import PassiveJoints, give_back
from fbid_gym.compiled import bind, compiled, kernel
from fbid_gym.control import ContactLimits
from fbid_gym.control.balance import balance_target, balance_wrench, body_motion
from fbid_gym.control.balancers import RIDGE, map_torques
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY, limit_rows, wrench_scale
from fbid_gym.control.underactuation import underactuation
from fbid_gym.control.wrench_distribution import (
    Distribution,
    share_freely,
    share_within_limits,
)
from fbid_gym.dynamics.centroidal import find_centroidal_terms
from fbid_gym.dynamics.contacts import reduce_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.quantities import (
    ActivePoints,
    CentroidalTerms,
    Constraint,
    ContactGeometry,
    DynamicsTerms,
    EquationOfMotion,
    ForcePath,
    Heading,
    Limits,
    Memory,
    PointLimits,
    PostureCommand,
    ReducedContacts,
    Reference,
    RobotState,
    SupportFrame,
    TorqueMap,
    WrenchGains,
    rows_of,
    some_of,
)
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import copy, dot

# A swinging leg follows its own command; the other joints make up for what that does to contacts
# and momentum.
_SWING_MOBILITY = 1e-3


class PostureGains(NamedTuple):
    """Of the joints: w^2 (1/s^2) and 2 zeta w (1/s), while their foot stands and while it swings.

    Attributes:
        stiffness: of joints that no swinging foot hangs from.
        damping: of the same.
        swing_stiffness: of a swinging leg.
        swing_damping: of the same.
    """

    stiffness: float
    damping: float
    swing_stiffness: float
    swing_damping: float

    @classmethod
    def of(cls, posture: float, swing: float, ratio: float) -> "PostureGains":
        """From natural frequencies in Hz and a damping ratio."""
        rates = 2.0 * np.pi * posture, 2.0 * np.pi * swing
        return cls(rates[0] ** 2, 2.0 * ratio * rates[0], rates[1] ** 2, 2.0 * ratio * rates[1])


class _Constants(NamedTuple):
    """Of the law on one robot, see `BalanceLaw`.

    Attributes:
        balancer: one of those in `fbid_gym.control.balancers`.
        wrench: gains of the desired wrench.
        posture: gains of the joints.
        push: (6,) N and N·m, what action 1 adds to the desired wrench, in the frame of the feet.
        gravity: m/s².
        geometry: of the contact points.
        heading: of the feet.
        legs: (F, n) bool, joints that move this foot and no other.
        limits: (1, P, 3) on the contact forces, see `limit_rows`.
        torque_limit: (1, n) N·m.
        weight: (1,) N, of the robot.
        scale: (6,) turns errors of the wrench into N whose squares are comparable.
        passive: what joints take of their torques, to be given back.
    """

    balancer: int
    wrench: WrenchGains
    posture: PostureGains
    push: np.ndarray
    gravity: float
    geometry: ContactGeometry
    heading: Heading
    legs: np.ndarray
    limits: np.ndarray
    torque_limit: np.ndarray
    weight: np.ndarray
    scale: np.ndarray
    passive: PassiveJoints


@dataclass(frozen=True, eq=False)
class BalanceLaw:
    """A balancer on a robot's feet; F feet, P points.

    Attributes:
        robot: whose joints.
        belief: which points are taken to be in contact.
        ramp: leads from one set of contacts to the next; None where the torque may jump.
        constants: of the law.
        limited: whether contact forces and torques have limits; contacts without can pull and never
            slip.
    """

    robot: Robot
    belief: ContactBelief
    ramp: ContactRamp | None
    constants: _Constants
    limited: bool

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        contact: ContactOptions,
        balancer: int,
        gains: tuple[WrenchGains, PostureGains],
        moment_priority: float,
        push: np.ndarray,
    ) -> "BalanceLaw":
        """Build the law on what `contact` says of the contacts; `push` is that of action 1."""
        stance, limits = Stance.of(robot), contact.limits(robot)
        cost = (1.0,) * 3 + (moment_priority,) * 3
        constants = _Constants(
            balancer,
            *gains,
            push=push,
            gravity=robot.gravity,
            geometry=stance.geometry,
            heading=stance.heading,
            legs=stance.legs,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            torque_limit=robot.torque_limit[None].copy(),
            weight=np.array([robot.weight]),
            scale=wrench_scale(stance.length, cost if limits is not None else None),
            passive=contact.passive(robot),
        )
        return cls(
            robot=robot,
            belief=contact.belief(robot, control_hz),
            ramp=contact.ramp(control_hz),
            constants=constants,
            limited=limits is not None,
        )

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, the diagnostics, and a ramp's state."""
        return fresh_memory(num_robots, self.ramp, self.robot.num_points, self.robot.num_joints)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            action: (N, 6).
            state: of the robots.
            reference: what they shall do.
            terms: of the robots.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m.
        """
        active, own = self.belief(state, reference), LawMemory.of(memory)
        torque = self._balance(active, action, state, reference, terms, own)

        def of_contacts(rows: np.ndarray, active: ActivePoints) -> np.ndarray:
            return self._balance(
                active,
                action[rows],
                some_of(state, rows),
                rows_of(reference, rows),
                some_of(terms, rows),
                some_of(own, rows),
            )

        return through_contact_switches(self.ramp, active, torque, of_contacts, memory)

    @cached_property
    def _balance(self) -> Callable[..., np.ndarray]:
        # Chosen here and not in compiled code: what a layer does not use is then not compiled.
        law = _balance_within_limits if self.limited else _balance_without_limits
        return bind(law, self.constants)


class _Wanted(NamedTuple):
    """What the contacts shall deliver at a tick, and on what.

    Attributes:
        wrench: (N, 6) desired at the centre of mass, N and N·m, world.
        torques: from contact forces to joint torques.
        path: from contact forces to the wrench.
        contacts: of the robots.
    """

    wrench: np.ndarray
    torques: TorqueMap
    path: ForcePath
    contacts: ReducedContacts


@compiled
def _want(
    law: _Constants,
    active: ActivePoints,
    action: np.ndarray,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
) -> _Wanted:
    """The wrench, with what actions (N, 6) add to it, and the balancer's map."""
    body = find_centroidal_terms(terms, state.qvel)
    frame = support_frame(law.heading, terms)
    contacts = reduce_contacts(law.geometry, active, terms)
    constraint = Constraint(contacts.jacobian, contacts.bias)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    push = law.push * action
    wrench = desired_wrench(law.wrench, law.gravity, push, state, reference, terms, body, frame)
    posture = _posture(law, active, state, reference)
    torques = map_torques(law.balancer, motion, body, constraint, posture, RIDGE)
    give_back(law.passive, torques.offset, state.qpos, state.qvel)  # before limits are kept
    path = ForcePath(body.to_com, contacts.point_map, np.empty((0, len(law.geometry.offset), 3, 3)))
    return _Wanted(wrench, torques, path, contacts)


@kernel
def _balance_within_limits(
    law: _Constants,
    active: ActivePoints,
    action: np.ndarray,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for actions (N, 6); updates the memory."""
    wanted = _want(law, active, action, state, reference, terms)
    found = share_within_limits(
        wanted.torques,
        wanted.path,
        wanted.wrench,
        Limits(PointLimits(law.limits, active.mask), law.torque_limit),
        law.scale,
        law.weight,
        DEFAULT_ACCURACY,
        memory.warm_start,
    )
    return _noted(active, wanted.contacts, found, memory)


@kernel
def _balance_without_limits(
    law: _Constants,
    active: ActivePoints,
    action: np.ndarray,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """The same where contact forces and torques have no limits."""
    wanted = _want(law, active, action, state, reference, terms)
    found = share_freely(wanted.torques, wanted.path, wanted.wrench, law.scale, law.weight)
    return _noted(active, wanted.contacts, found, memory)


@compiled
def _noted(
    active: ActivePoints, contacts: ReducedContacts, found: Distribution, memory: LawMemory
) -> np.ndarray:
    """The torques that were found; updates the memory."""
    remember(found.warm_start, found.residual, memory)
    if active.switching:
        copy(underactuation(contacts.jacobian), memory.underactuation)
    return found.torque


@kernel
def desired_wrench(
    gains: WrenchGains,
    gravity: float,
    push: np.ndarray,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
    body: CentroidalTerms,
    frame: SupportFrame,
) -> np.ndarray:
    """Return the wrench at the centre of mass that leads robots back to their reference.

    Args:
        gains: of [G15] (36) or (38); all but K_R along the axes of the feet's frame.
        gravity: m/s^2, along -z.
        push: (N, 6) N and N·m, to add; in the frame of the feet.
        state: of the robots.
        reference: what they shall do.
        terms: of the robots.
        body: of the robots.
        frame: of their feet.

    Returns:
        (N, 6) N and N·m, world.
    """
    target, moving = balance_target(reference, frame, body), body_motion(state, terms, body)
    wrench = balance_wrench(gains, target, moving, frame.world_from_support, gravity)
    for i in range(len(wrench)):
        for axis in range(3):
            wrench[i, axis] += dot(frame.world_from_support[i, axis], push[i, :3])
            wrench[i, 3 + axis] += dot(frame.world_from_support[i, axis], push[i, 3:])
    return wrench


@compiled
def _posture(
    law: _Constants, active: ActivePoints, state: RobotState, reference: Reference
) -> PostureCommand:
    """Desired accelerations of the joints, and how readily each departs from its own."""
    gains, legs = law.posture, law.legs
    count, joints = len(state.qpos), legs.shape[1]
    acceleration, mobility = np.empty((count, joints)), np.empty((count, joints))
    in_the_air = np.empty(len(legs), np.bool_)
    for i in range(count):
        row, contacts = min(i, len(reference.qpos) - 1), active.mask[min(i, len(active.mask) - 1)]
        in_the_air[:] = True
        for point in range(len(contacts)):
            if contacts[point]:
                in_the_air[law.geometry.foot_of_point[point]] = False
        for j in range(joints):
            error = reference.qpos[row, 7 + j] - state.qpos[i, 7 + j]
            rate = reference.qvel[row, 6 + j] - state.qvel[i, 6 + j]
            swings = False
            for foot in range(len(legs)):
                swings |= in_the_air[foot] and legs[foot, j]
            pull = gains.swing_stiffness * error + gains.swing_damping * rate
            if not swings:
                pull = gains.stiffness * error + gains.damping * rate
            acceleration[i, j] = reference.qacc[row, 6 + j] + pull
            mobility[i, j] = _SWING_MOBILITY if swings else 1.0
    return PostureCommand(acceleration, mobility)
