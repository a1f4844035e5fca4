"""What a robot measures of itself, and what it makes of that: sensors, and an estimator."""

from fbid_gym.estimation.sensors import PRESETS, Sensors, sensors_of

__all__ = ["PRESETS", "Sensors", "sensors_of"]
