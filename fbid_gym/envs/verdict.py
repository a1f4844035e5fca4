"""Verdict on a robot, in a few sentences: the layers in which it stands and walks, and a policy."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.fitting import check_fits
from fbid_gym.envs.registered import registered
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot
from fbid_gym.runtime.config import AROUND, EnvConfig

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


def by_policy(robot: Robot, policy: Policy) -> str:
    """Say how a robot does by a policy of bodies, beside the zero action of its layer.

    As `verdict` says it of layers, in the policy's own environment. Raises FbidError for a policy
    of other joints that sees or moves them, or of other feet, and for a robot that cannot walk.
    """
    given = {**registered(policy.env_id).kwargs, **policy.env_args}
    arguments = {name: value for name, value in given.items() if name not in AROUND}
    told = [
        f"{name} {up:.0%}, with {earned:.0%} of the reward that there is"
        for name, (up, earned) in (
            ("the policy", _tried(robot, arguments, policy)),
            (f"the zero action of {arguments['action_layer']}", _tried(robot, arguments)),
        )
    ]
    return f"Up to the end in {policy.env_id.rpartition('/')[2]}: {'; '.join(told)}."


def survival(robot: Robot, arguments: Mapping[str, Any]) -> float:
    """Return the share of robots that are up at the end, by the zero action.

    The arguments are of the environment, beside robot, time and pushes.
    """
    return _tried(robot, arguments)[0]


def _tried(
    robot: Robot, arguments: Mapping[str, Any], policy: Policy | None = None
) -> tuple[float, float]:
    """Shares of robots that are up at the end, and of the greatest reward."""
    own = {"robot": robot, "episode_seconds": _SECONDS, "push_force": (0.0, 0.0)}
    batch = EnvBatch(EnvConfig.of({**arguments, **own}), _ROBOTS)
    for number in range(_ROBOTS):
        batch.seed(number, np.random.default_rng(number))
    batch.reset(np.arange(_ROBOTS))
    size = len(batch.action_names)
    if policy is not None:
        check_fits(policy, robot, batch.observation().shape[1], size)
    up, earned = np.ones(_ROBOTS, bool), 0.0
    for _ in range(batch.num_steps):
        zero = np.zeros((_ROBOTS, size))
        step = batch.step(zero if policy is None else policy(batch.observation()))
        up &= ~step.terminated
        earned += float(step.reward[up].sum())
        if not up.any():
            break
    return float(up.mean()), earned / batch.num_steps / _ROBOTS


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
