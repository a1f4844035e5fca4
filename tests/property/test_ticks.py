"""What environments promise at every tick.

What comes out is finite and within its space; and a batch is the same on any number of threads and
as its robots one by one, to the bit, whatever the layer, its options and the actions.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.robots import load

_CONTACTS = ("planned", "all", "measured", "some feet")
_MOST_ROBOTS = 5
# Wilder than anything that is learnt with.
_DIFFERENT = {"mass": 0.5, "com": 0.05, "friction": (0.1, 1.5), "motor_strength": (0.3, 1.2)}
_DIFFERENT |= {"action_delay": (0.0, 0.05), "model_mass": 0.5, "model_inertia": (0.3, 3.0)}
_OPTIONS = ("contacts", "contact_limits", "contact_ramp", "moment_priority", "reference")
_STEERING = ("footholds", "step_rate")
_ALIKE = {"go1": "quadruped", "biped": "humanoid", "humanoid": "g1"}  # walk as well
_FASTEST = 30.0  # rad/s and m/s, of a state that is put in

CASES = st.fixed_dictionaries(
    {
        "env": st.sampled_from(list(ENVIRONMENTS)),
        "other_robot": st.booleans(),
        "layer": st.sampled_from(list(LAYERS)),
        "contacts": st.sampled_from(_CONTACTS),
        "contact_limits": st.sampled_from(("friction", "none")),
        "contact_ramp": st.sampled_from((0.0, 0.02)),
        "moment_priority": st.sampled_from((None, 30.0, 0.01, (0.01, 1.0))),
        "reference": st.sampled_from(("gait", "home")),
        "footholds": st.booleans(),
        "step_rate": st.booleans(),
        "height_scan": st.booleans(),
        "different": st.booleans(),
        "push": st.sampled_from((0.0, 0.5, 5.0)),
        "num_envs": st.integers(1, _MOST_ROBOTS),
        "threads": st.integers(2, 3),
        "steps": st.integers(1, 12),
        "size": st.floats(0.0, 1.0),
        "put_in": st.one_of(st.just(0.0), st.floats(0.0, _FASTEST)),
        "seed": st.integers(0, 2**31),
    }
)


@given(CASES)
def test_ticks(case: dict[str, Any]) -> None:
    arguments = _arguments(case)
    one = _trajectory(case, arguments, case["num_envs"], 1)
    several = _trajectory(case, arguments, case["num_envs"], case["threads"])
    alone = _trajectory(case, arguments, 1, 1)
    for name, value in one.items():
        assert value.dtype.kind != "f" or np.isfinite(value).all(), name
        np.testing.assert_array_equal(value, several[name], f"{name} depends on the threads")
        np.testing.assert_array_equal(value[:, :1], alone[name], f"{name} depends on others")


def _arguments(case: dict[str, Any]) -> dict[str, Any]:
    usual, layer = ENVIRONMENTS[case["env"]], case["layer"]
    walks = usual["task"] == "walk"
    given = {name: case[name] for name in (*_OPTIONS, *(_STEERING if walks else ()))}
    if given["contacts"] == "some feet":
        feet = load(usual["robot"]).foot_names
        given["contacts"] = [(1.0, list(feet[: len(feet) // 2]))]
    options = {name: value for name, value in given.items() if name in layer_options(layer)}
    robot = _ALIKE[usual["robot"]] if walks and case["other_robot"] else usual["robot"]
    weight = load(robot).weight
    return {
        "robot": robot,
        "action_layer": layer,
        "layer_options": options,
        "episode_seconds": 0.2,
        "push_force": (0.0, case["push"] * weight),
        "push_duration": 0.04,
        "push_interval": (0.05, 0.1),
        **({"randomisation": _DIFFERENT} if case["different"] else {}),
        **({"height_scan": case["height_scan"]} if "Terrain" in case["env"] else {}),
    }


def _trajectory(
    case: dict[str, Any], arguments: dict[str, Any], num_envs: int, threads: int
) -> dict[str, np.ndarray]:
    """What robots see and earn: name -> (steps, N, ...)."""
    envs = gym.make_vec(case["env"], num_envs=num_envs, num_threads=threads, **arguments)
    ours: Any = envs.unwrapped
    found: dict[str, list[np.ndarray]] = {"observation": [envs.reset(seed=case["seed"])[0]]}
    rng = np.random.default_rng(case["seed"])
    for number in range(case["steps"]):
        if case["put_in"] and number == case["steps"] // 2:
            state = ours.chunks.state_dict()
            moving = state["simulation.qvel"]
            wild = rng.uniform(-1.0, 1.0, (_MOST_ROBOTS, moving.shape[1]))
            moving += case["put_in"] * wild[:num_envs]
            ours.chunks.load_state_dict(state)
        shape = (case["num_envs"], *(envs.single_action_space.shape or ()))
        action = case["size"] * rng.uniform(-1.0, 1.0, shape)
        observation, reward, terminated, truncated, info = envs.step(action[:num_envs])
        step = {"reward": reward, "terminated": terminated, "truncated": truncated}
        step |= {name: value for name, value in info.items() if isinstance(value, np.ndarray)}
        found["observation"].append(observation)
        for name, value in step.items():
            found.setdefault(name, []).append(value.copy())
    envs.close()
    return {name: np.stack(values) for name, values in found.items() if values[0].dtype != object}
