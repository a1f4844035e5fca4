"""A humanoid of the Unitree G1's class: 29 joints, 33.3 kg, two flat feet."""

ASSET = "g1.xml"
"""The model; every mass, length and limit has its source there."""

FEET = {
    side: tuple(f"{side}_{corner}" for corner in ("toe_out", "toe_in", "heel_out", "heel_in"))
    for side in ("left", "right")
}
"""The corners of each sole."""

_HIP, _KNEE = -0.2638, 0.6
_PITCH = {
    "hip_pitch": _HIP,
    "knee": _KNEE,
    "ankle_pitch": -_HIP - _KNEE,
    "shoulder_pitch": 0.2,
    "elbow": 0.9,
}
_SIDEWAYS = {"shoulder_roll": 0.2}
HOME = {
    f"{side}_{joint}": sign * angle
    for side, mirror in (("left", 1.0), ("right", -1.0))
    for angles, sign in ((_PITCH, 1.0), (_SIDEWAYS, mirror))
    for joint, angle in angles.items()
}
"""Joint angles in rad; joints not named are 0.

The knees are bent enough to lift a foot or take a push. The ankle keeps the sole flat under an
upright trunk, and the hip angle is the one that puts the centre of mass over the centre of the
soles (solved for; the tests hold it to 1 mm). The arms hang a little off the trunk with bent
elbows.
"""
