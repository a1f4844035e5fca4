"""A saved batch continues on another object to the same bits."""

import numpy as np
import pytest

import fbid_gym
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError
from tests.batches import assert_same
from tests.envs.cases import BIPED, CASES, QUADRUPED


def assert_same_steps(ours, theirs, rng, steps):
    ends = 0
    for _ in range(steps):
        action = rng.uniform(-0.5, 0.5, (ours.num_envs, *ours.action_space.shape))
        one, other = ours.step(action), theirs.step(action)
        for value, expected in zip(one[:3], other[:3], strict=True):
            np.testing.assert_array_equal(value, expected)
        for info, expected in zip(one[3], other[3], strict=True):
            assert info.keys() == expected.keys()
            if "terminal_observation" in info:
                observations = (i["terminal_observation"] for i in (info, expected))
                np.testing.assert_array_equal(*observations)
                for key in ("r", "l"):  # and not the time that it took
                    assert info["episode"][key] == expected["episode"][key]
        told, expected = ours.last_info, theirs.last_info
        # NumPy rounds sines of two and of three robots differently, of which this is told.
        far = {key for key in told if key.startswith("estimate_")}
        assert_same(*({k: v for k, v in info.items() if k not in far} for info in (told, expected)))
        for key in far:
            np.testing.assert_allclose(told[key], expected[key], atol=1e-12, err_msg=key)
        ends += one[2].sum()
    return ends


@pytest.mark.parametrize(("name", "arguments"), CASES)
def test_a_state_continues_on_another_object(name, arguments, rng):
    """In the middle of episodes and pushes, on another number of threads, through episode ends."""
    first = fbid_gym.make_sb3(name, 3, seed=1, **arguments)
    first.reset()
    for _ in range(8):
        first.step(rng.uniform(-0.5, 0.5, (3, *first.action_space.shape)))
    state = first.state_dict()
    assert all(isinstance(value, np.ndarray) for value in state.values())
    kept = {key: value.copy() for key, value in state.items()}
    second = fbid_gym.make_sb3(name, 3, seed=9, num_threads=2, **arguments)
    second.load_state_dict(state)
    assert assert_same_steps(first, second, rng, 10) >= 1
    assert_same(state, kept)  # a state is a copy
    # Once more from the same state, on an object that has moved on.
    third = fbid_gym.make_sb3(name, 3, **arguments)
    third.load_state_dict(state)
    first.load_state_dict(state)
    assert_same_steps(first, third, rng, 3)


@pytest.mark.parametrize("name", list(ENVIRONMENTS)[::3])
def test_the_state_after_a_reset_can_be_put_back(name):
    """All robots stand: the biped's gait had not begun any phase, which was infinitely long ago."""
    envs = fbid_gym.make_sb3(name, 2, seed=1, action_layer="joint_position")
    envs.reset()
    state = envs.state_dict()
    assert all(np.isfinite(value).all() for value in state.values())
    envs.load_state_dict(state)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"num_envs": 3}, r"state 'returns' has shape \(2,\). Expected \(3,\), as of these"),
        (
            {"action_layer": "torque"},
            r"state of environments with action_layer: 'base_acceleration'. Expected torque",
        ),
        ({"layer_options": {"friction": 0.5}}, r"with layer_options: None. Expected {'friction'"),
        ({"env_id": QUADRUPED}, r"state of environments with robot: 'biped'. Expected quadruped"),
        ({"randomisation": {"mass": 0.1}}, "state of environments with randomisation: None"),
    ],
)
def test_the_state_of_other_environments_is_an_error(change, message):
    arguments = {"env_id": BIPED, "num_envs": 2, "action_layer": "base_acceleration", "seed": 0}
    envs = fbid_gym.make_sb3(**arguments)
    envs.reset()
    others = fbid_gym.make_sb3(**(arguments | change))
    others.reset()
    before = others.state_dict()
    with pytest.raises(FbidError, match=message):
        others.load_state_dict(envs.state_dict())
    assert_same(others.state_dict(), before)
