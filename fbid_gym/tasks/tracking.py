"""Tracking: follow a reference motion, at a commanded speed where it has one, despite pushes."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.state import Outcome
from fbid_gym.dynamics.support import Support
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot
from fbid_gym.tasks.body import Body, bell, weighted
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
        wanted = self.reference(plan, tick)
        angle = (plan["phase"] + tick) * (2.0 * np.pi / self.motion.period)
        planted = np.ones((1, robot.num_feet)) if wanted.planted is None else wanted.planted
        columns = (
            np.sin(angle)[:, None],
            np.cos(angle)[:, None],
            plan["speed"][:, None],
            planted,
            wanted.qpos[:, :3] - self.support.home_base,
            wanted.qpos[:, 7:] - robot.home_qpos[7:],
        )
        rows = [np.broadcast_to(c, (len(tick), c.shape[1])) for c in columns]
        return np.concatenate([*rows, self.body.observe(outcome)], axis=1)

    def reward(
        self, outcome: Outcome, plan: dict[str, np.ndarray]
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step; see `Task.reward`."""
        body, state, frame = self.body, outcome.state, outcome.frame
        wanted = self.reference(plan, state.tick)
        joint_error = wanted.qpos[:, 7:] - state.qpos[:, 7:]
        joint_rms = np.sqrt(np.vecdot(joint_error, joint_error) / body.robot.num_joints)
        base = body.base(outcome)
        drift = base - wanted.qpos[:, :3]
        velocity = np.vecmat(state.qvel[:, :3], frame.rotation)
        rush = velocity[:, :2] - wanted.qvel[:, :2]
        # 1 - cos(angle) between the reference's and the real orientation, heading left out.
        up = quaternion_to_matrix(wanted.qpos[:, 3:7])[:, 2]
        tilt = 1.0 - np.vecdot(up, outcome.terms.base_rotation[:, 2])

        touching = body.touching(outcome)
        slip = body.slip(outcome, touching)
        planted = True if wanted.planted is None else wanted.planted[:, body.geometry.foot_of_point]
        as_planned = (touching == planted).mean(axis=1)
        size = body.home_height  # lengths scale with the robot
        rms, limit = np.sqrt(outcome.torque_square), body.robot.torque_limit.mean()
        share = {
            "joints": bell(joint_rms, 0.1),
            "base": bell(np.sqrt(np.vecdot(drift, drift)), 0.06 * size),
            "upright": np.exp(-tilt / (1.0 - np.cos(0.2))),
            "velocity": bell(np.sqrt(np.vecdot(rush, rush)), 0.3 * size),
            "contact": as_planned * bell(slip, 0.1),
            "torque": bell(rms / limit, 0.3),
        }
        metrics = {
            "height": base[:, 2],
            "height_command": np.broadcast_to(wanted.qpos[:, 2], len(base)),
            "height_error": drift[:, 2],
            "joint_error": joint_rms,
            "speed": velocity[:, 0],
            "speed_command": plan["speed"].copy(),
            "torque_rms": rms,
            "power": outcome.power,
            "slip": slip,
        }
        return weighted(share, REWARD_WEIGHTS), metrics

    def fallen(self, outcome: Outcome) -> np.ndarray:
        """Return which robots lie: (N,) bool."""
        return self.body.fallen(outcome)
