"""Observations that all tasks share, and the test for a fall."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.contacts import point_velocities
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, Heading, RobotState, SupportFrame
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.observation import FORCES, KNOWN, MEASURED, Group
from fbid_gym.tasks.outcome import Posture

FALLEN_HEIGHT = 0.6
"""Share of the robot's height in its task, `Body.size` less `Body.lowered`, below which it counts
as fallen."""

FALLEN_TILT = 60.0
"""Tilt of the base (degrees) beyond which the robot counts as fallen."""

TOUCHING_LOAD = 0.01
"""Share of the robot's weight that a point must carry to count as in contact."""

_LEAST_UPRIGHT = float(np.cos(np.radians(FALLEN_TILT)))


class Units(NamedTuple):
    """Units in which robots of all sizes are comparable.

    Attributes:
        length: m.
        speed: m/s, sqrt(g * length).
        rate: 1/s, sqrt(g / length).
        torque: N·m, mean of the joints' limits.
        weight: N.
    """

    length: float
    speed: float
    rate: float
    torque: float
    weight: float

    @classmethod
    def of(cls, robot: Robot, length: float) -> "Units":
        """Measure a robot by a length, m."""
        speed, rate = np.sqrt(robot.gravity * length), np.sqrt(robot.gravity / length)
        torque = float(robot.torque_limit.mean())
        return cls(length, float(speed), float(rate), torque, robot.weight)


@dataclass(frozen=True, eq=False)
class Body:
    """A robot as its tasks see it.

    Attributes:
        robot: the robot.
        stance: it at home.
        lowered: m, most by which the task has it walk lower than it stands at home.
    """

    robot: Robot
    stance: Stance
    lowered: float

    @classmethod
    def of(cls, robot: Robot, lowered: float = 0.0) -> "Body":
        """Measure a robot's home stance; `lowered` as above."""
        return cls(robot, Stance.of(robot), lowered)

    @cached_property
    def home_height(self) -> float:
        """Height of the base above its feet at home, m."""
        return float(self.stance.home_base[2])

    @property
    def size(self) -> float:
        """Size of the robot, m, the unit of lengths: `Stance.size`."""
        return self.stance.size

    @cached_property
    def units(self) -> Units:
        """Units for the errors of a standing robot, from its size."""
        return Units.of(self.robot, self.size)

    def height(self, share: np.ndarray) -> np.ndarray:
        """Return the height of a base, m, that is lower than at home as a robot of a share is."""
        return self.size * share + (self.home_height - self.size)

    @cached_property
    def frame_groups(self) -> dict[str, Group]:
        """Groups of an observation: where the base is, seen from the feet, and how it moves."""
        home = self.stance.home_base
        return {
            "base": Group.of(
                "base {} from home (m, support frame)",
                "xyz",
                10.0,
                lambda m: m.outcome.posture.base - home,
            ),
            "up": UP,
            "velocity": Group.of(
                "base velocity {} (m/s, support frame)",
                "xyz",
                100.0,
                lambda m: m.outcome.posture.velocity,
            ),
            "angular_velocity": ANGULAR_VELOCITY,
        }

    @cached_property
    def limb_groups(self) -> dict[str, Group]:
        """Groups of an observation: joints, and loads on the contact points."""
        robot, weight = self.robot, self.robot.weight
        joints, home, limit = robot.joint_names, robot.home_qpos[7:], robot.torque_limit
        points = [str(point) for point in range(robot.num_points)]
        return {
            "joint_position": Group.of(
                "{} position from home (rad)",
                joints,
                10.0,
                lambda m: m.outcome.state.qpos[:, 7:] - home,
                MEASURED,
            ),
            "joint_velocity": Group.of(
                "{} velocity (rad/s)",
                joints,
                100.0,
                lambda m: m.outcome.state.qvel[:, 6:],
                MEASURED,
            ),
            "torque": Group.of(
                "{} last torque (share of its limit)",
                joints,
                1.0,
                lambda m: m.outcome.torque / limit,
                KNOWN,
            ),
            "load": Group.of(
                "normal force on point {} (share of the weight)",
                points,
                100.0,
                lambda m: m.outcome.state.contact_force[:, :, 2] / weight,
                FORCES,
            ),
        }

    @property
    def groups(self) -> dict[str, Group]:
        """Groups of an observation: all that is seen of the robot itself."""
        return self.frame_groups | self.limb_groups

    def posture(self, state: RobotState, terms: DynamicsTerms) -> Posture:
        """Return the posture of robots."""
        return _measure(self._standing, self.stance.geometry, self.stance.heading, state, terms)

    @cached_property
    def _standing(self) -> "_Standing":
        return _Standing(
            touching_force=TOUCHING_LOAD * self.robot.weight,
            above=self.size - self.home_height,
            low=FALLEN_HEIGHT * (self.size - self.lowered),
        )


UP = Group.of(
    "up direction {} (base frame)", "xyz", 1.0, lambda m: m.outcome.terms.world_from_base[:, 2]
)
"""Where the vertical is, seen from the base."""

ANGULAR_VELOCITY = Group.of(
    "base angular velocity {} (rad/s, base frame)",
    "xyz",
    100.0,
    lambda m: m.outcome.state.qvel[:, 3:6],
)
"""How fast the base turns."""


class _Standing(NamedTuple):
    """Limits within which a robot counts as standing."""

    touching_force: float  # N, of a point that counts as in contact
    above: float  # m, from the base up to the robot's size, at home
    low: float  # m, height of that point below which the robot has fallen


@kernel
def _measure(
    standing: _Standing,
    geometry: ContactGeometry,
    heading: Heading,
    state: RobotState,
    terms: DynamicsTerms,
) -> Posture:
    """Return the posture of robots."""
    frame, (count, points) = support_frame(heading, terms), state.contact_force.shape[:2]
    point_velocity = point_velocities(geometry, terms)
    base, velocity, upright = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    touching, grounded = np.empty((count, points), np.bool_), np.empty(count)
    slip, fallen = np.empty(count), np.empty(count, np.bool_)
    posture = Posture(base, velocity, upright, touching, grounded, slip, fallen)
    _judge(standing, frame, point_velocity, state, terms, posture)
    return posture


@compiled
def _judge(
    standing: _Standing,
    frame: SupportFrame,
    point_velocity: np.ndarray,
    state: RobotState,
    terms: DynamicsTerms,
    posture: Posture,
) -> None:
    """Write the posture of robots."""
    base, velocity, upright, touching, grounded, slip, fallen = posture
    count, points = touching.shape
    for i in range(count):
        for k in range(3):
            base[i, k], velocity[i, k] = 0.0, 0.0
            for axis in range(3):
                offset = terms.base_position[i, axis] - frame.centre[i, axis]
                base[i, k] += frame.world_from_support[i, axis, k] * offset
                velocity[i, k] += frame.world_from_support[i, axis, k] * state.qvel[i, axis]
        upright[i] = terms.world_from_trunk[i, 2, 2]
        top = base[i, 2] + standing.above * upright[i]
        fallen[i] = top < standing.low or upright[i] < _LEAST_UPRIGHT
        total, down = 0.0, 0
        for point in range(points):
            touching[i, point] = state.contact_force[i, point, 2] > standing.touching_force
            if touching[i, point]:
                moving = point_velocity[i, point]
                total += np.sqrt(dot(moving, moving))
                down += 1
        grounded[i] = down / points
        slip[i] = total / max(down, 1)
