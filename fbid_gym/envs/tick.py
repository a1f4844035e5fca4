"""What stands between an action layer and MuJoCo at every control tick, compiled.

MuJoCo's batch keeps what it simulates in one row per robot: positions, velocities, controls and
applied forces, each from a column of its own on. The kernels read and write these rows.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel


class Effort(NamedTuple):
    """What the motors of N robots did during a policy step; n joints.

    Attributes:
        torque: (N, n) N·m, on the last control tick.
        saturation: (N,) share of the joints at their limit, then.
        torque_square: (N,) (N·m)^2, sum of torque^2 over joints and ticks.
        lost: (N,) bool, robots whose torques were no numbers on some tick.
        power: (N,) W, sum of |torque * velocity| over joints and ticks.
    """

    torque: np.ndarray
    saturation: np.ndarray
    torque_square: np.ndarray
    lost: np.ndarray
    power: np.ndarray

    @classmethod
    def none(cls, num_robots: int, num_joints: int) -> "Effort":
        """At the beginning of a step."""
        saturation, torque_square, power = np.zeros((3, num_robots))
        torque, lost = np.zeros((num_robots, num_joints)), np.zeros(num_robots, bool)
        return cls(torque, saturation, torque_square, lost, power)


@kernel
def write_controls(
    torque: np.ndarray, gear: np.ndarray, controls: np.ndarray, rows: np.ndarray
) -> None:
    """Let the motors of N robots give torques (N, n), or (1, n) all of them the same.

    Args:
        torque: N·m.
        gear: (n,) torque per unit of control.
        controls: (n,) the column of each joint's control.
        rows: (N, S) of the batch.
    """
    for i in range(len(rows)):
        wanted = torque[min(i, len(torque) - 1)]
        for j in range(len(gear)):
            rows[i, controls[j]] = wanted[j] / gear[j]


@kernel
def drive(
    wanted: np.ndarray,
    limit: np.ndarray,
    gear: np.ndarray,
    controls: np.ndarray,
    push: np.ndarray,
    pushed: int,
    rows: np.ndarray,
    torque: np.ndarray,
    saturation: np.ndarray,
    torque_square: np.ndarray,
    lost: np.ndarray,
) -> None:
    """Limit the torques of N robots, and write them and the pushes into the batch.

    A robot whose torques are no numbers gets none, and is lost.

    Args:
        wanted: (N, n) N·m, of the action layer.
        limit: (n,) N·m.
        gear: (n,) torque per unit of control.
        controls: (n,) the column of each joint's control.
        push: (N, 3) N.
        pushed: the first of the three columns of the force on the base.
        rows: (N, S) of the batch.
        torque: (N, n) N·m, and the rest: see `Effort`.
        saturation: see there.
        torque_square: see there.
        lost: see there.
    """
    joints = len(limit)
    for i in range(len(rows)):
        broken = False
        for j in range(joints):
            broken |= np.isnan(wanted[i, j])
        square, full = 0.0, 0
        for j in range(joints):
            given = 0.0 if broken else min(max(wanted[i, j], -limit[j]), limit[j])
            torque[i, j] = given
            rows[i, controls[j]] = given / gear[j]
            square += given * given
            full += abs(given) >= limit[j]
        for axis in range(3):
            rows[i, pushed + axis] = push[i, axis]
        saturation[i] = full / joints
        torque_square[i] += square
        lost[i] |= broken


@kernel
def read(
    rows: np.ndarray,
    position: int,
    velocity: int,
    sensors: np.ndarray,
    contact: int,
    torque: np.ndarray,
    power: np.ndarray,
    qpos: np.ndarray,
    qvel: np.ndarray,
    contact_force: np.ndarray,
    tick: np.ndarray,
) -> None:
    """Read what a control tick did to N robots.

    Args:
        rows: (N, S) of the batch.
        position: the first column of the robots' qpos.
        velocity: the first column of their qvel.
        sensors: (N, R) of the batch.
        contact: the first of its columns with contact forces.
        torque: (N, n) N·m, as applied.
        power: (N,) W, to which that of these torques is added.
        qpos: (N, nq) to be read.
        qvel: (N, nv) to be read.
        contact_force: (N, P, 3) N, to be read.
        tick: (N,) control ticks, one more now.
    """
    points = contact_force.shape[1]
    for i in range(len(rows)):
        for j in range(qpos.shape[1]):
            qpos[i, j] = rows[i, position + j]
        for j in range(qvel.shape[1]):
            qvel[i, j] = rows[i, velocity + j]
        for j in range(points):
            for axis in range(3):
                contact_force[i, j, axis] = sensors[i, contact + 3 * j + axis]
        total = 0.0
        for j in range(torque.shape[1]):
            total += abs(torque[i, j] * qvel[i, 6 + j])
        power[i] += total
        tick[i] += 1


@kernel
def find_diverged(
    warning: np.ndarray,
    kinds: np.ndarray,
    velocity: int,
    size: int,
    fastest: float,
    rows: np.ndarray,
    diverged: np.ndarray,
) -> None:
    """Find the robots whose states can no longer be trusted.

    Args:
        warning: (N, W, 2) the batch's warnings; the count of each kind comes second.
        kinds: (K,) those of a restart, which were set to 1 beforehand.
        velocity: the first column of the robots' qvel.
        size: nv.
        fastest: m/s and rad/s, largest speed that is trusted.
        rows: (N, S) of the batch.
        diverged: (N,) bool.
    """
    for i in range(len(rows)):
        trusted = True
        for kind in kinds:
            trusted &= warning[i, kind, 1] == 1
        for j in range(size):
            trusted &= abs(rows[i, velocity + j]) < fastest
        diverged[i] = not trusted
