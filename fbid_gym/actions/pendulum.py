"""Force of a pendulum: the share of the weight that each standing leg carries.

A robot that walks is a pendulum on its centre of pressure p: with its centre of mass c at a height
h above p, the ground's force goes from p to c (`fbid_gym.motions.gait.divergent`),

    f = m g ((c - p) / h, 1),    p = c - cdd_target / omega^2,

where cdd_target is the gait's. Standing feet share it by what they may bear, so that p is where
they push together; what is left of p beside them turns soles. tau = -J^T f holds it: that is how
ankles answer errors of the velocity, by the gait's law for p. It takes places, Jacobians and the
weight, no mass matrix. What each link weighs beside this is g dc_z/dq for every joint,
of which the first rows of M are m times (dc/dq): it is held as in the home posture, or compensated.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.actions.joint_gains import holding_torque
from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.passive_joints import PassiveJoints, give_back
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.target import MotionKind, home_target
from fbid_gym.quantities import DynamicsTerms, Target
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import factor, solve_factored

_RIDGE = 1e-6  # where feet stand on a line, or one alone


class Pendulum(NamedTuple):
    """Constants of a robot's pendulum. n joints, F feet."""

    weight: float  # N
    gravity: float  # m/s^2
    omega: float  # 1/s, rate at which the robot falls while it moves so
    length: float  # m, between the feet
    soles: bool  # whether feet can bear moments
    # Whether every link's weight is compensated, in all joints; else legs carry the whole.
    links: bool
    legs: np.ndarray  # (F, n) bool, joints of each foot's leg
    rest: np.ndarray  # (n,) N·m, held besides

    @classmethod
    def of(
        cls, robot: Robot, kind: MotionKind, *, links: bool = False, leg_weight: bool = True
    ) -> "Pendulum":
        """Return that of a robot; see `JointPosition.of` for `leg_weight`."""
        stance, still = Stance.of(robot), np.zeros((1, robot.nv))
        none = np.zeros((1, robot.num_joints))
        springs = give_back(PassiveJoints.of(robot), none, robot.home_qpos[None], still)[0]
        own = cls(
            weight=robot.weight,
            gravity=robot.gravity,
            omega=kind.omega,
            length=stance.length,
            soles=bool(robot.has_soles),
            links=links,
            legs=stance.legs,
            rest=springs,
        )
        if links:
            return own
        home, compensated = home_target(robot), own._replace(links=True)
        whole = carry(compensated, home, stance.terms)[0] if leg_weight else holding_torque(robot)
        left = whole - carry(own, home, stance.terms)[0]
        massless = kind.steps and not (robot.has_soles or leg_weight)
        return own._replace(rest=springs + np.where(stance.legs.any(axis=0) & massless, 0.0, left))


@kernel
def carry(pendulum: Pendulum, target: Target, terms: DynamicsTerms) -> np.ndarray:
    """Return the joint torques (N, n) N·m that carry robots as pendulums."""
    (count, feet), joints = target.load.shape, len(pendulum.rest)
    torque = np.empty((count, joints))
    room = _Room(np.empty(feet), np.empty((3, 3)), np.empty(3))
    for i in range(count):
        _share(pendulum, target, terms, i, room)
        _hold(pendulum, target, terms, i, room.share, torque[i])
    return torque


class _Room(NamedTuple):
    """Buffers: shares (F,) of the feet, a matrix (3, 3) and a vector (3,)."""

    share: np.ndarray
    matrix: np.ndarray
    vector: np.ndarray


@compiled
def _pressure(pendulum: Pendulum, target: Target, terms: DynamicsTerms, i: int, axis: int) -> float:
    """Return where the ground shall push along a horizontal axis, m."""
    shift: float = target.com_acceleration[i, axis] / pendulum.omega**2
    place: float = terms.com[i, axis]
    return place - shift


@compiled
def _share(pendulum: Pendulum, target: Target, terms: DynamicsTerms, i: int, room: _Room) -> None:
    """Write each foot's share of the weight: the least that push together where they shall."""
    share, matrix, wanted = room.share, room.matrix, room.vector
    for row in range(3):
        wanted[row] = 0.0
        for column in range(3):
            matrix[row, column] = _RIDGE if row == column else 0.0
    wanted[0] = 1.0
    for foot in range(len(share)):
        for row in range(3):
            for column in range(row + 1):
                side = _side(pendulum, target, terms, i, foot, row)
                other = _side(pendulum, target, terms, i, foot, column)
                matrix[row, column] += target.load[i, foot] * side * other
    factor(matrix)
    solve_factored(matrix, wanted)
    total = 0.0
    for foot in range(len(share)):
        found = 0.0
        for row in range(3):
            found += wanted[row] * _side(pendulum, target, terms, i, foot, row)
        share[foot] = max(found * target.load[i, foot], 0.0)
        total += share[foot]
    for foot in range(len(share)):
        share[foot] = share[foot] / total if total > 0.0 else 0.0


@compiled
def _side(
    pendulum: Pendulum, target: Target, terms: DynamicsTerms, i: int, foot: int, row: int
) -> float:
    """Return 1, or how far a foot is from where the ground shall push, in lengths."""
    if row == 0:
        return 1.0
    place: float = terms.foot_position[i, foot, row - 1]
    return (place - _pressure(pendulum, target, terms, i, row - 1)) / pendulum.length


@compiled
def _hold(
    pendulum: Pendulum,
    target: Target,
    terms: DynamicsTerms,
    i: int,
    share: np.ndarray,
    torque: np.ndarray,
) -> None:
    """Write the torques (n,) against the ground's forces, and with `links` the links' weight."""
    x, y = _pressure(pendulum, target, terms, i, 0), _pressure(pendulum, target, terms, i, 1)
    beside_x, beside_y, ground = x, y, 0.0
    for foot in range(len(share)):
        beside_x -= share[foot] * terms.foot_position[i, foot, 0]
        beside_y -= share[foot] * terms.foot_position[i, foot, 1]
        ground += share[foot] * terms.foot_position[i, foot, 2]
    height = max(terms.com[i, 2] - ground, 0.1 * pendulum.length)
    lean_x, lean_y = (terms.com[i, 0] - x) / height, (terms.com[i, 1] - y) / height
    for j in range(len(torque)):
        torque[j] = pendulum.rest[j]
        if pendulum.links:
            torque[j] += pendulum.gravity * terms.mass_matrix[i, 2, 6 + j]
    for foot in range(len(share)):
        force, moves = pendulum.weight * share[foot], terms.foot_jacobian[i, foot]
        for j in range(len(torque)):
            if pendulum.links or pendulum.legs[foot, j]:
                k = 6 + j
                pushed = lean_x * moves[0, k] + lean_y * moves[1, k] + moves[2, k]
                if pendulum.soles:
                    pushed += beside_y * moves[3, k] - beside_x * moves[4, k]
                    pushed += (beside_x * lean_y - beside_y * lean_x) * moves[5, k]
                torque[j] -= force * pushed
