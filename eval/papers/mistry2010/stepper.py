"""A controller of ours for figures 8-9: the package's walk on flat feet, squatting, step by step.

Balance, footholds and swinging feet are those of `fbid_gym.motions.gait.flat_feet`, torques those
of `fbid_gym.actions.law`: eq. (19) with the feet as constraints and the body as the task, contact
forces within friction cones. What is added here:

- The base follows the squat, and the force that balances is that of its changing weight.
- A planned step is a command to walk, hardly faster than not at all, given when the motion lifts a
  foot, or as soon after that as the robot is calm, and taken back when the foot is up.
- A robot that is about to fall beyond its toes or heels gets the same command.
"""

from dataclasses import replace

import numpy as np

from eval.papers.mistry2010.controllers import SplitTorque
from eval.papers.trial import Memory
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.law import BodyLaw
from fbid_gym.control.body_law import Command
from fbid_gym.dynamics import DynamicsTerms
from fbid_gym.motions import Steps, stepping
from fbid_gym.motions.gait.biped import DOUBLE, SOLE, STAND, SWING, biped_gait
from fbid_gym.motions.gait.command import GaitCommand, no_command
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.target import MotionKind
from fbid_gym.quantities import RobotState, Target
from fbid_gym.robots import Robot

USED = 0.95
"""Share of the soles that is counted on."""

GAIN = 4.0
"""Of the centre of pressure on errors of xi."""

SINGLE, DOUBLE_SUPPORT, SETTLE = 0.2, 0.04, 0.05
"""s in the air to catch a fall, s on both feet before, and before a step from standing."""

SOONER = 1.33
"""Times as fast as that a planned step is."""

LIFT, LEAST_APART, FARTHER, LONGEST = 0.05, 0.22, 0.25, 0.4
"""m: lift of a foot; feet from each other sideways, at least and, beyond their width, at most; and
ahead at most."""

REACH = (0.2, 0.08)
"""m, forward and sideways. Half of it is what footholds expect the centre of pressure to take back,
all of the sole's length: smaller steps, in which the leg turns the trunk less."""

FRICTION = 0.7
"""Of the cones that contact forces keep within."""

CALM, LOST = 0.03, 0.095
"""m that xi may be from the middle of the feet for a planned step, and forward without a step."""

_HARDLY = 1e-9  # m/s, to walk with
_LOWEST = 0.1  # m, height of the centre of mass; less is a robot that lies


class Stepper:
    """Squat and step, and stay up. A `Controller` for bipeds with a left and a right foot.

    The memory gets "base" and "base_target" (N, 2) m in the frame of the feet, and "steps" and
    "captures" (N,), how many steps there were that were planned, and that were not.

    Attributes:
        plan: the motion with its feet on the ground throughout: what trunk and squat shall do.
        gait: how the robot steps.
        law: from the body's task to torque.
    """

    def __init__(self, robot: Robot, steps: Steps) -> None:
        """For the motion `stepping(robot, steps)`."""
        self.robot = robot
        self.plan = stepping(robot, steps._replace(lift=(0.0, 0.0, 0.0), ramp=0.0))
        motion = self.plan.reference(np.arange(self.plan.period))
        omega = float(np.sqrt(robot.gravity / motion.com[:, 2].mean()))
        walk = biped_gait(robot)
        width = float(walk.width + 2.0 * steps.spread)
        walk = walk._replace(
            omega=omega, single=SINGLE, double=DOUBLE_SUPPORT, settle=SETTLE, gain=GAIN,
            height=float(motion.qpos[:, 2].mean()), width=width, least_apart=LEAST_APART,
            most_apart=width + FARTHER, longest=LONGEST, lift=LIFT, sole=np.array(REACH),
            points=walk.points / SOLE * USED,
        )  # fmt: skip
        self.gait = replace(gait_of(robot, self.plan.hz), constants=walk)
        kind = MotionKind(True, omega)
        # Contacts switch instantly, as in [M10] IV.D.
        contact = ContactOptions(contact_ramp=0.0, friction=FRICTION).on(robot, kind)
        gains = default_gains(robot, kind)._replace(small_errors=0.0)
        self.law = BodyLaw.of(robot, self.plan.hz, contact, gains, 0.05)

    def memory(self, num_robots: int) -> Memory:
        """See `Controller`."""
        none = np.zeros(num_robots)
        return self.law.memory(num_robots) | {"placed": False, "steps": none, "captures": none}

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: Target, memory: Memory
    ) -> SplitTorque:
        """See `Controller`. The goal is not used: `plan` is it, without the lifted legs."""
        plan = self.plan.reference(state.tick)
        if not memory["placed"]:
            memory |= self.gait.memory(terms)
            memory |= {"placed": True, "due": ~plan.planted, "plan": plan.planted}
        memory["due"] = memory["due"] | (memory["plan"] & ~plan.planted)
        memory["plan"] = plan.planted
        command, planned = self._command(terms, memory)
        before = memory["phase"].copy()
        self.gait.advance(command, terms, state.contact_force, memory)
        target = self.gait.target(memory)
        _count((before == DOUBLE) & (memory["phase"] == SWING), planned, memory)

        planted = target.planted
        ground = (terms.foot_position[..., 2] * planted).sum(axis=1) / planted.sum(axis=1)
        # The gait's pendulum has a constant height.
        height = np.maximum(terms.com[:, 2] - ground, _LOWEST)
        share = (self.robot.gravity + plan.qacc[:, 2]) / height / self.gait.omega**2
        qpos, qvel, qacc = (part.copy() for part in (target.qpos, target.qvel, target.qacc))
        qpos[:, 2] = ground + plan.qpos[:, 2]
        qvel[:, 2], qacc[:, 2] = plan.qvel[:, 2], plan.qacc[:, 2]
        acceleration = target.com_acceleration * share[:, None]
        target = target._replace(com_acceleration=acceleration, qpos=qpos, qvel=qvel, qacc=qacc)
        aim = Command.to_target(np.zeros((len(ground), 6)))
        torque = self.law.torque(aim, state, target, terms, memory)
        base = terms.base_position[:, :2] - terms.foot_position[..., :2].mean(axis=1)
        memory["base"], memory["base_target"] = _ahead(base, memory), plan.qpos[:, :2]
        return SplitTorque(torque, np.zeros_like(torque))

    def _command(self, terms: DynamicsTerms, memory: Memory) -> tuple[GaitCommand, np.ndarray]:
        """Return when to step, to the side whose foot shall lift; and whether it is planned."""
        command = no_command(len(terms.com), 2)
        fall = terms.com[:, :2] + terms.com_velocity[:, :2] / self.gait.omega
        xi = _ahead(fall - terms.foot_position[..., :2].mean(axis=1), memory)
        stands, due = memory["phase"] == STAND, memory["due"]
        lost = stands & (np.abs(xi[:, 0]) > LOST)
        planned = due.any(axis=1) & ~lost
        calm = stands & (np.linalg.norm(xi, axis=1) < CALM)
        side = np.where(due[:, 0], 1.0, -1.0) * (planned & calm)
        # A robot that falls stays on the foot that is nearer to where it falls.
        command.velocity[:, 1] = _HARDLY * np.where(lost, -np.sign(xi[:, 1]), side)
        command.rate[:] = np.where(planned, SOONER, 1.0)
        return command, planned


def _ahead(vector: np.ndarray, memory: Memory) -> np.ndarray:
    """Horizontal vectors (N, 2) of the world along the gait's heading."""
    cosine, sine = np.cos(memory["heading"]), np.sin(memory["heading"])
    x, y = vector.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)


def _count(lifted: np.ndarray, planned: np.ndarray, memory: Memory) -> None:
    """Note which robots (N,) bool have just lifted a foot: it is due no more."""
    foot = np.arange(2) == 1 - memory["carrier"][:, None]
    wanted = planned & (memory["due"] & foot).any(axis=1)
    memory["steps"] = memory["steps"] + (lifted & wanted)
    memory["captures"] = memory["captures"] + (lifted & ~wanted)
    memory["due"] = memory["due"] & ~(foot & lifted[:, None])
