"""A LittleDog-like quadruped: 12 joints, four point feet."""

import math

ASSET = "quadruped.xml"
"""The model; every mass, length and limit has its source there."""

FEET = {leg: (f"{leg}_foot",) for leg in ("front_left", "front_right", "hind_left", "hind_right")}
"""One point contact per foot."""

_UPPER, _LOWER = 0.0751, 0.102  # m, link lengths of the model
_HIP = 0.6
_KNEE = -_HIP - math.asin(_UPPER * math.sin(_HIP) / _LOWER)
HOME = {
    f"{end}_{side}_{joint}": sign * angle
    for end, sign in (("front", 1.0), ("hind", -1.0))
    for side in ("left", "right")
    for joint, angle in (("hip_pitch", _HIP), ("knee", _KNEE))
}
"""Joint angles in rad; hip rolls are 0.

The knee angle puts each foot straight below its hip, so the centre of mass is over the centre of
the feet; the hip angle makes the robot 0.20 m tall.
"""

MOTORS = {"no_load_speed": 12.0}
"""rad/s, argued: 8,000 rpm, a coreless motor of a few watts, behind the 70:1 gear that the file's
armature stands for. A straight line is that of such a motor; the maker publishes none.
"""
