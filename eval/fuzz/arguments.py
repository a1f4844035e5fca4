"""Arguments of environments: each is answered by one error of ours, or the environment works."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from hypothesis import strategies as st

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.errors import FbidError

_ENV = "fbid_gym/BipedBalance-v0"
# Not "num_envs", nor what else may ask for all the memory there is: the search shall outlive them.
_NAMES = ("action_layer", "randomisation", "physics_hz", "control_hz", "push_force",
          "push_interval", "push_duration", "layer_options", "render_mode",
          "render_options", "robot")  # fmt: skip

UNIT = "values"


def cases() -> st.SearchStrategy[dict[str, Any]]:
    """Return the choice of an argument, or of an option of a layer, and of its value."""
    options = [(layer, name) for layer in LAYERS for name in layer_options(layer)]
    return st.fixed_dictionaries(
        {
            "layer": st.sampled_from(list(LAYERS)),
            "argument": st.one_of(
                st.sampled_from(_NAMES).map(lambda name: [name]),
                st.sampled_from(options).map(list),
            ),
            "value": _values(),
        }
    )


def _values() -> st.SearchStrategy[Any]:
    plain = st.one_of(
        st.sampled_from([None, True, "", "0.5", -1, 0, 10**30, 1e300, -1e300, 1e-300, 0.5]),
        st.sampled_from(["nan", "inf", "-inf"]).map(lambda word: {"float": word}),
        st.floats(-10.0, 10.0),
    )
    return st.one_of(plain, st.lists(plain, max_size=3))


def _meant(value: Any) -> Any:
    """The value of a case: what JSON cannot hold is written as {"float": "nan"}."""
    if isinstance(value, dict):
        return float(value["float"])
    return [_meant(entry) for entry in value] if isinstance(value, list) else value


def amount(case: dict[str, Any]) -> int:
    """Return how many values a case tries: one."""
    return 1


def faults(case: dict[str, Any]) -> Iterator[str]:
    """Yield what goes wrong in a case, one sentence each."""
    *layer, name = case["argument"]
    value = _meant(case["value"])
    arguments: dict[str, Any] = {"action_layer": case["layer"], "episode_seconds": 0.2}
    if layer:
        arguments |= {"action_layer": layer[0], "layer_options": {name: value}}
    else:
        arguments[name] = value
    try:
        envs = gym.make_vec(_ENV, num_envs=2, **arguments)
    except FbidError as error:
        if "\n" in str(error).strip():
            yield f"{name}={value!r}: more than one line"
        return
    try:
        observation, _ = envs.reset(seed=0)
        for _ in range(3):
            if not np.isfinite(observation).all():
                yield f"{name}={value!r}: an observation is not finite"
            observation, *_ = envs.step(np.ones(envs.action_space.shape))
    finally:
        envs.close()
