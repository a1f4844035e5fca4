"""The motors of N simulated robots, compiled: from torques that are asked for to those that act.

They are stepped with the physics, not with the control: a joint passes a good part of its
torque-speed line within one control tick, and a drive's own electronics are faster than either.
Ideal motors, which have torque limits and nothing else, turn once in a control tick.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.envs.tick import Wiring
from fbid_gym.robots.drives import Drives, least_and_most
from fbid_gym.runtime.effort import Effort

_HOT = 0.9  # of what a motor bears for ever: from here on its limit falls


class MotorState(NamedTuple):
    """State of the motors of N robots, n joints."""

    torque: np.ndarray  # (N, n) N·m, at the end of the last physics step
    heat: np.ndarray  # (N, n) share of the heat that a motor bears for ever
    speed: np.ndarray  # (N,) factor on the speeds of the torque-speed line
    lag: np.ndarray  # (N,) factor on the lag

    @classmethod
    def cold(cls, num_robots: int, num_joints: int) -> "MotorState":
        """State of the motors of robots that have not moved yet."""
        torque, heat = np.zeros((2, num_robots, num_joints))
        return cls(torque, heat, np.ones(num_robots), np.ones(num_robots))

    def cool(self, ids: np.ndarray) -> None:
        """Begin anew with robots (K,)."""
        self.torque[ids], self.heat[ids] = 0.0, 0.0


@kernel
def turn_motors(
    wiring: Wiring,
    drives: Drives,
    motors: MotorState,
    effort: Effort,
    wanted: np.ndarray,
    push: np.ndarray,
    seconds: float,
    share: float,
) -> None:
    """Write the torques of N robots' motors for a physics step, and the pushes, into the batch.

    In this order: the limit at the present speed and heat, on what is asked for; a first-order lag,
    solved exactly, whose mean over the step acts; the limit once more, for the speed has changed
    since; the battery. A robot whose torques are no numbers gets none, and is lost.

    `wanted` (N, n) are the layer's torques, N·m, and `push` (N, 3) forces on the bases, N. The step
    takes `seconds`, which is `share` of a control tick. Updates `motors`, and all of `effort` but
    the power, by the torques that act.
    """
    rows, joints = wiring.rows, wanted.shape[1]
    warming = 1.0 - math.exp(-seconds / drives.thermal_time)
    for i in range(len(rows)):
        broken = False
        for j in range(joints):
            broken |= np.isnan(wanted[i, j])
        full, driving = 0, 0.0
        for j in range(joints):
            speed = rows[i, wiring.velocity + 6 + j]
            least, most = least_and_most(drives.line, j, speed, motors.speed[i])
            bearable = _bearable(drives, j, motors.heat[i, j])
            least, most = max(least, -bearable), min(most, bearable)
            asked = 0.0 if broken else wanted[i, j]
            full += asked <= least or asked >= most
            asked = min(max(asked, least), most)
            mean, end = _lagged(motors.torque[i, j], asked, drives.lag[j] * motors.lag[i], seconds)
            effort.torque[i, j] = min(max(mean, least), most)
            motors.torque[i, j] = min(max(end, least), most)
            driving += max(effort.torque[i, j] * speed, 0.0)
        square = 0.0
        for j in range(joints):
            if driving > drives.battery and (
                effort.torque[i, j] * rows[i, wiring.velocity + 6 + j] > 0.0
            ):
                effort.torque[i, j] *= drives.battery / driving
                motors.torque[i, j] *= drives.battery / driving
            given = effort.torque[i, j]
            rows[i, wiring.controls[j]] = given / wiring.gear[j]
            square += given * given
            load = given / drives.continuous[j]
            motors.heat[i, j] += warming * (load * load - motors.heat[i, j])
        for axis in range(3):
            rows[i, wiring.push + axis] = push[i, axis]
        effort.saturation[i] = full / joints
        effort.torque_square[i] += share * square
        effort.lost[i] |= broken


@compiled
def _bearable(drives: Drives, j: int, heat: float) -> float:
    """Largest torque of motor j at a heat, N·m."""
    highest, lasting = drives.line.torque[j], drives.continuous[j]
    if heat <= _HOT or lasting >= highest:
        return highest
    left = max(0.0, (1.0 - heat) / (1.0 - _HOT))
    return lasting + left * (highest - lasting)


@compiled
def _lagged(torque: float, asked: float, lag: float, seconds: float) -> tuple[float, float]:
    """Mean over a step, and the end, of the torque that follows `asked` at a first-order lag."""
    if lag <= 0.0:
        return asked, asked
    steps = seconds / lag
    left = math.exp(-steps)
    return asked + (torque - asked) * (1.0 - left) / steps, asked + (torque - asked) * left
