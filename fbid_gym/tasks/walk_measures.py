"""What a policy sees of a robot that walks, and how it is judged."""

from typing import Any, NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.trunk import trunk_rate
from fbid_gym.motions.gait.heading import along, axes_of_trunk
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.body import bell, level, see_limbs, side_by_side, weigh
from fbid_gym.tasks.outcome import Outcome

_PREFIX = "seen_"


class WalkReward(NamedTuple):
    """The terms of the reward, (N,) each, or their weights.

    Attributes:
        velocity: horizontal velocity as commanded.
        turning: yaw rate as commanded.
        clock: feet on the ground and in the air as the gait's clock has them.
        upright: base upright.
        steady: base neither rises nor rolls nor pitches.
        torque: small torques.
    """

    velocity: Any
    turning: Any
    clock: Any
    upright: Any
    steady: Any
    torque: Any


REWARD_WEIGHTS = WalkReward(
    velocity=0.4, turning=0.2, clock=0.15, upright=0.1, steady=0.05, torque=0.1
)
"""Each reward term lies in [0, weight]; they sum to 1."""


class Scales(NamedTuple):
    """What observation and reward measure by."""

    size: float  # m, height of the centre of mass at home
    gravity: float
    home_height: float  # m, of the base
    home_qpos: np.ndarray
    torque_limit: np.ndarray
    mean_torque_limit: float
    weight: float
    foot_of_point: np.ndarray


class Notes(NamedTuple):
    """What is noted of N robots: of the gait's last target, and of the episode so far."""

    planted: np.ndarray  # (N, F) bool, feet that shall stand
    foothold: np.ndarray  # (N, F, 3) m, where the others shall land
    cycle: np.ndarray  # (N,) share of the gait's cycle that has passed
    height: np.ndarray  # (N,) m, of the base, as the gait has it
    ground: np.ndarray  # (N,) m, height of the ground below the feet that last stood
    clipped: np.ndarray  # (N,) int64, ticks and feet at which a foothold was out of reach
    landed: np.ndarray  # (N,) int64, feet that came down
    missed: np.ndarray  # (N,) m, horizontal distances of those from their footholds, summed
    distance: np.ndarray  # (N,) m, way of the base
    energy: np.ndarray  # (N,) J, of the joints

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
            clipped=np.zeros(count, np.int64),
            landed=np.zeros(count, np.int64),
            missed=np.zeros(count),
            distance=np.zeros(count),
            energy=np.zeros(count),
        )

    @classmethod
    def of(cls, memory: Memory) -> "Notes":
        """Return them from the task's memory."""
        return cls(*(memory[_PREFIX + name] for name in cls._fields))

    def memory(self) -> Memory:
        """Return them as part of the task's memory."""
        return {_PREFIX + name: values for name, values in self._asdict().items()}


class Seen(NamedTuple):
    """What a policy sees of N robots, in the order of the observation; the limbs follow."""

    clock: np.ndarray  # (N, 2)
    command: np.ndarray  # (N, 3)
    wanting: np.ndarray  # (N, 3) what the velocity lacks of the command
    planted: np.ndarray  # (N, F)
    height: np.ndarray  # (N, 1) m, from home
    up: np.ndarray  # (N, 3) the vertical, base frame
    velocity: np.ndarray  # (N, 3) m/s, heading
    angular_velocity: np.ndarray  # (N, 3) rad/s, base frame


class Moved(NamedTuple):
    """How the robots moved."""

    velocity_error: np.ndarray  # (N,) m/s
    turning_error: np.ndarray  # (N,) rad/s
    speed: np.ndarray  # (N,) m/s


class Judged(NamedTuple):
    """What the reward is made of, and what it was made from."""

    terms: WalkReward
    moved: Moved


@compiled
def yaw_rate(world_from_base: np.ndarray, qvel: np.ndarray) -> float:
    """rad/s about the vertical, of one robot: (3, 3) and (nv,)."""
    return dot(world_from_base[2], qvel[3:6])


@kernel
def note(target: Target, foot_position: np.ndarray, notes: Notes) -> None:
    """Note what the gait asks for at a control tick, and how far from its foothold a foot landed.

    Args:
        target: of the gait.
        foot_position: (N, F, 3) m, world.
        notes: updated.
    """
    count, feet = target.planted.shape
    for i in range(count):
        ground = np.inf
        for foot in range(feet):
            stands = target.planted[i, foot]
            if stands:
                ground = min(ground, foot_position[i, foot, 2])
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
            notes.ground[i] = ground
        notes.cycle[i], notes.height[i] = target.cycle[i], target.qpos[i, 2]


@kernel
def observe(scales: Scales, outcome: Outcome, command: np.ndarray, notes: Notes) -> np.ndarray:
    """What `Walk.observe` returns, without a scan."""
    state, terms = outcome.state, outcome.terms
    count, feet = notes.planted.shape
    seen = Seen(
        np.empty((count, 2)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, feet)),
        np.empty((count, 1)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, 3)),
    )
    for i in range(count):
        angle = 2.0 * np.pi * notes.cycle[i]
        seen.clock[i, 0], seen.clock[i, 1] = np.sin(angle), np.cos(angle)
        base = terms.world_from_base[i]
        axes = axes_of_trunk(terms.world_from_trunk[i])
        ahead, left = along(axes, state.qvel[i, 0], state.qvel[i, 1])
        seen.velocity[i, 0], seen.velocity[i, 1] = ahead, left
        seen.velocity[i, 2] = state.qvel[i, 2]
        height = terms.base_position[i, 2] - notes.ground[i]
        seen.height[i, 0] = height - scales.home_height
        seen.wanting[i, 0] = command[i, 0] - ahead
        seen.wanting[i, 1] = command[i, 1] - left
        seen.wanting[i, 2] = command[i, 2] - yaw_rate(base, state.qvel[i])
        for k in range(3):
            seen.command[i, k] = command[i, k]
            seen.up[i, k] = base[2, k]
            seen.angular_velocity[i, k] = state.qvel[i, 3 + k]
        for foot in range(feet):
            seen.planted[i, foot] = notes.planted[i, foot]
    limbs = see_limbs(scales.home_qpos, scales.torque_limit, scales.weight, outcome)
    return side_by_side((side_by_side(seen), limbs))


@kernel
def judge(scales: Scales, outcome: Outcome, command: np.ndarray, notes: Notes) -> Judged:
    """Return the terms of the reward, and how the robots moved; note the latter."""
    state, terms, posture = outcome.state, outcome.terms, outcome.posture
    count, feet = notes.planted.shape
    points = posture.touching.shape[1]
    share = WalkReward(
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
    )
    moved = Moved(np.empty(count), np.empty(count), np.empty(count))
    speed, rate = np.sqrt(scales.gravity * scales.size), np.sqrt(scales.gravity / scales.size)
    down = np.empty(feet, np.bool_)
    for i in range(count):
        base, qvel = terms.world_from_base[i], state.qvel[i]
        ahead, left = along(axes_of_trunk(terms.world_from_trunk[i]), qvel[0], qvel[1])
        moved.velocity_error[i] = np.hypot(ahead - command[i, 0], left - command[i, 1])
        moved.speed[i] = np.hypot(ahead, left)
        notes.distance[i] += moved.speed[i] * outcome.seconds
        notes.energy[i] += outcome.power[i] * outcome.seconds
        moved.turning_error[i] = abs(yaw_rate(base, qvel) - command[i, 2])
        down[:] = False
        for point in range(points):
            if posture.touching[i, point]:
                down[scales.foot_of_point[point]] = True
        as_planned = 0
        for foot in range(feet):
            as_planned += down[foot] == notes.planted[i, foot]
        roll, pitch, _ = trunk_rate(terms, state.qvel, i)
        tumble = np.sqrt(roll**2 + pitch**2) / rate + abs(qvel[2]) / speed
        torque = np.sqrt(outcome.torque_square[i])
        # Speeds scale with sqrt(g h), rates with sqrt(g / h).
        share.velocity[i] = bell(moved.velocity_error[i], 0.19 * speed)
        share.turning[i] = bell(moved.turning_error[i], 0.09 * rate)
        share.clock[i] = as_planned / feet * bell(posture.slip[i], 0.2 * speed)
        share.upright[i] = level(posture.upright[i])
        share.steady[i] = bell(tumble, 0.3)
        share.torque[i] = bell(torque / scales.mean_torque_limit, 0.5)
    weigh(share, REWARD_WEIGHTS)
    return Judged(share, moved)
