"""Policies are kept to the bit; what they compute is held by those who learn and export them."""

import dataclasses
import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy

from fbid_gym.actions.ranges import Falling
from fbid_gym.bundles import load_bundle, save_bundle
from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    PolicyFileError,
    ShapeError,
    UnknownOptionError,
)
from fbid_gym.policy import Policy
from train.runs.archive import found


def make_policy(seed=0, widths=(5, 7, 6, 3), **changes) -> Policy:
    draw = np.random.default_rng(seed)
    fields = {
        "env_id": "fbid_gym/BipedBalance-v0",
        "env_args": {"action_layer": "torque", "push_force": [20.0, 100.0]},
        "mean": draw.normal(size=widths[0]),
        "variance": draw.uniform(0.1, 4.0, size=widths[0]),
        "weights": [draw.normal(size=(b, a)) for a, b in zip(widths, widths[1:], strict=False)],
        "biases": [draw.normal(size=b) for b in widths[1:]],
        "activation": "tanh",
        "clip": 2.0,
        "trained_steps": 123,
        "versions": {"numpy": "2"},
    }
    return Policy(**{**fields, **changes})


@pytest.mark.parametrize("widths", [(5, 7, 6, 3), (4, 2), (1, 3, 1)])
@pytest.mark.parametrize("activation", ["tanh", "relu", "elu"])
def test_save_and_load_keep_every_bit(tmp_path, activation, widths):
    policy = make_policy(widths=widths, activation=activation, output="tanh", algorithm="sac")
    policy.save(tmp_path / "p")
    loaded = Policy.load(tmp_path / "p")
    observation = np.random.default_rng(1).normal(scale=3.0, size=(9, widths[0]))
    np.testing.assert_array_equal(loaded(observation), policy(observation))
    for name in ("env_id", "env_args", "activation", "output", "clip", "epsilon",
                 "algorithm", "trained_steps"):  # fmt: skip
        assert getattr(loaded, name) == getattr(policy, name)
    assert (loaded.observation_size, loaded.action_size) == (widths[0], widths[-1])


def save_older(policy, folder, form=2, **changes):
    """As policies were written before: JSON and arrays in two files, with a digest of both."""
    hidden = [len(bias) for bias in policy.biases[:-1]]
    network = {"activation": policy.activation, "hidden": hidden}
    data = {
        "format": form, "env_id": policy.env_id, "env_args": policy.env_args,
        "observation_size": policy.observation_size, "action_size": policy.action_size,
        "network": network | ({"output": policy.output} if form == 2 else {}),
        "normalisation": {"clip": policy.clip, "epsilon": policy.epsilon},
        "trained_steps": policy.trained_steps, "versions": policy.versions,
    } | ({"algorithm": policy.algorithm} if form == 2 else {}) | changes  # fmt: skip
    policy.save(folder.with_name("new"))
    packed = safetensors.numpy.save(load_bundle(folder.with_name("new"), FbidError).tensors)
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(hashlib.sha256(packed).digest() + text.encode()).hexdigest()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "policy.json").write_text(json.dumps(data | {"sha256": digest}, indent=2))
    (folder / "policy.safetensors").write_bytes(packed)


def test_policies_of_before_are_read(tmp_path):
    """In their folder and in that of a run; of the first format all were clipped and PPO's."""
    first, second = make_policy(), make_policy(seed=1, output="tanh", algorithm="sac")
    save_older(first, tmp_path / "a", form=1)
    save_older(second, tmp_path / "run" / "policy")
    observation = np.random.default_rng(1).normal(scale=3.0, size=(9, 5))
    for place, policy in (("a", first), ("run", second), ("run/policy", second)):
        loaded = Policy.load(tmp_path / place)
        assert (loaded.output, loaded.algorithm) == (policy.output, policy.algorithm)
        assert loaded.versions == policy.versions and loaded.clip == policy.clip
        np.testing.assert_array_equal(loaded(observation), policy(observation))


def test_a_packed_run_of_before_is_read():
    run = Path(__file__).parents[1] / "studies/walking/QuadrupedWalk-v0-base_acceleration-s0"
    policy = Policy.load(found(run))
    assert policy.env_id == "fbid_gym/QuadrupedWalk-v0" and policy.trained_steps > 0


def test_policies_of_before_are_checked(tmp_path):
    for changes, message in (
        ({"format": 3}, "format is 3. Expected 1 or 2"),
        ({"network": None}, "entry 'activation' is missing"),
        ({"network": {"activation": "elu", "norm": "layer"}}, "entry 'norm' is missing or"),
    ):
        save_older(make_policy(), tmp_path / "a", **changes)
        with pytest.raises(PolicyFileError, match=f"{tmp_path / 'a'}.*{message}"):
            Policy.load(tmp_path / "a")
    for name in ("policy.json", "policy.safetensors"):
        save_older(make_policy(widths=(2, 2)), tmp_path / "a")
        file = tmp_path / "a" / name
        content, place = bytearray(file.read_bytes()), len(file.read_bytes()) // 2
        content[place] ^= 8
        file.write_bytes(content)
        with pytest.raises(PolicyFileError):
            Policy.load(tmp_path / "a")


def test_arrays_are_private_and_read_only():
    mean = np.zeros(5)
    policy = make_policy(mean=mean)
    mean[:] = 9.0
    assert (policy.mean == 0.0).all()
    with pytest.raises(ValueError, match="read-only"):
        policy.weights[0][0, 0] = 1.0


@pytest.mark.parametrize("shape", [(5,), (2, 4), (2, 5, 1), ()])
def test_wrong_observation_shape(shape):
    with pytest.raises(InvalidValueError, match=r"Invalid observation.*numbers of shape \(N, 5\)"):
        make_policy()(np.full(shape, "a"))
    with pytest.raises(ShapeError, match=r"observation has shape .* Expected \(N, 5\)"):
        make_policy()(np.zeros(shape))
    with pytest.raises(NonFiniteError, match=r"observation is not finite.*\(1, 4\)"):
        make_policy()(np.vstack([np.zeros(5), [0.0, 0.0, 0.0, 0.0, np.nan]]))
    with pytest.raises(InvalidValueError, match="Invalid policy: 3. Expected the path of one"):
        Policy.load(3)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"activation": "swish"}, UnknownOptionError, "'swish'. Valid choices: tanh, relu, elu"),
        ({"clip": -1.0}, InvalidValueError, "Invalid clip: -1.0. Expected a positive"),
        ({"variance": np.ones(4)}, ShapeError, r"variance has shape \(4,\). Expected \(5\)"),
        ({"mean": np.full(5, np.nan)}, NonFiniteError, r"mean is not finite.*index \(0,\)"),
        ({"variance": -np.ones(5)}, NonFiniteError, "square root of normalisation.variance"),
        ({"weights": [np.zeros((3, 6))], "biases": [np.zeros(3)]}, ShapeError, r"layers\.0\.w"),
    ],
)
def test_inconsistent_fields(changes, error, message):
    with pytest.raises(error, match=message):
        make_policy(**changes)


def test_check_names_both_values():
    policy = make_policy()
    policy.check(env_id="fbid_gym/BipedBalance-v0", observation_size=5, action_size=3)
    others = {"env_id": "fbid_gym/QuadrupedBalance-v0", "observation_size": 6, "action_size": 2}
    for name, value in others.items():
        with pytest.raises(PolicyFileError, match=f"{name} .* Expected {value!r}"):
            policy.check(**{name: value})


def test_nothing_to_load(tmp_path):
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(PolicyFileError, match=re.escape("config.json: not safetensors")):
        Policy.load(tmp_path / "config.json")


def forged(file, tensors, **changes):
    """Write a policy with other entries and arrays, and a digest that fits them."""
    make_policy().save(file)
    bundle = load_bundle(file, PolicyFileError)
    data = {key: value for key, value in (bundle.data | changes).items() if value is not ...}
    held = {key: v for key, v in (bundle.tensors | tensors).items() if v is not None}
    save_bundle(file, data, held)


FORGED = {
    "format": (dict(format=4), "format is 4. Expected 3"),
    "no entry": (dict(clip=...), "entry 'clip' is missing or unknown. Expected env_id, env_args"),
    "another entry": (dict(norm="layer"), "entry 'norm' is missing or unknown. Expected env_id"),
    "output": (dict(output="softmax"), "Unknown output 'softmax'. Valid choices: clip, tanh"),
    "env id": (dict(env_id=3), "Expected `str`, got `int` - at `$.env_id`"),
    "module": (dict(env_id="evil:mine/A-v0"), "Invalid env_id: 'evil:mine/A-v0'. Expected the id"),
    "clip beyond a float": (dict(clip=10**400), "Number out of range - at `$.clip`"),
    "steps": (dict(trained_steps=True), "Expected `int`, got `bool` - at `$.trained_steps`"),
}
HELD = {  # tensors, and what is said
    "missing": ({"layers.1.bias": None}, "tensor 'layers.1.bias' is missing or unknown. Expected"),
    "another": ({"scale": np.ones(3)}, "tensor 'scale' is missing or unknown. Expected"),
    "shape": ({"layers.1.weight": np.zeros((6, 8))}, "has shape (6, 8). Expected (any, 7)"),
    "integers": ({"layers.2.bias": np.zeros(3, int)}, "tensor 'layers.2.bias' is int64. Expected"),
    "nan": ({"layers.2.bias": np.full(3, np.nan)}, "layers.2.bias is not finite: first NaN or"),
}


@pytest.mark.parametrize("forgery", [*FORGED, *HELD])
def test_what_is_no_policy_gives_one_clear_error(tmp_path, forgery):
    changes, message = FORGED.get(forgery) or HELD[forgery]
    file = tmp_path / "p.safetensors"
    forged(file, changes) if forgery in HELD else forged(file, {}, **changes)
    with pytest.raises(PolicyFileError) as caught:
        Policy.load(file)
    assert str(caught.value).startswith(f"{file}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_json_cannot_hold_as_it_is_is_refused_and_the_old_file_kept(tmp_path):
    policy, file = make_policy(), tmp_path / "p.safetensors"
    options = {"layer_options": {"swing_frequency": Falling(2.0)}}
    for kept in (False, True):
        for args, error, words in (
            ({"x": object()}, FbidError, r"p\.safetensors.*values JSON can hold"),
            (options, InvalidValueError, r"env_args.layer_options.swing_frequency"),
        ):
            with pytest.raises(error, match=words):
                dataclasses.replace(policy, env_args=args).save(file)
            assert file.exists() == kept
        policy.save(file)
    assert Policy.load(file).env_args == policy.env_args
