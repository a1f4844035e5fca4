"""The environments of this package, by what defines each."""

from typing import Any

# What one learns from must be cheap: the papers' rates cost four times as much.
_WALK = {
    "task": "walk",
    "physics_hz": 250,
    "control_hz": 250,
    "friction_cone": "pyramidal",
    "solver_iterations": 20,
    "solver_warm_start": False,
    "episode_seconds": 20.0,
}
_GO1 = {"robot": "go1", **_WALK}
_ON_SOLES = {
    "forward_range": (-0.14, 0.14),
    "sideways_range": (-0.05, 0.05),
    "turning_range": (-0.12, 0.12),
    "push_force": (0.0, 0.0),
}

# Version 1: commands as others train them, pushes three times as strong, loads and ground that laws
# do not know, and a reward that tells a good answer from a better one. All in robots' own units.
_UNKNOWN = {"payload": (0.0, 0.25), "friction": (0.3, 1.0)}
_HARDER = {
    "forward_range": (-0.93, 0.93),
    "sideways_range": (-0.5, 0.5),
    "turning_range": (-0.2, 0.2),
    "command_ramp": (0.5, 1.5),
    "push_weights": (0.0, 1.2),
    "randomisation": _UNKNOWN,
    "reward_weights": {
        "velocity": 0.5,
        "turning": 0.25,
        "clock": 0.1,
        "torque": 0.05,
        "upright": 0.05,
    },
    "reward_scales": {"velocity": 0.06, "turning": 0.03},
}
_HARDER_ON_SOLES = {
    **_HARDER,
    "gait": "brisk_walk",
    "forward_range": (-0.14, 0.32),
    "sideways_range": (-0.05, 0.05),
    "turning_range": (-0.12, 0.12),
    "push_weights": (0.0, 0.4),
    "reward_scales": {"velocity": 0.1, "turning": 0.05},
}

ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "fbid_gym/BipedBalance-v0": {"robot": "biped", "task": "balance"},
    "fbid_gym/QuadrupedBalance-v0": {"robot": "quadruped", "task": "balance"},
    "fbid_gym/HumanoidBalance-v0": {"robot": "humanoid", "task": "balance"},
    "fbid_gym/BipedSquat-v0": {"robot": "biped", "task": "squat"},
    "fbid_gym/BipedStep-v0": {"robot": "biped", "task": "step"},
    "fbid_gym/QuadrupedCrawl-v0": {"robot": "quadruped", "task": "crawl"},
    "fbid_gym/QuadrupedRough-v0": {"robot": "quadruped", "task": "crawl", "terrain": "obstacles"},
    "fbid_gym/QuadrupedWalk-v0": {**_GO1},
    "fbid_gym/BipedWalk-v0": {"robot": "biped", **_WALK, **_ON_SOLES},
    "fbid_gym/HumanoidWalk-v0": {"robot": "humanoid", **_WALK, **_ON_SOLES},
    "fbid_gym/QuadrupedTerrain-v0": {**_GO1, "terrain": "mixed", "push_force": (0.0, 0.0)},
    "fbid_gym/BipedTerrain-v0": {"robot": "biped", **_WALK, "terrain": "mixed", **_ON_SOLES},
    "fbid_gym/QuadrupedWalk-v1": {**_GO1, **_HARDER, "gait": "short_trot"},
    "fbid_gym/BipedWalk-v1": {"robot": "biped", **_WALK, **_HARDER_ON_SOLES},
    "fbid_gym/HumanoidWalk-v1": {"robot": "g1", **_WALK, **_HARDER_ON_SOLES},
    "fbid_gym/QuadrupedTerrain-v1": {
        **_GO1,
        **_HARDER,
        "terrain": "mixed",
        "curriculum": True,
        "forward_range": (-0.35, 0.58),
        "sideways_range": (-0.23, 0.23),
        "turning_range": (-0.13, 0.13),
        "push_weights": (0.0, 0.4),
    },
}
"""Registered id -> arguments that define it."""
