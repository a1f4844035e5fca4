"""Motions: what a robot's joints, base and feet shall do over time."""

from fbid_gym.motions.reference import Reference, home_reference

__all__ = ["Reference", "home_reference"]
