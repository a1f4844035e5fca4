"""Speed of whole environments, by layer and by thread."""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium as gym
import numpy as np

from eval.tools.bench.figures import Figure, FigureTable, Limit
from eval.tools.bench.timing import Clock, Measure, added, in_turns
from fbid_gym.actions.joint_gains import holding_torque
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import load
from fbid_gym.runtime.rates import Rates

STEPS = 25
"""Policy steps timed at a stretch. Each stretch starts from a reset, so that all layers are
compared on robots that stand."""

BALANCE = "fbid_gym/BipedBalance-v0"
"""The environment, given a robot: not every robot has one of its own."""

WALK = "fbid_gym/QuadrupedWalk-v0"

RELATIVE_LIMITS = {"biped, `base_acceleration`": Limit(0.55, at_least=True)}
MIXED = ((4, 64), (16, 4))  # robots of a list, and how many environments of each

MIXED_LIMIT = Limit(0.9, at_least=True)
THREAD_LIMIT = Limit(1.7, at_least=True)


def zero_action(space: gym.Space) -> np.ndarray:
    """Return the action 0, "hold the home posture"."""
    assert isinstance(space, gym.spaces.Box)
    return np.zeros(space.shape, space.dtype)


def _stretch(clock: Clock, env: str = BALANCE, **given: Any) -> Measure:
    """Seconds that zero actions take, from a reset that is not timed."""
    envs = gym.make_vec(env, **given)
    action = zero_action(envs.action_space)
    return added(lambda: envs.reset(seed=0), lambda: envs.step(action), STEPS, clock)


def _physics_stretch(clock: Clock, robot: str, num_envs: int, num_threads: int) -> Measure:
    """Seconds of as many physics steps, and nothing else, of robots held by constant torques."""
    rates, own = Rates(), load(robot)
    count, torque = num_envs // num_threads, holding_torque(own)[None]
    parts = [Simulation(own, count, rates) for _ in range(num_threads)]
    pool = ThreadPoolExecutor(num_threads)

    def place() -> None:
        for part in parts:
            home = np.tile(own.home_qpos, (count, 1))
            part.place(np.arange(count), home, np.zeros((count, own.nv)))

    def run(part: Simulation) -> None:
        for _ in range(STEPS * rates.ticks):
            part.step(torque)

    return added(place, lambda: list(pool.map(run, parts)), 1, clock)


def _relative(
    stretches: Mapping[str, Measure],
    yardstick: Mapping[str, str],
    num_envs: int,
    rounds: int,
    limits: Mapping[str, Limit],
) -> list[Figure]:
    """Environment steps per second of stretches, relative to the yardstick of each."""
    seconds = in_turns(stretches, rounds)
    return [
        Figure.of(
            what,
            f"{num_envs * STEPS / np.median(seconds[what]):,.0f} steps/s",
            seconds[base] / seconds[what],
            limits.get(what),
        )
        for what, base in yardstick.items()
    ]


def by_layer(robots: Sequence[str], layers: list[str], num_envs: int, rounds: int) -> FigureTable:
    """Environment steps per second of every layer, relative to the layer `torque`."""
    figures: list[Figure] = []
    for robot in robots:
        given: dict[str, Any] = {"robot": robot, "num_envs": num_envs, "num_threads": 1}
        stretches = {
            f"{robot}, `{layer}`": _stretch(time.process_time, action_layer=layer, **given)
            for layer in layers
        }
        base = dict.fromkeys(stretches, f"{robot}, `torque`")
        figures += _relative(stretches, base, num_envs, rounds, RELATIVE_LIMITS)
    return FigureTable(
        f"Environment steps by layer (N = {num_envs}, one thread)",
        "CPU time. A step is one policy step of one robot: 10 control ticks, 20 physics steps, "
        "observation and reward. Figure: speed relative to `torque`.",
        "x torque",
        tuple(figures),
    )


def by_threads(robots: Sequence[str], layers: list[str], num_envs: int, rounds: int) -> FigureTable:
    """Environment steps per second with two threads, relative to one; physics alone beside it."""
    figures: list[Figure] = []
    for robot in robots:
        alone, clock = f"{robot}, physics alone", time.perf_counter
        stretches: dict[str, Measure] = {}
        for threads in (1, 2):
            one = " 1" if threads == 1 else ""
            given: dict[str, Any] = {"robot": robot, "num_envs": num_envs, "num_threads": threads}
            stretches[alone + one] = _physics_stretch(clock, **given)
            for layer in layers:
                stretches[f"{robot}, `{layer}`{one}"] = _stretch(clock, action_layer=layer, **given)
        base = {what: f"{what} 1" for what in stretches if f"{what} 1" in stretches}
        limits = {what: THREAD_LIMIT for what in base if robot == "biped" and what != alone}
        figures += _relative(stretches, base, num_envs, rounds, limits)
    return FigureTable(
        f"Two threads (N = {num_envs})",
        "Wall-clock time of the whole step, law included. Figure: speed relative to one thread. "
        "Physics alone is what the machine's second core is worth.",
        "x one thread",
        tuple(figures),
    )


def several_robots(rounds: int) -> FigureTable:
    """Environment steps per second of several robots in a list, relative to as many of one."""
    figures: list[Figure] = []
    layer: dict[str, Any] = {
        "action_layer": "base_acceleration",
        "observation": "body",
        "num_threads": 1,
    }
    for robots, each in MIXED:
        what, count = f"{robots} robots, {each} environments of each", robots * each
        stretches = {
            name: _stretch(
                *(time.process_time, WALK), robots=["go1"] * kinds, num_envs=count, **layer
            )
            for name, kinds in (("one", 1), (what, robots))
        }
        figures += _relative(stretches, {what: "one"}, count, rounds, {what: MIXED_LIMIT})
    return FigureTable(
        "Several robots in one batch (one thread)",
        "CPU time. `go1`, several times in the list and so stepped as different robots would be, "
        "walks through `base_acceleration`. Figure: speed relative to as many environments of one "
        "robot.",
        "x one robot",
        tuple(figures),
    )
