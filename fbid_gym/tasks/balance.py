"""Balance: stand on all feet, follow a commanded base height, survive random pushes."""

from dataclasses import dataclass, field

import numpy as np

from fbid_gym.dynamics.contacts import ContactGeometry, point_velocities
from fbid_gym.dynamics.state import Outcome
from fbid_gym.dynamics.support import Support
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions import Reference, home_reference
from fbid_gym.robots import Robot
from fbid_gym.tasks.pushes import Pushes

REWARD_WEIGHTS = {
    "height": 0.25,
    "upright": 0.15,
    "position": 0.15,
    "stillness": 0.15,
    "contact": 0.15,
    "torque": 0.15,
}
"""Each reward term lies in [0, weight]; they sum to 1."""

FALLEN_HEIGHT = 0.6
"""Share of the home height below which the robot counts as fallen."""

FALLEN_TILT = 60.0
"""Tilt of the base (degrees) beyond which the robot counts as fallen."""

TOUCH = 0.01
"""Share of the robot's weight that a point must carry to count as in contact."""


@dataclass(frozen=True, eq=False)
class Balance:
    """The task, for one robot.

    Attributes:
        robot: which robot stands.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        height_range: (least, most) commanded base height, as shares of the home height.
        height_interval: (least, most) s from one command to the next.
        joint_noise: rad (m for slides), largest offset of each joint from home at the start.
        velocity_noise: m/s and rad/s, largest velocity of each coordinate at the start.
    """

    robot: Robot
    seconds: float
    hz: int
    pushes: Pushes
    height_range: tuple[float, float] = (0.94, 1.0)
    height_interval: tuple[float, float] = (2.0, 4.0)
    joint_noise: float = 0.02
    velocity_noise: float = 0.05
    support: Support = field(init=False)
    geometry: ContactGeometry = field(init=False)
    home: Reference = field(init=False)

    def __post_init__(self) -> None:
        """Check the ranges and measure the home stance."""
        if not FALLEN_HEIGHT < self.height_range[0] <= self.height_range[1] < 1.5:
            raise InvalidValueError(
                "height_range",
                self.height_range,
                f"a pair {FALLEN_HEIGHT} < least <= most < 1.5, shares of the home height",
            )
        if not 0.0 < self.height_interval[0] <= self.height_interval[1] < np.inf:
            raise InvalidValueError(
                "height_interval", self.height_interval, "a pair 0 < least <= most of s"
            )
        for name, value in (
            ("joint_noise", self.joint_noise),
            ("velocity_noise", self.velocity_noise),
        ):
            if not 0.0 <= value <= 1.0:
                raise InvalidValueError(name, value, "a number from 0 to 1")
        object.__setattr__(self, "support", Support.of(self.robot))
        object.__setattr__(self, "geometry", ContactGeometry.of(self.robot))
        object.__setattr__(self, "home", home_reference(self.robot))

    @property
    def home_height(self) -> float:
        """Height of the base above its feet at home, m."""
        return float(self.support.home_base[2])

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of the observation."""
        joints, points = self.robot.joint_names, self.geometry.num_points
        return (
            "commanded height - home height (m)",
            *(f"base {axis} from home (m, support frame)" for axis in "xyz"),
            *(f"up direction {axis} (base frame)" for axis in "xyz"),
            *(f"base velocity {axis} (m/s, support frame)" for axis in "xyz"),
            *(f"base angular velocity {axis} (rad/s, base frame)" for axis in "xyz"),
            *(f"{joint} position from home (rad)" for joint in joints),
            *(f"{joint} velocity (rad/s)" for joint in joints),
            *(f"{joint} last torque (share of its limit)" for joint in joints),
            *(f"normal force on point {point} (share of the weight)" for point in range(points)),
        )

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of the observation, (O,); observations are clipped to it."""
        joints, points = self.robot.num_joints, self.geometry.num_points
        sizes = {10.0: 4, 1.0: 3, 100.0: 6}  # m; of a unit vector; m/s and rad/s
        return np.concatenate(
            [
                *(np.full(count, size) for size, count in sizes.items()),
                np.full(joints, 10.0),
                np.full(joints, 100.0),
                np.ones(joints),
                np.full(points, 100.0),
            ]
        )

    def draw(self, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Draw all that chance decides about one episode.

        The base starts upright above its feet with a random heading; its height is for the
        simulation to settle, since it depends on the terrain.
        """
        robot = self.robot
        qpos = robot.home_qpos.copy()
        heading = rng.uniform(-np.pi, np.pi)
        qpos[3:7] = _turned(heading, robot.home_qpos[3:7])
        noise = rng.uniform(-self.joint_noise, self.joint_noise, size=robot.num_joints)
        qpos[7:] = np.clip(qpos[7:] + noise, robot.joint_range[:, 0], robot.joint_range[:, 1])
        qvel = rng.uniform(-self.velocity_noise, self.velocity_noise, size=robot.nv)

        start, force = self.pushes.draw(rng, self.seconds, self.hz)
        count = int(np.ceil(self.seconds / self.height_interval[0])) + 1
        command_times = np.cumsum(rng.uniform(*self.height_interval, size=count))
        return {
            "qpos": qpos,
            "qvel": qvel,
            "push_start": start,
            "push_force": force,
            "command_start": np.concatenate([[0.0], command_times[:-1]]) * self.hz,
            "command": self.home_height * rng.uniform(*self.height_range, size=count),
        }

    def push(self, plan: dict[str, np.ndarray], tick: np.ndarray) -> np.ndarray:
        """Return the force on each base: (..., N, 3) N, world, for ticks (..., N)."""
        return self.pushes.at(plan["push_start"], plan["push_force"], tick, self.hz)

    def reference(self, plan: dict[str, np.ndarray], tick: np.ndarray) -> Reference:
        """Return the motion that the action layers follow: the home stance.

        The commanded height is not among it: to follow that is the policy's part.
        """
        return self.home

    def command(self, plan: dict[str, np.ndarray], tick: np.ndarray) -> np.ndarray:
        """Return the commanded height of each base above its feet: (N,) m."""
        index = (plan["command_start"] <= tick[:, None]).sum(axis=1) - 1
        return plan["command"][np.arange(len(tick)), index]

    def observe(self, outcome: Outcome, plan: dict[str, np.ndarray]) -> np.ndarray:
        """Return what the policy sees: (N, O), named by `observation_names`."""
        robot, terms, state, frame = self.robot, outcome.terms, outcome.state, outcome.frame
        base = np.vecmat(terms.base_position - frame.centre, frame.rotation)
        return np.concatenate(
            [
                self.command(plan, state.tick)[:, None] - self.home_height,
                base - self.support.home_base,
                terms.base_rotation[:, 2],
                np.vecmat(state.qvel[:, :3], frame.rotation),
                state.qvel[:, 3:6],
                state.qpos[:, 7:] - robot.home_qpos[7:],
                state.qvel[:, 6:],
                outcome.torque / robot.torque_limit,
                state.contact_force[:, :, 2] / robot.weight,
            ],
            axis=1,
        )

    def reward(
        self, outcome: Outcome, plan: dict[str, np.ndarray]
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step.

        Returns:
            terms: name -> (N,), each in [0, its weight].
            metrics: name -> (N,) physical quantities for evaluation.
        """
        robot, terms, state, frame = self.robot, outcome.terms, outcome.state, outcome.frame
        base = np.vecmat(terms.base_position - frame.centre, frame.rotation)
        command = self.command(plan, state.tick)
        error = base[:, 2] - command
        drift = base[:, :2] - self.support.home_base[:2]
        # 1 - cos(tilt) from the angle between the base's and the world's up direction at home.
        tilt = 1.0 - self._upright(terms.base_rotation)
        touching = state.contact_force[:, :, 2] > TOUCH * robot.weight
        velocity = point_velocities(self.geometry, terms)
        speed = np.sqrt(np.vecdot(velocity, velocity))
        slip = (speed * touching).sum(axis=1) / np.maximum(touching.sum(axis=1), 1)

        motion, size = state.qvel[:, :6], self.home_height  # lengths scale with the robot
        share = {
            "height": _bell(error, 0.03 * size),
            "upright": np.exp(-tilt / (1.0 - np.cos(0.2))),
            "position": _bell(np.sqrt(np.vecdot(drift, drift)), 0.06 * size),
            "stillness": _bell(np.sqrt(np.vecdot(motion, motion)), 0.5),
            "contact": touching.mean(axis=1) * _bell(slip, 0.1),
            "torque": _bell(np.sqrt(outcome.torque_square) / robot.torque_limit.mean(), 0.3),
        }
        rewards = {name: REWARD_WEIGHTS[name] * value for name, value in share.items()}
        metrics = {
            "height": base[:, 2],
            "height_command": command,
            "height_error": error,
            "torque_rms": np.sqrt(outcome.torque_square),
            "power": outcome.power,
            "slip": slip,
        }
        return rewards, metrics

    def fallen(self, outcome: Outcome) -> np.ndarray:
        """Return which robots lie: (N,) bool."""
        terms = outcome.terms
        height = terms.base_position[:, 2] - outcome.frame.centre[:, 2]
        low = height < FALLEN_HEIGHT * self.home_height
        return low | (self._upright(terms.base_rotation) < np.cos(np.radians(FALLEN_TILT)))

    def _upright(self, rotation: np.ndarray) -> np.ndarray:
        """Cosine of the angle between the base's up direction and the vertical: (N,)."""
        return np.vecdot(rotation[:, 2], self.support.home_base_rotation[2])


def _bell(value: np.ndarray, scale: float) -> np.ndarray:
    """1 at zero, 1/e at `scale`."""
    return np.exp(-np.square(value / scale))


def _turned(heading: float, quaternion: np.ndarray) -> np.ndarray:
    """Turn an orientation (w, x, y, z) about the world's vertical by `heading` rad."""
    cosine, sine = np.cos(heading / 2.0), np.sin(heading / 2.0)
    w, x, y, z = quaternion
    return np.array(
        [
            cosine * w - sine * z,
            cosine * x - sine * y,
            cosine * y + sine * x,
            cosine * z + sine * w,
        ]
    )
