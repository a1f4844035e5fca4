"""What a first use costs: nothing compiled yet, until the first step of an environment is done."""

import os
import resource
import subprocess
import sys
import tempfile

import numpy as np

from eval.benchmark.figures import Figure, Limit, Section

ENVS = ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedBalance-v0")
LIMIT = Limit(15.0)
_PROGRAM = """
import sys
import gymnasium as gym
import fbid_gym
env = gym.make(sys.argv[1], action_layer=sys.argv[2])
env.reset(seed=0)
env.step(env.action_space.sample())
"""


def _seconds(env: str, layer: str, folder: str) -> float:
    """CPU seconds of a process that takes one step, with compiled code in a folder."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-c", _PROGRAM, env, layer],
        env=os.environ | {"NUMBA_CACHE_DIR": folder, "OMP_NUM_THREADS": "1"},
        stderr=subprocess.DEVNULL,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def by_environment(layer: str = "base_acceleration") -> Section:
    """A first use and the next, each in a fresh process."""
    figures = []
    for env in ENVS:
        with tempfile.TemporaryDirectory() as folder:
            first, again = (_seconds(env, layer, folder) for _ in range(2))
        cost = f"{again:.1f} s once it is compiled"
        figures.append(Figure.of(env.removeprefix("fbid_gym/"), cost, np.array([first]), LIMIT))
    return Section(
        "First use",
        f"From an empty cache: import, `gym.make` with `{layer}`, `reset`, one `step`."
        " Figure: CPU seconds.",
        "s",
        tuple(figures),
    )
