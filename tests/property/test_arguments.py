"""Arguments of environments: each is answered by one error of ours, or the environment works."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.errors import FbidError

# Not "num_envs", nor what else may ask for all the memory there is: the search shall outlive them.
NAMES = ("action_layer", "randomisation", "physics_hz", "control_hz", "push_force",
         "push_interval", "push_duration", "layer_options", "render_mode",
         "render_options", "robot")  # fmt: skip
OPTIONS = [(layer, name) for layer in LAYERS for name in layer_options(layer)]
PLAIN = st.one_of(
    st.sampled_from([None, True, "", "0.5", -1, 0, 10**30, 1e300, -1e300, 1e-300, 0.5]),
    st.sampled_from([np.nan, np.inf, -np.inf]),
    st.floats(-10.0, 10.0),
)
VALUES = st.one_of(PLAIN, st.lists(PLAIN, max_size=3))


def _holds(arguments: dict[str, Any]) -> None:
    try:
        envs = gym.make_vec("fbid_gym/BipedBalance-v0", 2, episode_seconds=0.2, **arguments)
    except FbidError as error:
        assert "\n" not in str(error).strip()
        return
    try:
        observation, _ = envs.reset(seed=0)
        for _ in range(3):
            assert np.isfinite(observation).all()
            observation, *_ = envs.step(np.ones(envs.action_space.shape))
    finally:
        envs.close()


@pytest.mark.long_search  # some take all the time there is
@given(st.sampled_from(list(LAYERS)), st.sampled_from(NAMES), VALUES)
def test_arguments(layer: str, name: str, value: Any) -> None:
    _holds({"action_layer": layer, name: value})


@given(st.sampled_from(OPTIONS), VALUES)
def test_options_of_layers(option: tuple[str, str], value: Any) -> None:
    layer, name = option
    _holds({"action_layer": layer, "layer_options": {name: value}})
