"""What a policy sees of a robot that walks, and how it is judged."""

from typing import Any, NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.quantities import Memory
from fbid_gym.tasks.body import Posture, bell, level, side_by_side
from fbid_gym.tasks.outcome import Outcome


class WalkReward(NamedTuple):
    """The terms of the reward: the share (N,) of each in [0, 1], or its weight.

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


class Clock(NamedTuple):
    """What of the gait's last target is seen."""

    planted: np.ndarray  # (N, F) bool
    cycle: np.ndarray  # (N,)
    ground: np.ndarray  # (N,) m

    @classmethod
    def of(cls, memory: Memory) -> "Clock":
        """Return it from the task's memory."""
        return cls(memory["seen_planted"], memory["seen_cycle"], memory["seen_ground"])


class Seen(NamedTuple):
    """What a policy sees of N robots, in the order of the observation."""

    clock: np.ndarray  # (N, 2)
    command: np.ndarray  # (N, 3)
    planted: np.ndarray  # (N, F)
    height: np.ndarray  # (N, 1) m, from home
    up: np.ndarray  # (N, 3) the vertical, base frame
    velocity: np.ndarray  # (N, 3) m/s, heading
    angular_velocity: np.ndarray  # (N, 3) rad/s, base frame
    joint_position: np.ndarray  # (N, n) rad, from home
    joint_velocity: np.ndarray  # (N, n) rad/s
    torque: np.ndarray  # (N, n) last one, share of its limit
    load: np.ndarray  # (N, P) normal force, share of the weight


class Moved(NamedTuple):
    """How the robots moved."""

    velocity_error: np.ndarray  # (N,) m/s
    turning_error: np.ndarray  # (N,) rad/s
    speed: np.ndarray  # (N,) m/s


class Judged(NamedTuple):
    """What the reward is made of, and what it was made from."""

    shares: WalkReward
    moved: Moved


@kernel
def command_at(start: np.ndarray, command: np.ndarray, tick: np.ndarray) -> np.ndarray:
    """Return the commands (N, 3) at ticks (N,), of those (N, K, 3) that start at ticks (N, K)."""
    found = np.empty((len(tick), 3))
    for i in range(len(tick)):
        index = -1
        for k in range(start.shape[1]):
            index += start[i, k] <= tick[i]
        for axis in range(3):
            found[i, axis] = command[i, index, axis]
    return found


@kernel
def observe(scales: Scales, outcome: Outcome, command: np.ndarray, clock: Clock) -> np.ndarray:
    """What `Walk.observe` returns."""
    state, terms = outcome.state, outcome.terms
    (count, joints), points = outcome.torque.shape, state.contact_force.shape[1]
    feet = clock.planted.shape[1]
    seen = Seen(
        np.empty((count, 2)),
        np.empty((count, 3)),
        np.empty((count, feet)),
        np.empty((count, 1)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, joints)),
        np.empty((count, joints)),
        np.empty((count, joints)),
        np.empty((count, points)),
    )
    for i in range(count):
        angle = 2.0 * np.pi * clock.cycle[i]
        seen.clock[i, 0], seen.clock[i, 1] = np.sin(angle), np.cos(angle)
        base = terms.world_from_base[i]
        size = np.hypot(base[0, 0], base[1, 0]) + 1e-12
        cosine, sine = base[0, 0] / size, base[1, 0] / size
        x, y = state.qvel[i, 0], state.qvel[i, 1]
        seen.velocity[i, 0], seen.velocity[i, 1] = cosine * x + sine * y, cosine * y - sine * x
        seen.velocity[i, 2] = state.qvel[i, 2]
        height = terms.base_position[i, 2] - clock.ground[i]
        seen.height[i, 0] = height - scales.home_height
        for k in range(3):
            seen.command[i, k] = command[i, k]
            seen.up[i, k] = base[2, k]
            seen.angular_velocity[i, k] = state.qvel[i, 3 + k]
        for foot in range(feet):
            seen.planted[i, foot] = clock.planted[i, foot]
        for j in range(joints):
            seen.joint_position[i, j] = state.qpos[i, 7 + j] - scales.home_qpos[7 + j]
            seen.joint_velocity[i, j] = state.qvel[i, 6 + j]
            seen.torque[i, j] = outcome.torque[i, j] / scales.torque_limit[j]
        for point in range(points):
            seen.load[i, point] = state.contact_force[i, point, 2] / scales.weight
    return side_by_side(seen)


@kernel
def judge(
    scales: Scales, posture: Posture, outcome: Outcome, command: np.ndarray, clock: Clock
) -> Judged:
    """Return the shares of the terms of the reward, and how the robots moved."""
    state, terms = outcome.state, outcome.terms
    count, feet = clock.planted.shape
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
        size = np.hypot(base[0, 0], base[1, 0]) + 1e-12
        cosine, sine = base[0, 0] / size, base[1, 0] / size
        ahead, left = cosine * qvel[0] + sine * qvel[1], cosine * qvel[1] - sine * qvel[0]
        moved.velocity_error[i] = np.hypot(ahead - command[i, 0], left - command[i, 1])
        moved.speed[i] = np.hypot(ahead, left)
        spin = base[2, 0] * qvel[3] + base[2, 1] * qvel[4] + base[2, 2] * qvel[5]
        moved.turning_error[i] = abs(spin - command[i, 2])
        down[:] = False
        for point in range(points):
            if posture.touching[i, point]:
                down[scales.foot_of_point[point]] = True
        as_planned = 0
        for foot in range(feet):
            as_planned += down[foot] == clock.planted[i, foot]
        tumble = np.sqrt(qvel[3] ** 2 + qvel[4] ** 2) / rate + abs(qvel[2]) / speed
        torque = np.sqrt(outcome.torque_square[i])
        # Speeds scale with sqrt(g h), rates with sqrt(g / h).
        share.velocity[i] = bell(moved.velocity_error[i], 0.19 * speed)
        share.turning[i] = bell(moved.turning_error[i], 0.09 * rate)
        share.clock[i] = as_planned / feet * bell(posture.slip[i], 0.2 * speed)
        share.upright[i] = level(posture.upright[i])
        share.steady[i] = bell(tumble, 0.3)
        share.torque[i] = bell(torque / scales.mean_torque_limit, 0.5)
    return Judged(share, moved)
