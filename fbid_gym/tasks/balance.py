"""Task `balance`: stand on all feet, follow a commanded base height, survive random pushes.

## Description
The robot stands on all its feet and keeps its base above them, upright and at a commanded height,
while random horizontal forces push the base. Height and distance are those in the support frame.

## Starting State
The home stance. A commanded height is constant for a time uniform in `height_interval`; each value
is uniform in `height_range` times H.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from fbid_gym.motions.target import home_target, in_world
from fbid_gym.options import Pair, checked
from fbid_gym.quantities import Memory, Target
from fbid_gym.tasks.body import FALLEN_HEIGHT, Units
from fbid_gym.tasks.observation import KNOWN, Group, Groups
from fbid_gym.tasks.outcome import Outcome, lengths
from fbid_gym.tasks.plan import Plan, check_schedule, command_at, drawn_commands
from fbid_gym.tasks.reward import Term, Terms, bell, torque, upright
from fbid_gym.tasks.task import Episode, Now, PlannedEpisode


class BalanceMeasures(NamedTuple):
    """Measurements of N robots that stand."""

    outcome: Outcome  # of the step
    units: Units  # of lengths, speeds and rates
    command: np.ndarray  # (N,) m, commanded height of the base
    from_home: np.ndarray  # (N,) m, commanded height less that at home
    height_error: np.ndarray  # (N,) m, height less the commanded one
    drift: np.ndarray  # (N,) m, horizontal distance of the base from home
    motion: np.ndarray  # (N,) velocity and rate of turning of the base, in units, their norm


def height(measured: BalanceMeasures, width: float) -> np.ndarray:
    """Bell of the base's height less the commanded one."""
    return bell(measured.height_error, width * measured.units.length)


def position(measured: BalanceMeasures, width: float) -> np.ndarray:
    """Bell of the base's horizontal distance from its place at home, seen from the feet."""
    return bell(measured.drift, width * measured.units.length)


def stillness(measured: BalanceMeasures, width: float) -> np.ndarray:
    """Bell of the norm of the base's velocity in sqrt(g H) and rate of turning in sqrt(g / H)."""
    return bell(measured.motion, width)


def contact(measured: BalanceMeasures, width: float) -> np.ndarray:
    """Share of the points on the ground times the bell of their mean speed."""
    posture = measured.outcome.posture
    return posture.grounded * bell(posture.slip, width * measured.units.speed)


@dataclass(frozen=True, eq=False, kw_only=True)
class Balance(PlannedEpisode):
    """The task, for one robot; a `Task`.

    Attributes:
        home: the home stance, which the action layers follow.
        height_range: (least, most) commanded base height, see `Body.height`.
        height_interval: (least, most) s from one command to the next.
    """

    home: Target
    height_range: tuple[float, float]
    height_interval: tuple[float, float]

    reward_terms: ClassVar[Terms] = {
        "height": Term(height, 0.25, 0.03, "H"),
        "upright": Term(upright, 0.15, 0.2, "rad"),
        "position": Term(position, 0.15, 0.06, "H"),
        "stillness": Term(stillness, 0.15, 0.16),
        "contact": Term(contact, 0.15, 0.033, "sqrt(g H)"),
        "torque": Term(torque, 0.15, 0.3, "mean torque limit"),
    }
    """H is the robot's size, g gravity. The weights sum to 1."""

    @classmethod
    @checked
    def of(
        cls,
        episode: Episode,
        *,
        height_range: Annotated[tuple[float, float], Pair(FALLEN_HEIGHT + 0.01, 1.49)] = (
            0.94,
            1.0,
        ),
        height_interval: Annotated[tuple[float, float], Pair(1e-4, 1e9, "s")] = (2.0, 4.0),
    ) -> "Balance":
        """Build the task.

        Args:
            episode: robot, length, pushes and start.
            height_range: (least, most) commanded base height, as shares of the robot's size: of the
                height of its hips or of its centre of mass above the feet, whichever is higher.
            height_interval: (least, most) s from one command to the next.
        """
        check_schedule("height_interval", height_interval, episode.seconds)
        return cls.from_episode(
            episode,
            commands={"m of height": episode.body.height(np.array(height_range))},
            home=home_target(episode.body.robot),
            height_range=height_range,
            height_interval=height_interval,
        )

    @property
    def observation_groups(self) -> Groups:
        """See `Task.observation_groups`."""
        asked = ("commanded height - home height (m)",)
        command = Group(asked, 10.0, lambda m: m.from_home[:, None], KNOWN)
        return {"command": command, **self.body.groups}

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all random parts of one episode."""
        begun = self.begin_at_home(rng)
        count, asked = drawn_commands(rng, self.height_interval, self.seconds, self.hz)
        return begun | asked | {"command": self.body.height(rng.uniform(*self.height_range, count))}

    def target(self, plan: Plan, now: Now) -> Target:
        """Return the home stance above the feet.

        The commanded height is not among it: to follow that is the policy's part.
        """
        return in_world(self.body.stance.heading, self.home, now.terms())

    def command(self, plan: Plan, tick: np.ndarray) -> np.ndarray:
        """Return the commanded height of each base above its feet: (N,) m."""
        start, asked = plan["command_start"], plan["command"][:, :, None]
        return command_at(start, np.zeros(start.shape), asked, tick)[:, 0]

    def measure(self, outcome: Outcome, plan: Plan, memory: Memory) -> BalanceMeasures:
        """Return the measurements from which observation, reward and metrics are computed."""
        body, units, base = self.body, self.body.units, outcome.posture.base
        qvel, command = outcome.state.qvel, self.command(plan, outcome.state.tick)
        away = base[:, :2] - body.stance.home_base[:2]
        moving = qvel[:, :6] / ([units.speed] * 3 + [units.rate] * 3)
        return BalanceMeasures(
            outcome=outcome,
            units=units,
            command=command,
            from_home=command - body.home_height,
            height_error=base[:, 2] - command,
            drift=lengths(away),
            motion=lengths(moving),
        )

    def metrics(self, measured: BalanceMeasures) -> dict[str, np.ndarray]:
        """Return physical quantities for evaluation, name -> (N,)."""
        return {
            "height": measured.outcome.posture.base[:, 2],
            "height_command": measured.command,
            "height_error": measured.height_error,
            **measured.outcome.metrics,
        }
