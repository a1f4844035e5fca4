"""What `make setup` compiles is what the environments run, and the laws that stand on their own."""

import subprocess
import sys

import numpy as np
import pytest

from fbid_gym.actions import LAYERS, layer_options, walking_layer_options
from fbid_gym.compile_all import Trial, run, trials
from fbid_gym.compile_laws import LAWS, call
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.vector_env import RobotVectorEnv


def test_every_environment_meets_every_layer() -> None:
    met = {(trial.env, trial.arguments["action_layer"]) for trial in trials()}
    assert met == {(env, layer) for env in ENVIRONMENTS for layer in LAYERS}


@pytest.mark.parametrize("layer", [name for name in LAYERS if "contacts" in layer_options(name)])
def test_every_layer_with_contacts_meets_both_forms_with_and_without_ramp(layer: str) -> None:
    options = [
        trial.arguments.get("layer_options", {})
        for trial in trials()
        if trial.arguments["action_layer"] == layer and ENVIRONMENTS[trial.env]["task"] != "walk"
    ]
    forms = {(o.get("contact_limits", "friction"), "contact_ramp" in o) for o in options}
    assert forms == {(limits, ramp) for limits in ("friction", "none") for ramp in (False, True)}


def test_trials_are_environments() -> None:
    for trial in trials():
        config = EnvConfig.of(ENVIRONMENTS[trial.env] | trial.arguments)
        robot = config.load_robot()
        layer, steering = config.layer(robot, config.make_task(robot))
        assert layer.action_names, trial
        given = trial.arguments.get("layer_options", {})
        assert bool(steering.action_names) or not given.get("footholds"), trial


@pytest.mark.parametrize("layer", LAYERS)
def test_every_layer_on_a_gait_meets_its_choices(layer: str) -> None:
    met = {
        (trial.env, option, str(value))
        for trial in trials()
        if trial.arguments["action_layer"] == layer and ENVIRONMENTS[trial.env]["task"] == "walk"
        for option, value in trial.arguments.get("layer_options", {}).items()
    }
    choices = {"footholds": True, "step_rate": True, "contact_limits": "none", "reference": "home"}
    known = walking_layer_options(layer)
    for env in ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0"):
        for option, value in choices.items():
            assert ((env, option, str(value)) in met) == (option in known)


def test_every_law_that_compiles_is_called() -> None:
    for name in LAWS:
        answer = call(name)
        assert all(np.isfinite(value).all() for value in answer if isinstance(value, np.ndarray))
    # In a process of its own: in this one other tests call them, too.
    called = "import fbid_gym.compile_laws as laws; [laws.call(name) for name in laws.LAWS]"
    listed = (
        "import sys; print([f'{name}.{value.__name__}' for name, module in sys.modules.items()"
        " if name.startswith('fbid_gym.control') for value in vars(module).values()"
        " if hasattr(value, 'entry') and value.__module__ == name and not value.entry.signatures])"
    )
    found = subprocess.run(
        [sys.executable, "-c", f"{called}; {listed}"], capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == ["[]"], found.stdout


def compiled_forms() -> set[tuple[str, str]]:
    """Each compiled function with each combination of argument types that it has met."""
    modules = [module for name, module in sys.modules.items() if name.startswith("fbid_gym")]
    functions = [value for module in modules for value in vars(module).values()]
    entries = [entry for f in functions for entry in getattr(f, "entries", {}).items()]
    return {
        (f"{entry.py_func.__module__}.{entry.py_func.__qualname__}", f"{bound} {form}")
        for bound, entry in entries
        for form in entry.signatures
    }


@pytest.mark.slow
@pytest.mark.parametrize("layer", LAYERS)
def test_other_numbers_of_robots_threads_and_options_compile_nothing_new(layer: str) -> None:
    for env in ("fbid_gym/BipedBalance-v0", "fbid_gym/QuadrupedCrawl-v0"):
        run(Trial(env, {"action_layer": layer}))
    before = compiled_forms()
    assert before
    for task, robot in (("balance", "humanoid"), ("crawl", "quadruped")):
        envs = RobotVectorEnv(5, robot, task=task, action_layer=layer, num_threads=2)
        envs.reset(seed=3)
        for _ in range(30):
            envs.step(envs.action_space.sample())
        envs.close()
    assert compiled_forms() == before
