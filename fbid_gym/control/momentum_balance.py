"""The papers' balancers on a robot's feet: a desired wrench at the centre of mass, and torques.

They are for motions that are planned; of these some feet may swing.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.balance import desired_wrench
from fbid_gym.control.balancers import RIDGE, map_torques
from fbid_gym.control.body_law import LawMemory
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY
from fbid_gym.control.wrench_distribution import share, underactuation
from fbid_gym.dynamics.centroidal import find_centroidal_terms
from fbid_gym.dynamics.contacts import reduce_contacts
from fbid_gym.dynamics.passive_joints import PassiveJoints, give_back
from fbid_gym.dynamics.support import support_frame
from fbid_gym.quantities import (
    Constraint,
    ContactGeometry,
    DynamicsTerms,
    EquationOfMotion,
    ForcePath,
    Heading,
    Limits,
    PointLimits,
    PostureCommand,
    RobotState,
    Target,
    WrenchGains,
)
from fbid_gym.small_matrices import copy

# A swinging leg follows its own command; the other joints make up for what that does to contacts
# and momentum.
_SWING_MOBILITY = 1e-3


class PostureGains(NamedTuple):
    """Gains of the joints: w^2 (1/s^2) and 2 zeta w (1/s), where their foot stands and swings."""

    stiffness: float  # of joints that no swinging foot hangs from
    damping: float  # of the same
    swing_stiffness: float  # of a swinging leg
    swing_damping: float  # of the same

    @classmethod
    def of(cls, posture: float, swing: float, ratio: float) -> "PostureGains":
        """From natural frequencies in Hz and a damping ratio."""
        rates = 2.0 * np.pi * posture, 2.0 * np.pi * swing
        return cls(rates[0] ** 2, 2.0 * ratio * rates[0], rates[1] ** 2, 2.0 * ratio * rates[1])


class MomentumBalance(NamedTuple):
    """Constants of a paper's balancer on one robot, see `balance_torque`."""

    balancer: int  # one of those in `fbid_gym.control.balancers`
    wrench: WrenchGains  # gains of the desired wrench
    posture: PostureGains  # gains of the joints
    # (6,) N and N·m, what action 1 adds to the desired wrench, in the frame of the feet.
    push: np.ndarray
    gravity: float  # m/s²
    geometry: ContactGeometry  # of the contact points
    heading: Heading  # of the feet
    legs: np.ndarray  # (F, n) bool, joints that move this foot and no other
    limits: np.ndarray  # (1, P, 3) on the contact forces, see `limit_rows`
    torque_limit: np.ndarray  # (1, n) N·m
    weight: np.ndarray  # (1,) N, of the robot
    scale: np.ndarray  # (6,) turns errors of the wrench into N whose squares are comparable
    passive: PassiveJoints  # what joints take of their torques, to be given back
    limited: bool  # whether contact forces and torques have limits


@kernel
def balance_torque(
    law: MomentumBalance,
    active: np.ndarray,
    action: np.ndarray,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for actions (N, 6), which add to the wrench; updates the memory."""
    body = find_centroidal_terms(terms, state.qvel)
    frame = support_frame(law.heading, terms)
    contacts = reduce_contacts(law.geometry, active, terms)
    constraint = Constraint(contacts.jacobian, contacts.bias)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    push = law.push * action
    wrench = desired_wrench(law.wrench, law.gravity, push, state, target, terms, body, frame)
    posture = _posture(law, active, state, target)
    torques = map_torques(law.balancer, motion, body, constraint, posture, RIDGE)
    give_back(law.passive, torques.offset, state.qpos, state.qvel)  # before limits are kept
    path = ForcePath(body.to_com, contacts.point_map, np.empty((0, len(law.geometry.offset), 3, 3)))
    limits = Limits(PointLimits(law.limits, active), law.torque_limit)
    found = share(
        *(torques, path, wrench, limits, law.scale, law.weight, DEFAULT_ACCURACY),
        *(memory.warm_start, law.limited),
    )
    copy(found.residual, memory.residual)
    copy(underactuation(contacts.jacobian), memory.underactuation)
    for i in range(len(active)):
        copy(found.warm_start[i], memory.warm_start[i])
    return found.torque


@compiled
def _posture(
    law: MomentumBalance, active: np.ndarray, state: RobotState, target: Target
) -> PostureCommand:
    """Desired accelerations of the joints, and how readily each departs from its own."""
    gains, legs = law.posture, law.legs
    count, joints = len(state.qpos), legs.shape[1]
    acceleration, mobility = np.empty((count, joints)), np.empty((count, joints))
    in_the_air = np.empty(len(legs), np.bool_)
    for i in range(count):
        contacts = active[i]
        in_the_air[:] = True
        for point in range(len(contacts)):
            if contacts[point]:
                in_the_air[law.geometry.foot_of_point[point]] = False
        for j in range(joints):
            error = target.qpos[i, 7 + j] - state.qpos[i, 7 + j]
            rate = target.qvel[i, 6 + j] - state.qvel[i, 6 + j]
            swings = False
            for foot in range(len(legs)):
                swings |= in_the_air[foot] and legs[foot, j]
            pull = gains.swing_stiffness * error + gains.swing_damping * rate
            if not swings:
                pull = gains.stiffness * error + gains.damping * rate
            acceleration[i, j] = target.qacc[i, 6 + j] + pull
            mobility[i, j] = _SWING_MOBILITY if swings else 1.0
    return PostureCommand(acceleration, mobility)
