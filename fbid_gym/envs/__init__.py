"""Simulation, vector and scalar environments, and their registration with Gymnasium."""

import warnings

import gymnasium as gym

from fbid_gym.environments import ENVIRONMENTS as ENVIRONMENTS

ENTRY_POINT = "fbid_gym.envs.robot_env:RobotEnv"


def register() -> None:
    """Register the environments with Gymnasium; done by `import fbid_gym`."""
    # Version 0 is easier than version 1, and no worse: nobody has to be told to leave it.
    outdated = r".*fbid_gym/\w+-v0 is out of date"
    warnings.filterwarnings("ignore", outdated, DeprecationWarning)
    for name, arguments in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                id=name,
                entry_point=ENTRY_POINT,
                vector_entry_point="fbid_gym.envs.vector_env:RobotVectorEnv",
                kwargs=arguments,
            )
