"""One experiment's robots: N of them balance, are hit if so wished, and what matters is logged."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple, Protocol

import mujoco
import numpy as np

from eval.papers.garofalo2015.balancer import Goal, Memory, Outcome
from eval.papers.garofalo2015.pendulum import Bob, Pendulum
from eval.papers.trial import moving
from fbid_gym.control.balance import resting_target
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.frames import rotation_vector
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.envs.rates import Rates
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import Robot

RATES = Rates(physics=1000, control=500)

FALLEN_HEIGHT = 0.6
"""Share of the height of the base at the start below which a robot counts as fallen."""

FALLEN_TILT = float(np.cos(np.radians(60.0)))
"""Cosine of the tilt of the base beyond which it counts as fallen."""


class Controller(Protocol):
    """A balancer; see `Balancer`."""

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        ...

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: Goal, memory: Memory
    ) -> Outcome:
        """Return the torques for one control tick."""
        ...


class Blow(NamedTuple):
    """One blow of the pendulum for each robot.

    Attributes:
        start: s.
        direction: (N, 3) unit vectors, horizontal, in which the bob flies.
        energy: (N,) J.
    """

    start: float
    direction: np.ndarray
    energy: np.ndarray


@dataclass(frozen=True, eq=False)
class Bout:
    """What happens to N robots, whoever balances them.

    Attributes:
        robot: the robot.
        seconds: how long.
        num_robots: N.
        world: compiled from `robot.spec` and what was added to it. Default: the robot's own.
        start: (nq,) where the robots begin; the height is set by the ground. Default: home.
        pendulum: in the world, if it is in it.
        blow: with the pendulum, if any.
        goal: from the time (s) and the dynamics at the start to what the robots shall do. Default:
            stay where they began.
        believe: from the simulation to what computes the dynamics terms that the balancer sees.
            Default: the simulation's own.
        every: control ticks from one logged tick to the next.
    """

    robot: Robot
    seconds: float
    num_robots: int = 1
    world: mujoco.MjModel | None = None
    start: np.ndarray | None = None
    pendulum: Pendulum | None = None
    blow: Blow | None = None
    goal: Callable[[float, DynamicsTerms], Goal] | None = None
    believe: Callable[[Simulation], Callable[[], DynamicsTerms]] | None = None
    every: int = 1


@dataclass(frozen=True, eq=False)
class Record:
    """T logged ticks of N robots.

    Attributes:
        time: (T,) s.
        com: (T, N, 3) m, centre of mass minus where it shall be, world.
        rotation: (T, N, 3) rad, of the base from where it shall be, as a rotation vector.
        momentum: (T, N, 6) kg m/s and kg m^2/s about the centre of mass, world.
        desired: (T, N, 6) N and N m, wrench at the centre of mass that the balancer wants.
        delivered: (T, N, 6) by the contact forces that it counts on.
        measured: (T, N, 3) N, total force of the ground during the physics step before.
        torque: (T, N, n) N m.
        residual: (T, N) of the wrench, per weight.
        qpos: (T, N, ...) of the whole world.
        qvel: (T, N, nv) of the robot.
        fell: (N,) s at which each robot was lost; NaN for those still up.
    """

    time: np.ndarray
    com: np.ndarray
    rotation: np.ndarray
    momentum: np.ndarray
    desired: np.ndarray
    delivered: np.ndarray
    measured: np.ndarray
    torque: np.ndarray
    residual: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    fell: np.ndarray

    @property
    def survived(self) -> np.ndarray:
        """(N,) bool, up to the end."""
        return np.isnan(self.fell)

    def arrays(self, prefix: str = "") -> dict[str, np.ndarray]:
        """Return all arrays by name, single precision."""
        return {
            f"{prefix}{item.name}": np.asarray(getattr(self, item.name), np.float32)
            for item in fields(self)
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], prefix: str = "") -> "Record":
        """Rebuild a record from `arrays` of the same prefix."""
        return cls(**{item.name: arrays[f"{prefix}{item.name}"] for item in fields(cls)})


def run(
    bout: Bout, controller: Controller, progress: Callable[[float], None] | None = None
) -> Record:
    """Run a bout.

    A robot that has fallen or whose simulation diverged gets no more torque, and comes to a halt
    after `trial.COLLAPSE_SECONDS`; the bout ends early when none is left.

    Args:
        bout: what happens.
        controller: who balances.
        progress: called now and then with the share that is done.
    """
    robot, count = bout.robot, bout.num_robots
    simulation = Simulation(robot, count, RATES, world=bout.world)
    believed = simulation.terms if bout.believe is None else bout.believe(simulation)
    start = robot.home_qpos if bout.start is None else bout.start
    simulation.place(np.arange(count), np.tile(start, (count, 1)), np.zeros((count, robot.nv)))
    bob = Bob(simulation, bout.pendulum) if bout.pendulum is not None else None
    first, height = simulation.terms(), simulation.qpos[:, 2].copy()
    stay = Goal(resting_target(first.com, first.base_rotation), start[7:])
    memory = controller.memory(count)
    lost, fell = np.zeros(count, bool), np.full(count, np.nan)
    everything = simulation.batch.bind("qpos")
    rows: dict[str, list[np.ndarray]] = {
        item.name: [] for item in fields(Record) if item.name not in ("time", "fell")
    }
    steps, hit = round(bout.seconds * RATES.control), -1
    if bout.blow is not None:
        hit = round(bout.blow.start * RATES.control)
    for step in range(steps):
        goal = stay if bout.goal is None else bout.goal(step / RATES.control, first)
        state = RobotState(
            simulation.qpos, simulation.qvel, simulation.contact_force, np.full(count, step)
        )
        outcome = controller(state, believed(), goal, memory)
        terms = simulation.terms()
        fallen = (_fallen(terms, height) | simulation.diverged()) & ~lost
        fell[fallen], lost = step / RATES.control, lost | fallen
        outcome.torque[lost | ~np.isfinite(outcome.torque).all(axis=1)] = 0.0
        if step % bout.every == 0:
            seen = (
                terms.com - goal.target.com,
                rotation_vector(goal.target.rotation.mT @ terms.base_rotation),
                centroidal_terms(terms, simulation.qvel).momentum,
                outcome.desired,
                outcome.delivered,
                simulation.contact_force.sum(axis=1),
                outcome.torque,
                outcome.residual,
                everything,
                simulation.qvel,
            )
            for kept, value in zip(rows.values(), seen, strict=True):
                kept.append(np.array(value))
        if lost.all():
            break
        if step == hit and bob is not None and bout.blow is not None:
            bob.swing(np.arange(count), bout.blow.direction, bout.blow.energy)
        simulation.step(outcome.torque, moving(fell, step / RATES.control))
        if bob is not None:
            bob.catch()
        if progress is not None and step % 250 == 0:
            progress(step / steps)
    time = np.arange(len(rows["com"])) * bout.every / RATES.control
    return Record(time, **{name: np.array(kept) for name, kept in rows.items()}, fell=fell)


def _fallen(terms: DynamicsTerms, height: np.ndarray) -> np.ndarray:
    """Which robots lie: (N,) bool."""
    low = terms.base_position[:, 2] < FALLEN_HEIGHT * height
    return low | (terms.base_rotation[:, 2, 2] < FALLEN_TILT)
