"""Dynamics terms of a batch of robots, from two providers that agree."""

from typing import TYPE_CHECKING, Any

from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.quantities import CentroidalTerms, DynamicsTerms

if TYPE_CHECKING:
    from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics

__all__ = [
    "CentroidalTerms",
    "DynamicsTerms",
    "MuJoCoDynamics",
    "PinocchioDynamics",
    "centroidal_terms",
]


def __getattr__(name: str) -> Any:
    # Pinocchio is loaded by those who ask for it.
    if name == "PinocchioDynamics":
        from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics

        return PinocchioDynamics
    raise AttributeError(f"module 'fbid_gym.dynamics' has no attribute {name!r}")
