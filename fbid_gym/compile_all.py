"""Compile what the environments run, so that no first use waits: the last step of `make setup`.

Compiled functions are kept for each combination of argument types that they meet. So every
environment takes a few steps through every layer, alone and in a batch, and with every choice that
leads elsewhere in the code, and the laws that a user may call alone are called; what a user then
runs is found on disk. Robots of another kind may still compile something on first use.

Run as `python -m fbid_gym.compile_all`.
"""

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.actions.com_wrench import BALANCERS
from fbid_gym.compile_cache import say_nothing_of_compiling
from fbid_gym.compile_laws import LAWS, call
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.envs.vector_env import RobotVectorEnv

_POLL_SECONDS = 0.5
_PROCESSES = 4  # more of them would compile the same things
_EPISODE = {"episode_seconds": 0.04}  # two steps

_LONGEST_FIRST = ("com_wrench", "base_acceleration", "joint_position_feedforward")
_CHOICES: tuple[dict[str, Any], ...] = (
    {"contact_limits": "none"},
    {"contact_ramp": 0.02},
    {"contact_limits": "none", "contact_ramp": 0.02},
    {"contacts": "all"},
    {"contacts": "measured"},
)
"""Options of the model-based layers that lead elsewhere in the code."""
_WALKING_CHOICES: tuple[dict[str, Any], ...] = (
    {"contact_limits": "none"},
    {"reference": "home"},
    {"footholds": True, "step_rate": True},
)
"""The same of the layers on a gait."""
_WALKING = ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0")
_SWITCHING = ("fbid_gym/BipedStep-v0", "fbid_gym/QuadrupedCrawl-v0")


class Trial(NamedTuple):
    """An environment to take a few steps of."""

    env: str
    """Its id."""
    arguments: dict[str, Any]
    """Its arguments."""


def trials() -> Iterator[Trial]:
    """Yield what to run, what takes longest to compile first."""
    layers = sorted(LAYERS, key=lambda name: name not in _LONGEST_FIRST)
    for env in ENVIRONMENTS:
        for layer in layers:
            yield Trial(env, {"action_layer": layer})
    for layer in layers:
        lighter = {"action_layer": layer, "randomisation": {"mass": 0.1, "model_mass": 0.1}}
        yield Trial("fbid_gym/BipedBalance-v0", lighter)
        for options in _options(layer):
            for env in ("fbid_gym/BipedBalance-v0", *_SWITCHING):
                yield Trial(env, {"action_layer": layer, "layer_options": options})
        known = layer_options(layer)
        for options in _WALKING_CHOICES:
            for env in _WALKING if options.keys() <= known.keys() else ():
                yield Trial(env, {"action_layer": layer, "layer_options": options})


def _options(layer: str) -> Iterator[dict[str, Any]]:
    known = layer_options(layer)
    if "contacts" in known:
        yield from _CHOICES
    if "balancer" in known:
        for balancer in BALANCERS:
            yield {"balancer": balancer}
            yield {"balancer": balancer, "contact_limits": "none"}


def run(trial: Trial) -> None:
    """Take a few steps, over the end of an episode, with two robots and with one."""
    arguments = ENVIRONMENTS[trial.env] | trial.arguments | _EPISODE
    several = RobotVectorEnv(num_envs=2, **arguments)
    several.reset(seed=0)
    for _ in range(4):
        several.step(several.action_space.sample())
    several.close()
    one = RobotEnv(**arguments)
    for _ in range(2):
        one.reset(seed=0)
        one.step(one.action_space.sample())
    one.close()


def _do(job: Callable[[], object]) -> None:
    job()


def main() -> None:
    """Run all of it on a few processes, and show how far they are."""
    every = [partial(call, law) for law in LAWS] + [partial(run, trial) for trial in trials()]
    began = time.monotonic()
    processes = min(len(os.sched_getaffinity(0)), _PROCESSES)
    spawn = multiprocessing.get_context("spawn")  # threads and forks do not go together
    with spawn.Pool(processes, initializer=say_nothing_of_compiling) as pool:
        results = pool.imap_unordered(_do, every)
        done = 0
        while done < len(every):
            try:
                results.next(timeout=_POLL_SECONDS)
                done += 1
            except multiprocessing.TimeoutError:
                pass
            if sys.stdout.isatty() or done == len(every):
                end = "\n" if done == len(every) else "\r"
                seconds = f"{time.monotonic() - began:.0f} s"
                line = f"Compiling the control laws: {done} of {len(every)} cases, {seconds}"
                print(line, end=end, flush=True)


if __name__ == "__main__":
    argparse.ArgumentParser("python -m fbid_gym.compile_all", description=__doc__).parse_args()
    main()
