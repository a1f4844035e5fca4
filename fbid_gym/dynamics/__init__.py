"""Dynamics terms of a batch of robots, from two providers that agree."""

from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.terms import DynamicsTerms

__all__ = ["DynamicsTerms", "MuJoCoDynamics"]
