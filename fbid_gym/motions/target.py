"""Targets: of robots that stay at home, of motions planned from feet to feet, and of gaits."""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.dynamics.vectors import add, matrix, product, store, turn, vector
from fbid_gym.quantities import DynamicsTerms, Heading, SupportFrame, Target
from fbid_gym.robots import Robot

WALK_CYCLE = 3.4  # pendulum times in which a biped that walks slowly takes two steps


class MotionKind(NamedTuple):
    """The kind of motion of a task; defaults of layers depend on it."""

    gait: bool  # whether a gait makes the target online, from where the robot is; or it is planned
    omega: float  # 1/s, rate at which the robot falls while it moves so
    steps: bool = True  # whether feet leave the ground
    cycle: float = WALK_CYCLE  # 1/omega in which each foot steps once; planned ones are slow
    friction: float = 0.0  # coefficient that carries the robot without a moment, see `Gait`


NUMBERS = (
    *("foot_position", "world_from_foot", "foot_velocity", "foot_acceleration"),
    *("com", "com_velocity", "com_acceleration", "qpos", "qvel", "qacc"),
)
"""Fields of a `Target` that are numbers from which the others follow, but for planted feet."""


def planned_kind(robot: Robot, *, steps: bool = False) -> MotionKind:
    """Return the kind of motions that are planned beforehand, standing among them."""
    return MotionKind(False, Stance.of(robot).falling_rate, steps)


def home_target(robot: Robot) -> Target:
    """Return the target of robots that hold their home stance: one row, seen from the feet."""
    stance = Stance.of(robot)
    qpos = np.concatenate([stance.home_base, robot.home_qpos[3:]])[None]
    rest, still = np.zeros((1, robot.nv)), np.zeros((1, 3))
    feet = np.zeros((1, robot.num_feet, 6))
    place = stance.terms.foot_position - (stance.terms.base_position - stance.home_base)[:, None]
    return planned_target(
        np.ones((1, robot.num_feet), bool),
        *(place, stance.terms.world_from_foot, feet, feet),
        *(stance.home_com[None], still, still, qpos, rest, rest),
    )


def planned_target(planted: np.ndarray, *numbers: np.ndarray) -> Target:
    """Return the target of T instants of a planned motion: planted feet (T, F), and `NUMBERS`."""
    given = dict(zip(NUMBERS, numbers, strict=True))
    return Target(
        planted=planted,
        load=planted.astype(float),
        foothold=given["foot_position"],
        clipped=np.zeros(planted.shape, bool),
        cycle=np.arange(len(planted)) / len(planted),
        moment=np.ones((len(planted), 3)),
        **given,
    )


@compiled
def empty_target(count: int, feet: int, size: int) -> Target:
    """Return a target of N robots with F feet and nv coordinates, to be filled in."""
    return Target(
        planted=np.ones((count, feet), np.bool_),
        load=np.ones((count, feet)),
        foot_position=np.empty((count, feet, 3)),
        world_from_foot=np.empty((count, feet, 3, 3)),
        foot_velocity=np.zeros((count, feet, 6)),
        foot_acceleration=np.zeros((count, feet, 6)),
        foothold=np.empty((count, feet, 3)),
        clipped=np.zeros((count, feet), np.bool_),
        com=np.empty((count, 3)),
        com_velocity=np.zeros((count, 3)),
        com_acceleration=np.zeros((count, 3)),
        qpos=np.empty((count, size + 1)),
        qvel=np.zeros((count, size)),
        qacc=np.zeros((count, size)),
        cycle=np.zeros(count),
        moment=np.ones((count, 3)),
    )


@kernel
def standing_target(terms: DynamicsTerms, home_qpos: np.ndarray) -> Target:
    """Return the target of robots that stand where they are, upright, joints at home (nq,)."""
    count, feet = terms.foot_position.shape[:2]
    target = empty_target(count, feet, len(home_qpos) - 1)
    for i in range(count):
        for k in range(len(home_qpos)):
            target.qpos[i, k] = terms.base_position[i, k] if k < 3 else home_qpos[k]
        for axis in range(3):
            target.com[i, axis] = terms.com[i, axis]
        ahead = terms.world_from_trunk[i]
        face(target, home_qpos, np.arctan2(ahead[1, 0], ahead[0, 0]), i)
        for foot in range(feet):
            stand_where_it_is(target, terms, i, foot)
    return target


@compiled
def stand_where_it_is(target: Target, terms: DynamicsTerms, i: int, foot: int) -> None:
    """Let a foot of robot i stand where it is, at rest."""
    target.planted[i, foot], target.clipped[i, foot] = True, False
    for axis in range(3):
        place = terms.foot_position[i, foot, axis]
        target.foot_position[i, foot, axis], target.foothold[i, foot, axis] = place, place
        for column in range(3):
            entry = terms.world_from_foot[i, foot, axis, column]
            target.world_from_foot[i, foot, axis, column] = entry
    for k in range(6):
        target.foot_velocity[i, foot, k], target.foot_acceleration[i, foot, k] = 0.0, 0.0


@compiled
def face(target: Target, home_qpos: np.ndarray, heading: float, i: int) -> None:
    """Have the base of robot i upright as at home (nq,), turned to a heading (rad)."""
    cosine, sine = np.cos(0.5 * heading), np.sin(0.5 * heading)
    _turn_quaternion(home_qpos[3:7], cosine, sine, target.qpos[i])


@compiled
def move_along(
    target: Target, home_qpos: np.ndarray, x: float, y: float, turning: float, i: int
) -> None:
    """Have robot i move at (x, y) m/s and turn to the left (rad/s), upright as at home (nq,)."""
    target.com_velocity[i, 0], target.com_velocity[i, 1] = x, y
    target.qvel[i, 0], target.qvel[i, 1] = x, y
    # The vertical, in the axes of a base that is upright.
    w, a, b, c = home_qpos[3], home_qpos[4], home_qpos[5], home_qpos[6]
    target.qvel[i, 3] = 2.0 * (a * c - w * b) * turning
    target.qvel[i, 4] = 2.0 * (b * c + w * a) * turning
    target.qvel[i, 5] = (1.0 - 2.0 * (a * a + b * b)) * turning


@compiled
def _turn_quaternion(quaternion: np.ndarray, cosine: float, sine: float, qpos: np.ndarray) -> None:
    """Write a quaternion, turned about the vertical, given the half angle's cosine and sine."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    qpos[3], qpos[6] = cosine * w - sine * z, cosine * z + sine * w
    qpos[4], qpos[5] = cosine * x - sine * y, cosine * y + sine * x


@kernel
def in_world(heading: Heading, planned: Target, terms: DynamicsTerms) -> Target:
    """Place planned targets where the feet of N robots are.

    Args:
        heading: finds the support frame of the feet.
        planned: (N or 1) rows, seen from that frame.
        terms: where the robots are.
    """
    frame = support_frame(heading, terms)
    count, feet = terms.foot_position.shape[:2]
    target = empty_target(count, feet, terms.bias.shape[1])
    _place(frame, planned, target)
    return target


@compiled
def _place(frame: SupportFrame, planned: Target, target: Target) -> None:
    """Write a target of N robots."""
    count, feet = target.planted.shape
    for i in range(count):
        row = min(i, len(planned.qpos) - 1)
        _place_body(frame, planned, row, target, i)
        to_world = matrix(frame.world_from_support, (i,))
        for foot in range(feet):
            target.planted[i, foot] = planned.planted[row, foot]
            target.load[i, foot] = planned.load[row, foot]
            place = add(
                vector(frame.centre, (i,)),
                turn(to_world, vector(planned.foot_position, (row, foot))),
            )
            store(place, target.foot_position, (i, foot))
            store(place, target.foothold, (i, foot))
            rotation = product(to_world, matrix(planned.world_from_foot, (row, foot)))
            for axis in range(3):
                store(rotation[axis], target.world_from_foot, (i, foot, axis))
            for first in (0, 3):
                rate = turn(to_world, vector(planned.foot_velocity, (row, foot), first))
                store(rate, target.foot_velocity, (i, foot), first)
                rate = turn(to_world, vector(planned.foot_acceleration, (row, foot), first))
                store(rate, target.foot_acceleration, (i, foot), first)
        target.cycle[i] = planned.cycle[row]


@compiled
def _place_body(frame: SupportFrame, planned: Target, row: int, target: Target, i: int) -> None:
    """Place centre of mass and base; the joints are as planned."""
    to_world, centre = matrix(frame.world_from_support, (i,)), vector(frame.centre, (i,))
    store(add(centre, turn(to_world, vector(planned.com, (row,)))), target.com, (i,))
    store(turn(to_world, vector(planned.com_velocity, (row,))), target.com_velocity, (i,))
    store(turn(to_world, vector(planned.com_acceleration, (row,))), target.com_acceleration, (i,))
    for k in range(7, target.qpos.shape[1]):
        target.qpos[i, k] = planned.qpos[row, k]
    for k in range(3, target.qvel.shape[1]):
        target.qvel[i, k], target.qacc[i, k] = planned.qvel[row, k], planned.qacc[row, k]
    store(add(centre, turn(to_world, vector(planned.qpos, (row,)))), target.qpos, (i,))
    store(turn(to_world, vector(planned.qvel, (row,))), target.qvel, (i,))
    store(turn(to_world, vector(planned.qacc, (row,))), target.qacc, (i,))
    # Half the angle of the frame, which is turned about the vertical alone.
    half = 0.5 * np.arctan2(to_world[1][0], to_world[0][0])
    _turn_quaternion(planned.qpos[row, 3:7], np.cos(half), np.sin(half), target.qpos[i])
