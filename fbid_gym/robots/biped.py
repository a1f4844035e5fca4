"""The biped of [M10] IV.A: lower half of a Sarcos-class humanoid, 16 joints, two flat feet."""

ASSET = "biped.xml"
"""The model; every mass, length and limit has its source there."""

FEET = {
    side: tuple(f"{side}_{corner}" for corner in ("toe_out", "toe_in", "heel_out", "heel_in"))
    for side in ("left", "right")
}
"""Four point contacts per foot, [M10] IV.A."""

_HIP, _KNEE = -0.2105, 0.45
HOME = {
    f"{side}_{joint}": angle
    for side in ("left", "right")
    for joint, angle in (
        ("hip_pitch", _HIP),
        ("knee", _KNEE),
        ("ankle_pitch", -_HIP - _KNEE),
    )
}
"""Joint angles in rad; joints not named are 0.

The knee is bent well away from its singularity at 0 but not so far that standing is tiring. The
ankle keeps the sole flat under an upright trunk, and the hip angle is the one that puts the centre
of mass over the centre of the soles (solved for; the tests hold it to 1 mm).
"""

MOTORS = {"no_load_speed": 10.0}
"""rad/s, argued: the robot's makers publish none. Hydraulic legs of this size are built for about
that, and a straight line lies below what a valve gives: its flow falls with the root of the
pressure.
"""
