"""One experiment's robots: N of them follow a plan under one controller, and all is logged."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import mujoco
import numpy as np

from eval.papers.log import Log, single
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics
from fbid_gym.envs.simulation import Simulation
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot
from fbid_gym.runtime.rates import Rates

RATES = Rates(physics=1000, control=500)
"""[M10] IV.A: integration at 1000 Hz, feedback at 500 Hz."""

FALLEN_HEIGHT = 0.6
"""Share of the height that the plan has below which a robot counts as fallen. Of the plan and not
of the home stance: a deep squat is no fall."""

FALLEN_TILT = np.cos(np.radians(60.0))
"""Cosine of the tilt of the base beyond which the robot counts as fallen."""

COLLAPSE_SECONDS = 1.0
"""How long a fallen robot is simulated on, for the pictures. A heap on the ground is slow."""

_TOLD_EVERY = 250  # ticks

Memory = dict[str, Any]
GoalT = TypeVar("GoalT")
GoalT_contra = TypeVar("GoalT_contra", contravariant=True)


class Wanted(NamedTuple, Generic[GoalT]):
    """What the robots shall do on one tick.

    Attributes:
        goal: as their controller takes it.
        height: (N,) m, of the base above the lowest foot.
        seen: returns what the log shall keep of it, arrays with a row per robot by name.
    """

    goal: GoalT
    height: np.ndarray
    seen: Callable[[], dict[str, np.ndarray]]


Plan = Callable[[Simulation, np.ndarray], Callable[[np.ndarray], Wanted[GoalT]]]
"""Places the robots where the plan has them at their ticks (N,); returns what they shall do, as a
function of their ticks (N,)."""

Belief = Callable[[Simulation], Callable[[], DynamicsTerms]]
"""From the simulation to what computes the dynamics terms that the controller sees."""

Disturbance = Callable[[Simulation], Callable[[int], np.ndarray]]
"""From the simulation to what disturbs it before each step: the force on each base, (N, 3) N."""


class Command(Protocol):
    """What a controller wants on one tick: a NamedTuple of arrays with a row per robot."""

    @property
    def torque(self) -> np.ndarray:
        """(N, n) N·m; applied within the limits."""
        ...

    def _asdict(self) -> dict[str, Any]: ...


class Controller(Protocol[GoalT_contra]):
    """From state, dynamics and goal to torques; it keeps what it remembers in `memory`."""

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        ...

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: GoalT_contra, memory: Memory
    ) -> Command:
        """Return the command for one control tick."""
        ...


@dataclass(frozen=True, eq=False)
class Trial(Generic[GoalT]):
    """What happens to N robots, whoever controls them.

    Attributes:
        robot: the robot.
        plan: what it shall do.
        seconds: how long.
        num_robots: N.
        start: (N,) s into the plan at which each robot begins; None for its beginning.
        world: compiled from `robot.spec` and what was added to it; None for the robot's own.
        prepare: changes the simulated world before the robots are placed.
        believe: by default the controller knows the robot.
        disturb: by default nothing does.
        every: control ticks from one logged tick to the next.
        watch: entries of the controller's memory to log, each (N, ...).
    """

    robot: Robot
    plan: Plan[GoalT]
    seconds: float
    num_robots: int = 1
    start: np.ndarray | None = None
    world: mujoco.MjModel | None = None
    prepare: Callable[[Simulation], None] | None = None
    believe: Belief | None = None
    disturb: Disturbance | None = None
    every: int = 1
    watch: tuple[str, ...] = ()


def simulate(
    trial: Trial[GoalT],
    controller: Controller[GoalT],
    progress: Callable[[float], None] = lambda share: None,
) -> Log:
    """Run a trial.

    A robot that has fallen, whose torques are not finite or whose simulation diverged gets no more
    torque, and comes to a halt after `COLLAPSE_SECONDS`; the time is in the log, and statistics end
    there. The trial ends early when none is left.

    Args:
        trial: what happens.
        controller: who controls.
        progress: called now and then with the share that is done.
    """
    robot, count, limit = trial.robot, trial.num_robots, trial.robot.torque_limit
    simulation = Simulation(robot, count, RATES, world=trial.world)
    if trial.prepare is not None:
        trial.prepare(simulation)
    start = np.zeros(count) if trial.start is None else trial.start
    start = np.round(start * RATES.control).astype(np.int64)
    wanted_at = trial.plan(simulation, start)
    believed = simulation.terms if trial.believe is None else trial.believe(simulation)
    push_at = (pushed() if trial.disturb is None else trial.disturb)(simulation)
    memory, upright = controller.memory(count), _upright(robot)
    recorder = _Recorder(simulation, trial.every)
    steps = round(trial.seconds * RATES.control)
    for step in range(steps):
        tick = start + step
        wanted = wanted_at(tick)
        qpos, qvel = simulation.qpos.copy(), simulation.qvel.copy()
        state = RobotState(qpos, qvel, simulation.contact_force, tick)
        command = controller(state, believed(), wanted.goal, memory)
        torque = np.clip(command.torque, -limit, limit)
        broken = simulation.diverged() | ~np.isfinite(torque).all(axis=1)
        lost = recorder.lose(broken | _fallen(simulation.terms(), wanted.height, upright), step)
        torque[lost] = 0.0
        push = push_at(step)
        if step % trial.every == 0:
            watched = {name: memory[name] for name in trial.watch}
            signals = wanted.seen() | command._asdict() | watched
            recorder.add(signals | {"torque": torque, "push": push})
        if lost.all():
            break
        simulation.push(push)
        simulation.step(torque, recorder.moving(step))
        if step % _TOLD_EVERY == 0:
            progress(step / steps)
    return recorder.log()


def _upright(robot: Robot) -> np.ndarray:
    """The vertical (3,) in the base's axes at home."""
    home = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
    return home.world_from_base[0, 2]


def _fallen(terms: DynamicsTerms, height: np.ndarray, upright: np.ndarray) -> np.ndarray:
    """Which robots lie: (N,) bool."""
    low = height_of(terms) < FALLEN_HEIGHT * height
    return low | (np.vecdot(terms.world_from_base[:, 2], upright) < FALLEN_TILT)


def height_of(terms: DynamicsTerms) -> np.ndarray:
    """Return the height of each base above the lowest foot, (N,) m."""
    return terms.base_position[:, 2] - terms.foot_position[:, :, 2].min(axis=1)


class _Recorder:
    """Collects the ticks of a trial, every so many control ticks, and who was lost when."""

    def __init__(self, simulation: Simulation, every: int) -> None:
        """Start empty."""
        self._simulation, self._world = simulation, simulation.batch.bind("qpos")
        self._tick_seconds, self._every = 1.0 / RATES.control, every
        self._rows: dict[str, list[np.ndarray]] = {}
        self._fell = np.full(simulation.num_robots, np.nan)

    def lose(self, robots: np.ndarray, step: int) -> np.ndarray:
        """Note that robots (N,) bool are lost by now; return all that are."""
        self._fell[robots & np.isnan(self._fell)] = step * self._tick_seconds
        return ~np.isnan(self._fell)

    def moving(self, step: int) -> np.ndarray | None:
        """Return the robots that stand or collapse still; None for all."""
        halted = step * self._tick_seconds - self._fell >= COLLAPSE_SECONDS
        return np.flatnonzero(~halted) if halted.any() else None

    def add(self, signals: Mapping[str, np.ndarray]) -> None:
        """Keep one tick."""
        now = self._simulation
        always = {"qpos": self._world, "qvel": now.qvel, "contact_force": now.contact_force}
        for name, value in (always | dict(signals)).items():
            self._rows.setdefault(name, []).append(single(value))

    def log(self) -> Log:
        """Return what was collected."""
        signals = {name: np.array(rows) for name, rows in self._rows.items()}
        time = np.arange(len(signals["qpos"])) * self._every * self._tick_seconds
        return Log(time, self._fell, signals)


class Push(NamedTuple):
    """A constant force on the base of every robot, once.

    Attributes:
        start: (N,) s.
        duration: s.
        force: (N, 3) N, world.
    """

    start: np.ndarray
    duration: float
    force: np.ndarray


def pushed(*pushes: Push) -> Disturbance:
    """Return what pushes the robots."""

    def begin(simulation: Simulation) -> Callable[[int], np.ndarray]:
        still = np.zeros((simulation.num_robots, 3))

        def force(step: int) -> np.ndarray:
            total = still
            for push in pushes:
                since = step - np.round(push.start * RATES.control)
                on = (since >= 0) & (since < round(push.duration * RATES.control))
                total = total + np.where(on[:, None], push.force, 0.0)
            return total

        return force

    return begin
