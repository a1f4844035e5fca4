"""Simulation, vector and scalar environments, and their registration with Gymnasium."""

import gymnasium as gym

ENVIRONMENTS = {
    "fbid_gym/BipedBalance-v0": {"robot": "biped"},
    "fbid_gym/QuadrupedBalance-v0": {"robot": "quadruped"},
}
"""Registered id -> arguments that define it."""


def register() -> None:
    """Register the environments with Gymnasium; done by `import fbid_gym`."""
    for name, arguments in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                id=name,
                entry_point="fbid_gym.envs.balance_env:BalanceEnv",
                vector_entry_point="fbid_gym.envs.vector_env:BalanceVectorEnv",
                kwargs=arguments,
            )
