"""Compile what the environments run, so that no first use waits: the last step of `make setup`.

Compiled functions are kept for each combination of argument types that they meet. So every
environment takes two steps through every layer; what a user then runs is found on disk. Options
that lead elsewhere in the code, and robots of another kind, may compile something on first use.
Run as `python -m fbid_gym.compile_all`.
"""

import argparse
import multiprocessing
import os
import sys
import time

from fbid_gym.actions import LAYERS
from fbid_gym.compile_cache import NEWS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.vector_env import RobotVectorEnv

CASES = [(env, layer) for layer in reversed(LAYERS) for env in ENVIRONMENTS]
"""What to run; the layers that take longest to compile come first."""


def run(case: tuple[str, str]) -> None:
    """Take two steps, over the end of an episode, in silence."""
    (env, layer), NEWS.silent = case, True
    own = {"action_layer": layer, "episode_seconds": 0.02, "sensors": "mems"}
    envs = RobotVectorEnv(2, **ENVIRONMENTS[env] | own)
    envs.reset(seed=0)
    for _ in range(2):
        envs.step(envs.action_space.sample())
    envs.close()


def main() -> None:
    """Run all of it on a few processes, and show how far they are."""
    began, spawn = time.monotonic(), multiprocessing.get_context("spawn")
    # Threads and forks do not go together; more processes would compile the same things.
    processes = min(len(os.sched_getaffinity(0)), 4)
    with spawn.Pool(processes) as pool:
        for done, _ in enumerate(pool.imap_unordered(run, CASES), 1):
            if sys.stdout.isatty() or done == len(CASES):
                line = f"Compiling the control laws: {done} of {len(CASES)} cases"
                end = "\n" if done == len(CASES) else "\r"
                print(f"{line}, {time.monotonic() - began:.0f} s", end=end, flush=True)


if __name__ == "__main__":
    argparse.ArgumentParser("python -m fbid_gym.compile_all", description=__doc__).parse_args()
    main()
