"""What a robot does without a policy, in a few sentences: in which layers it stands and walks."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot
from fbid_gym.runtime.config import EnvConfig

_LAYERS = ("joint_position", "base_acceleration", "com_wrench")
_RATES = (500, 1000)  # Hz that are tried where a robot falls at an environment's own
_ROBOTS, _SECONDS, _SHARE = 8, 5.0, 0.8


def verdict(robot: Robot) -> Iterator[str]:
    """Say in which layers a robot stands and walks by the zero action, and what to change else.

    Eight robots each, for five seconds, without pushes, at the rates at which robots walk; walking
    as the environments command it. A robot does so where four of five stay up.
    """
    legs = "Biped" if robot.num_feet == 2 else "Quadruped"
    stand, walk = (ENVIRONMENTS[f"fbid_gym/{legs}{task}-v0"] for task in ("Balance", "Walk"))
    rates = {name: walk[name] for name in ("physics_hz", "control_hz")}
    for word, arguments in (("Stands", stand | rates), ("Walks", walk)):
        told, advice = list[str](), list[str]()
        for layer in _LAYERS:
            try:
                share = survival(robot, arguments | {"action_layer": layer})
                told.append(f"{layer} {share:.0%}")
                if share < _SHARE:
                    advice += _faster(robot, arguments | {"action_layer": layer})
            except FbidError as error:
                told.append(f"{layer} not at all")
                advice += [str(error)] * (str(error) not in advice)
        yield f"{word} up to the end: {', '.join(told)}."
        yield from advice


def survival(robot: Robot, arguments: Mapping[str, Any]) -> float:
    """Return the share of robots that are up at the end, by the zero action.

    Args:
        robot: the robot.
        arguments: of the environment, beside robot, time and pushes.
    """
    own = {"robot": robot, "episode_seconds": _SECONDS, "push_force": (0.0, 0.0)}
    batch = EnvBatch(EnvConfig.of({**arguments, **own}), _ROBOTS)
    for number in range(_ROBOTS):
        batch.seed(number, np.random.default_rng(number))
    batch.reset(np.arange(_ROBOTS))
    up, zero = np.ones(_ROBOTS, bool), np.zeros((_ROBOTS, len(batch.action_names)))
    for _ in range(batch.num_steps):
        up &= ~batch.step(zero).terminated
        if not up.any():
            break
    return float(up.mean())


def _faster(robot: Robot, arguments: Mapping[str, Any]) -> list[str]:
    """Try greater rates: light legs cannot be damped at low ones."""
    for hz in _RATES:
        if hz > arguments["physics_hz"]:
            share = survival(robot, {**arguments, "physics_hz": hz, "control_hz": hz})
            if share >= _SHARE:
                return [
                    f"In {arguments['action_layer']} it does at physics_hz={hz}, control_hz={hz}: "
                    f"{share:.0%}. Armature, which many files leave out, helps as well."
                ]
    return []
