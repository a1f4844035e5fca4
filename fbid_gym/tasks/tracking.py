"""Tracking: follow a reference motion, at a commanded speed where it has one, despite pushes."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.dynamics.rotations import rotation_of
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind, in_world, planned_kind
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.body import Body, bell, level, side_by_side, weigh
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.task import Now


class TrackingReward(NamedTuple):
    """The terms of the reward, (N,) each, or their weights.

    Attributes:
        joints: joints where the motion has them.
        base: base where the motion has it, seen from the feet.
        upright: base level as in the motion; its heading does not count.
        velocity: base as fast as in the motion.
        contact: points on the ground as planned, none slips.
        torque: small torques.
    """

    joints: Any
    base: Any
    upright: Any
    velocity: Any
    contact: Any
    torque: Any


REWARD_WEIGHTS = TrackingReward(
    joints=0.3, base=0.2, upright=0.15, velocity=0.15, contact=0.1, torque=0.1
)
"""Each reward term lies in [0, weight]; they sum to 1."""


class Motion(Protocol):
    """A motion that repeats itself after `period` control ticks."""

    @property
    def period(self) -> int:
        """Control ticks."""
        ...

    def reference(self, tick: np.ndarray, speed: np.ndarray) -> Target:
        """Return what N robots shall do at ticks (N,), moving at speeds (N,) m/s."""
        ...


@dataclass(frozen=True, eq=False)
class Tracking:
    """The task, for one robot and one motion; a `Task`.

    Attributes:
        body: which robot moves.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins: anywhere in the motion.
        motion: what to follow.
        speed_range: (least, most) m/s, commanded forward speed, constant in an episode.
        derived: what the options mean that a robot decides where the user does not.
    """

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    motion: Motion
    speed_range: tuple[float, float]
    derived: Mapping[str, Any]

    @classmethod
    def of(
        cls,
        robot: Robot,
        seconds: float,
        hz: int,
        pushes: Pushes,
        start: Start,
        motion: Motion,
        speed_range: tuple[float, float] = (0.0, 0.0),
        derived: Mapping[str, Any] = MappingProxyType({}),
    ) -> "Tracking":
        """Build the task; the arguments are its attributes."""
        if not -np.inf < speed_range[0] <= speed_range[1] < np.inf:
            raise InvalidValueError("speed_range", speed_range, "a pair least <= most of m/s")
        return cls(Body.of(robot), seconds, hz, pushes, start, motion, speed_range, derived)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of the observation."""
        robot = self.body.robot
        return (
            "sine of the phase of the motion (1)",
            "cosine of the phase of the motion (1)",
            "commanded speed (m/s)",
            *(f"{foot} planned to stand (1)" for foot in robot.foot_names),
            *(f"base {axis} of the reference from home (m, support frame)" for axis in "xyz"),
            *(f"{joint} reference from home (rad)" for joint in robot.joint_names),
            *self.body.observation_names,
        )

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of the observation, (O,); observations are clipped to it."""
        robot = self.body.robot
        own = [1.0, 1.0, 10.0, *[1.0] * robot.num_feet, *[10.0] * (3 + robot.num_joints)]
        return np.concatenate([own, self.body.observation_bound])

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all that chance decides about one episode."""
        robot = self.body.robot
        phase, speed = rng.integers(self.motion.period), rng.uniform(*self.speed_range)
        reference = self.motion.reference(np.array([phase]), np.array([speed]))
        qpos, qvel = self.start.draw(robot, reference.qpos[0], reference.qvel[0], rng)
        # Where on the ground an episode begins is not the motion's to say.
        qpos[:2] = robot.home_qpos[:2]
        pushes = self.pushes.draw(rng, self.seconds, self.hz)
        return {
            "qpos": qpos,
            "qvel": qvel,
            "phase": np.array(phase),
            "speed": np.array(speed),
            **pushes,
        }

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Nothing: the motion is planned ahead."""
        return {}

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        return planned_kind(self.body.robot)

    def advance(self, plan: Plan, now: Now) -> None:
        """Nothing goes on: the motion is planned ahead."""

    def target(self, plan: Plan, now: Now) -> Target:
        """Return the motion at each robot's phase and speed, above its feet."""
        planned = self._planned(plan, now.state.tick)
        return in_world(self.body.stance.heading, planned, now.terms())

    def observe(self, outcome: Outcome, plan: Plan, memory: Memory) -> np.ndarray:
        """Return what the policy sees: (N, O), named by `observation_names`."""
        body, tick = self.body, outcome.state.tick
        reference = self._planned(plan, tick)
        angle = 2.0 * np.pi / self.motion.period * (plan["phase"] + tick)
        home = body.stance.home_base, body.robot.home_qpos
        asked = _ask(angle, plan["speed"], reference, *home)
        return np.concatenate([asked, body.observe(outcome)], axis=1)

    def reward(
        self, outcome: Outcome, plan: Plan, memory: Memory
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step; see `Task.reward`."""
        body, posture = self.body, outcome.posture
        reference = self._planned(plan, outcome.state.tick)
        sizes = body.size, body.speed, body.mean_torque_limit
        scales = _Scales(*sizes, body.stance.geometry.foot_of_point)
        joint_error, terms = _judge(scales, outcome, reference)
        height, asked = posture.base[:, 2], reference.qpos[:, 2]
        metrics = {
            "height": height,
            "height_command": np.broadcast_to(asked, len(height)),
            "height_error": height - asked,
            "joint_error": joint_error,
            "speed": posture.velocity[:, 0],
            "speed_command": plan["speed"].copy(),
            "torque_rms": np.sqrt(outcome.torque_square),
            "power": outcome.power,
            "slip": posture.slip,
        }
        return terms._asdict(), metrics

    def _planned(self, plan: Plan, tick: np.ndarray) -> Target:
        return self.motion.reference(plan["phase"] + tick, plan["speed"])


class _Asked(NamedTuple):
    """What a policy sees of the motion, in the order of the observation."""

    sine: np.ndarray  # (N, 1) of the phase
    cosine: np.ndarray  # (N, 1)
    speed: np.ndarray  # (N, 1) m/s
    planted: np.ndarray  # (N, F)
    base: np.ndarray  # (N, 3) m, from home, support frame
    joints: np.ndarray  # (N, n) rad, from home


@kernel
def _ask(
    angle: np.ndarray,
    speed: np.ndarray,
    reference: Target,
    home_base: np.ndarray,
    home_qpos: np.ndarray,
) -> np.ndarray:
    """What the policy sees of the motion, the first columns of `Tracking.observe`.

    Args:
        angle: (N,) rad, the phase.
        speed: (N,) m/s, commanded.
        reference: of the motion.
        home_base: (3,) m, support frame.
        home_qpos: (nq,).
    """
    count, feet, joints = len(angle), reference.planted.shape[1], len(home_qpos) - 7
    asked = _Asked(
        np.empty((count, 1)),
        np.empty((count, 1)),
        np.empty((count, 1)),
        np.empty((count, feet)),
        np.empty((count, 3)),
        np.empty((count, joints)),
    )
    for i in range(count):
        row = min(i, len(reference.qpos) - 1)
        asked.sine[i, 0], asked.cosine[i, 0] = np.sin(angle[i]), np.cos(angle[i])
        asked.speed[i, 0] = speed[i]
        for foot in range(feet):
            asked.planted[i, foot] = reference.planted[row, foot]
        for k in range(3):
            asked.base[i, k] = reference.qpos[row, k] - home_base[k]
        for j in range(joints):
            asked.joints[i, j] = reference.qpos[row, 7 + j] - home_qpos[7 + j]
    return side_by_side(asked)


class _Scales(NamedTuple):
    """What the reward measures by."""

    size: float  # m, see `Body.size`
    speed: float  # m/s, see `Body.speed`
    torque_limit: float  # N·m, mean of the joints
    foot_of_point: np.ndarray  # (P,)


class _Judged(NamedTuple):
    joint_error: np.ndarray  # (N,) rad, root mean square
    terms: TrackingReward


@kernel
def _judge(scales: _Scales, outcome: Outcome, reference: Target) -> _Judged:
    """Return the joints' errors, and the terms of the reward."""
    qpos, world_from_base = outcome.state.qpos, outcome.terms.world_from_base
    posture = outcome.posture
    (count, width), points = qpos.shape, posture.touching.shape[1]
    joint_error, target = np.empty(count), np.empty((3, 3))
    share = TrackingReward(
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
    )
    for i in range(count):
        row = min(i, len(reference.qpos) - 1)
        square, drift, rush = 0.0, 0.0, 0.0
        for j in range(7, width):
            square += (reference.qpos[row, j] - qpos[i, j]) ** 2
        for k in range(3):
            drift += (posture.base[i, k] - reference.qpos[row, k]) ** 2
        for k in range(2):
            rush += (posture.velocity[i, k] - reference.qvel[row, k]) ** 2
        joint_error[i] = np.sqrt(square / (width - 7))
        # The angle between the vertical as base and reference see it: heading left out.
        rotation_of(reference.qpos[row, 3:7], target)
        as_planned = 0
        for point in range(points):
            stands = reference.planted[row, scales.foot_of_point[point]]
            as_planned += posture.touching[i, point] == stands
        torque = np.sqrt(outcome.torque_square[i])
        # Lengths and speeds scale with the robot.
        share.joints[i] = bell(joint_error[i], 0.1)
        share.base[i] = bell(np.sqrt(drift), 0.06 * scales.size)
        share.upright[i] = level(dot(target[2], world_from_base[i, 2]))
        share.velocity[i] = bell(np.sqrt(rush), 0.1 * scales.speed)
        share.contact[i] = as_planned / points * bell(posture.slip[i], 0.033 * scales.speed)
        share.torque[i] = bell(torque / scales.torque_limit, 0.3)
    weigh(share, REWARD_WEIGHTS)
    return _Judged(joint_error, share)
