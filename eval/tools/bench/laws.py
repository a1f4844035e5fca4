"""Cost of the laws per control tick, relative to the physics steps that a tick drives."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from eval.tools.bench.figures import Figure, Limit, Section
from eval.tools.bench.timing import in_turns, timed_physics
from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.control.body_law import Command, desired_acceleration, stabilise
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import home_target, in_world
from fbid_gym.motions.target import planned_kind
from fbid_gym.quantities import RobotState
from fbid_gym.robots import load
from fbid_gym.runtime.rates import Rates

PARTS = ("physics", "terms", "stabiliser", "desired", "eq. 15", "limited")
SETTLE, TICKS = 25, 50
"""Control ticks of a round, after it put the robots on their feet: untimed, then timed."""

LIMITS = {
    ("biped", "terms + eq. 15"): Limit(0.15),
    ("biped", "terms + friction-limited forces"): Limit(0.15),
}


def per_tick(robots: Sequence[str], num_robots: int, rounds: int) -> Section:
    """Time terms and laws in a closed loop that stands, tick by tick beside the physics."""
    figures = []
    found = in_turns({robot: _Stand(robot, num_robots).round for robot in robots}, rounds)
    for robot, seconds in found.items():
        cost = dict(zip(PARTS, seconds.T / (TICKS * num_robots) * 1e6, strict=True))
        physics = cost["physics"]
        shown = {
            "physics, 2 steps": physics,
            "terms": cost["terms"],
            "terms + eq. 15": cost["terms"] + cost["eq. 15"] - cost["desired"],
            "terms + friction-limited forces": cost["terms"] + cost["limited"],
            "stabiliser of `base_acceleration`": cost["stabiliser"],
            "acceleration that feet and body come to": cost["desired"],
        }
        figures += [
            Figure.of(
                f"{robot}, {name}",
                f"{np.median(values):.2f} µs",
                values / physics,
                LIMITS.get((robot, name)),
            )
            for name, values in shown.items()
        ]
    return Section(
        f"Laws (N = {num_robots}, one thread)",
        "CPU time per robot and control tick, standing on all feet; forces warm-started from the "
        "tick before and solved to their default tolerance. Eq. 15 for an acceleration that is "
        "given, the friction-limited law from a command for feet and body. Figure: cost relative "
        "to the two physics steps that a tick drives.",
        "x physics",
        tuple(figures),
    )


class _Stand:
    """Robots that stand under the friction-limited law."""

    def __init__(self, name: str, num_robots: int) -> None:
        robot, rates = load(name), Rates()
        self.simulation = Simulation(robot, num_robots, rates)
        self.layers = {
            key: BaseAcceleration.of(
                robot,
                rates.control,
                planned_kind(robot),
                contact=ContactOptions(contact_limits=limits),
            )
            for key, limits in (("eq. 15", "none"), ("limited", "friction"))
        }
        self.memories = {key: law.memory(num_robots) for key, law in self.layers.items()}
        self.rng = np.random.default_rng(0)
        self.action = np.zeros((num_robots, 6))
        self.heading, self.home = Stance.of(robot).heading, home_target(robot)
        self.physics = timed_physics(self.simulation)
        self.seconds = dict.fromkeys(PARTS, 0.0)

    def round(self) -> tuple[float, ...]:
        """Put the robots on their feet, moving a little, and stand: seconds of `PARTS`."""
        simulation, robot = self.simulation, self.simulation.robot
        count = simulation.num_robots
        velocity = self.rng.uniform(-0.1, 0.1, (count, robot.nv))
        simulation.place(np.arange(count), np.tile(robot.home_qpos, (count, 1)), velocity)
        for tick in range(SETTLE + TICKS):
            if tick == SETTLE:
                self.seconds = dict.fromkeys(PARTS, 0.0)
                self.physics.seconds = 0.0
            simulation.step(self.tick(reverse=bool(tick % 2)))
        self.seconds["physics"] = self.physics.seconds
        return tuple(self.seconds.values())

    def timed(self, name: str, run: Callable[..., Any], *args: Any) -> Any:
        """Add the CPU seconds of a call to those of a part."""
        start = time.process_time()
        result = run(*args)
        self.seconds[name] += time.process_time() - start
        return result

    def tick(self, *, reverse: bool) -> np.ndarray:
        """Time terms, stabiliser and both laws, the laws in either order."""
        simulation = self.simulation
        state = RobotState(
            simulation.qpos,
            simulation.qvel,
            simulation.contact_force,
            np.zeros(simulation.num_robots, np.int64),
        )
        terms = self.timed("terms", simulation.terms)
        target = in_world(self.heading, self.home, terms)
        constants = self.layers["limited"].law.constants
        command = Command.to_target(self.action)
        wanted = self.timed("stabiliser", stabilise, constants, command, state, target, terms)
        active = self.layers["limited"].law.belief(state, target)
        self.timed("desired", desired_acceleration, constants, wanted, state, target, terms, active)
        torques = {}
        for key in list(self.layers)[:: -1 if reverse else 1]:
            law = self.layers[key].law
            torques[key] = self.timed(
                key, law.torque, wanted, state, target, terms, self.memories[key]
            )
        return torques["limited"]
