"""Online gaits of any robot: what walking on point feet and on flat feet have in common."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fbid_gym.errors import UnknownOptionError
from fbid_gym.motions.gait import flat_feet, point_feet, walking
from fbid_gym.motions.gait.biped import biped_gait
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.quadruped import quadruped_gait
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import DynamicsTerms, Memory
from fbid_gym.robots import Robot


class Gait(Protocol):
    """How a robot walks: immutable, for any number of robots of one kind."""

    @property
    def omega(self) -> float:
        """Rate at which the robot falls, 1/s: what its gains and times are derived from."""
        ...

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Return what is remembered of robots that stand where they are."""
        ...

    def target(
        self,
        command: GaitCommand,
        terms: DynamicsTerms,
        contact_force: np.ndarray,
        memory: Memory,
    ) -> GaitTarget:
        """Go on by one control tick, and say what the robots shall do.

        Args:
            command: where to go.
            terms: where the robots are.
            contact_force: (N, P, 3) N, world, on the contact points.
            memory: of the robots; updated.
        """
        ...


def gait_of(robot: Robot, hz: int, name: str | None = None) -> Gait:
    """Return the gait of a robot: on four point feet, or on two flat ones.

    Args:
        robot: who walks.
        hz: control ticks per second.
        name: of a quadruped's gait; a trot by default. A biped has one gait only, "walk".

    Raises:
        UnknownOptionError: no such gait.
        RobotError: the robot has other feet.
    """
    biped = robot.num_feet == 2
    known = ["walk"] if biped else [*PATTERNS]
    if name is not None and name not in known:
        raise UnknownOptionError("gait of a biped" if biped else "gait", name, known)
    if biped:
        return FlatFeet(biped_gait(robot), 1.0 / hz)
    return PointFeet(quadruped_gait(robot, name or default_gait(robot)), 1.0 / hz)


def default_gait(robot: Robot) -> str:
    """Return the name of the gait that a robot walks unless told otherwise."""
    return "walk" if robot.num_feet == 2 else "trot"


@dataclass(frozen=True, eq=False)
class PointFeet:
    """A gait on point feet; a `Gait`.

    Attributes:
        gait: its constants.
        tick: s, of the control.
    """

    gait: point_feet.PointFootGait
    tick: float

    @property
    def omega(self) -> float:
        """See `Gait.omega`."""
        return self.gait.omega

    def memory(self, terms: DynamicsTerms) -> Memory:
        """See `Gait.memory`."""
        return point_feet.standing(_heading(terms), terms.foot_position)._asdict()

    def target(
        self,
        command: GaitCommand,
        terms: DynamicsTerms,
        contact_force: np.ndarray,
        memory: Memory,
    ) -> GaitTarget:
        """See `Gait.target`."""
        own = point_feet.GaitMemory(*(memory[name] for name in point_feet.GaitMemory._fields))
        return point_feet.walk(self.gait, command, terms, contact_force, self.tick, own)


@dataclass(frozen=True, eq=False)
class FlatFeet:
    """A gait on two flat feet; a `Gait`.

    Attributes:
        gait: its constants.
        tick: s, of the control.
    """

    gait: walking.FlatFootGait
    tick: float

    @property
    def omega(self) -> float:
        """See `Gait.omega`."""
        return self.gait.omega

    def memory(self, terms: DynamicsTerms) -> Memory:
        """See `Gait.memory`."""
        return walking.standing(_heading(terms))._asdict()

    def target(
        self,
        command: GaitCommand,
        terms: DynamicsTerms,
        contact_force: np.ndarray,
        memory: Memory,
    ) -> GaitTarget:
        """See `Gait.target`."""
        own = walking.GaitMemory(*(memory[name] for name in walking.GaitMemory._fields))
        found = flat_feet.walk(self.gait, command, terms, contact_force, self.tick, own)
        foothold = terms.foot_position.copy()
        swinging = ~found.planted
        foothold[swinging] = np.broadcast_to(found.foothold[:, None], foothold.shape)[swinging]
        heading, walks = found.heading, own.phase != walking.STAND
        cosine, sine = np.cos(heading), np.sin(heading)
        velocity = command.velocity
        ahead, left = (velocity[:, :2] * walks[:, None]).T
        return GaitTarget(
            planted=found.planted,
            foot_position=found.foot_position,
            world_from_foot=found.world_from_foot,
            foot_velocity=found.foot_velocity,
            foot_acceleration=found.foot_acceleration,
            load=found.planted.astype(float),
            foothold=foothold,
            clipped=swinging & found.clipped[:, None],
            velocity=np.stack([cosine * ahead - sine * left, sine * ahead + cosine * left], axis=1),
            com_acceleration=found.com_acceleration,
            height=found.height,
            heading=heading,
            turning=velocity[:, 2] * walks,
            cycle=found.cycle,
        )


def _heading(terms: DynamicsTerms) -> np.ndarray:
    """(N,) rad, of the bases."""
    return np.arctan2(terms.world_from_base[:, 1, 0], terms.world_from_base[:, 0, 0])
