"""Cost of the laws per control tick, relative to the physics steps that a tick drives."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np

from eval.tools.bench.figures import Figure, FigureTable, Limit
from eval.tools.bench.timing import Measure, Timed, added, in_turns, timed_physics
from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.control import body_law
from fbid_gym.control.body_law import Command
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


def per_tick(robots: Sequence[str], num_robots: int, rounds: int) -> FigureTable:
    """Time terms and laws in a closed loop that stands, tick by tick beside the physics."""
    figures = []
    found = in_turns({robot: _standing(robot, num_robots) for robot in robots}, rounds)
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
    return FigureTable(
        f"Laws (N = {num_robots}, one thread)",
        "CPU time per robot and control tick, standing on all feet; forces warm-started from the "
        "tick before and solved to their default tolerance. Eq. 15 for an acceleration that is "
        "given, the friction-limited law from a command for feet and body. Figure: cost relative "
        "to the two physics steps that a tick drives.",
        "x physics",
        tuple(figures),
    )


def _standing(name: str, count: int) -> Measure:
    """Stand under the friction-limited law, and return the CPU seconds of `PARTS` in a round.

    Robots begin a round on their feet, moving a little; the laws take their turns in either order.
    """
    robot, rates, rng = load(name), Rates(), np.random.default_rng(0)
    simulation, kind = Simulation(robot, count, rates), planned_kind(robot)
    layers = {
        key: BaseAcceleration.of(
            robot, rates.control, kind, contact=ContactOptions(contact_limits=limits)
        )
        for key, limits in (("eq. 15", "none"), ("limited", "friction"))
    }
    memories = {key: layer.memory(count) for key, layer in layers.items()}
    law, turns, torque = layers["limited"].law, cycle((1, -1)), dict[str, np.ndarray]()
    heading, home = Stance.of(robot).heading, home_target(robot)
    command = Command.to_target(np.zeros((count, 6)))
    timed = {
        "physics": timed_physics(simulation),
        "terms": Timed(simulation, "terms"),
        "stabiliser": Timed(body_law, "stabilise"),
        "desired": Timed(body_law, "desired_acceleration"),
        **{key: Timed(layer.law, "torque") for key, layer in layers.items()},
    }

    def tick() -> None:
        never = np.zeros(count, np.int64)
        state = RobotState(simulation.qpos, simulation.qvel, simulation.contact_force, never)
        terms = timed["terms"].terms()
        target = in_world(heading, home, terms)
        seen = state, target, terms
        wanted = timed["stabiliser"].stabilise(law.constants, command, *seen)
        active = law.belief(state, target)
        timed["desired"].desired_acceleration(law.constants, wanted, *seen, active)
        for key in list(layers)[:: next(turns)]:
            torque[key] = timed[key].torque(wanted, *seen, memories[key])
        simulation.step(torque["limited"])

    def begin() -> None:
        velocity = rng.uniform(-0.1, 0.1, (count, robot.nv))
        simulation.place(np.arange(count), np.tile(robot.home_qpos, (count, 1)), velocity)
        for _ in range(SETTLE):
            tick()

    return added(begin, tick, TICKS, lambda: tuple(timed[part].seconds for part in PARTS))
