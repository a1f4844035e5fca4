"""Policies in the forms that others run: what these compute is what the policy computes."""

import importlib.util
import json
import sys

import gymnasium as gym
import numpy as np
import pytest

from eval.export.__main__ import ExportConfig
from eval.export.__main__ import run as export
from eval.export.onnx_model import to_onnx
from fbid_gym.errors import FbidError, InvalidValueError, PolicyFileError, RunError
from fbid_gym.policy import ACTIVATIONS, OUTPUTS, Policy
from fbid_gym.robots import load

SHIPPED = "shipped:QuadrupedWalk-v0/joint_position_gait"
REMEDY = "is not installed: pip install -c constraints.txt 'fbid_gym[export]'"


@pytest.fixture(scope="module")
def onnx():
    return pytest.importorskip("onnx", reason=f"onnx {REMEDY}")


@pytest.fixture(scope="module")
def session():
    onnxruntime = pytest.importorskip("onnxruntime", reason=f"onnxruntime {REMEDY}")
    return lambda model: onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_every_kind_of_network_acts_the_same(onnx, session, activation, output):
    """Also far outside of what was observed, where all is clipped."""
    draw = np.random.default_rng(0)
    seen = {"mean": draw.normal(size=7), "variance": draw.uniform(1e-6, 4.0, 7), "clip": 3.0}
    weights = tuple(draw.normal(size=size) / 4.0 for size in ((16, 7), (16, 16), (3, 16)))
    biases = tuple(draw.normal(size=size) for size in (16, 16, 3))
    own = {"weights": weights, "biases": biases, "activation": activation, "output": output}
    policy = Policy(env_id="fbid_gym/BipedBalance-v0", env_args={}, **seen, **own)
    observation = (draw.normal(size=(50, 7)) * 10.0 ** draw.uniform(-3, 4, (50, 1))).astype("f")
    (actions,) = session(to_onnx(policy, {})).run(["actions"], {"obs": observation})
    np.testing.assert_allclose(actions, policy(observation), rtol=0, atol=1e-6)


def test_a_folder_of_the_hub_holds_all_that_it_takes(onnx, session, tmp_path):
    export(ExportConfig(SHIPPED, onnx=tmp_path / "walk.onnx", hub=tmp_path / "hub"))
    spec = importlib.util.spec_from_file_location("hub_env", tmp_path / "hub" / "env.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    envs = module.make_env(n_envs=2, use_async_envs=True, physics_hz=500)
    assert isinstance(envs, gym.vector.VectorEnv) and envs.num_envs == 2
    assert (envs.config.physics_hz, envs.config.action_layer) == (500, "joint_position")
    policy = Policy.load(tmp_path / "hub" / "policy.safetensors")
    assert (tmp_path / "hub" / "policy.onnx").read_bytes() == (tmp_path / "walk.onnx").read_bytes()
    net, (observation, _) = session(tmp_path / "walk.onnx"), envs.reset(seed=0)
    for _ in range(20):
        (actions,) = net.run(["actions"], {"obs": observation})
        np.testing.assert_allclose(actions, policy(observation), rtol=0, atol=1e-6)
        observation, *_ = envs.step(actions)
    told = net.get_modelmeta().custom_metadata_map
    robot, layer = load("go1"), envs.chunks.batches[0].layer
    assert told["joint_names"].split(",") == list(robot.joint_names)
    for name, values in (
        ("default_joint_pos", robot.home_qpos[7:]),
        ("joint_stiffness", layer.gains.stiffness),
        ("joint_damping", layer.gains.damping),
        ("action_scale", [layer.scale] * 12),
    ):
        np.testing.assert_allclose([float(x) for x in told[name].split(",")], values, rtol=1e-8)
    assert json.loads(told["observation_entries"]) == list(envs.observation_names)
    assert told["robot_sha256"] == robot.digest
    assert json.loads(told["layer_options"])["reference"] == "gait"
    envs.close()


def test_what_cannot_be_written_or_read_is_one_error(onnx, tmp_path, monkeypatch):
    with pytest.raises(InvalidValueError, match="--onnx FILE or --hub FOLDER"):
        export(ExportConfig(SHIPPED))
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(RunError, match=r"holds README\.md but no policy\.onnx, so no export"):
        export(ExportConfig(SHIPPED, hub=tmp_path))
    with pytest.raises(InvalidValueError, match=r"a file name ending in \.onnx"):
        export(ExportConfig(SHIPPED, onnx=tmp_path / "walk.pt"))
    export(ExportConfig(SHIPPED, onnx=tmp_path / "walk.onnx"))
    with pytest.raises(PolicyFileError, match=r"walk\.onnx: an ONNX model\. Expected"):
        Policy.load(tmp_path / "walk.onnx")
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(FbidError, match=r"pip install 'fbid_gym\[export\]'"):
        export(ExportConfig(SHIPPED, onnx=tmp_path / "other.onnx"))
    assert not (tmp_path / "other.onnx").exists()
