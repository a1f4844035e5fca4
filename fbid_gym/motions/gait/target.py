"""What a gait asks of the robot at a control tick."""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.quantities import DynamicsTerms


class GaitTarget(NamedTuple):
    """What robots that walk shall do now, made online by a gait; world axes.

    Attributes:
        planted: (N, F) bool, feet that shall stand. For these the next four say where they are, at
            rest.
        foot_position: (N, F, 3) m.
        world_from_foot: (N, F, 3, 3).
        foot_velocity: (N, F, 6) m/s, rad/s; for point feet the first three count.
        foot_acceleration: (N, F, 6) m/s^2, rad/s^2.
        load: (N, F) share of its greatest force that a foot may take: 0 in the air, and on the way
            to 0 or 1 before it lifts and after it lands.
        foothold: (N, F, 3) m, where a foot in the air shall land; that of a foot that stands.
        clipped: (N, F) bool, the foothold would have to be farther away than the leg reaches.
        velocity: (N, 2) m/s, of the base.
        offset: (N, 2) m, horizontal, from the centre of mass to where it shall stand; zero while
            the robot walks.
        com_acceleration: (N, 2) m/s^2, horizontal, of the centre of mass.
        height: (N,) m, of the base.
        heading: (N,) rad, of the body.
        turning: (N,) rad/s, of the heading.
        cycle: (N,) share of the gait's cycle that has passed.
    """

    planted: np.ndarray
    foot_position: np.ndarray
    world_from_foot: np.ndarray
    foot_velocity: np.ndarray
    foot_acceleration: np.ndarray
    load: np.ndarray
    foothold: np.ndarray
    clipped: np.ndarray
    velocity: np.ndarray
    offset: np.ndarray
    com_acceleration: np.ndarray
    height: np.ndarray
    heading: np.ndarray
    turning: np.ndarray
    cycle: np.ndarray


@compiled
def standing_target(terms: DynamicsTerms) -> GaitTarget:
    """Return a target of feet that stand where they are; how the body moves is not yet said."""
    count, feet = terms.foot_position.shape[:2]
    return GaitTarget(
        planted=np.ones((count, feet), np.bool_),
        foot_position=terms.foot_position.copy(),
        world_from_foot=terms.world_from_foot.copy(),
        foot_velocity=np.zeros((count, feet, 6)),
        foot_acceleration=np.zeros((count, feet, 6)),
        load=np.ones((count, feet)),
        foothold=terms.foot_position.copy(),
        clipped=np.zeros((count, feet), np.bool_),
        velocity=np.empty((count, 2)),
        offset=np.zeros((count, 2)),
        com_acceleration=np.empty((count, 2)),
        height=np.empty(count),
        heading=np.empty(count),
        turning=np.empty(count),
        cycle=np.empty(count),
    )
