"""What environments promise at every tick, and the search for robots on which one breaks it.

What comes out is finite and within its space; and a batch is the same on any number of threads and
as its robots one by one, to the bit, whatever the layer, its options and the actions.
"""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from hypothesis import strategies as st

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.robots import load

_CONTACTS = ("planned", "all", "measured", "some feet")
_PLAIN = [name for name in ENVIRONMENTS if "Walk" not in name and "Terrain" not in name]


def cases() -> st.SearchStrategy[dict[str, Any]]:
    """Return the choice of an environment, its arguments, and how it is driven."""
    return st.fixed_dictionaries(
        {
            "env": st.sampled_from(_PLAIN),
            "layer": st.sampled_from(list(LAYERS)),
            "contacts": st.sampled_from(_CONTACTS),
            "contact_limits": st.sampled_from(("friction", "none")),
            "contact_ramp": st.sampled_from((0.0, 0.02)),
            "base_priority": st.sampled_from((1.0, 30.0, 0.01)),
            "num_envs": st.integers(1, 5),
            "threads": st.integers(2, 3),
            "steps": st.integers(1, 12),
            "size": st.floats(0.0, 1.0),
            "seed": st.integers(0, 2**31),
        }
    )


def faults(case: dict[str, Any]) -> Iterator[str]:
    """Yield what goes wrong in a case, one sentence each."""
    arguments = _arguments(case)
    one = _trajectory(case, arguments, case["num_envs"], 1)
    for name, value in one.items():
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            yield f"{name} is not finite"
    several = _trajectory(case, arguments, case["num_envs"], case["threads"])
    alone = _trajectory(case, arguments, 1, 1)
    for name, value in one.items():
        if not np.array_equal(value, several[name], equal_nan=True):
            yield f"{name} depends on the number of threads"
        if not np.array_equal(value[:, :1], alone[name], equal_nan=True):
            yield f"{name} of a robot depends on the others"


def _arguments(case: dict[str, Any]) -> dict[str, Any]:
    known = layer_options(case["layer"])
    given = {name: case[name] for name in ("contacts", "contact_limits", "contact_ramp")}
    if given["contacts"] == "some feet":
        feet = load(ENVIRONMENTS[case["env"]]["robot"]).foot_names
        given["contacts"] = [(1.0, list(feet[: len(feet) // 2]))]
    given["base_priority"] = case["base_priority"]
    options = {name: value for name, value in given.items() if name in known}
    return {"action_layer": case["layer"], "layer_options": options, "episode_seconds": 0.2}


def _trajectory(
    case: dict[str, Any], arguments: dict[str, Any], num_envs: int, threads: int
) -> dict[str, np.ndarray]:
    """What robots see and earn: name -> (steps, N, ...)."""
    envs = gym.make_vec(case["env"], num_envs=num_envs, num_threads=threads, **arguments)
    found: dict[str, list[np.ndarray]] = {"observation": [envs.reset(seed=case["seed"])[0]]}
    rng = np.random.default_rng(case["seed"])
    for _ in range(case["steps"]):
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
