"""Measurements of walking robots, and their reward."""

from operator import itemgetter
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.trunk import trunk_rate
from fbid_gym.motions.gait.heading import along, axes_of_trunk
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.body import Units
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.reward import Term, Terms, bell, torque, upright

_PREFIX = "seen_"


class Notes(NamedTuple):
    """Notes on N robots: the gait's last target, and sums over the episode so far."""

    planted: np.ndarray  # (N, F) bool, feet that shall stand
    foothold: np.ndarray  # (N, F, 3) m, where the others shall land
    cycle: np.ndarray  # (N,) share of the gait's cycle that has passed
    height: np.ndarray  # (N,) m, of the base, as the gait has it
    ground: np.ndarray  # (N,) m, height of the ground below the feet that last stood
    actual_ground: np.ndarray  # (N,) m, likewise, where the robots are and not where they believe
    clipped: np.ndarray  # (N,) int64, ticks and feet at which a foothold was out of reach
    landed: np.ndarray  # (N,) int64, feet that came down
    missed: np.ndarray  # (N,) m, horizontal distances of those from their footholds, summed

    @classmethod
    def standing(cls, terms: DynamicsTerms) -> "Notes":
        """Return those of robots that have stood where they are."""
        count, feet = terms.foot_position.shape[:2]
        return cls(
            planted=np.ones((count, feet), bool),
            foothold=terms.foot_position.copy(),
            cycle=np.zeros(count),
            height=terms.base_position[:, 2].copy(),
            ground=terms.foot_position[:, :, 2].min(axis=1),
            actual_ground=terms.foot_position[:, :, 2].min(axis=1),
            clipped=np.zeros(count, np.int64),
            landed=np.zeros(count, np.int64),
            missed=np.zeros(count),
        )

    @classmethod
    def of(cls, memory: Memory) -> "Notes":
        """Return them from the task's memory."""
        return cls(*_noted(memory))

    def memory(self) -> Memory:
        """Return them as part of the task's memory."""
        return {_PREFIX + name: values for name, values in self._asdict().items()}


_noted = itemgetter(*(_PREFIX + name for name in Notes._fields))


class WalkMotion(NamedTuple):
    """Motion of N robots and its difference from the desired motion."""

    command: np.ndarray  # (N, 3) m/s ahead, m/s and rad/s to the left
    clock: np.ndarray  # (N, 2) sine and cosine of the gait's cycle
    velocity: np.ndarray  # (N, 3) m/s, of the base: ahead and to the left as it heads, up
    lack: np.ndarray  # (N, 3) the command less that: m/s ahead, m/s and rad/s to the left
    velocity_error: np.ndarray  # (N,) m/s, horizontal
    turning_error: np.ndarray  # (N,) rad/s, of the yaw rate
    speed: np.ndarray  # (N,) m/s, horizontal
    as_planned: np.ndarray  # (N,) share of the feet on the ground, or off it, as the gait has them
    tumble: np.ndarray  # (N,) rate of roll and pitch, and speed up or down: in units, their sum
    speed_command: np.ndarray  # (N,) m/s, horizontal
    height: np.ndarray  # (N,) m, of the base above the ground
    height_command: np.ndarray  # (N,) m, as the gait has it
    foothold_error: np.ndarray  # (N,) m, mean of the feet that came down in this episode


class WalkMeasures(NamedTuple):
    """Measurements of N robots that walk."""

    outcome: Outcome  # of the step
    units: Units  # from the height of the centre of mass at home, h
    notes: Notes  # of the gait
    motion: WalkMotion  # how they move


def velocity(measured: WalkMeasures, width: float) -> np.ndarray:
    """Bell of the base's horizontal velocity error."""
    return bell(measured.motion.velocity_error, width * measured.units.speed)


def turning(measured: WalkMeasures, width: float) -> np.ndarray:
    """Bell of the base's yaw rate error."""
    return bell(measured.motion.turning_error, width * measured.units.rate)


def clock(measured: WalkMeasures, width: float) -> np.ndarray:
    """Share of the feet on the ground or off it as planned times the bell of the points' slip."""
    return measured.motion.as_planned * bell(
        measured.outcome.posture.slip, width * measured.units.speed
    )


def steady(measured: WalkMeasures, width: float) -> np.ndarray:
    """Bell of roll and pitch rate in sqrt(g / h) plus vertical speed in sqrt(g h)."""
    return bell(measured.motion.tumble, width)


REWARD_TERMS: Terms = {
    "velocity": Term(velocity, 0.4, 0.19, "sqrt(g h)"),
    "turning": Term(turning, 0.2, 0.09, "sqrt(g / h)"),
    "clock": Term(clock, 0.15, 0.2, "sqrt(g h)"),
    "upright": Term(upright, 0.1, 0.2, "rad"),
    "steady": Term(steady, 0.05, 0.3),
    "torque": Term(torque, 0.1, 0.5, "mean torque limit"),
}
"""h is the height of the centre of mass at home, g gravity. The weights sum to 1."""


@kernel
def note(
    target: Target, foot_position: np.ndarray, actual_position: np.ndarray, notes: Notes
) -> None:
    """Note the gait's target at a control tick, and the distance of a landing from its foothold.

    Feet are at `foot_position` (N, F, 3) m as controllers know it, at `actual_position` as it is.
    """
    count, feet = target.planted.shape
    for i in range(count):
        ground, actual = np.inf, np.inf
        for foot in range(feet):
            stands = target.planted[i, foot]
            if stands:
                ground = min(ground, foot_position[i, foot, 2])
                actual = min(actual, actual_position[i, foot, 2])
            if stands and not notes.planted[i, foot]:
                x = foot_position[i, foot, 0] - notes.foothold[i, foot, 0]
                y = foot_position[i, foot, 1] - notes.foothold[i, foot, 1]
                notes.missed[i] += np.hypot(x, y)
                notes.landed[i] += 1
            notes.planted[i, foot] = stands
            notes.clipped[i] += target.clipped[i, foot]
            for axis in range(3):
                notes.foothold[i, foot, axis] = target.foothold[i, foot, axis]
        if ground < np.inf:
            notes.ground[i], notes.actual_ground[i] = ground, actual
        notes.cycle[i], notes.height[i] = target.cycle[i], target.qpos[i, 2]


@kernel
def measure_motion(
    units: Units,
    foot_of_point: np.ndarray,
    qvel: np.ndarray,
    terms: DynamicsTerms,
    touching: np.ndarray,
    command: np.ndarray,
    notes: Notes,
    ground: np.ndarray,
) -> WalkMotion:
    """Return how robots move.

    By the points that carry weight, `touching` (N, P), the command (N, 3), m/s ahead, m/s and rad/s
    to the left, and the height of the ground (N,) m in the world of `terms`.
    """
    count, feet = notes.planted.shape
    clock, velocity, lack = np.empty((count, 2)), np.empty((count, 3)), np.empty((count, 3))
    e = np.empty((9, count))
    motion = WalkMotion(
        command, clock, velocity, lack, e[0], e[1], e[2], e[3], e[4], e[5], e[6], e[7], e[8]
    )
    _measure(
        units, foot_of_point, qvel, terms, touching, notes, ground, motion, np.empty(feet, np.bool_)
    )
    return motion


@compiled
def _measure(
    units: Units,
    foot_of_point: np.ndarray,
    qvel: np.ndarray,
    terms: DynamicsTerms,
    touching: np.ndarray,
    notes: Notes,
    ground: np.ndarray,
    motion: WalkMotion,
    down: np.ndarray,
) -> None:
    """Write a motion whose command is known; `down` (F,) is a buffer."""
    command, (count, feet) = motion.command, notes.planted.shape
    for i in range(count):
        angle, velocity = 2.0 * np.pi * notes.cycle[i], qvel[i]
        motion.clock[i, 0], motion.clock[i, 1] = np.sin(angle), np.cos(angle)
        ahead, left = along(axes_of_trunk(terms.world_from_trunk[i]), velocity[0], velocity[1])
        yaw_rate = dot(terms.world_from_base[i, 2], velocity[3:6])
        motion.velocity[i, 0], motion.velocity[i, 1] = ahead, left
        motion.velocity[i, 2] = velocity[2]
        lack = motion.lack[i]
        lack[0], lack[1] = command[i, 0] - ahead, command[i, 1] - left
        lack[2] = command[i, 2] - yaw_rate
        motion.velocity_error[i] = np.hypot(lack[0], lack[1])
        motion.turning_error[i] = abs(lack[2])
        motion.speed[i] = np.hypot(ahead, left)
        for foot in range(feet):
            down[foot] = False
        for point in range(len(foot_of_point)):
            if touching[i, point]:
                down[foot_of_point[point]] = True
        as_planned = 0
        for foot in range(feet):
            as_planned += down[foot] == notes.planted[i, foot]
        motion.as_planned[i] = as_planned / feet
        roll, pitch, _ = trunk_rate(terms, qvel, i)
        rolling, rising = np.sqrt(roll**2 + pitch**2), abs(velocity[2])
        motion.tumble[i] = rolling / units.rate + rising / units.speed
        motion.speed_command[i] = np.hypot(command[i, 0], command[i, 1])
        motion.height[i] = terms.base_position[i, 2] - ground[i]
        motion.height_command[i] = notes.height[i] - notes.ground[i]
        motion.foothold_error[i] = notes.missed[i] / max(notes.landed[i], 1)
