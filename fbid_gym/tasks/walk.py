"""Task `walk`: follow velocity commands despite pushes.

## Description
A command gives the velocity ahead and to the left and the yaw rate. At every control tick an online
gait computes from clock, command and state which feet stand, where the feet in the air go, and how
the body moves. Its numbers derive from measurements of the robot's model. Any robot with four point
feet or with two flat ones can walk: `robot="quadruped"`, "g1" or one of the user's.

## Action Space
The zero action follows the gait. With `layer_options={"reference": "home"}` the zero action of
`joint_position` holds the home posture, and the policy has to learn walking by itself. The option
`footholds` adds two entries for each foot after those of the layer, and `step_rate` one for the
gait's frequency.

## Observation Space
The heading is that of the base. The ground is that under the feet that are planned to stand.
`height_scan=True` adds the height of the ground at 35 places: from 1 h behind to 2 h ahead of the
base and up to 0.8 h beside it, in the frame of its heading. Then the gait knows the ground, too,
and sets feet down at its height. Otherwise it assumes the plane on which its feet last stood.

## Starting State
The home stance. A command is uniform in its ranges and holds for a time uniform in
`command_interval`; one in ten is to stand. With a `command_ramp` half of the commands come evenly
from the one before, the others at once.

## Episode End
If gait and `lowered_range` make a robot walk lower than it stands at home, the height of a fall is
lower by as much: H is then that of the walk.
"""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.gait import Gait, default_gait, default_period, gait_of
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Number, Pair, checked
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.robots.terrain.grid import plane
from fbid_gym.tasks.body import ANGULAR_VELOCITY, UP, Body, Units
from fbid_gym.tasks.height_scan import SCAN, in_place, scanned
from fbid_gym.tasks.observation import KNOWN, Group, Groups
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan, check_schedule, command_at, drawn_commands
from fbid_gym.tasks.reward import Terms
from fbid_gym.tasks.task import Episode, Ground, Now
from fbid_gym.tasks.walk_measures import REWARD_TERMS, Notes, WalkMeasures, measure_motion, note

MOST_LOWERED = 0.2
"""Of the height of the centre of mass: much lower, and legs are too bent to walk."""

Rates = Annotated[tuple[float, float], Pair(-2.0, 2.0)]

_TOLERANCE = 0.12  # of sqrt(g h)
_STANDS = 0.1  # share of the commands that are to stand
_RAMPS = 0.5  # share of them that do not come at once, where there are ramps
_UNSEEN = np.full((1, 4), np.nan)  # m, height of the ground below up to four feet


@dataclass(frozen=True, eq=False, kw_only=True)
class Walk(Episode):
    """The task, for one robot; a `Task`.

    Attributes:
        gait: how the robot walks where a layer follows it, and whose clock all see.
        most: (3, 2) least and greatest command: m/s ahead, m/s to the left, rad/s to the left.
        interval: (least, most) s from one command to the next.
        ramp: (least, most) s that half of the commands take to come; (0, 0): all come at once.
        lowered: (least, most) m by which the base is lower than the gait has it, in an episode.
        units: from the height of the centre of mass at home.
        scan: (S, 2) m ahead and to the left of the base, where the ground is seen; none: blind.
        ground: tells its heights.
    """

    gait: Gait
    most: np.ndarray
    interval: tuple[float, float]
    ramp: tuple[float, float]
    lowered: tuple[float, float]
    units: Units
    scan: np.ndarray
    ground: Ground

    reward_terms: ClassVar[Terms] = REWARD_TERMS

    @classmethod
    @checked
    def of(
        cls,
        episode: Episode,
        *,
        forward_range: Rates = (-0.35, 0.58),
        sideways_range: Rates = (-0.23, 0.23),
        turning_range: Rates = (-0.13, 0.13),
        command_interval: Annotated[tuple[float, float], Pair(0.1, 1e9, "s")] = (2.0, 5.0),
        command_ramp: Annotated[tuple[float, float], Pair(0.0, 1e9, "s")] = (0.0, 0.0),
        lowered_range: Annotated[tuple[float, float], Pair(0.0, MOST_LOWERED)] = (0.0, 0.0),
        gait: str | None = None,
        gait_period: Annotated[float, Number(0.5, 10.0)] | None = None,
        integral_time: Annotated[float, Number(0.0, 1e6)] = 0.0,
        height_scan: bool = False,
    ) -> "Walk":
        """Build the task.

        Args:
            episode: of a robot on four point feet or on two flat ones.
            forward_range: (least, most) commanded velocity ahead, in units of sqrt(g h), h the
                height of the centre of mass at home.
            sideways_range: (least, most) commanded velocity to the left, in the same units.
            turning_range: (least, most) commanded yaw rate, in units of sqrt(g / h).
            command_interval: (least, most) s from one command to the next. One command in ten is
                to stand.
            command_ramp: (least, most) s that every second command, by chance, takes to come evenly
                from the one before; the others come at once. No longer than they hold.
            lowered_range: (least, most) by which the base is lower than the gait has it throughout
                an episode, in units of h. Layers follow; the policy sees its height.
            gait: of a quadruped: "trot", "short_trot", "walk", "pace", "bound" or "stand"; of a
                biped: "walk", up to 0.17 sqrt(g l) with l the length of its legs, "brisk_walk" or
                "rolling_walk", from heel to toe, up to 0.32. Default: "trot", "walk".
            gait_period: time that a cycle of the gait takes, in units of sqrt(h / g); for a biped h
                is the height at which it walks. Default: 2.5 of a trot, 1.8 of a short one and a
                bound, 4 of a walk, 1.7 of a pace; of a biped 3.4 of a walk, 2.4 to 4 of the
                others, as its joints are strong.
            integral_time: in which the gait makes up for a lasting error of the velocity, such as a
                load's, in units of sqrt(h / g): it adds the error's integral, up to a tenth of
                sqrt(g h), to the command. 0: it does not.
            height_scan: whether the ground is known: its heights around the robot are observed, and
                feet are set down on it. Otherwise robot and policy are blind.
        """
        ranges = (forward_range, sideways_range, turning_range)
        check_schedule("command_interval", command_interval, episode.seconds)
        if command_ramp[1] > command_interval[0]:
            expected = f"at most {command_interval[0]:g} s, the least command_interval"
            raise InvalidValueError("command_ramp", command_ramp, expected)
        robot, stance = episode.body.robot, episode.body.stance
        gait = default_gait(robot) if gait is None else gait
        walks = gait_of(robot, episode.hz, gait, integral_time, gait_period)
        height = float(stance.home_com[2])
        units = Units.of(robot, height)
        lowered = height * lowered_range[0], height * lowered_range[1]
        most = np.array(ranges) * np.array([[units.speed], [units.speed], [units.rate]])
        return cls.from_episode(
            episode,
            # A gait may have a robot whose legs are straight at home a good deal lower.
            body=Body.of(robot, float(stance.home_base[2]) - walks.height + lowered[1]),
            derived={"gait": gait, "gait_period": gait_period or default_period(robot, gait)},
            gait=walks,
            commands=dict(zip(("m/s ahead", "m/s to the left", "rad/s"), most, strict=True)),
            most=most,
            interval=command_interval,
            ramp=command_ramp,
            lowered=lowered,
            units=units,
            scan=SCAN * height if height_scan else np.zeros((0, 2)),
            ground=plane().heights,
        )

    def on(self, ground: Ground) -> "Walk":
        """Return the task on other ground."""
        return replace(self, ground=ground)

    @property
    def observation_groups(self) -> Groups:
        """See `Task.observation_groups`."""
        home, feet = self.body.home_height, self.body.robot.foot_names
        asked = ("velocity ahead{} (m/s)", "velocity to the left{} (m/s)", "yaw rate{} (rad/s)")
        commanded = tuple(f"commanded {one.format('')}" for one in asked)
        lacking = tuple(one.format(" short of the command") for one in asked)
        return {
            "clock": Group.of(
                "{} of the gait's cycle (1)",
                ("sine", "cosine"),
                1.0,
                lambda m: m.motion.clock,
                KNOWN,
            ),
            "command": Group(commanded, 10.0, lambda m: m.motion.command, KNOWN),
            "lack": Group(lacking, 100.0, lambda m: m.motion.lack),
            "planted": Group.of(
                "{} planned to stand (1)", feet, 1.0, lambda m: m.notes.planted, KNOWN
            ),
            "height": Group(
                ("height of the base above the ground, from home (m)",),
                10.0,
                lambda m: m.motion.height[:, None] - home,
            ),
            "up": UP,
            "velocity": Group.of(
                "base velocity {} (m/s, heading)",
                ("ahead", "to the left", "up"),
                100.0,
                lambda m: m.motion.velocity,
            ),
            "angular_velocity": ANGULAR_VELOCITY,
            **self.body.limb_groups,
            **self._scan_group,
        }

    @property
    def _scan_group(self) -> Groups:
        """Height of the ground around above that under the feet; the blind have none."""
        if not len(self.scan):
            return {}
        names = tuple(f"ground {x:.2f} m ahead, {y:.2f} m to the left (m)" for x, y in self.scan)

        def seen(measured: WalkMeasures) -> np.ndarray:
            heights = self.ground(scanned(self.scan, measured.outcome.actual))
            return heights - measured.notes.actual_ground[:, None]

        return {"scan": Group(names, 10.0, seen)}

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all random parts of one episode."""
        begun = self.begin_at_home(rng)
        count, asked = drawn_commands(rng, self.interval, self.seconds, self.hz)
        command = rng.uniform(self.most[:, 0], self.most[:, 1], size=(count, 3))
        command[rng.random(count) < _STANDS] = 0.0
        least, most = self.lowered
        # An empty range draws nothing, so that later draws stay the same.
        lowered = np.array(rng.uniform(least, most) if least < most else most)
        ramp = np.zeros(count)
        if self.ramp[1] > 0.0:
            ramp[1:] = rng.uniform(*self.ramp, count - 1) * (rng.random(count - 1) < _RAMPS)
        drawn = {"command": command, "command_ramp": ramp * self.hz, "lowered": lowered}
        return begun | asked | drawn

    def command(self, plan: Plan, tick: np.ndarray) -> np.ndarray:
        """Return the commanded velocity: (N, 3) m/s ahead, m/s and rad/s to the left."""
        return command_at(plan["command_start"], plan["command_ramp"], plan["command"], tick)

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Return the memory of the gait, and the notes for observation, reward and metrics."""
        return self.gait.memory(terms) | Notes.standing(terms).memory()

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        omega, friction = self.gait.omega, self.gait.friction
        return MotionKind(True, omega, cycle=self.derived["gait_period"], friction=friction)

    def advance(self, plan: Plan, now: Now) -> None:
        """Advance the gait by a tick, and note the motion of the feet."""
        terms, notes = now.terms(), Notes.of(now.memory)
        command = GaitCommand(
            velocity=self.command(plan, now.state.tick),
            shift=now.steering.shift,
            rate=now.steering.rate,
            ground=self._foreseen(notes.foothold, now),
            lowered=plan["lowered"],
        )
        target = self.gait.advance(command, terms, now.state.contact_force, now.memory)
        note(target, terms.foot_position, now.actual().foot_position, notes)

    def target(self, plan: Plan, now: Now) -> Target:
        """Return the gait's target."""
        return self.gait.target(now.memory)

    def measure(self, outcome: Outcome, plan: Plan, memory: Memory) -> WalkMeasures:
        """Return the measurements from which observation, reward and metrics are computed."""
        notes = Notes.of(memory)
        motion = measure_motion(
            self.units,
            self.body.stance.geometry.foot_of_point,
            outcome.state.qvel,
            outcome.terms,
            outcome.posture.touching,
            self.command(plan, outcome.state.tick),
            notes,
            notes.ground if outcome.estimated else notes.actual_ground,
        )
        return WalkMeasures(outcome, self.units, notes, motion)

    def metrics(self, measured: WalkMeasures) -> dict[str, np.ndarray]:
        """Return physical quantities for evaluation, name -> (N,)."""
        outcome, motion, units = measured.outcome, measured.motion, measured.units
        # Bounded, because a robot that stands on the spot covers no distance.
        way = np.maximum(outcome.distance, units.length)
        return {
            "velocity_error": motion.velocity_error,
            "turning_error": motion.turning_error,
            "speed": motion.speed,
            "speed_command": motion.speed_command,
            "height": motion.height,
            "height_command": motion.height_command,
            "height_error": motion.height - motion.height_command,
            "distance": outcome.distance,
            "cost_of_transport": outcome.energy / (units.weight * way),
            "foothold_error": motion.foothold_error,
            "clipped_footholds": measured.notes.clipped.astype(float),
            **outcome.metrics,
        }

    @property
    def tolerance(self) -> float:
        """Error of the velocity, m/s, up to which a robot follows its commands."""
        return _TOLERANCE * self.units.speed

    def _foreseen(self, foothold: np.ndarray, now: Now) -> np.ndarray:
        """(N or 1, F) m, height of the ground at footholds (N, F, 3); NaN for the blind.

        A foothold moves little from tick to tick: the next one is looked up where the last was.
        Robots that estimate where they are see the ground around themselves, as a camera of theirs
        would show it: the map moves with the estimate, and its drift does no harm.
        """
        if not len(self.scan):
            return _UNSEEN
        if now.actual is now.terms:
            return self.ground(foothold)
        places, above = in_place(foothold, now.terms(), now.actual())
        return self.ground(places) + above[:, None]
