"""Balance: stand on all feet, follow a commanded base height, survive random pushes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from fbid_gym.compiled import bind, kernel
from fbid_gym.motions.target import MotionKind, home_target, in_world, planned_kind
from fbid_gym.options import Pair, checked
from fbid_gym.quantities import DynamicsTerms, Memory, Target
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.body import (
    FALLEN_HEIGHT,
    Body,
    BodyConstants,
    bell,
    level,
    see_body,
    side_by_side,
    weigh,
)
from fbid_gym.tasks.outcome import Outcome, Posture
from fbid_gym.tasks.plan import Plan, check_schedule, last_started
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.task import Now


class BalanceReward(NamedTuple):
    """The terms of the reward, (N,) each, or their weights.

    Attributes:
        height: base at the commanded height.
        upright: base upright.
        position: base above its place at home, seen from the feet.
        stillness: base at rest.
        contact: all points on the ground, none slips.
        torque: small torques.
    """

    height: Any
    upright: Any
    position: Any
    stillness: Any
    contact: Any
    torque: Any


REWARD_WEIGHTS = BalanceReward(
    height=0.25, upright=0.15, position=0.15, stillness=0.15, contact=0.15, torque=0.15
)
"""Each reward term lies in [0, weight]; they sum to 1."""


@dataclass(frozen=True, eq=False)
class Balance:
    """The task, for one robot; a `Task`.

    Attributes:
        body: which robot stands.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        home: the home stance, what the action layers follow.
        height_range: (least, most) commanded base height, see `Body.height`.
        height_interval: (least, most) s from one command to the next.
    """

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    home: Target
    height_range: tuple[float, float]
    height_interval: tuple[float, float]

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
        height_range: Annotated[tuple[float, float], Pair(FALLEN_HEIGHT + 0.01, 1.49)] = (
            0.94,
            1.0,
        ),
        height_interval: Annotated[tuple[float, float], Pair(1e-4, 1e9, "s")] = (2.0, 4.0),
    ) -> "Balance":
        """Build the task.

        Args:
            robot: which robot stands.
            seconds: length of an episode.
            hz: control ticks per second.
            pushes: the disturbances.
            start: how an episode begins.
            height_range: (least, most) commanded base height, as shares of the robot's size: of the
                height of its hips or of its centre of mass above the feet, whichever is higher.
            height_interval: (least, most) s from one command to the next.
        """
        check_schedule("height_interval", height_interval, seconds)
        body, home = Body.of(robot), home_target(robot)
        return cls(body, seconds, hz, pushes, start, home, height_range, height_interval)

    @property
    def derived(self) -> Mapping[str, Any]:
        """See `Task.derived`: shares of its size need no robot."""
        return {}

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of the observation."""
        return ("commanded height - home height (m)", *self.body.observation_names)

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of the observation, (O,); observations are clipped to it."""
        return np.concatenate([[10.0], self.body.observation_bound])

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all that chance decides about one episode."""
        robot = self.body.robot
        qpos, qvel = self.start.draw(robot, robot.home_qpos, np.zeros(robot.nv), rng)
        pushes = self.pushes.draw(rng, self.seconds, self.hz)
        count = int(np.ceil(self.seconds / self.height_interval[0])) + 1
        command_times = np.cumsum(rng.uniform(*self.height_interval, size=count))
        return {
            "qpos": qpos,
            "qvel": qvel,
            **pushes,
            "command_start": np.concatenate([[0.0], command_times[:-1]]) * self.hz,
            "command": self.body.height(rng.uniform(*self.height_range, size=count)),
        }

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Nothing: the motion is planned ahead."""
        return {}

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        return planned_kind(self.body.robot)

    def advance(self, plan: Plan, now: Now) -> None:
        """Nothing goes on: the motion is planned ahead."""

    def target(self, plan: Plan, now: Now) -> Target:
        """Return the home stance above the feet.

        The commanded height is not among it: to follow that is the policy's part.
        """
        return in_world(self.body.stance.heading, self.home, now.terms())

    def command(self, plan: Plan, tick: np.ndarray) -> np.ndarray:
        """Return the commanded height of each base above its feet: (N,) m."""
        return _height_at(plan["command_start"], plan["command"], tick)

    def observe(self, outcome: Outcome, plan: Plan, memory: Memory) -> np.ndarray:
        """Return what the policy sees: (N, O), named by `observation_names`."""
        return self._see(outcome, plan["command_start"], plan["command"])

    def reward(
        self, outcome: Outcome, plan: Plan, memory: Memory
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step.

        Returns:
            terms: name -> (N,), each in [0, its weight].
            metrics: name -> (N,) physical quantities for evaluation.
        """
        posture, command = outcome.posture, self.command(plan, outcome.state.tick)
        square = outcome.torque_square
        terms = self._judge(posture, outcome.state.qvel, square, command)
        height = posture.base[:, 2]
        metrics = {
            "height": height,
            "height_command": command,
            "height_error": height - command,
            "torque_rms": np.sqrt(square),
            "power": outcome.power,
            "slip": posture.slip,
        }
        return terms._asdict(), metrics

    @cached_property
    def _see(self) -> Callable[..., np.ndarray]:
        return bind(_see, self.body.constants, self.body.home_height)

    @cached_property
    def _judge(self) -> Callable[..., BalanceReward]:
        body = self.body
        sizes = body.size, body.speed, body.mean_torque_limit
        return bind(_judge, _Scales(body.stance.home_base, *sizes))


@kernel
def _height_at(start: np.ndarray, command: np.ndarray, tick: np.ndarray) -> np.ndarray:
    """What `Balance.command` returns: of the commands (N, K) that start at ticks (N, K)."""
    height = np.empty(len(tick))
    for i in range(len(tick)):
        height[i] = command[i, last_started(start[i], tick[i])]
    return height


@kernel
def _see(
    body: BodyConstants,
    home_height: float,
    outcome: Outcome,
    start: np.ndarray,
    command: np.ndarray,
) -> np.ndarray:
    """What `Balance.observe` returns; commands as of `_height_at`."""
    asked = np.empty((len(command), 1))
    asked[:, 0] = _height_at(start, command, outcome.state.tick)
    asked -= home_height
    return side_by_side((asked, see_body(body, outcome)))


class _Scales(NamedTuple):
    """What the reward measures by."""

    home_base: np.ndarray  # (3,) m, support frame
    size: float  # m, see `Body.size`
    speed: float  # m/s, see `Body.speed`
    torque_limit: float  # N·m, mean of the joints


@kernel
def _judge(
    scales: _Scales,
    posture: Posture,
    velocity: np.ndarray,
    torque_square: np.ndarray,
    command: np.ndarray,
) -> BalanceReward:
    """Return the terms of the reward.

    Args:
        scales: of the robot.
        posture: of N.
        velocity: (N, nv) m/s, rad/s.
        torque_square: (N,) (N·m)^2, mean.
        command: (N,) m, heights.
    """
    count = len(command)
    share = BalanceReward(
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
    )
    home = scales.home_base
    # Lengths, speeds and rates scale with the robot.
    size, speed, rate = scales.size, scales.speed, scales.speed / scales.size
    for i in range(count):
        base, qvel = posture.base[i], velocity[i]
        drift = np.hypot(base[0] - home[0], base[1] - home[1])
        torque = np.sqrt(torque_square[i])
        motion = dot(qvel[:3], qvel[:3]) / speed**2 + dot(qvel[3:6], qvel[3:6]) / rate**2
        share.height[i] = bell(base[2] - command[i], 0.03 * size)
        share.upright[i] = level(posture.upright[i])
        share.position[i] = bell(drift, 0.06 * size)
        share.stillness[i] = bell(np.sqrt(motion), 0.16)
        share.contact[i] = posture.touching[i].mean() * bell(posture.slip[i], 0.033 * speed)
        share.torque[i] = bell(torque / scales.torque_limit, 0.3)
    weigh(share, REWARD_WEIGHTS)
    return share
