"""Limits of the motors on a law: torque limits in the force problem, and weak motors.

A torque that is clipped at its limit takes a wrench from the base that nobody chose. So where a
motor of a standing leg cannot give its torque at its present speed, the contact forces are solved
for once more, with the torques' bounds beside the friction cones (`torque_limits`), and the motion
yields to what they deliver, as it yields to friction. Torques depend on the forces directly, and
through the motion that yields: the latter is small, legs being light, and is left to a second pass.
A leg in the air moves by its own motors alone; its torques are clipped.

Whether motors give what they are asked for is seen from the centre of mass: the vertical force that
it took to move it as it moved, over the one that was asked for, in the mean over the time in which
the robot falls. Laws trust their torques where this share lies within a tenth of one, as it does
while a robot walks; beyond, torques are divided by it. Without that a robot whose motors give 0.4
of what they are asked for sinks until the error of its height asks for the rest, and falls.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.control.dual_newton import Problem
from fbid_gym.control.torque_limits import AffineTorque, forces_within_torque_limits
from fbid_gym.control.whole_body import Work
from fbid_gym.dynamics.vectors import add, cross, store, vector
from fbid_gym.quantities import Accuracy, DynamicsTerms
from fbid_gym.robots.drives import TorqueLine, least_and_most
from fbid_gym.small_matrices import dot

PASSES = 2
"""Times that forces are solved for with the torques' bounds, at most."""

# Of a limit: torques that exceed it by less are left to the clip, so close comes the first pass. Up
# to twice as much, forces go over to those within the bounds, so that no torque jumps.
_CLOSE = 0.05
_LEAST, _MOST = 0.25, 2.0  # strengths that are believed
_TRUSTED, _DOUBTED = 0.1, 0.2  # errors of the share: torques are trusted to here, doubted from here


class MotorModel(NamedTuple):
    """A law's model of the motors."""

    line: TorqueLine  # what they can give at a speed
    tick: float  # s, of the law
    window: float  # s, time constant of the mean in which weak motors are seen


@compiled
def believed_strength(
    motors: MotorModel, gravity: float, terms: DynamicsTerms, past: np.ndarray, i: int
) -> float:
    """Return the share of their torques that a robot's motors are taken to give.

    Its `past` (4,) is the vertical velocity of its centre of mass a tick ago (m/s), the vertical
    force that was asked for then (N), the means of its product with the force that came and of its
    square (N^2); zeros if there is no past. It is updated, but for the force.
    """
    mass, speed = terms.mass_matrix[i, 0, 0], terms.com_velocity[i, 2]
    if past[3] == 0.0:
        past[2] = past[3] = (mass * gravity) ** 2
    else:
        came = mass * ((speed - past[0]) / motors.tick + gravity)
        share = motors.tick / motors.window
        past[2] += share * (past[1] * came - past[2])
        past[3] += share * (past[1] * past[1] - past[3])
    past[0] = speed
    error = min(max(past[2] / past[3], _LEAST), _MOST) - 1.0
    return 1.0 + error * min(max((abs(error) - _TRUSTED) / (_DOUBTED - _TRUSTED), 0.0), 1.0)


@compiled
def bound_forces(
    line: TorqueLine,
    strength: float,
    accuracy: Accuracy,
    weight: float,
    terms: DynamicsTerms,
    qvel: np.ndarray,
    torque: np.ndarray,
    i: int,
    work: Work,
    missed: np.ndarray,
) -> bool:
    """Bring forces of a robot within what its motors can give; whether that changed them.

    To be called where torques `exceed_limits`: buffers are made here. The motors are taken to give
    a share, `strength`, of their torques; `torque` (n,) N·m is what forces and motion need. The
    forces in `work` are changed, and their missing wrench is how theirs differs from before; the
    scaled wrench that they miss altogether is written to `missed` (6,).
    """
    count = work.forces.problem.number[0]
    slope = np.zeros((len(torque), 3 * count))
    excess = _slopes(line, strength, terms, qvel, torque, i, work, slope)
    if count == 0 or excess <= _CLOSE:
        return False
    problem = Problem(np.empty((6, 3 * count)), np.empty(6), np.empty((count, 3)))
    affine = AffineTorque(slope, np.empty(len(torque)), np.empty(len(torque)))
    force = np.empty(3 * count)
    _pose(line, strength, qvel, torque, i, work, problem, affine, force)
    forces_within_torque_limits(problem, affine, weight, accuracy, force)
    _take(work, problem, min(excess / _CLOSE - 1.0, 1.0), force, missed)
    return True


@compiled
def ask_more(strength: np.ndarray, torque: np.ndarray) -> None:
    """Ask motors that give a share (N,) of their torques (N, n) for as much more, in place."""
    for i in range(len(torque)):
        share = 1.0 / strength[i]
        for j in range(torque.shape[1]):
            torque[i, j] *= share


@compiled
def _range(
    line: TorqueLine, strength: float, qvel: np.ndarray, i: int, j: int
) -> tuple[float, float]:
    """Least and greatest torque to ask of motor j of robot i for what it can give."""
    least, most = least_and_most(line, j, qvel[i, 6 + j], 1.0)
    return strength * least, strength * most


@compiled
def exceed_limits(
    line: TorqueLine, strength: float, qvel: np.ndarray, torque: np.ndarray, i: int
) -> bool:
    """Tell whether a torque (n,) is beyond the motors; mostly none is, see `bound_forces`."""
    for j in range(len(torque)):
        if _excess(line, strength, qvel, torque, i, j) > _CLOSE:
            return True
    return False


@compiled
def _excess(
    line: TorqueLine, strength: float, qvel: np.ndarray, torque: np.ndarray, i: int, j: int
) -> float:
    """By how much a torque exceeds what its motor can give, as a share of the whole limit."""
    least, most = least_and_most(line, j, qvel[i, 6 + j], 1.0)
    beyond = max(torque[j] - strength * most, strength * least - torque[j])
    return beyond / (strength * line.torque[j])


@compiled
def _slopes(
    line: TorqueLine,
    strength: float,
    terms: DynamicsTerms,
    qvel: np.ndarray,
    torque: np.ndarray,
    i: int,
    work: Work,
    slope: np.ndarray,
) -> float:
    """Write -J^T of the joints (n, 3 P); the largest excess of a torque that forces change."""
    largest = 0.0
    for j in range(len(torque)):
        levers = 0.0
        for point in range(work.forces.problem.number[0]):
            jacobian = terms.foot_jacobian[i, work.feet[point]]
            linear = jacobian[0, 6 + j], jacobian[1, 6 + j], jacobian[2, 6 + j]
            angular = jacobian[3, 6 + j], jacobian[4, 6 + j], jacobian[5, 6 + j]
            along = add(linear, cross(angular, vector(work.arms, (point,))))
            for axis in range(3):
                slope[j, 3 * point + axis] = -along[axis]
                levers += abs(along[axis])
        if levers > 0.0:
            largest = max(largest, _excess(line, strength, qvel, torque, i, j))
    return largest


@compiled
def _pose(
    line: TorqueLine,
    strength: float,
    qvel: np.ndarray,
    torque: np.ndarray,
    i: int,
    work: Work,
    problem: Problem,
    affine: AffineTorque,
    force: np.ndarray,
) -> None:
    """Write the problem of the forces with bounds on the torques, and where to start."""
    points = work.forces.problem
    for row in range(6):
        problem.wrench[row] = points.wrench[row]
    for point in range(points.number[0]):
        for axis in range(3):
            force[3 * point + axis] = work.forces.point.force[point, axis]
            problem.limits[point, axis] = points.limits[point, axis]
            for row in range(6):
                problem.maps[row, 3 * point + axis] = points.wrenches[point, axis, row]
    for j in range(len(torque)):
        least, most = _range(line, strength, qvel, i, j)
        affine.limit[j] = 0.5 * (most - least)
        affine.offset[j] = torque[j] - dot(affine.slope[j], force) - 0.5 * (most + least)


@compiled
def _take(
    work: Work, problem: Problem, share: float, force: np.ndarray, missed: np.ndarray
) -> None:
    """Go a share of the way to other forces, and write the difference it makes to the wrench."""
    point = work.forces.point
    for k in range(len(force)):
        force[k] = (1.0 - share) * point.force[k // 3, k % 3] + share * force[k]
    for row in range(6):
        before, after = 0.0, 0.0
        for k in range(len(force)):
            before += problem.maps[row, k] * point.force[k // 3, k % 3]
            after += problem.maps[row, k] * force[k]
        point.missing[row] = after - before
        missed[row] = after - problem.wrench[row]
    for k in range(work.forces.problem.number[0]):
        store(vector(force, (), 3 * k), point.force, (k,))
