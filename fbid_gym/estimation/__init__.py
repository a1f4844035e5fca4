"""Sensors of a robot, and an estimator of its state from their readings."""

from fbid_gym.estimation.sensors import PRESETS, Sensors, sensors_of

__all__ = ["PRESETS", "Sensors", "sensors_of"]
