"""A proportional law as a policy: one gain, no learning.

It asks the body for K (commanded velocity - velocity), ahead and to the left, in the units of the
action layer; the other entries of its actions are zero. It is named where a policy is:

    fbid-gym eval proportional:24/QuadrupedWalk-v0/base_acceleration

Over the body's view it is a law in each robot's own units: K counts in sqrt(g / h), and 4 are 24/s
of a robot whose centre of mass is 0.27 m high.

    fbid-gym eval proportional:4/QuadrupedWalk-v0/base_acceleration/body --robot zoo:quadruped:7

An arm of a study may act by it, or by the zero action, instead of a training.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.registered import registered
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Choice, Number
from fbid_gym.policy import Policy
from fbid_gym.runtime.config import AROUND, EnvConfig
from fbid_gym.runtime.observer import BODY

ZERO = "zero"
"""Names the zero action."""

PREFIX = "proportional:"
"""What a name begins with; then come the gain, and with a policy's name environment and layer."""

LAW = "proportional"
"""What such a policy says has learnt it."""

GAIN = Number(0.0, 1e6, "1/s")

_LACK = "velocity {} short of the command ({})"
_BOUND = 1e6  # of what the policy sees, m/s: beyond any


def matrix_of(batch: EnvBatch, gain: float) -> np.ndarray:
    """Return the law of environments as a matrix (A, O), from observations to actions.

    Args:
        batch: the environments.
        gain: K, 1/s: m/s^2 that are asked of the body for each m/s that it is short of; of those
            who see the body alone in sqrt(g / h).

    Raises:
        InvalidValueError: nothing is commanded there, or the layer moves no body.
    """
    names = batch.observation_names
    own = batch.config.observation == BODY
    unit = "sqrt(g h)" if own else "m/s"
    lacks = [_LACK.format(way, unit) for way in ("ahead", "to the left")]
    if not set(lacks) <= set(names):
        expected = "one that commands velocities and observes its own, such as QuadrupedWalk-v0"
        raise InvalidValueError("task of a proportional law", batch.config.task, expected)
    # A layer of the user's need not say.
    entries = getattr(batch.layer, "per_acceleration", None)
    if entries is None:
        raise _moves_no_body(batch.config.action_layer)
    matrix = np.zeros((len(batch.action_names), len(names)))
    size = batch.robot.gravity if own else 1.0
    for row, lack in enumerate(lacks):
        matrix[row, names.index(lack)] = gain * size * entries[row]
    return matrix


def proportional(env_id: str, make_args: Mapping[str, Any], gain: float) -> Policy:
    """Return the law as a policy, a network of one linear layer.

    Args:
        env_id: of an environment of this package, or of a user's own task.
        make_args: its arguments; the action layer among them.
        gain: K, as of `matrix_of`.

    Raises:
        FbidError: such an environment cannot be made, or as `matrix_of`.
    """
    gain = GAIN.check("gain of a proportional law", gain)
    given = {**registered(env_id).kwargs, **make_args}
    config = EnvConfig.of({name: value for name, value in given.items() if name not in AROUND})
    law = matrix_of(EnvBatch(config, 1), gain)
    return Policy(
        env_id=env_id,
        env_args=dict(make_args),
        mean=np.zeros(law.shape[1]),
        variance=np.ones(law.shape[1]),
        weights=(law,),
        biases=(np.zeros(len(law)),),
        clip=_BOUND,
        algorithm=LAW,
        source=f"{PREFIX}{gain:g}",
    )


def gain_of(name: str) -> float:
    """Return the gain of a law `proportional:GAIN`; InvalidValueError for another name."""
    text = name.removeprefix(PREFIX)
    if text == name:
        raise InvalidValueError("policy", name, f"{ZERO}, or {PREFIX}GAIN such as {PREFIX}24")
    try:
        return GAIN.check("gain of a proportional law", float(text))
    except ValueError as error:
        raise InvalidValueError("gain of a proportional law", text, GAIN.words) from error


def check_unlearnt(policy: str, layer: str) -> None:
    """Raise InvalidValueError unless a policy without learning can act through a layer.

    Args:
        policy: "zero", or `proportional:GAIN`.
        layer: action layer; one of the user's is asked when it plays.
    """
    if policy == ZERO:
        return
    gain_of(policy)
    built = getattr(LAYERS.get(layer), "__self__", None)
    if built is not None and not hasattr(built, "per_acceleration"):
        raise _moves_no_body(layer)


def _moves_no_body(layer: str) -> InvalidValueError:
    expected = "one whose action moves the body, such as base_acceleration"
    return InvalidValueError("layer of a proportional law", layer, expected)


def named(path: Path) -> Policy | None:
    """Return the law `proportional:GAIN/ENVIRONMENT/LAYER[/body]`; None for another path.

    Raises:
        FbidError: a name that begins so, and ends otherwise.
    """
    if not str(path).startswith(PREFIX):
        return None
    gain, *rest = path.parts
    view = {"observation": BODY} if rest[2:] == [BODY] else {}
    if len(rest) != 2 + len(view):
        expected = (
            f"{PREFIX}GAIN/ENVIRONMENT/LAYER, such as {PREFIX}24/QuadrupedWalk-v0/com_wrench, "
            f"and /{BODY} for the body's view"
        )
        raise InvalidValueError("policy", str(path), expected)
    env_id = Choice(ENVIRONMENTS, "environment").check("environment", f"fbid_gym/{rest[0]}")
    layer = Choice(LAYERS, "action layer").check("action layer", rest[1])
    return proportional(env_id, {"action_layer": layer, **view}, gain_of(gain))
