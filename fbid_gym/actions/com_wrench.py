"""Layer `com_wrench`: the momentum is balanced as in [G15]; to the wrench the action adds."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions, contact_belief
from fbid_gym.actions.gains import BODY_DEFAULTS, PRIORITY_ACTION, BodyOptions, meant, set_priority
from fbid_gym.actions.law import BodyLaw, LawLayer, OnContacts, no_lighter
from fbid_gym.actions.layer import GetTerms, scaled_names
from fbid_gym.actions.ranges import Falling, in_hertz
from fbid_gym.control.balance import desired_wrench
from fbid_gym.control.balance_gains import BalanceGains
from fbid_gym.control.balancers import GAROFALO2015, OTT2011
from fbid_gym.control.body_law import NONE, Command, LawMemory, stabilise
from fbid_gym.control.contact_forces import ContactLimits, limit_rows, wrench_scale
from fbid_gym.control.momentum_balance import MomentumBalance, PostureGains, balance_torque
from fbid_gym.dynamics.centroidal import centroidal_terms, find_centroidal_terms
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Choice, checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class BalanceLaw(OnContacts):
    """A paper's balancer on a robot's feet, for motions that are planned; some feet may swing."""

    constants: MomentumBalance  # of the law

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        contact: ContactOptions,
        balancer: str,
        hertz: Mapping[str, float],
        ratio: float,
        moment_priority: float | tuple[float, float],
        push: np.ndarray,
    ) -> "BalanceLaw":
        """Build the law.

        It holds the parts of a robot with frequencies (Hz) and a damping ratio; `push` is the
        wrench of action 1.
        """
        stance, limits = Stance.of(robot), contact.limits(robot)
        gains = papers_gains(robot, balancer, hertz, ratio)
        tilting, turning = np.broadcast_to(moment_priority, 2)
        cost = (1.0, 1.0, 1.0, tilting, tilting, turning)  # the wrench's axes are the world's
        constants = MomentumBalance(
            BALANCERS[balancer],
            gains.on_errors(of_velocity=balancer == "ott2011"),
            PostureGains.of(hertz["posture"], hertz["swing"], ratio),
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
            limited=limits is not None,
        )
        belief = contact_belief(contact.contacts, robot, control_hz)
        return cls(robot, belief, contact.ramp(control_hz), constants)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        target: Target,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques, (N, n) N·m; arguments as of `ActionLayer.torque`."""
        active, own = self.belief(state, target), LawMemory.of(memory)
        torque = balance_torque(self.constants, active, action, state, target, terms, own)
        return torque if self.ramp is None else self.ramp.torque(torque, active, memory)

    def desired(
        self, action: np.ndarray, state: RobotState, target: Target, terms: DynamicsTerms
    ) -> np.ndarray:
        """Return the acceleration that it asks of the centre of mass, (N, 3) m/s^2, world."""
        law, body = self.constants, find_centroidal_terms(terms, state.qvel)
        frame, push = support_frame(law.heading, terms), law.push * action
        wrench = desired_wrench(law.wrench, law.gravity, push, state, target, terms, body, frame)
        return wrench[:, :3] / body.mass[:, None] - np.array([0.0, 0.0, law.gravity])


BALANCERS = {"garofalo2015": GAROFALO2015, "ott2011": OTT2011}
"""The papers' balancers -> what they are in `fbid_gym.control.balancers`."""

_INVERSE_DYNAMICS = "inverse_dynamics"
# Of the papers' balancers: frequencies in units of falling, damping ratio, what cannot be changed.
_PAPERS = {"balance": 1.2, "height": 2.0, "rotation": 2.0, "posture": 1.7, "swing": 6.8}
_PAPERS_RATIO = 1.5
_FIXED: dict[str, Any] = {"velocity_gain": 0.0, "velocity_of": "com", "loop_delay": 0.0}


@dataclass(frozen=True, eq=False)
class ComWrench(LawLayer):
    """The contacts push the centre of mass and the base to their target, plus scale * action.

    The momentum changes as [G15] eqs. (38), (39) ask for: springs on the centre of mass and on the
    base's orientation, damping of the linear and angular momentum, the target's rate of momentum,
    and scale * action along the heading. The balancer says how that becomes torques:

    - "inverse_dynamics", by the law of all layers (`fbid_gym.actions.law`), which neglects no
      velocity and no acceleration of the joints.
    - "garofalo2015" and "ott2011", for motions that are planned: the contact forces that come
      nearest to the wrench within their limits and the torque limits become joint torques by the
      map of [G15], or of its predecessor with the wrench of (36). The joints follow their target as
      far as neither contacts nor momentum object. Legs whose foot is not taken to be on the ground
      swing by the gains of `swing_frequency`, and the other joints make up for it.

    The scale of the action is what the contacts can do: horizontally the force that moves the
    centre of pressure from below the centre of mass to the nearest edge of the support polygon,
    weight * margin / height, but no more than friction allows; vertically half of the weight; for
    tilting the moment of the same shift, weight * margin, for turning that of friction. Or it is
    the same on all robots, see `BodyOptions.action_units`.
    """

    law: BodyLaw | BalanceLaw  # from action to torque
    scale: np.ndarray  # (6,) N and N·m, what action 1 adds to the wrench
    contact: ContactOptions  # what it assumes of contacts
    moment_priority: float | tuple[float, float]  # of the law
    meant: Mapping[str, Any]  # name of an option that may be None -> what it means
    priority_action: bool  # whether the action changes the priority

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        kind: MotionKind,
        *,
        balancer: Annotated[str, Choice((_INVERSE_DYNAMICS, *BALANCERS))] = _INVERSE_DYNAMICS,
        body: BodyOptions = BODY_DEFAULTS,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "ComWrench":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            balancer: "inverse_dynamics", or one of the papers': see `ComWrench`.
            body: how firmly it is held.
            contact: what it assumes of contacts.

        Raises:
            InvalidValueError: one of the papers' balancers on a gait, or with a velocity gain, a
                delay or a pair of gains.
        """
        assumed = contact.on(robot, kind)
        stance = Stance.of(robot)
        if body.action_units == "robot":
            scale = 0.5 * robot.weight * np.repeat([1.0, stance.home_com[2]], 3)
        else:
            scale = wrench_scale_of(robot, stance, assumed.coefficient)
        limited = assumed.limits(robot) is not None
        body.check_priority_action(limited and balancer == _INVERSE_DYNAMICS)
        if balancer != _INVERSE_DYNAMICS:
            priority = 1.0 if body.moment_priority is None else body.moment_priority
            hertz, ratio = _papers_frequencies(robot, kind, balancer, body)
            rival = BalanceLaw.of(
                robot, control_hz, assumed, balancer, hertz, ratio, priority, scale
            )
            told = {f"{part}_frequency": value for part, value in hertz.items()} | _FIXED
            return cls(rival, scale, assumed, priority, told | {"damping_ratio": ratio}, False)
        held, priority = body.gains(robot, kind), body.priority(robot, kind)
        law = BodyLaw.of(robot, control_hz, assumed, held, priority, delay=body.loop_delay)
        return cls(law, scale, assumed, priority, meant(held, kind), body.priority_action)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six components of the wrench at the centre of mass, and the priority if it is one."""
        axes = ("ahead", "to the left", "up")
        names = [f"force {axis} at the centre of mass, heading" for axis in axes]
        names += [f"moment {axis} about the centre of mass, heading" for axis in axes]
        more = (PRIORITY_ACTION,) if self.priority_action else ()
        return (*scaled_names(names, self.scale, "N", "N·m"), *more)

    @property
    def per_acceleration(self) -> np.ndarray:
        """Action for each m/s^2 of the body ahead and to the left, (2,)."""
        return self.law.robot.mass / self.scale[:2]

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known = terms()
        if isinstance(self.law, BalanceLaw):
            return self.law.torque(action, state, target, known, memory)
        set_priority(action, memory)
        push = self.scale * action[:, :6]
        command = Command(NONE, np.zeros(push.shape), push)
        return self.law.torque(command, state, target, known, memory)

    def desired(
        self, action: np.ndarray, state: RobotState, target: Target, terms: DynamicsTerms
    ) -> np.ndarray:
        """Return the acceleration that it asks of the body, (N, 3) m/s^2, world."""
        if isinstance(self.law, BalanceLaw):
            return self.law.desired(action, state, target, terms)
        push = self.scale * action[:, :6]
        added = np.concatenate([push[:, :3] / self.law.robot.mass, 0.0 * push[:, 3:]], axis=1)
        command = Command.to_target(added)
        return stabilise(self.law.constants, command, state, target, terms).body[:, :3]


def _papers_frequencies(
    robot: Robot, kind: MotionKind, balancer: str, body: BodyOptions
) -> tuple[dict[str, float], float]:
    """Hz of each part, and the damping ratio, of a paper's balancer; or say what it cannot do."""
    if kind.gait:
        expected = f'"{_INVERSE_DYNAMICS}" on a gait: the papers balance motions that are planned'
        raise InvalidValueError("balancer", balancer, expected)
    expected = f'or the balancer "{_INVERSE_DYNAMICS}"'
    for name, must in _FIXED.items():
        if getattr(body, name) not in (None, must):
            raise InvalidValueError(name, getattr(body, name), f"{must!r}, {expected}")
    given = body.frequencies.items()
    hertz = {k: in_hertz(robot, Falling(_PAPERS[k]) if x is None else x) for k, x in given}
    for part, value in hertz.items():
        if isinstance(value, tuple):
            raise InvalidValueError(f"{part}_frequency", value, f"a number of Hz, {expected}")
    return hertz, _PAPERS_RATIO if body.damping_ratio is None else body.damping_ratio


def papers_gains(
    robot: Robot, balancer: str, hertz: Mapping[str, float], ratio: float
) -> BalanceGains:
    """Return the gains of a paper's balancer, from frequencies (Hz) and a damping ratio."""
    inertia = turning_inertia(robot, balancer)
    gains = BalanceGains.from_frequencies(
        robot.mass,
        inertia,
        linear=(hertz["balance"], hertz["balance"], hertz["height"]),
        rotation=hertz["rotation"],
        damping_ratio=ratio,
    )
    if balancer == "ott2011":
        gains = gains.on_velocity(robot.mass, inertia)
    # Derived along the trunk's axes, and meant along the base's.
    own = base_from_trunk(robot)
    return replace(gains, rotation_stiffness=own @ gains.rotation_stiffness @ own.T)


def turning_inertia(robot: Robot, balancer: str) -> np.ndarray:
    """Return what a moment at the centre of mass must overcome to turn the base: (3, 3) kg·m².

    In the home stance, with the feet and the centre of mass in place and the joints moving as they
    do when the base turns with the least kinetic energy. The torques of Ott's balancer do the work
    of the moment on the base's angular velocity, so it is twice the kinetic energy per square of
    that. Those of [G15] do it on the average angular velocity, which takes the locked robot's
    inertia.
    """
    stance = Stance.of(robot)
    terms, body = stance.terms, centroidal_terms(stance.terms, np.zeros((1, robot.nv)))
    locked = body.inertia[0]
    if balancer == "garofalo2015":
        return 0.5 * (locked + locked.T)
    contacts = reduced_contacts(stance.geometry, terms)
    # The metric of the kinetic energy turns least energy into least squares.
    root = np.linalg.inv(np.linalg.cholesky(terms.mass_matrix[0])).T
    held = np.concatenate([contacts.jacobian[0], body.matrix[0, :3]]) @ root
    turn = np.zeros((3, robot.nv))
    turn[:, 3:6] = terms.world_from_base[0]
    turn = turn @ root
    turn -= (turn @ np.linalg.pinv(held, rcond=1e-6)) @ held
    motion = root @ np.linalg.pinv(turn, rcond=1e-6)
    return no_lighter(motion.T @ terms.mass_matrix[0] @ motion, locked)


def wrench_scale_of(robot: Robot, stance: Stance, friction: float) -> np.ndarray:
    """Return the wrench of action 1, see `ComWrench`: (6,) N and N·m."""
    margin = stance.margin
    pressed = np.minimum(margin / stance.home_com[2], friction)
    return robot.weight * np.concatenate([pressed, [0.5], margin[::-1], [friction * stance.radius]])
