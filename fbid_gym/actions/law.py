"""The law that all model-based layers share, on a robot: see `fbid_gym.control.body_law`."""

import math
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.contact_options import (
    ContactBelief,
    ContactOptions,
    ContactRamp,
    contact_belief,
)
from fbid_gym.control.body_law import (
    Command,
    LawConstants,
    LawMemory,
    torque_within_limits,
    torque_without_limits,
)
from fbid_gym.control.contact_forces import ContactLimits, limit_rows, wrench_scale
from fbid_gym.control.grip import ANY, GripModel
from fbid_gym.control.look_ahead import Delay, look_ahead
from fbid_gym.control.motor_limits import MotorModel
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import about_base, base_from_trunk
from fbid_gym.quantities import BodyGains, DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot
from fbid_gym.robots.drives import torque_line

LEAST_GAIN = 0.05
"""Of a task of the body, see `fbid_gym.control.operational_space`."""

_LEAST_INERTIA = 0.05  # of the locked robot's: below it the base turns too easily to tell
_SOLE = 0.9  # of a flat foot, that carries: its edges are where it tips
_MOST_LOAD = 1.5  # of the weight, on a point foot
_JOINTS_FIRST = 1e-3  # weight of squared base accelerations beside one for the joints


@dataclass(frozen=True, eq=False)
class OnContacts:
    """Shared base of the laws that act through contacts."""

    robot: Robot  # whose joints
    belief: ContactBelief  # which points are taken to be on the ground
    # Leads the torque through switches of contacts; None where it may jump.
    ramp: ContactRamp | None

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        residual, underactuation = np.zeros((2, num_robots))
        own: Memory = LawMemory(
            warm_start=np.zeros((num_robots, 6)),
            residual=residual,
            underactuation=underactuation,
            strength=np.ones(num_robots),
            grip=np.ones(num_robots),
            allowed=np.full((num_robots, self.robot.num_feet), ANY),
            priority=np.ones(num_robots),
            vertical=np.zeros((num_robots, 4)),
            acceleration=np.zeros((num_robots, self.robot.nv)),
        )._asdict()
        if self.ramp is not None:
            own |= self.ramp.memory(num_robots, self.robot.num_points, self.robot.num_joints)
        return own

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """What it reports: errors of the wrench, directions in which contacts cannot push."""
        return "residual", "underactuation"


@dataclass(frozen=True, eq=False)
class BodyLaw(OnContacts):
    """The law on one robot."""

    constants: LawConstants  # of the law
    limited: bool  # whether contact forces have limits; else they can pull and never slip
    late: Delay | None  # how late its torques come; None where they come at once
    initial_grip: float  # share of the coefficient of friction that is counted on at first

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        contact: ContactOptions,
        gains: BodyGains,
        moment_priority: float | tuple[float, float],
        *,
        joints_first: bool = False,
        delay: float = 0.0,
    ) -> "BodyLaw":
        """Build the law.

        Where contacts cannot deliver both, squared errors of the moment (per weight and mean
        distance of the contact points) weigh `moment_priority` times as much as those of the force
        (per weight): of what tilts the body, and of what turns it. With `joints_first` feet in the
        air follow their joints, and the base yields where feet do not allow what is asked of base
        and joints. Torques come `delay` s after the state that they answer.
        """
        stance, limits = Stance.of(robot), contact.limits(robot)
        inertia, priority = _turning_inertia(robot), np.broadcast_to(moment_priority, 2)
        cost = (1.0, 1.0, 1.0, *about_base(robot, *priority))
        tick, falls, softness = 1.0 / control_hz, stance.falling_rate, contact.contact_time or 0.0
        constants = LawConstants(
            gains=gains,
            limbs=stance.limbs,
            geometry=contact_geometry(robot, share=_SOLE),
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            most_load=math.inf if robot.has_soles else _MOST_LOAD,
            mobility=stance.mobility(_JOINTS_FIRST if joints_first else 1.0),
            least_gain=LEAST_GAIN * np.repeat([stance.home_com[2], 1.0], 3),
            nearness=wrench_scale(stance.length, cost),
            gravity=robot.gravity,
            ahead=np.ascontiguousarray(base_from_trunk(robot)[:, 0]),
            turning_inertia=inertia,
            turning_mobility=np.linalg.inv(inertia),
            feet_first=not joints_first,
            passive=contact.passive(robot),
            motors=MotorModel(torque_line(robot), tick, 1.0 / falls),
            grip=GripModel.of(falls, robot.gravity, tick, softness, notices=contact.notice_slip),
        )
        belief = contact_belief(contact.contacts, robot, control_hz)
        radius = np.array([foot.radius for foot in robot.feet])
        late = Delay(delay, tick, robot.gravity, radius) if delay else None
        ramp, grip = contact.ramp(control_hz), contact.initial_grip or 1.0
        return cls(robot, belief, ramp, constants, limits is not None, late, grip)

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """See `OnContacts`; by [M10] eq. (15) it misses no wrench that can be had."""
        found = super().diagnostics
        return (*found, "strength", "grip") if self.limited else found[1:]

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        own = super().memory(num_robots)
        own["grip"][:] = self.initial_grip
        if self.late is not None:
            own["sent"] = np.zeros((num_robots, self.late.ticks, self.robot.nv))
        return own

    def torque(
        self,
        command: Command,
        state: RobotState,
        target: Target,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques (N, n) N·m for the command of a layer; updates the memory."""
        active = self.belief(state, target)
        if self.late is not None:
            made, sent = memory["acceleration"], memory["sent"]
            state, terms = look_ahead(self.late, made, sent, state, terms)
        solve = torque_within_limits if self.limited else torque_without_limits
        torque = solve(self.constants, command, state, target, terms, active, LawMemory.of(memory))
        return torque if self.ramp is None else self.ramp.torque(torque, active, memory)


class LawLayer:
    """Shared base of the layers that act through a law."""

    law: OnContacts

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the law."""
        return self.law.diagnostics

    def memory(self, num_robots: int) -> Memory:
        """See `ActionLayer.memory`."""
        return self.law.memory(num_robots)


def _turning_inertia(robot: Robot) -> np.ndarray:
    """Return the inertia against turns of the base: (3, 3) kg·m², ahead, to the left and up.

    In the home stance, the angular momentum per angular velocity of the base while the feet, the
    centre of mass and the base's height stay, as far as legs can, and the joints move little.
    """
    stance = Stance.of(robot)
    terms, body = stance.terms, centroidal_terms(stance.terms, np.zeros((1, robot.nv)))
    # Point feet turn freely: rows of zeros.
    axes = robot.has_soles * stance.limbs.turns @ terms.world_from_foot[0].mT
    places, turns = terms.foot_jacobian[0, :, :3], axes @ terms.foot_jacobian[0, :, 3:]
    com = terms.mass_matrix[0, :2] / robot.mass
    held = np.concatenate([*places, *turns, com, np.eye(6, robot.nv)[2:]])
    turn = np.zeros((len(held), 3))
    turn[-3:] = terms.world_from_base[0].T
    inertia = body.matrix[0, 3:] @ np.linalg.pinv(held, rcond=1e-6) @ turn
    return no_lighter(inertia, body.inertia[0])


def no_lighter(inertia: np.ndarray, locked: np.ndarray) -> np.ndarray:
    """Return the symmetric part of an inertia (3, 3), none less than a share of the locked one's.

    About an axis in which a robot hardly resists, the inertia does not say how it turns.
    """
    values, vectors = np.linalg.eigh(0.5 * (inertia + inertia.T))
    least = _LEAST_INERTIA * np.linalg.eigvalsh(0.5 * (locked + locked.T))[0]
    return (vectors * np.maximum(values, least)) @ vectors.T
