"""The controller of [M10] section IV, joint PD with inverse dynamics ahead of it, and its plans."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from eval.papers.mistry2010.laws import Law, Tick
from eval.papers.trial import RATES, Memory, Plan, Wanted
from fbid_gym.actions.contact_options import ContactBelief, contact_belief
from fbid_gym.actions.joint_gains import holding_torque
from fbid_gym.control import operational_space_acceleration, task_acceleration
from fbid_gym.dynamics import DynamicsTerms
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.simulation import Simulation
from fbid_gym.quantities import RobotState, Target
from fbid_gym.robots import Robot
from fbid_gym.tasks.tracking import PeriodicMotion


def following(motion: PeriodicMotion, speed: float = 0.0, pose: np.ndarray | None = None) -> Plan:
    """Return the plan to follow a motion. The log gets the "target" (T, N, n) rad of the joints.

    Args:
        motion: what to do.
        speed: m/s commanded.
        pose: (N, 3) m, m, rad: where each robot begins in the world, and its heading; None for the
            origin.
    """

    def begin(simulation: Simulation, start: np.ndarray) -> Callable[[np.ndarray], Wanted]:
        every = np.arange(simulation.num_robots)
        speeds = np.full(len(every), speed)
        first = motion.reference(start, speeds)
        qpos, qvel = first.qpos.copy(), first.qvel.copy()
        if pose is not None:
            heading = pose[:, 2]
            _turn(qpos, [0, 1], heading)
            _turn(qvel, [0, 1], heading)
            qpos[:, :2] += pose[:, :2]
            _turn(qpos, [3, 6], 0.5 * heading)
            _turn(qpos, [4, 5], 0.5 * heading)
        simulation.place(every, qpos, qvel)

        def wanted(tick: np.ndarray) -> Wanted:
            reference = motion.reference(tick, speeds)
            target = reference.qpos[:, 7:]
            return Wanted(reference, reference.qpos[:, 2], lambda: {"target": target})

        return wanted

    return begin


def _turn(values: np.ndarray, pair: list[int], angle: np.ndarray) -> None:
    """Turn the vectors in two columns."""
    x, y = values[:, pair].T
    cosine, sine = np.cos(angle), np.sin(angle)
    values[:, pair] = np.stack([cosine * x - sine * y, cosine * y + sine * x], axis=1)


class SplitTorque(NamedTuple):
    """Torques of N robots, by where they come from."""

    feedforward: np.ndarray  # (N, n) N·m, from the model and the reference
    feedback: np.ndarray  # (N, n) N·m, from the tracking errors

    @property
    def torque(self) -> np.ndarray:
        """(N, n) N·m, their sum."""
        return self.feedforward + self.feedback


class PdGains(NamedTuple):
    """Joint PD gains, K_P = I w^2 and K_D = 2 zeta I w; I is each joint's inertia in stance."""

    stiffness: np.ndarray  # (n,) or (N, n) N·m/rad
    damping: np.ndarray  # the same shape, N·m·s/rad

    @classmethod
    def of(
        cls, robot: Robot, hertz: float | np.ndarray, zeta: float | np.ndarray = 1.0
    ) -> "PdGains":
        """Derive gains from a natural frequency (Hz) and a damping ratio, or from N of each.

        The damping stays below the inertia that a joint moves in the air times the control rate,
        beyond which sampled damping itself oscillates.
        """
        stance = Stance.of(robot)
        inertia = stance.standing_inertia
        omega = 2.0 * np.pi * np.asarray(hertz, float)[..., None]
        damping = 2.0 * np.asarray(zeta, float)[..., None] * omega * inertia
        return cls(inertia * omega**2, np.minimum(damping, _most_damping(stance)))

    def torque(self, state: RobotState, reference: Target) -> np.ndarray:
        """K_P (q_d - q) + K_D (qdot_d - qdot): (N, n) N·m."""
        error = reference.qpos[:, 7:] - state.qpos[:, 7:]
        rate = reference.qvel[:, 6:] - state.qvel[:, 6:]
        return self.stiffness * error + self.damping * rate


def _most_damping(stance: Stance) -> np.ndarray:
    """Return the most that a sampled joint can be damped with in the air: (n,) N·m·s/rad.

    Damping that is sampled once a tick and held oscillates by itself beyond twice the inertia
    it acts on, divided by the tick. That inertia lies between two: the diagonal of M, with the
    base and all other joints held, and the inverse of the diagonal of M^-1, with all of them
    giving way. The first alone is too much where a heavy shank hangs from a light pelvis. The
    second counts one and a half times, since the others are damped, too.
    """
    matrix = stance.terms.mass_matrix[0]
    giving_way = 1.0 / np.diag(np.linalg.inv(matrix))
    return np.minimum(np.diag(matrix), 1.5 * giving_way)[6:] * RATES.control


Desire = Callable[[Tick, Memory], np.ndarray]
"""Which acceleration the robots shall have, (N, nv) m/s^2 and rad/s^2: what the inverse dynamics is
given. It may note in the memory what the log shall have."""


def as_planned(robot: Robot) -> Desire:
    """Desire the reference's acceleration, its linear part turned into the world."""
    stance = Stance.of(robot)

    def desire(tick: Tick, memory: Memory) -> np.ndarray:
        acceleration = tick.reference.qacc.copy()
        rotation = stance.frame(tick.terms).world_from_support
        acceleration[:, :3] = np.matvec(rotation, acceleration[:, :3])
        return acceleration

    return desire


def base_returning(robot: Robot, hertz: float | np.ndarray) -> Desire:
    """[M10] eqs. (19) and (20): the contacts stay, the base's x and y return to the reference's.

    What is left is at rest: the acceleration of least norm, in which the reference has no part.
    The memory gets "base" and "base_target", (N, 2) m in the frame of the feet.

    Args:
        robot: the robot.
        hertz: natural frequency of the return, or (N, 1); critically damped.
    """
    stance, omega = Stance.of(robot), 2.0 * np.pi * hertz

    def desire(tick: Tick, memory: Memory) -> np.ndarray:
        terms, reference, contacts = tick.terms, tick.reference, tick.contacts
        frame = stance.frame(terms)
        base = np.vecmat(terms.base_position - frame.centre, frame.world_from_support)
        memory["base"], memory["base_target"] = base[:, :2], reference.qpos[:, :2]
        there = frame.centre + np.matvec(frame.world_from_support, reference.qpos[:, :3])
        task = task_acceleration(
            there[:, :2], terms.base_position[:, :2], tick.state.qvel[:, :2], omega**2, 2.0 * omega
        )
        xy = np.eye(robot.nv)[:2]
        return operational_space_acceleration(
            contacts.jacobian, contacts.bias, xy, None, task
        ).motion

    return desire


class JointController:
    """[M10] eq. (18): inverse dynamics of a desired acceleration, and joint PD. A `Controller`.

    Viscous damping of the joints is known to the robot's model but is not part of h; where there is
    inverse dynamics, it is compensated.
    """

    def __init__(
        self,
        robot: Robot,
        gains: PdGains,
        law: Law | None = None,
        belief: ContactBelief | None = None,
        desire: Desire | None = None,
    ) -> None:
        """Measure the feet.

        Args:
            robot: whose joints.
            gains: of the feedback.
            law: the inverse dynamics; None for PD alone.
            belief: which contacts it counts on; None for the planned ones.
            desire: which acceleration is desired; None for the reference's.
        """
        self.robot, self.gains, self.law = robot, gains, law
        self.belief = belief or contact_belief("planned", robot, RATES.control)
        self.desire = desire or as_planned(robot)
        self.geometry = contact_geometry(robot)

    def memory(self, num_robots: int) -> Memory:
        """See `Controller`."""
        if self.law is None:
            return {}
        home = np.tile(holding_torque(self.robot), (num_robots, 1))
        return self.law.memory(num_robots) | {"applied": home}

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: Target, memory: Memory
    ) -> SplitTorque:
        """See `Controller`."""
        feedback = self.gains.torque(state, goal)
        if self.law is None:
            return SplitTorque(np.zeros_like(feedback), feedback)
        active = self.belief(state, goal)
        contacts = reduced_contacts(self.geometry, terms, active)
        tick = Tick(state, terms, goal, active, contacts)
        torque = self.law.torque(tick, self.desire(tick, memory), memory)
        limit, friction = self.robot.torque_limit, self.robot.joint_damping * state.qvel[:, 6:]
        # What acts on the robot's rigid bodies: the motors' torque less the joints' friction.
        memory["applied"] = np.clip(torque + friction + feedback, -limit, limit) - friction
        return SplitTorque(torque + friction, feedback)
