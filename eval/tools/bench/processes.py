"""Measure fresh processes: resident memory, and the time of a first use, with nothing compiled."""

import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import gymnasium as gym
import numpy as np
import psutil

from eval.tools.bench.environments import BALANCE, zero_action
from eval.tools.bench.figures import Figure, FigureTable, Limit

FEW, MANY = 64, 320
LONG = 10_000
ROBOT_LIMIT = Limit(1.0)
GROWTH_LIMIT = Limit(1.0)
MEGABYTE = 2**20

FIRST_USES = ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedBalance-v0")
FIRST_USE_LIMIT = Limit(15.0)
_PROGRAM = """
import sys
import gymnasium as gym
import fbid_gym
env = gym.make(sys.argv[1], action_layer=sys.argv[2])
env.reset(seed=0)
env.step(env.action_space.sample())
"""


def _measure(robot: str, layer: str, num_envs: int, warmup: int, steps: int) -> tuple[float, float]:
    """Resident megabytes of this process before and after `steps` policy steps."""
    envs = gym.make_vec(BALANCE, robot=robot, num_envs=num_envs, action_layer=layer, num_threads=2)
    action = zero_action(envs.action_space)
    envs.reset(seed=0)
    process = psutil.Process()
    for _ in range(warmup):
        envs.step(action)
    before = process.memory_info().rss
    for _ in range(steps):
        envs.step(action)
    after = process.memory_info().rss
    envs.close()
    return before / MEGABYTE, after / MEGABYTE


def _resident(*what: Any) -> tuple[float, float]:
    """Return the result of `_measure` in a fresh process."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as fresh:
        return fresh.submit(_measure, *what).result()


def resident(robots: Sequence[str], layer: str = "base_acceleration") -> FigureTable:
    """Resident memory per added robot, and its growth over 10,000 policy steps."""
    figures = []
    for robot in robots:
        few, many = (_resident(robot, layer, num, 20, 0)[1] for num in (FEW, MANY))
        per_robot = (many - few) / (MANY - FEW)
        figures.append(
            Figure.of(
                f"{robot}, each added robot",
                f"{few:.0f} MB with {FEW}, {many:.0f} MB with {MANY}",
                np.array([per_robot]),
                ROBOT_LIMIT,
            )
        )
        before, after = _resident(robot, layer, 4, 500, LONG)
        figures.append(
            Figure.of(
                f"{robot}, {LONG:,} steps of 4 robots",
                f"{before:.0f} MB before, {after:.0f} MB after",
                np.array([after - before]),
                GROWTH_LIMIT,
            )
        )
    return FigureTable(
        "Resident memory",
        f"`{layer}`, each in a fresh process. Figure: growth in MB.",
        "MB",
        tuple(figures),
    )


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


def first_use(layer: str = "base_acceleration") -> FigureTable:
    """A first use and the next, each in a fresh process."""
    figures = []
    for env in FIRST_USES:
        with tempfile.TemporaryDirectory() as folder:
            first, again = (_seconds(env, layer, folder) for _ in range(2))
        cost = f"{again:.1f} s once it is compiled"
        figures.append(
            Figure.of(env.removeprefix("fbid_gym/"), cost, np.array([first]), FIRST_USE_LIMIT)
        )
    return FigureTable(
        "First use",
        f"From an empty cache: import, `gym.make` with `{layer}`, `reset`, one `step`."
        " Figure: CPU seconds.",
        "s",
        tuple(figures),
    )
