"""What `make setup` compiles is what the environments run, and how much a first use compiles."""

import os
import subprocess
import sys

import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.compile_all import run
from fbid_gym.dynamics.contacts import point_positions
from fbid_gym.envs.vector_env import RobotVectorEnv

FIRST_USE = """
from numba.core import event
import gymnasium as gym
import fbid_gym

with event.install_recorder("numba:compile") as recorded:
    env = gym.make("fbid_gym/QuadrupedWalk-v0", action_layer="base_acceleration")
    env.reset(seed=0)
    env.step(env.action_space.sample())
begun = [event.data["dispatcher"] for _, event in recorded.buffer if event.is_start]
functions = [dispatcher.py_func for dispatcher in begun]
ours = [function for function in functions if function.__module__.startswith("fbid_gym")]
kernels = [dispatcher for dispatcher in begun if type(dispatcher._cache).__name__ == "_Cache"]
print(len(kernels), len(ours), len(functions) - len(ours))
"""
KERNELS, FORMS, FORMS_OF_NUMBA = 15, 229, 57
"""Most that a first use may compile: kernels, all of our functions, functions of Numba's own."""


def compiled_forms() -> set[tuple[str, str]]:
    """Each kernel with each combination of argument types that it has met."""
    modules = [module for name, module in sys.modules.items() if name.startswith("fbid_gym")]
    functions = [value for module in modules for value in vars(module).values()]
    entries = [f.entry for f in functions if type(f) is type(point_positions)]
    return {
        (f"{entry.py_func.__module__}.{entry.py_func.__qualname__}", str(form))
        for entry in entries
        for form in entry.signatures
    }


@pytest.mark.slow
@pytest.mark.parametrize("layer", LAYERS)
def test_other_numbers_of_robots_threads_and_steps_compile_nothing_new(layer):
    for env in ("fbid_gym/BipedBalance-v0", "fbid_gym/QuadrupedCrawl-v0"):
        run((env, layer))
    before = compiled_forms()
    assert before
    for task, robot in (("balance", "humanoid"), ("crawl", "quadruped")):
        for count in (1, 5):
            envs = RobotVectorEnv(count, robot, task=task, action_layer=layer, num_threads=2)
            envs.reset(seed=3)
            for _ in range(30):
                envs.step(envs.action_space.sample())
            envs.close()
    assert compiled_forms() == before


@pytest.mark.slow
def test_a_first_use_compiles_little(tmp_path):
    own = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_OPT": "0"}  # as many, sooner
    command = [sys.executable, "-c", FIRST_USE]
    done = subprocess.run(command, env=os.environ | own, capture_output=True, text=True, check=True)
    kernels, forms, forms_of_numba = map(int, done.stdout.split())
    assert 0 < kernels <= KERNELS
    assert forms <= FORMS
    assert forms_of_numba <= FORMS_OF_NUMBA
    assert "compiling for the first use" in done.stderr
