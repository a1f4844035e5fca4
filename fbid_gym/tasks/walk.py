"""Task `walk`: follow velocity commands on foot, despite pushes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.gait import Gait, default_gait, gait_of
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Pair, checked
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.robots import Robot
from fbid_gym.robots.terrain.grid import HeightGrid, heights_below, plane
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.height_scan import SCAN, scan_heights
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan, check_schedule, command_at
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.task import Now
from fbid_gym.tasks.walk_measures import (
    Notes,
    Scales,
    Seen,
    judge,
    note,
    observe,
)

MOST_LOWERED = 0.2
"""Of the height of the centre of mass: much lower, and legs are too bent to walk."""

Rates = Annotated[tuple[float, float], Pair(-2.0, 2.0)]

_TOLERANCE = 0.12  # of sqrt(g h)
_STANDS = 0.1  # share of the commands that are to stand


@dataclass(frozen=True, eq=False)
class Walk:
    """The task, for one robot; a `Task`.

    Attributes:
        body: which robot walks.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        gait: how the robot walks where a layer follows it, and whose clock all see.
        gait_name: what it is called.
        most: (3, 2) least and greatest command: m/s ahead, m/s to the left, rad/s to the left.
        interval: (least, most) s from one command to the next.
        lowered: (least, most) m by which the base is lower than the gait has it, in an episode.
        scan: (S, 2) m ahead and to the left of the base, where the ground is seen; none: blind.
        ground: its heights.
    """

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    gait: Gait
    gait_name: str
    most: np.ndarray
    interval: tuple[float, float]
    lowered: tuple[float, float]
    scan: np.ndarray
    ground: HeightGrid

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        seconds: float,
        hz: int,
        pushes: Pushes,
        start: Start,
        *,
        forward_range: Rates = (-0.35, 0.58),
        sideways_range: Rates = (-0.23, 0.23),
        turning_range: Rates = (-0.13, 0.13),
        command_interval: Annotated[tuple[float, float], Pair(0.1, 1e9, "s")] = (2.0, 5.0),
        lowered_range: Annotated[tuple[float, float], Pair(0.0, MOST_LOWERED)] = (0.0, 0.0),
        gait: str | None = None,
        height_scan: bool = False,
    ) -> "Walk":
        """Build the task.

        Args:
            robot: who walks, on four point feet or on two flat ones.
            seconds: length of an episode.
            hz: control ticks per second.
            pushes: the disturbances.
            start: how an episode begins.
            forward_range: (least, most) commanded velocity ahead, in units of sqrt(g h), h the
                height of the centre of mass at home.
            sideways_range: (least, most) commanded velocity to the left, in the same units.
            turning_range: (least, most) commanded yaw rate, in units of sqrt(g / h).
            command_interval: (least, most) s from one command to the next. One command in ten is
                to stand.
            lowered_range: (least, most) by which the base is lower than the gait has it throughout
                an episode, in units of h. Layers follow; the policy sees its height.
            gait: of a quadruped: "trot", "walk", "pace", "bound" or "stand". Default: "trot"; a
                biped has but one.
            height_scan: whether the ground is known: its heights around the robot are observed, and
                feet are set down on it. Otherwise robot and policy are blind.
        """
        ranges = (forward_range, sideways_range, turning_range)
        check_schedule("command_interval", command_interval, seconds)
        stance, gravity = Stance.of(robot), robot.gravity
        height = float(stance.home_com[2])
        speed, rate = np.sqrt(gravity * height), np.sqrt(gravity / height)
        most = np.array(ranges) * np.array([speed, speed, rate])[:, None]
        walks, name = gait_of(robot, hz, gait), gait or default_gait(robot)
        lowered = height * lowered_range[0], height * lowered_range[1]
        # A gait may have a robot whose legs are straight at home a good deal lower.
        body = Body.of(robot, float(stance.home_base[2]) - walks.height + lowered[1])
        scan = SCAN * height if height_scan else np.zeros((0, 2))
        return cls(
            *(body, seconds, hz, pushes, start, walks, name, most),
            interval=command_interval,
            lowered=lowered,
            scan=scan,
            ground=plane(),
        )

    def on(self, ground: HeightGrid) -> "Walk":
        """Return the task on other ground."""
        return replace(self, ground=ground)

    @property
    def derived(self) -> Mapping[str, Any]:
        """See `Task.derived`."""
        return {"gait": self.gait_name}

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of the observation."""
        robot = self.body.robot
        return (
            "sine of the gait's cycle (1)",
            "cosine of the gait's cycle (1)",
            "commanded velocity ahead (m/s)",
            "commanded velocity to the left (m/s)",
            "commanded yaw rate (rad/s)",
            *(f"velocity {way} short of the command (m/s)" for way in ("ahead", "to the left")),
            "yaw rate short of the command (rad/s)",
            *(f"{foot} planned to stand (1)" for foot in robot.foot_names),
            "height of the base above the ground, from home (m)",
            *(f"up direction {axis} (base frame)" for axis in "xyz"),
            *(f"base velocity {axis} (m/s, heading)" for axis in ("ahead", "to the left", "up")),
            *(f"base angular velocity {axis} (rad/s, base frame)" for axis in "xyz"),
            *self.body.limb_names,
            *(f"ground {x:.2f} m ahead, {y:.2f} m to the left (m)" for x, y in self.scan),
        )

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of the observation, (O,); observations are clipped to it."""
        axes, feet = np.ones(3), np.ones(self.body.robot.num_feet)
        bound = Seen(
            clock=np.ones(2),
            command=10.0 * axes,
            wanting=100.0 * axes,
            planted=feet,
            height=np.full(1, 10.0),
            up=axes,
            velocity=100.0 * axes,
            angular_velocity=100.0 * axes,
        )
        return np.concatenate([*bound, self.body.limb_bound, np.full(len(self.scan), 10.0)])

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all that chance decides about one episode."""
        robot = self.body.robot
        qpos, qvel = self.start.draw(robot, robot.home_qpos, np.zeros(robot.nv), rng)
        pushes = self.pushes.draw(rng, self.seconds, self.hz)
        count = int(np.ceil(self.seconds / self.interval[0])) + 1
        times = np.cumsum(rng.uniform(*self.interval, size=count))
        command = rng.uniform(self.most[:, 0], self.most[:, 1], size=(count, 3))
        command[rng.random(count) < _STANDS] = 0.0
        least, most = self.lowered
        return {
            "qpos": qpos,
            "qvel": qvel,
            **pushes,
            "command_start": np.concatenate([[0.0], times[:-1]]) * self.hz,
            "command": command,
            # Where nothing is to be drawn, nothing is: what is drawn next stays as it is.
            "lowered": np.array(rng.uniform(least, most) if least < most else most),
        }

    def command(self, plan: Plan, tick: np.ndarray) -> np.ndarray:
        """Return the commanded velocity: (N, 3) m/s ahead, m/s and rad/s to the left."""
        return command_at(plan["command_start"], plan["command"], tick)

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Of the gait, and what is noted for observation, reward and metrics."""
        return self.gait.memory(terms) | Notes.standing(terms).memory()

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        return MotionKind(True, self.gait.omega)

    def advance(self, plan: Plan, now: Now) -> None:
        """Have the gait go on by a tick, and note what feet do."""
        terms, notes = now.terms(), Notes.of(now.memory)
        command = GaitCommand(
            velocity=self.command(plan, now.state.tick),
            shift=now.steering.shift,
            rate=now.steering.rate,
            ground=self._foreseen(notes.foothold),
            lowered=plan["lowered"],
        )
        self.gait.advance(command, terms, now.state.contact_force, now.memory)
        note(self.gait.target(now.memory), terms.foot_position, notes)

    def target(self, plan: Plan, now: Now) -> Target:
        """Return what the gait asks for."""
        return self.gait.target(now.memory)

    def observe(self, outcome: Outcome, plan: Plan, memory: Memory) -> np.ndarray:
        """Return what the policy sees: (N, O), named by `observation_names`."""
        command, notes = self.command(plan, outcome.state.tick), Notes.of(memory)
        seen = observe(self._scales, outcome, command, notes)
        if not len(self.scan):
            return seen
        around = scan_heights(self.ground, self.scan, outcome.terms, notes.ground)
        return np.concatenate([seen, around], axis=1)

    def reward(
        self, outcome: Outcome, plan: Plan, memory: Memory
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step; see `Task.reward`."""
        command = self.command(plan, outcome.state.tick)
        scales, notes = self._scales, Notes.of(memory)
        terms, moved = judge(scales, outcome, command, notes)
        height = outcome.terms.base_position[:, 2] - notes.ground
        asked = notes.height - notes.ground
        metrics = {
            "velocity_error": moved.velocity_error,
            "turning_error": moved.turning_error,
            "speed": moved.speed,
            "speed_command": np.hypot(command[:, 0], command[:, 1]),
            "height": height,
            "height_command": asked,
            "height_error": height - asked,
            "torque_rms": np.sqrt(outcome.torque_square),
            "power": outcome.power,
            "slip": outcome.posture.slip,
            "distance": notes.distance.copy(),
            # Bounded: who stands on the spot has not walked for nothing.
            "cost_of_transport": notes.energy
            / (scales.weight * np.maximum(notes.distance, scales.size)),
            "foothold_error": notes.missed / np.maximum(notes.landed, 1),
            "clipped_footholds": notes.clipped.astype(float),
        }
        return terms._asdict(), metrics

    @property
    def tolerance(self) -> float:
        """Error of the velocity, m/s, up to which a robot follows its commands."""
        return _TOLERANCE * float(np.sqrt(self._scales.gravity * self._scales.size))

    def _foreseen(self, foothold: np.ndarray) -> np.ndarray:
        """(N, F) m, height of the ground at footholds (N, F, 3); NaN for the blind.

        A foothold moves little from tick to tick: the next one is looked up where the last was.
        """
        if not len(self.scan):
            return np.full(foothold.shape[:2], np.nan)
        return heights_below(self.ground, foothold)

    @cached_property
    def _scales(self) -> Scales:
        body, robot = self.body, self.body.robot
        return Scales(
            float(body.stance.home_com[2]),
            robot.gravity,
            body.home_height,
            robot.home_qpos,
            robot.torque_limit,
            body.mean_torque_limit,
            robot.weight,
            body.stance.geometry.foot_of_point,
        )
