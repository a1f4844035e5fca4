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

_MEDIUM = ("*_hip_pitch", "*_hip_yaw", "waist_yaw")
_HEAVY = ("*_hip_roll", "*_knee")
_PAIR = ("*_ankle_*", "waist_roll", "waist_pitch")
_WRIST = ("*_wrist_pitch", "*_wrist_yaw")


def _by_motor(
    rest: float, medium: float, heavy: float, pair: float, wrist: float
) -> dict[str, float]:
    groups = (("*",), rest), (_MEDIUM, medium), (_HEAVY, heavy), (_PAIR, pair), (_WRIST, wrist)
    return {joint: value for joints, value in groups for joint in joints}


MOTORS = {
    "no_load_speed": _by_motor(40.13, 35.52, 22.7, 40.13, 24.76),
    "full_speed": _by_motor(30.86, 22.63, 14.5, 30.86, 15.3),
    "viscous_friction": _by_motor(0.06, 0.16, 0.24, 0.12, 0.06),
    "dry_friction": _by_motor(0.6, 1.6, 2.4, 1.2, 0.6),
}
"""Speeds in rad/s, friction in N·m·s/rad and N·m, of the maker's motors N5020-16, N7520-14.3,
N7520-22.5, a pair of N5020-16, W4010-25 (unitreerobotics/unitree_rl_lab, unitree_actuators.py: X2,
X1, Fd, Fs). Argued: a pair has twice the friction of one.
"""
