"""One experiment's robots: N of them follow a motion under one controller, and all is logged."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from eval.papers.log import Log, Recorder
from fbid_gym.dynamics.contacts import ContactGeometry
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.envs.rates import Rates
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

RATES = Rates(physics=1000, control=500)
"""[M10] IV.A: integration at 1000 Hz, feedback at 500 Hz."""

FALLEN_HEIGHT = 0.6
"""Share of the height that the reference has below which a robot counts as fallen. Of the
reference and not of the home stance: a deep squat is no fall."""

FALLEN_TILT = np.cos(np.radians(60.0))
"""Cosine of the tilt of the base beyond which the robot counts as fallen."""

COLLAPSE_SECONDS = 1.0
"""How long a fallen robot is simulated on, for the pictures. A heap on the ground is slow."""

Memory = dict[str, Any]


class Command(NamedTuple):
    """Torques of N robots, by where they come from; their sum is applied within the limits.

    Attributes:
        feedforward: (N, n) N·m, from the model and the reference.
        feedback: (N, n) N·m, from the tracking errors.
    """

    feedforward: np.ndarray
    feedback: np.ndarray


class Motion(Protocol):
    """What the robots shall do; see `fbid_gym.motions`."""

    @property
    def period(self) -> int:
        """Ticks after which it repeats, or ends."""
        ...

    def reference(self, tick: np.ndarray, speed: np.ndarray) -> Reference:
        """Return what each robot shall do at its own `tick` (N,), at `speed` (N,) m/s."""
        ...


class Controller(Protocol):
    """From state, dynamics and reference to torques; it keeps what it remembers in `memory`."""

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        ...

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, reference: Reference, memory: Memory
    ) -> Command:
        """Return torques for one control tick; arrays with a row per robot."""
        ...


@dataclass(frozen=True)
class Push:
    """A constant force on the base of every robot, once.

    Attributes:
        start: (N,) s.
        duration: s.
        force: (N, 3) N, world.
    """

    start: np.ndarray
    duration: float
    force: np.ndarray


def push_schedule(pushes: tuple[Push, ...], num_robots: int) -> Callable[[int], np.ndarray]:
    """Return the force on each base, (N, 3) N, as a function of the control tick."""
    spans = [
        (first, first + round(push.duration * RATES.control), push.force)
        for push in pushes
        for first in [np.round(push.start * RATES.control).astype(int)]
    ]

    def force(tick: int) -> np.ndarray:
        total = np.zeros((num_robots, 3))
        for first, last, newtons in spans:
            total += np.where(((first <= tick) & (tick < last))[:, None], newtons, 0.0)
        return total

    return force


@dataclass(frozen=True, eq=False)
class Trial:
    """What happens to N robots, whoever controls them.

    Attributes:
        robot: the robot.
        motion: what it shall do.
        seconds: how long.
        num_robots: N.
        start: (N,) s into the motion at which each robot begins; None for its beginning.
        speed: (N,) m/s commanded; None for 0.
        pose: (N, 3) m, m, rad: where each robot begins in the world, and its heading; None for the
            origin.
        pushes: forces on the base.
        prepare: changes the simulated world before the robots are placed: terrain, friction.
        believe: from the simulation to what computes the controller's dynamics terms; by default
            the controller knows the robot.
        every: control ticks from one logged tick to the next.
        watch: entries of the controller's memory to log, each (N, ...).
    """

    robot: Robot
    motion: Motion
    seconds: float
    num_robots: int = 1
    start: np.ndarray | None = None
    speed: np.ndarray | None = None
    pose: np.ndarray | None = None
    pushes: tuple[Push, ...] = ()
    prepare: Callable[[Simulation], None] | None = None
    believe: Callable[[Simulation], Callable[[], DynamicsTerms]] | None = None
    every: int = 1
    watch: tuple[str, ...] = ()
    support: Support = field(init=False)

    def __post_init__(self) -> None:
        """Measure the home stance."""
        object.__setattr__(self, "support", Support.of(self.robot))


def simulate(
    trial: Trial, controller: Controller, progress: Callable[[float], None] | None = None
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
    robot, count = trial.robot, trial.num_robots
    simulation = Simulation(robot, count, RATES)
    if trial.prepare is not None:
        trial.prepare(simulation)
    believed = simulation.terms if trial.believe is None else trial.believe(simulation)
    push = push_schedule(trial.pushes, count)
    speed = np.zeros(count) if trial.speed is None else trial.speed
    start = np.zeros(count) if trial.start is None else trial.start
    tick = np.round(start * RATES.control).astype(np.int64)

    first = trial.motion.reference(tick, speed)
    simulation.place(np.arange(count), *_placed(first, trial.pose))
    memory = controller.memory(count)
    recorder = Recorder(robot, count, 1.0 / RATES.control)
    limit, lost = robot.torque_limit, np.zeros(count, bool)
    steps = round(trial.seconds * RATES.control)
    for step in range(steps):
        reference = trial.motion.reference(tick, speed)
        state = RobotState(simulation.qpos, simulation.qvel, simulation.contact_force, tick)
        command = controller(state, believed(), reference, memory)
        torque = np.clip(command.feedforward + command.feedback, -limit, limit)
        broken = ~np.isfinite(torque).all(axis=1)
        fallen = (_fallen(trial, simulation, reference) | broken | simulation.diverged()) & ~lost
        recorder.lose(fallen, step)
        lost |= fallen
        torque[lost] = 0.0
        force = push(step)
        if step % trial.every == 0:
            recorder.add(simulation, reference, command, force, {k: memory[k] for k in trial.watch})
        if lost.all():
            break
        simulation.push(force)
        simulation.step(torque, moving(recorder.fell, step / RATES.control))
        tick = tick + 1
        if progress is not None and step % 250 == 0:
            progress(step / steps)
    return recorder.log(trial.every)


def moving(fell: np.ndarray, now: float) -> np.ndarray | None:
    """Return the robots that stand or collapse still, by the s (N,) at which each fell; None: all.

    Args:
        fell: (N,) s, NaN for those still up.
        now: s.
    """
    halted = now - fell >= COLLAPSE_SECONDS
    return np.flatnonzero(~halted) if halted.any() else None


def _placed(reference: Reference, pose: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """State of robots that do what the reference says, each at its own place and heading."""
    qpos, qvel = reference.qpos.copy(), reference.qvel.copy()
    if pose is None:
        return qpos, qvel
    cosine, sine = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    for vectors in (qpos, qvel):
        x, y = vectors[:, 0].copy(), vectors[:, 1].copy()
        vectors[:, 0], vectors[:, 1] = cosine * x - sine * y, sine * x + cosine * y
    qpos[:, :2] += pose[:, :2]
    cosine, sine = np.cos(0.5 * pose[:, 2]), np.sin(0.5 * pose[:, 2])
    w, x, y, z = qpos[:, 3:7].T.copy()
    qpos[:, 3:7] = np.stack(
        [
            cosine * w - sine * z,
            cosine * x - sine * y,
            cosine * y + sine * x,
            cosine * z + sine * w,
        ],
        axis=1,
    )
    return qpos, qvel


def _fallen(trial: Trial, simulation: Simulation, reference: Reference) -> np.ndarray:
    """Which robots lie: (N,) bool. The base's height counts from the lowest foot."""
    terms, support = simulation.terms(), trial.support
    height = terms.base_position[:, 2] - terms.foot_position[:, :, 2].min(axis=1)
    upright = np.vecdot(terms.base_rotation[:, 2], support.home_base_rotation[2])
    return (height < FALLEN_HEIGHT * reference.qpos[:, 2]) | (upright < FALLEN_TILT)


def contact_points(geometry: ContactGeometry, planted: np.ndarray | None) -> np.ndarray | None:
    """Which contact points belong to planted feet: (N, P) bool, None for all."""
    return None if planted is None else planted[:, geometry.foot_of_point]
