"""Online gaits of any robot: the interface of gaits on point feet and on flat feet."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from fbid_gym.motions.gait import biped, flat_feet, point_feet, quadruped
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.motions.target import standing_target
from fbid_gym.options import Choice
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.robots import Robot

_PREFIX = "target_"
_asked = itemgetter(*(_PREFIX + name for name in Target._fields))


@dataclass(frozen=True, eq=False)
class Gait:
    """The interface of gaits: immutable, for any number of robots of one kind."""

    # Of the gait, on point feet or on flat ones.
    constants: quadruped.PointFootGait | biped.FlatFootGait
    tick: float  # s, of the control
    # Type of its memory, a named tuple of arrays.
    remembered: type[quadruped.PointGaitMemory] | type[biped.FlatGaitMemory]
    walk: Callable[..., None]  # the kernel, see `point_feet.walk`
    friction: float = 0.0  # see `quadruped.least_friction`; not asked for on soles

    @cached_property
    def _own(self) -> Callable[[Memory], tuple[np.ndarray, ...]]:
        return itemgetter(*self.remembered._fields)

    @property
    def omega(self) -> float:
        """Rate at which the robot falls, 1/s; gains and times derive from it."""
        return self.constants.omega

    @property
    def height(self) -> float:
        """Height of the base above level ground, m, unless it is lowered."""
        return self.constants.height

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Return the memory of robots that stand where they are, their target included."""
        rotation = terms.world_from_trunk
        heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
        target = standing_target(terms, self.constants.home)._asdict()
        own: Memory = self.remembered.standing(heading, terms.foot_position)._asdict()
        return own | {_PREFIX + name: value for name, value in target.items()}

    def advance(
        self, command: GaitCommand, terms: DynamicsTerms, contact_force: np.ndarray, memory: Memory
    ) -> Target:
        """Advance by one control tick; return the robots' target, in the arrays of their memory.

        The forces on the contact points are (N, P, 3) N, world. Updates the memory.
        """
        own = self.remembered(*self._own(memory))
        target = self.target(memory)
        self.walk(self.constants, command, terms, contact_force, self.tick, own, target)
        return target

    def target(self, memory: Memory) -> Target:
        """Return the robots' target, in the arrays of their memory."""
        return Target(*_asked(memory))


def gait_of(
    robot: Robot,
    hz: int,
    name: str | None = None,
    integral_time: float = 0.0,
    period: float | None = None,
) -> Gait:
    """Return the gait of a robot: on four point feet, or on two flat ones.

    Without a name it is the `default_gait`. Errors of the velocity are made up for in an
    `integral_time`, see `Trim`, or last if that is 0. The period of a cycle is in units of
    sqrt(h / g); without one it is that of the gait.

    Raises:
        UnknownOptionError: no such gait.
        RobotError: the robot has other feet.
    """
    name, tick = default_gait(robot) if name is None else name, 1.0 / hz
    on_soles = robot.num_feet == 2
    Choice(gaits_of(robot)).check("gait of a biped" if on_soles else "gait", name)
    if on_soles:
        walk = biped.biped_gait(robot, name, integral_time, period)
        return Gait(walk, tick, biped.FlatGaitMemory, flat_feet.walk)
    trot = quadruped.quadruped_gait(robot, name, integral_time, period)
    friction = quadruped.least_friction(robot, trot)
    return Gait(trot, tick, quadruped.PointGaitMemory, point_feet.walk, friction)


def gaits_of(robot: Robot) -> tuple[str, ...]:
    """Return the names of a robot's gaits."""
    return tuple(biped.PATTERNS if robot.num_feet == 2 else PATTERNS)


def default_gait(robot: Robot) -> str:
    """Return the name of the gait that a robot walks unless told otherwise."""
    return "walk" if robot.num_feet == 2 else "trot"


def default_period(robot: Robot, name: str) -> float:
    """Return the time that a cycle of a robot's gait takes unless told, in units of sqrt(h / g)."""
    return biped.default_cycle(robot, name) if robot.num_feet == 2 else PATTERNS[name].period
