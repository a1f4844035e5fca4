"""How firmly a robot that walks is held to what its gait asks: gains by how fast it falls."""

from typing import NamedTuple

from fbid_gym.robots import Robot


class WalkingGains(NamedTuple):
    """Of a robot that walks: stiffness 1/s^2, damping 1/s.

    Attributes:
        height: of the base.
        height_damping: of the base.
        rotation: of the base.
        rotation_damping: of the base.
        swing: of feet in the air.
        swing_damping: of feet in the air.
        hold: 1/s, of feet that stand, on what they move.
        posture: of the joints.
        posture_damping: of the joints.
    """

    height: float
    height_damping: float
    rotation: float
    rotation_damping: float
    swing: float
    swing_damping: float
    hold: float
    posture: float
    posture_damping: float

    @classmethod
    def of(cls, robot: Robot, omega: float) -> "WalkingGains":
        """Derive the gains from the rate omega (1/s) at which the robot falls."""
        of_kind = _ON_SOLES if robot.has_soles else _ON_POINTS
        if has_spare_joints(robot):
            # Held as firmly as a foot in the air: else a leg turns about its ends.
            of_kind = of_kind._replace(posture=of_kind.swing, posture_damping=of_kind.swing_damping)
        powers = cls(2, 1, 2, 1, 2, 1, 1, 2, 1)
        return cls(*(gain * omega**power for gain, power in zip(of_kind, powers, strict=True)))


def has_spare_joints(robot: Robot) -> bool:
    """Whether it can move while its feet, which are points, and its base stay where they are."""
    return not robot.has_soles and robot.num_joints > 3 * robot.num_feet


# In units of omega, to the power of the unit. On points a robot has no ankles: what it does with
# its joints is all in its feet and its body, but where it has joints to spare.
_ON_POINTS = WalkingGains(4.4, 3.4, 5.9, 4.3, 26.0, 10.0, 5.0, 0.0, 0.34)
_ON_SOLES = WalkingGains(7.84, 5.6, 6.25, 5.0, 49.0, 14.0, 2.9, 4.84, 4.4)
