"""Speed of whole environments, by layer and by thread."""

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv

from eval.tools.bench.figures import Figure, Limit, Section
from eval.tools.bench.timing import Clock, in_turns, seconds_of
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

RELATIVE_LIMIT = {("biped", "base_acceleration"): Limit(0.55, at_least=True)}
MIXED = ((4, 64), (16, 4))
"""Robots of a list, and how many environments of each."""

MIXED_LIMIT = Limit(0.9, at_least=True)
THREAD_LIMIT = Limit(1.7, at_least=True)


def zero_action(space: gym.Space) -> np.ndarray:
    """Return the action 0, "hold the home posture"."""
    assert isinstance(space, gym.spaces.Box)
    return np.zeros(space.shape, space.dtype)


class Stretch:
    """A stretch of zero actions from a reset, timed without the reset."""

    def __init__(self, envs: VectorEnv) -> None:
        """Prepare for `envs`."""
        self.envs = envs
        self.action = zero_action(envs.action_space)

    def reset(self) -> None:
        """Put all robots on their feet."""
        self.envs.reset(seed=0)

    def __call__(self) -> None:
        """Step."""
        for _ in range(STEPS):
            self.envs.step(self.action)


class PhysicsStretch:
    """As many physics steps as a `Stretch` has, and nothing else, on some threads."""

    def __init__(self, robot: str, num_envs: int, num_threads: int) -> None:
        """Put robots on their feet, held by constant torques."""
        rates, own = Rates(), load(robot)
        self.parts = [Simulation(own, num_envs // num_threads, rates) for _ in range(num_threads)]
        self.ticks, self.torque = STEPS * rates.ticks, holding_torque(own)[None]
        self.pool = ThreadPoolExecutor(num_threads)

    def reset(self) -> None:
        """Put all robots on their feet."""
        for part in self.parts:
            own, count = part.robot, part.num_robots
            home = np.tile(own.home_qpos, (count, 1))
            part.place(np.arange(count), home, np.zeros((count, own.nv)))

    def __call__(self) -> None:
        """Step."""
        list(self.pool.map(self._run, self.parts))

    def _run(self, part: Simulation) -> None:
        for _ in range(self.ticks):
            part.step(self.torque)


def _seconds(
    stretches: Mapping[str, Stretch | PhysicsStretch], rounds: int, clock: Clock
) -> dict[str, np.ndarray]:
    """Seconds per policy step: name -> (rounds,)."""
    measures = {name: seconds_of(its, clock, its.reset) for name, its in stretches.items()}
    return {name: values / STEPS for name, values in in_turns(measures, rounds).items()}


def by_layer(robots: list[str], layers: list[str], num_envs: int, rounds: int) -> Section:
    """Environment steps per second of every layer, relative to the layer `torque`."""
    figures = []
    for robot in robots:
        stretches = {
            layer: Stretch(
                gym.make_vec(
                    BALANCE, robot=robot, num_envs=num_envs, action_layer=layer, num_threads=1
                )
            )
            for layer in layers
        }
        seconds = _seconds(stretches, rounds, time.process_time)
        for layer, values in seconds.items():
            figures.append(
                Figure.of(
                    f"{robot}, `{layer}`",
                    f"{num_envs / np.median(values):,.0f} steps/s",
                    seconds["torque"] / values,
                    RELATIVE_LIMIT.get((robot, layer)),
                )
            )
    return Section(
        f"Environment steps by layer (N = {num_envs}, one thread)",
        "CPU time. A step is one policy step of one robot: 10 control ticks, 20 physics steps, "
        "observation and reward. Figure: speed relative to `torque`.",
        "x torque",
        tuple(figures),
    )


def by_threads(robots: list[str], layers: list[str], num_envs: int, rounds: int) -> Section:
    """Environment steps per second with two threads, relative to one; physics alone beside it."""
    figures = []
    for robot in robots:
        stretches: dict[str, Stretch | PhysicsStretch] = {}
        for threads in (1, 2):
            stretches[f"physics alone {threads}"] = PhysicsStretch(robot, num_envs, threads)
            for layer in layers:
                stretches[f"`{layer}` {threads}"] = Stretch(
                    gym.make_vec(
                        BALANCE,
                        robot=robot,
                        num_envs=num_envs,
                        action_layer=layer,
                        num_threads=threads,
                    )
                )
        seconds = _seconds(stretches, rounds, time.perf_counter)
        for what in ("physics alone", *(f"`{layer}`" for layer in layers)):
            one, two = seconds[f"{what} 1"], seconds[f"{what} 2"]
            figures.append(
                Figure.of(
                    f"{robot}, {what}",
                    f"{num_envs / np.median(two):,.0f} steps/s",
                    one / two,
                    THREAD_LIMIT if robot == "biped" and what != "physics alone" else None,
                )
            )
    return Section(
        f"Two threads (N = {num_envs})",
        "Wall-clock time of the whole step, law included. Figure: speed relative to one thread. "
        "Physics alone is what the machine's second core is worth.",
        "x one thread",
        tuple(figures),
    )


def several_robots(rounds: int) -> Section:
    """Environment steps per second of several robots in a list, relative to as many of one."""
    figures = []
    for robots, each in MIXED:
        stretches = {
            name: Stretch(
                gym.make_vec(
                    WALK,
                    robots=["go1"] * kinds,
                    num_envs=robots * each,
                    num_threads=1,
                    action_layer="base_acceleration",
                    observation="body",
                )
            )
            for name, kinds in (("one", 1), ("several", robots))
        }
        seconds = _seconds(stretches, rounds, time.process_time)
        one, several = seconds["one"], seconds["several"]
        figures.append(
            Figure.of(
                f"{robots} robots, {each} environments of each",
                f"{robots * each / np.median(several):,.0f} steps/s",
                one / several,
                MIXED_LIMIT,
            )
        )
    return Section(
        "Several robots in one batch (one thread)",
        "CPU time. `go1`, several times in the list and so stepped as different robots would be, "
        "walks through `base_acceleration`. Figure: speed relative to as many environments of one "
        "robot.",
        "x one robot",
        tuple(figures),
    )
