"""The environments of this package, by what defines each."""

from typing import Any

# What one learns from must be cheap: the papers' rates cost four times as much.
_LIGHT = {
    "physics_hz": 250,
    "control_hz": 250,
    "friction_cone": "pyramidal",
    "solver_iterations": 20,
    "solver_warm_start": False,
    "episode_seconds": 20.0,
}
_ON_SOLES = {
    "forward_range": (-0.14, 0.14),
    "sideways_range": (-0.05, 0.05),
    "turning_range": (-0.12, 0.12),
    "push_force": (0.0, 0.0),
}

ENVIRONMENTS: dict[str, dict[str, Any]] = {
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
    "fbid_gym/QuadrupedWalk-v0": {"robot": "go1", "task": "walk", **_LIGHT},
    "fbid_gym/BipedWalk-v0": {"robot": "biped", "task": "walk", **_LIGHT, **_ON_SOLES},
    "fbid_gym/HumanoidWalk-v0": {"robot": "humanoid", "task": "walk", **_LIGHT, **_ON_SOLES},
    "fbid_gym/QuadrupedTerrain-v0": {
        "robot": "go1",
        "task": "walk",
        "terrain": "mixed",
        "push_force": (0.0, 0.0),
        **_LIGHT,
    },
    "fbid_gym/BipedTerrain-v0": {
        "robot": "biped",
        "task": "walk",
        "terrain": "mixed",
        **_LIGHT,
        **_ON_SOLES,
    },
}
"""Registered id -> arguments that define it."""
