"""Tracking: follow a reference motion, at a commanded speed where it has one, despite pushes.

## Description
The robot follows a motion. At every control tick this gives place, velocity and acceleration of
joints and base, and the feet that stand ([M10] section IV).

## Starting State
A random moment of the motion. A motion that ends holds its last posture.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind, in_world, planned_kind
from fbid_gym.quantities import Memory, Target
from fbid_gym.tasks.body import Units
from fbid_gym.tasks.observation import KNOWN, Group, Groups
from fbid_gym.tasks.outcome import Outcome, lengths
from fbid_gym.tasks.plan import Plan
from fbid_gym.tasks.reward import Term, Terms, bell, level, torque
from fbid_gym.tasks.task import Episode, Now, PlannedEpisode


class TrackingMeasures(NamedTuple):
    """Measurements of N robots that follow a motion."""

    outcome: Outcome  # of the step
    units: Units  # of lengths, speeds and rates
    reference: Target  # the desired motion, a row for each robot
    phase: np.ndarray  # (N,) rad, where in the motion each robot is
    speed: np.ndarray  # (N,) m/s, commanded
    joint_error: np.ndarray  # (N,) rad, root mean square over the joints
    base_error: np.ndarray  # (N,) m, distance of the base from its reference, seen from the feet
    velocity_error: np.ndarray  # (N,) m/s, the same of its horizontal velocity
    leaning: np.ndarray  # (N,) cosine of the angle between the verticals of base and reference
    as_planned: np.ndarray  # (N,) share of the contact points on the ground, or off it, as planned


def joints(measured: TrackingMeasures, width: float) -> np.ndarray:
    """Bell of the root mean square of the joints' errors."""
    return bell(measured.joint_error, width)


def base(measured: TrackingMeasures, width: float) -> np.ndarray:
    """Bell of the base's distance from where the motion has it, seen from the feet."""
    return bell(measured.base_error, width * measured.units.length)


def upright(measured: TrackingMeasures, width: float) -> np.ndarray:
    """exp(-(1 - cos(angle between the verticals of base and motion)) / (1 - cos(scale)))."""
    return level(measured.leaning, width)


def velocity(measured: TrackingMeasures, width: float) -> np.ndarray:
    """Bell of the base's horizontal velocity error."""
    return bell(measured.velocity_error, width * measured.units.speed)


def contact(measured: TrackingMeasures, width: float) -> np.ndarray:
    """Share of the points on the ground or off it as planned times the bell of their slip."""
    return measured.as_planned * bell(measured.outcome.posture.slip, width * measured.units.speed)


class PeriodicMotion(Protocol):
    """A motion that repeats itself after `period` control ticks."""

    @property
    def period(self) -> int:
        """Control ticks."""

    def reference(self, tick: np.ndarray, speed: np.ndarray) -> Target:
        """Return the desired motion of N robots at ticks (N,) and speeds (N,) m/s."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracking(PlannedEpisode):
    """The task, for one robot and one motion; a `Task`. Episodes begin anywhere in the motion.

    Attributes:
        motion: to be followed.
        speed_range: (least, most) m/s, commanded forward speed, constant in an episode.
    """

    motion: PeriodicMotion
    speed_range: tuple[float, float]

    reward_terms: ClassVar[Terms] = {
        "joints": Term(joints, 0.3, 0.1, "rad"),
        "base": Term(base, 0.2, 0.06, "H"),
        "upright": Term(upright, 0.15, 0.2, "rad"),
        "velocity": Term(velocity, 0.15, 0.1, "sqrt(g H)"),
        "contact": Term(contact, 0.1, 0.033, "sqrt(g H)"),
        "torque": Term(torque, 0.1, 0.3, "mean torque limit"),
    }
    """H is the robot's size, g gravity. The weights sum to 1."""

    @classmethod
    def of(
        cls,
        episode: Episode,
        motion: PeriodicMotion,
        derived: Mapping[str, Any],
        speed_range: tuple[float, float] = (0.0, 0.0),
    ) -> "Tracking":
        """Build the task; the other arguments are its attributes."""
        if not -np.inf < speed_range[0] <= speed_range[1] < np.inf:
            raise InvalidValueError("speed_range", speed_range, "a pair least <= most of m/s")
        told = {"m/s ahead": speed_range} if any(speed_range) else {}
        own = {"motion": motion, "speed_range": speed_range, "derived": derived, "commands": told}
        return cls.from_episode(episode, **own)

    @property
    def observation_groups(self) -> Groups:
        """See `Task.observation_groups`."""
        robot, home = self.body.robot, self.body.stance.home_base
        return {
            "phase": Group.of(
                "{} of the phase of the motion (1)",
                ("sine", "cosine"),
                1.0,
                lambda m: np.stack([np.sin(m.phase), np.cos(m.phase)], axis=1),
                KNOWN,
            ),
            "command": Group(("commanded speed (m/s)",), 10.0, lambda m: m.speed[:, None], KNOWN),
            "planted": Group.of(
                "{} planned to stand (1)",
                robot.foot_names,
                1.0,
                lambda m: m.reference.planted,
                KNOWN,
            ),
            "base_reference": Group.of(
                "base {} of the reference from home (m, support frame)",
                "xyz",
                10.0,
                lambda m: m.reference.qpos[:, :3] - home,
                KNOWN,
            ),
            "joint_reference": Group.of(
                "{} reference from home (rad)",
                robot.joint_names,
                10.0,
                lambda m: m.reference.qpos[:, 7:] - robot.home_qpos[7:],
                KNOWN,
            ),
            **self.body.groups,
        }

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        ticks = np.arange(self.motion.period)
        planted = self.motion.reference(ticks, np.full(len(ticks), self.speed_range[0])).planted
        return planned_kind(self.body.robot, steps=not planted.all())

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all random parts of one episode."""
        phase, speed = rng.integers(self.motion.period), rng.uniform(*self.speed_range)
        reference = self.motion.reference(np.array([phase]), np.array([speed]))
        plan = self.begin(rng, reference.qpos[0], reference.qvel[0])
        # Where on the ground an episode begins is not the motion's to say.
        plan["qpos"][:2] = self.body.robot.home_qpos[:2]
        return plan | {"phase": np.array(phase), "speed": np.array(speed)}

    def target(self, plan: Plan, now: Now) -> Target:
        """Return the motion at each robot's phase and speed, above its feet."""
        planned = self._planned(plan, now.state.tick)
        return in_world(self.body.stance.heading, planned, now.terms())

    def measure(self, outcome: Outcome, plan: Plan, memory: Memory) -> TrackingMeasures:
        """Return the measurements from which observation, reward and metrics are computed."""
        posture, tick = outcome.posture, outcome.state.tick
        asked = self._planned(plan, tick)
        joint_error = asked.qpos[:, 7:] - outcome.state.qpos[:, 7:]
        base_error = posture.base - asked.qpos[:, :3]
        velocity_error = posture.velocity[:, :2] - asked.qvel[:, :2]
        told = quaternion_to_matrix(asked.qpos[:, 3:7])[:, 2]
        foot_of_point = self.body.stance.geometry.foot_of_point
        as_planned = posture.touching == asked.planted.take(foot_of_point, axis=1)
        return TrackingMeasures(
            outcome=outcome,
            units=self.body.units,
            reference=asked,
            phase=2.0 * np.pi / self.motion.period * (plan["phase"] + tick),
            speed=plan["speed"].copy(),
            joint_error=lengths(joint_error) / np.sqrt(joint_error.shape[1]),
            base_error=lengths(base_error),
            velocity_error=lengths(velocity_error),
            leaning=np.einsum("nk,nk->n", told, outcome.terms.world_from_base[:, 2]),
            as_planned=as_planned.sum(axis=1) / len(foot_of_point),
        )

    def metrics(self, measured: TrackingMeasures) -> dict[str, np.ndarray]:
        """Return physical quantities for evaluation, name -> (N,)."""
        posture = measured.outcome.posture
        height, asked = posture.base[:, 2], measured.reference.qpos[:, 2]
        return {
            "height": height,
            "height_command": asked,
            "height_error": height - asked,
            "joint_error": measured.joint_error,
            "speed": posture.velocity[:, 0],
            "speed_command": measured.speed,
            **measured.outcome.metrics,
        }

    def _planned(self, plan: Plan, tick: np.ndarray) -> Target:
        return self.motion.reference(plan["phase"] + tick, plan["speed"])
