"""A policy as an ONNX model: from observations as the environment gives them to actions."""

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from fbid_gym.runtime import Controller

_OPSET, _FORMAT = 17, 8  # which runtimes of 2022 know
INPUT, OUTPUT = "obs", "actions"
"""Names of what goes in and comes out, as rsl_rl and mjlab have them."""


def to_onnx(policy: Policy, metadata: Mapping[str, str]) -> bytes:
    """Return a policy as an ONNX model: normalisation, clipping and network.

    It takes "obs" (N, O) float32 and gives "actions" (N, A) float32. What is normalised is computed
    in float64 as in `Policy`, whose variances may be tiny.

    Raises:
        FbidError: the package onnx is not installed.
    """
    try:
        import onnx
    except ModuleNotFoundError as error:
        raise FbidError(
            "An ONNX model needs onnx, which is not installed. It comes with the extra 'export': "
            "pip install 'fbid_gym[export]'."
        ) from error
    make, constants = onnx.helper, []

    def constant(name: str, value: Any, dtype: type) -> str:
        constants.append(onnx.numpy_helper.from_array(np.array(value, dtype), name))
        return name

    double, single = onnx.TensorProto.DOUBLE, onnx.TensorProto.FLOAT
    scale = np.sqrt(policy.variance + policy.epsilon)
    bounds = [constant(f"clip_{k}", k * policy.clip, np.float64) for k in (-1, 1)]
    nodes = [
        make.make_node("Cast", [INPUT], ["wide"], to=double),
        make.make_node("Sub", ["wide", constant("mean", policy.mean, np.float64)], ["centred"]),
        make.make_node("Div", ["centred", constant("deviation", scale, np.float64)], ["scaled"]),
        make.make_node("Clip", ["scaled", *bounds], ["clipped"]),
        make.make_node("Cast", ["clipped"], ["layer_0"], to=single),
    ]
    last = len(policy.weights) - 1
    for k, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        given = [
            constant(f"weight_{k}", weight, np.float32),
            constant(f"bias_{k}", bias, np.float32),
        ]
        nodes.append(make.make_node("Gemm", [f"layer_{k}", *given], [f"sum_{k}"], transB=1))
        if k < last:
            kind = {"tanh": "Tanh", "relu": "Relu", "elu": "Elu"}[policy.activation]
            nodes.append(make.make_node(kind, [f"sum_{k}"], [f"layer_{k + 1}"]))
    if policy.output == "tanh":
        nodes.append(make.make_node("Tanh", [f"sum_{last}"], [OUTPUT]))
    else:
        ends = [constant(name, k, np.float32) for name, k in (("least", -1.0), ("most", 1.0))]
        nodes.append(make.make_node("Clip", [f"sum_{last}", *ends], [OUTPUT]))
    graph = make.make_graph(
        nodes,
        "policy",
        [make.make_tensor_value_info(INPUT, single, ["N", policy.observation_size])],
        [make.make_tensor_value_info(OUTPUT, single, ["N", policy.action_size])],
        constants,
    )
    model = make.make_model(
        graph, opset_imports=[make.make_opsetid("", _OPSET)], producer_name="fbid_gym"
    )
    model.ir_version = _FORMAT
    make.set_model_props(model, dict(metadata))
    onnx.checker.check_model(model)
    found: bytes = model.SerializeToString()
    return found


def metadata_of(policy: Policy, controller: Controller, name: str) -> dict[str, str]:
    """Return what a user of a policy has to know beside its numbers, by name.

    The first eight are those that mjlab writes (`mjlab.rl.exporter_utils`), lists with commas
    between their items: layers without gains of joints have zeros there, and an action's scale is
    that in its name. The others are ours, in JSON where they are no plain words.
    """
    loop, robot, config = controller.loop, controller.robot, controller.config
    joints, layer = robot.num_joints, loop.layer
    gains = getattr(layer, "gains", None)
    still = np.zeros(joints)
    return {
        "run_path": name,
        "joint_names": _listed(robot.joint_names),
        "joint_stiffness": _listed(getattr(gains, "stiffness", still)),
        "joint_damping": _listed(getattr(gains, "damping", still)),
        "default_joint_pos": _listed(robot.home_qpos[7:]),
        "command_names": _listed(name for name in loop.observer.groups if name == "command"),
        "observation_names": _listed(loop.observer.seen),
        "action_scale": _listed(_scale(entry) for entry in loop.action_names),
        "environment": policy.env_id,
        "arguments": json.dumps(config.resolved(), ensure_ascii=False),
        "robot": robot.name,
        "robot_sha256": robot.digest,
        "action_layer": config.action_layer,
        "layer_options": json.dumps(config.resolved()["layer_options"], ensure_ascii=False),
        "gait": json.dumps(config.resolved().get("gait")),
        "rates_hz": json.dumps({"control": loop.rates.control, "policy": loop.rates.policy}),
        "observation_entries": json.dumps(loop.observer.names, ensure_ascii=False),
        "action_entries": json.dumps(loop.action_names, ensure_ascii=False),
        "torque_limit": _listed(robot.torque_limit),
    }


def _scale(entry: str) -> float:
    """Return action 1 in an entry's unit, as its name says."""
    told = re.search(r"\(x ([\d.e+-]+)", entry)
    return float(told[1]) if told else 1.0


def _listed(items: Iterable[Any]) -> str:
    return ",".join(item if isinstance(item, str) else f"{float(item):.9g}" for item in items)
