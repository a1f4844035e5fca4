"""A humanoid of TORO's kind, the robot of [G15] section V: 27 joints, two flat feet."""

ASSET = "humanoid.xml"
"""The model; every mass, length and limit has its source there."""

FEET = {
    side: tuple(f"{side}_{corner}" for corner in ("toe_out", "toe_in", "heel_out", "heel_in"))
    for side in ("left", "right")
}
"""The corners of each sole."""

_HIP, _KNEE = -0.26, 0.6
_PITCH = {
    "hip_pitch": _HIP,
    "knee": _KNEE,
    "ankle_pitch": -_HIP - _KNEE,
    "shoulder_pitch": 0.25,
    "elbow": -0.9,
}
_SIDEWAYS = {"shoulder_roll": 0.1, "shoulder_yaw": -0.2}
HOME = {
    f"{side}_{joint}": sign * angle
    for side, mirror in (("left", 1.0), ("right", -1.0))
    for angles, sign in ((_PITCH, 1.0), (_SIDEWAYS, mirror))
    for joint, angle in angles.items()
}
"""Joint angles in rad; joints not named are 0.

The knees are bent as far as brings the robot from 1.74 m to the 1.7 m of [G15]. The ankle keeps the
sole flat under an upright trunk, and the hip angle is the one that puts the centre of mass over the
centre of the soles (solved for; the tests hold it to 1 mm). The arms hang a little off the trunk
with bent elbows.
"""

MOTORS = {
    "no_load_speed": {
        **{"*": 2.23, "*_hip_roll": 1.92, "*_knee": 1.92, "*_ankle_*": 1.92},
        **{"*_shoulder_yaw": 3.56, "*_elbow": 3.56, "*_forearm_yaw": 3.56, "*_wrist_roll": 3.21},
    },
    "full_speed": {
        **{"*": 1.49, "*_hip_roll": 1.28, "*_knee": 1.28, "*_ankle_*": 1.28},
        **{"*_shoulder_yaw": 2.37, "*_elbow": 2.37, "*_forearm_yaw": 2.37, "*_wrist_roll": 2.14},
    },
}
"""rad/s. Largest speeds are those of the lightweight arm whose drives TORO has (KUKA LWR 4+: 110
deg/s of its 176 N·m joints, 128 of those with 100 N·m, 204 and 184 of those with 38). Argued: knee
and ankle, between the first two in torque, count as the slowest; torque falls over the last third.
Its inner torque loop takes the gear's friction away, but for the file's damping.
"""
