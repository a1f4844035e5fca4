"""One experiment's robots: N of them follow a plan under one controller, and all is logged."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np

from eval.papers.log import Log
from fbid_gym.dynamics import DynamicsTerms
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.simulation import Simulation
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot
from fbid_gym.runtime.rates import Rates
from fbid_gym.tasks.body import FALLEN_HEIGHT, FALLEN_TILT
from fbid_gym.tasks.plan import Pushes

RATES = Rates(physics=1000, control=500)
"""[M10] IV.A: integration at 1000 Hz, feedback at 500 Hz."""

COLLAPSE_SECONDS = 1.0
"""How long a fallen robot is simulated on, for the pictures. A heap on the ground is slow."""

Memory = dict[str, Any]


class Wanted(NamedTuple):
    """Desired motion of the robots on one tick."""

    goal: Any  # as their controller takes it
    height: np.ndarray  # (N,) m, of the base above the lowest foot
    seen: Callable[[], dict[str, np.ndarray]]
    """Returns what the log shall keep of it, arrays with a row per robot by name."""


Plan = Callable[[Simulation, np.ndarray], Callable[[np.ndarray], Wanted]]
"""Places the robots where the plan has them at their ticks (N,); returns what they shall do, as a
function of their ticks (N,)."""

Belief = Callable[[Simulation], Callable[[], DynamicsTerms]]
"""From the simulation to what computes the dynamics terms that the controller sees."""

Disturbance = Callable[[Simulation], Callable[[int], np.ndarray]]
"""From the simulation to what disturbs it before each step: the force on each base, (N, 3) N."""


class TickCommand(Protocol):
    """Commands of a controller on one tick: a NamedTuple of arrays with a row per robot."""

    @property
    def torque(self) -> np.ndarray:
        """(N, n) N·m; applied within the limits."""
        ...

    def _asdict(self) -> dict[str, Any]: ...


class TickController(Protocol):
    """From state, dynamics and goal to torques; it keeps what it remembers in `memory`."""

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        ...

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: Any, memory: Memory
    ) -> TickCommand:
        """Return the command for one control tick."""
        ...


def pushed(start: np.ndarray, force: np.ndarray, seconds: float) -> Disturbance:
    """Push the bases of N robots K times each, for some seconds.

    Args:
        start: (N, K) s.
        force: (N, K, 3) N, world.
        seconds: that each push lasts.
    """
    ticks = np.round(start * RATES.control).astype(np.int64)
    plan = {"push_start": ticks, "push_force": force, "push_velocity": 0.0 * force}
    pushes, now = Pushes((0.0, 0.0), seconds, (seconds, seconds)), np.zeros(len(start), np.int64)
    return lambda _: lambda step: pushes.during(plan, now + step, 1, RATES.control).force[0]


@dataclass(frozen=True, eq=False)
class Trial:
    """A trial of N robots, whoever controls them."""

    robot: Robot
    plan: Plan  # what it shall do
    seconds: float  # how long
    num_robots: int = 1  # N
    start: np.ndarray | None = None
    """(N,) s into the plan at which each robot begins; None for its beginning."""
    world: mujoco.MjModel | None = None
    """Compiled from `robot.spec` and what was added to it; None for the robot's own."""
    prepare: Callable[[Simulation], None] = lambda simulation: None
    """Changes the simulated world before the robots are placed."""
    believe: Belief = lambda simulation: simulation.terms
    """By default the controller knows the robot."""
    disturb: Disturbance = lambda simulation: lambda _: np.zeros((simulation.num_robots, 3))
    """By default nothing does."""
    every: int = 1  # control ticks from one logged tick to the next
    watch: tuple[str, ...] = ()  # entries of the controller's memory to log, each (N, ...)


def simulate(trial: Trial, controller: TickController) -> Log:
    """Run a trial.

    A robot that has fallen, whose torques are not finite or whose simulation diverged gets no more
    torque, and comes to a halt after `COLLAPSE_SECONDS`; the time is in the log, and statistics end
    there. The trial ends early when none is left.

    Args:
        trial: what happens.
        controller: who controls.
    """
    robot, count, limit = trial.robot, trial.num_robots, trial.robot.torque_limit
    simulation = Simulation(robot, count, RATES, world=trial.world)
    trial.prepare(simulation)
    start = np.zeros(count) if trial.start is None else trial.start
    start = np.round(start * RATES.control).astype(np.int64)
    wanted_at, believed = trial.plan(simulation, start), trial.believe(simulation)
    push_at, memory = trial.disturb(simulation), controller.memory(count)
    upright, world = Stance.of(robot).terms.world_from_base[0, 2], simulation.batch.bind("qpos")
    fell, rows, tick = np.full(count, np.nan), [], 1.0 / RATES.control
    for step in range(round(trial.seconds * RATES.control)):
        wanted = wanted_at(start + step)
        qpos, qvel = simulation.qpos.copy(), simulation.qvel.copy()
        state = RobotState(qpos, qvel, simulation.contact_force, start + step)
        command = controller(state, believed(), wanted.goal, memory)
        torque = np.clip(command.torque, -limit, limit)
        lost = simulation.diverged() | ~np.isfinite(torque).all(axis=1)
        lost |= _fallen(simulation.terms(), wanted.height, upright)
        fell[lost & np.isnan(fell)] = step * tick
        lost = ~np.isnan(fell)
        torque[lost] = 0.0
        push = push_at(step)
        if step % trial.every == 0:
            now = {"qpos": world, "qvel": qvel, "contact_force": simulation.contact_force}
            now |= wanted.seen() | command._asdict() | {name: memory[name] for name in trial.watch}
            now |= {"torque": torque, "push": push}
            # Copies, in single precision where it was double.
            rows.append({n: v.astype("f4" if v.dtype == "f8" else v.dtype) for n, v in now.items()})
        if lost.all():
            break
        halted = step * tick - fell >= COLLAPSE_SECONDS
        simulation.push(push)
        simulation.step(torque, np.flatnonzero(~halted) if halted.any() else None)
    signals = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Log(np.arange(len(rows)) * trial.every * tick, fell, signals)


def _fallen(terms: DynamicsTerms, height: np.ndarray, upright: np.ndarray) -> np.ndarray:
    """Tell which robots lie: (N,) bool. By the plan's height, not home's: one may squat deeply."""
    low = height_of(terms) < FALLEN_HEIGHT * height
    tilted = np.vecdot(terms.world_from_base[:, 2], upright) < np.cos(np.radians(FALLEN_TILT))
    return np.asarray(low | tilted)


def height_of(terms: DynamicsTerms) -> np.ndarray:
    """Return the height of each base above the lowest foot, (N,) m."""
    return terms.base_position[:, 2] - terms.foot_position[:, :, 2].min(axis=1)
