"""Simulation, vector and scalar environments, and their registration with Gymnasium."""

import gymnasium as gym

ENVIRONMENTS = {
    "fbid_gym/BipedBalance-v0": {"robot": "biped", "task": "balance"},
    "fbid_gym/QuadrupedBalance-v0": {"robot": "quadruped", "task": "balance"},
    "fbid_gym/HumanoidBalance-v0": {"robot": "humanoid", "task": "balance"},
    "fbid_gym/BipedSquat-v0": {"robot": "biped", "task": "squat"},
    "fbid_gym/BipedStep-v0": {"robot": "biped", "task": "step"},
    "fbid_gym/QuadrupedCrawl-v0": {"robot": "quadruped", "task": "crawl"},
    "fbid_gym/QuadrupedRough-v0": {
        "robot": "quadruped",
        "task": "crawl",
        "terrain": "obstacles",
    },
}
"""Registered id -> arguments that define it."""

_DESCRIBED = {"balance": "balance_env:BalanceEnv"}


def register() -> None:
    """Register the environments with Gymnasium; done by `import fbid_gym`."""
    for name, arguments in ENVIRONMENTS.items():
        if name not in gym.registry:
            described = _DESCRIBED.get(arguments["task"], "tracking_env:TrackingEnv")
            gym.register(
                id=name,
                entry_point=f"fbid_gym.envs.{described}",
                vector_entry_point="fbid_gym.envs.vector_env:RobotVectorEnv",
                kwargs=arguments,
            )
