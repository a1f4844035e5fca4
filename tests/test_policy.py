import dataclasses
import json
import shutil

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
    assert loaded.hidden == widths[1:-1]


def test_forward_is_the_formula():
    """Against a loop over robots and layers in Python floats."""
    policy = make_policy(activation="elu")
    observations = np.random.default_rng(2).normal(scale=4.0, size=(6, 5))
    for observation, action in zip(observations, policy(observations), strict=True):
        x = [
            float(np.clip((o - m) / (v + policy.epsilon) ** 0.5, -2.0, 2.0))
            for o, m, v in zip(observation, policy.mean, policy.variance, strict=True)
        ]
        for layer, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
            x = [sum(map(float.__mul__, map(float, row), x)) + float(b)
                 for row, b in zip(weight, bias, strict=True)]  # fmt: skip
            if layer < len(policy.weights) - 1:
                x = [value if value > 0 else float(np.expm1(value)) for value in x]
        np.testing.assert_allclose(action, np.clip(x, -1.0, 1.0), atol=1e-5)


def test_actions_are_limited_and_deterministic():
    policy = make_policy()
    observation = np.random.default_rng(3).normal(scale=1e6, size=(50, 5))
    action = policy(observation)
    assert action.shape == (50, 3) and action.dtype == np.float32
    assert np.abs(action).max() == 1.0
    np.testing.assert_array_equal(policy(observation), action)


def test_squashed_actions_are_the_tanh_of_the_same_network():
    squashed, clipped = make_policy(output="tanh"), make_policy()
    observation = np.random.default_rng(3).normal(scale=0.1, size=(50, 5))
    free = np.arctanh(squashed(observation).astype(float))
    inside = np.abs(free) < 0.99
    assert inside.any() and np.abs(squashed(1e6 * observation)).max() <= 1.0
    np.testing.assert_allclose(free[inside], clipped(observation)[inside], atol=1e-5)


def test_a_policy_of_the_first_format_is_clipped_and_of_ppo(tmp_path):
    """As PPO's were written before there was another: without an output and an algorithm."""
    policy = make_policy()
    policy.save(tmp_path / "p")
    bundle = load_bundle(tmp_path / "p", "policy", PolicyFileError)
    data = {k: v for k, v in bundle.data.items() if k not in ("algorithm", "sha256")}
    network = {k: v for k, v in data["network"].items() if k != "output"}
    older = {**data, "format": 1, "network": network}
    save_bundle(tmp_path / "p", "policy", older, bundle.tensors)
    loaded = Policy.load(tmp_path / "p")
    assert (loaded.output, loaded.algorithm) == ("clip", "ppo")
    observation = np.random.default_rng(1).normal(scale=3.0, size=(9, 5))
    np.testing.assert_array_equal(loaded(observation), policy(observation))


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


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"activation": "gelu"}, UnknownOptionError, "'gelu'. Valid choices: tanh, relu, elu"),
        ({"output": "softmax"}, UnknownOptionError, "'softmax'. Valid choices: clip, tanh"),
        ({"activation": ["tanh"]}, UnknownOptionError, "Valid choices: tanh, relu, elu"),
        ({"clip": -1.0}, InvalidValueError, "Invalid clip: -1.0. Expected a positive"),
        ({"epsilon": np.nan}, InvalidValueError, "Invalid epsilon"),
        ({"env_id": 3}, InvalidValueError, "Invalid env_id: 3. Expected text"),
        ({"variance": np.ones(4)}, ShapeError, r"variance has shape \(4,\). Expected \(5\)"),
        ({"mean": np.full(5, np.nan)}, NonFiniteError, r"mean is not finite.*index \(0,\)"),
        ({"variance": -np.ones(5)}, NonFiniteError, "square root of normalisation.variance"),
        ({"weights": [np.zeros((3, 6))], "biases": [np.zeros(3)]}, ShapeError, r"layers\.0\.w"),
        ({"weights": []}, ShapeError, "weights"),
    ],
)
def test_inconsistent_fields(changes, error, message):
    with pytest.raises(error, match=message):
        make_policy(**changes)


def test_check_names_both_values():
    policy = make_policy()
    policy.check(env_id="fbid_gym/BipedBalance-v0", observation_size=5, action_size=3)
    for name, value in (
        ("env_id", "fbid_gym/QuadrupedBalance-v0"),
        ("observation_size", 6),
        ("action_size", 2),
    ):
        with pytest.raises(PolicyFileError, match=f"{name} .* Expected {value!r}"):
            policy.check(**{name: value})


def test_run_folder_and_interrupted_save_are_found(tmp_path):
    run = tmp_path / "run"
    (run / "policy").parent.mkdir()
    make_policy().save(run / "policy")
    assert Policy.load(run).trained_steps == 123
    (run / "policy").rename(run / ".policy.old")
    assert Policy.load(run).trained_steps == 123
    assert Policy.load(run / "policy").trained_steps == 123


def test_nothing_to_load(tmp_path):
    with pytest.raises(PolicyFileError, match=r"nowhere: no such folder\. Expected a policy fold"):
        Policy.load(tmp_path / "nowhere")
    with pytest.raises(PolicyFileError, match=r"no policy here\. Expected policy\.json"):
        Policy.load(tmp_path)
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(PolicyFileError, match="this run has exported no policy yet"):
        Policy.load(tmp_path)
    with pytest.raises(PolicyFileError, match="is a file"):
        Policy.load(tmp_path / "config.json")


def test_what_json_would_hold_as_something_else_is_refused(tmp_path):
    args = {"layer_options": {"swing_frequency": Falling(2.0)}}
    with pytest.raises(InvalidValueError, match=r"env_args.layer_options.swing_frequency"):
        make_policy(env_args=args).save(tmp_path / "policy")
    assert not (tmp_path / "policy").exists()


def _json(edit):
    """Damage that edits what policy.json holds."""

    def harm(folder):
        file = folder / "policy.json"
        data = json.loads(file.read_text())
        edit(data)
        file.write_text(json.dumps(data))

    return harm


def _says(**changes):
    return _json(lambda data: data.update(changes))


def _network(**changes):
    return _json(lambda data: data["network"].update(changes))


def _tensors(edit):
    def harm(folder):
        file = folder / "policy.safetensors"
        tensors = safetensors.numpy.load_file(file)
        edit(tensors)
        safetensors.numpy.save_file(tensors, file)

    return harm


def _holds(name, content):
    return lambda folder: (folder / name).write_bytes(content)


def _flip_a_bit(folder):
    file = folder / "policy.safetensors"
    content = bytearray(file.read_bytes())
    content[-7] ^= 1
    file.write_bytes(content)


FOREIGN = "friend.evil:fbid_gym/BipedBalance-v0"
DAMAGE = {  # truncated files are tried below, at any length
    "binary json": (_holds("policy.json", b"\xff\xfe\x00"), "policy.json: not JSON"),
    "json list": (_holds("policy.json", b"[1]"), "holds list. Expected a JSON"),
    "no json": (lambda f: (f / "policy.json").unlink(), "no policy here. Expected policy.json"),
    "no tensors": (lambda f: (f / "policy.safetensors").unlink(), "policy.safetensors: cannot be"),
    "header": (_holds("policy.safetensors", b"\x08" + 7 * b"\0" + b"{notjson"), "not safetensors"),
    "huge header": (_holds("policy.safetensors", 8 * b"\xff" + b"{}"), "not safetensors"),
    "bit flip": (_flip_a_bit, "corrupt, or from another save"),
    "format": (_says(format=3), "format is 3. Expected 1 or 2"),
    "true format": (_says(format=True), "format is True. Expected 1 or 2"),
    "older format": (_says(format=1), "network has 'output'. Expected activation"),
    "output": (
        _network(output="softmax"),
        "Unknown output 'softmax'. Valid choices: clip",
    ),
    "no output": (_network(output=None), "network.output is None. Expected"),
    "activation": (_network(activation="gelu"), "Unknown activation 'gelu'. Valid choices: tanh"),
    "hidden": (_network(hidden=[7, "6"]), "network.hidden is '6'. Expected a positive integer"),
    "more": (_network(norm="layer"), "'norm'. Expected activation, hidden, output alone"),
    "network": (_says(network=None), "network.hidden is None"),
    "algorithm": (_says(algorithm=3), "algorithm is 3. Expected a value of"),
    "env id": (_says(env_id=3), "env_id is 3. Expected a value of type str"),
    "module": (_says(env_id=FOREIGN), f"env_id is '{FOREIGN}', which names a module to import"),
    "clip": (
        _says(normalisation={"clip": -1, "epsilon": 1e-8}),
        "normalisation.clip is -1. Expected a positive number",
    ),
    "clip beyond a float": (
        _says(normalisation={"clip": 10**400, "epsilon": 1e-8}),
        "0. Expected a positive number.",
    ),
    "size": (
        _says(observation_size=6),
        "tensor 'normalisation.mean' is float64 (5,). Expected floats of shape (6,)",
    ),
    "size type": (_says(action_size=True), "action_size is True. Expected a positive integer"),
    "missing tensor": (
        _tensors(lambda t: t.pop("layers.1.bias")),
        "tensor 'layers.1.bias' is missing. Expected normalisation.mean",
    ),
    "wrong shape": (
        _tensors(lambda t: t.update({"layers.1.weight": np.zeros((6, 8))})),
        "tensor 'layers.1.weight' is float64 (6, 8). Expected floats of shape (6, 7)",
    ),
    "integers": (
        _tensors(lambda t: t.update({"layers.2.bias": np.zeros(3, int)})),
        "tensor 'layers.2.bias' is int64 (3,). Expected floats",
    ),
    "nan weight": (
        _tensors(lambda t: t.update({"layers.2.bias": np.float32([0.0, np.nan, 0.0])})),
        "layers.2.bias is not finite: first NaN or infinity at index (1,)",
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_files_give_one_clear_error(tmp_path, damage):
    harm, message = DAMAGE[damage]
    make_policy().save(tmp_path / "p")
    harm(tmp_path / "p")
    with pytest.raises(PolicyFileError) as caught:
        Policy.load(tmp_path / "p")
    assert message in str(caught.value)
    assert str(tmp_path / "p") in str(caught.value)


def test_every_truncation_is_noticed(tmp_path):
    make_policy(widths=(2, 2)).save(tmp_path / "whole")
    for name in ("policy.json", "policy.safetensors"):
        content = (tmp_path / "whole" / name).read_bytes().rstrip(b"\n")
        for length in range(0, len(content), 3):
            shutil.copytree(tmp_path / "whole", tmp_path / "cut", dirs_exist_ok=True)
            (tmp_path / "cut" / name).write_bytes(content[:length])
            with pytest.raises(PolicyFileError):
                Policy.load(tmp_path / "cut")


def test_what_json_cannot_hold_is_refused_and_the_old_file_kept(tmp_path):
    policy = make_policy()
    policy.save(tmp_path / "p")
    with pytest.raises(FbidError, match=r"policy\.json"):
        dataclasses.replace(policy, env_args={"x": object()}).save(tmp_path / "p")
    assert Policy.load(tmp_path / "p").env_args == policy.env_args
