"""Tracking: follow a reference motion, at a commanded speed where it has one, despite pushes."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.dynamics.rotations import rotation_of
from fbid_gym.dynamics.state import Outcome
from fbid_gym.dynamics.support import Support
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.body import Body, bell, level, weighted
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start

REWARD_WEIGHTS = {
    "joints": 0.3,
    "base": 0.2,
    "upright": 0.15,
    "velocity": 0.15,
    "contact": 0.1,
    "torque": 0.1,
}
"""Each reward term lies in [0, weight]; they sum to 1."""


class Motion(Protocol):
    """A motion that repeats itself after `period` control ticks."""

    @property
    def period(self) -> int:
        """Control ticks."""
        ...

    def reference(self, tick: np.ndarray, speed: np.ndarray) -> Reference:
        """Return what N robots shall do at ticks (N,), moving at speeds (N,) m/s."""
        ...


@dataclass(frozen=True, eq=False)
class Tracking:
    """The task, for one robot and one motion; a `Task`.

    Attributes:
        body: which robot moves.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins: anywhere in the motion.
        motion: what to follow.
        speed_range: (least, most) m/s, commanded forward speed, constant in an episode.
    """

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    motion: Motion
    speed_range: tuple[float, float]

    @classmethod
    def of(
        cls,
        robot: Robot,
        seconds: float,
        hz: int,
        pushes: Pushes,
        start: Start,
        motion: Motion,
        speed_range: tuple[float, float] = (0.0, 0.0),
    ) -> "Tracking":
        """Build the task; the arguments are its attributes."""
        if not -np.inf < speed_range[0] <= speed_range[1] < np.inf:
            raise InvalidValueError("speed_range", speed_range, "a pair least <= most of m/s")
        return cls(Body.of(robot), seconds, hz, pushes, start, motion, speed_range)

    @property
    def support(self) -> Support:
        """The home stance."""
        return self.body.support

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of the observation."""
        robot = self.body.robot
        return (
            "sine of the phase of the motion (1)",
            "cosine of the phase of the motion (1)",
            "commanded speed (m/s)",
            *(f"{foot} planned to stand (1)" for foot in robot.foot_names),
            *(f"base {axis} of the reference from home (m, support frame)" for axis in "xyz"),
            *(f"{joint} reference from home (rad)" for joint in robot.joint_names),
            *self.body.observation_names,
        )

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of the observation, (O,); observations are clipped to it."""
        robot = self.body.robot
        own = [1.0, 1.0, 10.0, *[1.0] * robot.num_feet, *[10.0] * (3 + robot.num_joints)]
        return np.concatenate([own, self.body.observation_bound])

    def draw(self, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Draw all that chance decides about one episode."""
        robot = self.body.robot
        phase, speed = rng.integers(self.motion.period), rng.uniform(*self.speed_range)
        reference = self.motion.reference(np.array([phase]), np.array([speed]))
        qpos, qvel = self.start.draw(robot, reference.qpos[0], reference.qvel[0], rng)
        # Where on the ground an episode begins is not the motion's to say.
        qpos[:2] = robot.home_qpos[:2]
        start, force = self.pushes.draw(rng, self.seconds, self.hz)
        return {
            "qpos": qpos,
            "qvel": qvel,
            "phase": np.array(phase),
            "speed": np.array(speed),
            "push_start": start,
            "push_force": force,
        }

    def push(self, plan: dict[str, np.ndarray], tick: np.ndarray) -> np.ndarray:
        """Return the force on each base: (..., N, 3) N, world, for ticks (..., N)."""
        return self.pushes.at(plan["push_start"], plan["push_force"], tick, self.hz)

    def reference(self, plan: dict[str, np.ndarray], tick: np.ndarray) -> Reference:
        """Return what the robots shall do: the motion at each one's phase and speed."""
        return self.motion.reference(plan["phase"] + tick, plan["speed"])

    def observe(self, outcome: Outcome, plan: dict[str, np.ndarray]) -> np.ndarray:
        """Return what the policy sees: (N, O), named by `observation_names`."""
        robot, tick = self.body.robot, outcome.state.tick
        qpos, planted = self._wanted(self.reference(plan, tick))
        asked = np.empty((len(tick), 6 + robot.num_feet + robot.num_joints))
        _ask(
            *(plan["phase"] + tick, 2.0 * np.pi / self.motion.period, plan["speed"]),
            *(qpos, planted, self.support.home_base, robot.home_qpos, asked),
        )
        return np.concatenate([asked, self.body.observe(outcome)], axis=1)

    def _wanted(self, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
        """Postures (N, nq) and planted feet (N, F), or one row of them that stands for all."""
        planted = reference.planted
        if planted is None:
            planted = np.ones((1, self.body.robot.num_feet), bool)
        return np.ascontiguousarray(reference.qpos), planted

    def reward(
        self, outcome: Outcome, plan: dict[str, np.ndarray]
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step; see `Task.reward`."""
        body, posture = self.body, self.body.posture(outcome)
        reference = self.reference(plan, outcome.state.tick)
        wanted, planted = self._wanted(reference)
        qpos, wanted_qvel = map(np.ascontiguousarray, (outcome.state.qpos, reference.qvel))
        count = len(posture.slip)
        joint_rms, share = np.empty(count), np.empty((len(REWARD_WEIGHTS), count))
        _judge(
            *(posture.base, posture.velocity, posture.upright, posture.touching, posture.slip),
            *(outcome.terms.base_rotation, qpos, wanted, wanted_qvel),
            *(planted, body.geometry.foot_of_point, outcome.torque_square),
            body.home_height,
            body.mean_torque_limit,
            *(joint_rms, share),
        )
        height = posture.base[:, 2]
        metrics = {
            "height": height,
            "height_command": np.broadcast_to(wanted[:, 2], len(height)),
            "height_error": height - wanted[:, 2],
            "joint_error": joint_rms,
            "speed": posture.velocity[:, 0],
            "speed_command": plan["speed"].copy(),
            "torque_rms": np.sqrt(outcome.torque_square),
            "power": outcome.power,
            "slip": posture.slip,
        }
        return weighted(share, REWARD_WEIGHTS), metrics

    def fallen(self, outcome: Outcome) -> np.ndarray:
        """Return which robots lie: (N,) bool."""
        return self.body.fallen(outcome)


@kernel
def _ask(
    phase: np.ndarray,
    angle: float,
    speed: np.ndarray,
    wanted: np.ndarray,
    planted: np.ndarray,
    home_base: np.ndarray,
    home_qpos: np.ndarray,
    asked: np.ndarray,
) -> None:
    """Write what the policy sees of the motion, the first columns of `Tracking.observe`.

    Args:
        phase: (N,) ticks since the motion began.
        angle: rad per tick.
        speed: (N,) m/s.
        wanted: (N, nq) or (1, nq), of the reference.
        planted: (N, F) or (1, F), of the reference.
        home_base: (3,) m, of the support.
        home_qpos: (nq,) of the robot.
        asked: (N, 6 + F + n).
    """
    feet, joints = planted.shape[1], wanted.shape[1] - 7
    for i in range(len(asked)):
        row, column = min(i, len(wanted) - 1), min(i, len(planted) - 1)
        asked[i, 0], asked[i, 1] = np.sin(phase[i] * angle), np.cos(phase[i] * angle)
        asked[i, 2] = speed[i]
        for foot in range(feet):
            asked[i, 3 + foot] = planted[column, foot]
        for k in range(3):
            asked[i, 3 + feet + k] = wanted[row, k] - home_base[k]
        for j in range(joints):
            asked[i, 6 + feet + j] = wanted[row, 7 + j] - home_qpos[7 + j]


@kernel
def _judge(
    base: np.ndarray,
    velocity: np.ndarray,
    upright: np.ndarray,
    touching: np.ndarray,
    slip: np.ndarray,
    base_rotation: np.ndarray,
    qpos: np.ndarray,
    wanted_qpos: np.ndarray,
    wanted_qvel: np.ndarray,
    planted: np.ndarray,
    foot_of_point: np.ndarray,
    torque_square: np.ndarray,
    size: float,
    torque_limit: float,
    joint_rms: np.ndarray,
    share: np.ndarray,
) -> None:
    """Write the joints' errors (N,) rad and the shares (6, N) of the terms of the reward.

    The other arguments are those of `Posture`, `RobotState` and `Reference` (N rows or one), the
    mean squares of the torques, the home height and the mean torque limit.
    """
    target, points = np.empty((3, 3)), touching.shape[1]
    for i in range(len(base)):
        row = min(i, len(wanted_qpos) - 1)
        square, drift, rush = 0.0, 0.0, 0.0
        for j in range(7, qpos.shape[1]):
            square += (wanted_qpos[row, j] - qpos[i, j]) ** 2
        for k in range(3):
            drift += (base[i, k] - wanted_qpos[row, k]) ** 2
        for k in range(2):
            rush += (velocity[i, k] - wanted_qvel[row, k]) ** 2
        joint_rms[i] = np.sqrt(square / (qpos.shape[1] - 7))
        # The angle between the vertical as base and reference see it: heading left out.
        rotation_of(wanted_qpos[row, 3:7], target)
        as_planned = 0
        for point in range(points):
            stands = planted[min(i, len(planted) - 1), foot_of_point[point]]
            as_planned += touching[i, point] == stands
        # Lengths scale with the robot.
        share[0, i] = bell(joint_rms[i], 0.1)
        share[1, i] = bell(np.sqrt(drift), 0.06 * size)
        share[2, i] = level(dot(target[2], base_rotation[i, 2]))
        share[3, i] = bell(np.sqrt(rush), 0.3 * size)
        share[4, i] = as_planned / points * bell(slip[i], 0.1)
        share[5, i] = bell(np.sqrt(torque_square[i]) / torque_limit, 0.3)
