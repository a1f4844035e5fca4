"""Sizes that obstacles and rocks share, in units of the robot's reach: 0.12 m for `quadruped`."""

HALF_SIZE = 28.0
"""Of the square of ground that is not level."""

START_SPACING = 10.0
"""Distance of the places to start from."""

CLEARING = 1.8
"""Radius of these places."""
