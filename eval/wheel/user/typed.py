"""Names with the types that the package gives them.

An ignored error that a checker did not find is one itself: so it has seen the types.
"""

import numpy as np

import fbid_gym
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot, load

robot: Robot = load("biped")
weight: float = robot.weight
joints: tuple[str, ...] = robot.joint_names
words: str = robot.weight  # type: ignore[assignment]


def play(policy: Policy, observation: np.ndarray) -> np.ndarray:
    """Return what a policy does."""
    try:
        return policy(observation)
    except fbid_gym.FbidError as error:
        raise SystemExit(str(error)) from error
