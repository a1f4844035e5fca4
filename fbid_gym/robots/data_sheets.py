"""Motors of the built-in robots: tables for `fbid_gym.robots.drives`, with their sources.

Speeds are in rad/s, friction in N·m·s/rad and N·m.
"""

from collections.abc import Mapping
from typing import Any

from fbid_gym.robots.built_in import BUILT_IN, load
from fbid_gym.robots.robot import Robot

_MEDIUM = ("*_hip_pitch", "*_hip_yaw", "waist_yaw")
_HEAVY = ("*_hip_roll", "*_knee")
_PAIR = ("*_ankle_*", "waist_roll", "waist_pitch")
_WRIST = ("*_wrist_pitch", "*_wrist_yaw")


def _by_motor(
    rest: float, medium: float, heavy: float, pair: float, wrist: float
) -> dict[str, float]:
    groups = (("*",), rest), (_MEDIUM, medium), (_HEAVY, heavy), (_PAIR, pair), (_WRIST, wrist)
    return {joint: value for joints, value in groups for joint in joints}


SHEETS: Mapping[str, Mapping[str, Any]] = {
    # Argued: the robot's makers publish none. Hydraulic legs of this size are built for about that,
    # and a straight line lies below what a valve gives: its flow falls with the root of the
    # pressure.
    "biped": {"no_load_speed": 10.0},
    # Argued: 8,000 rpm, a coreless motor of a few watts, behind the 70:1 gear that the file's
    # armature stands for. A straight line is that of such a motor; the maker publishes none.
    "quadruped": {"no_load_speed": 12.0},
    # Largest speeds are those of the lightweight arm whose drives TORO has (KUKA LWR 4+: 110 deg/s
    # of its 176 N·m joints, 128 of the next two, with 100 N·m, 204 of the fifth, 184 of the last
    # two, with 38; github.com/CentroEPiaggio/kuka-lwr, lwr_description/model/kuka_lwr.urdf.xacro).
    # Argued: knee and ankle, between the first two in torque, count as the slowest, joints of the
    # arms with 40 N·m as the fifth; torque falls over the last third. Its inner torque loop takes
    # the gear's friction away, but for the file's damping.
    "humanoid": {
        "no_load_speed": {
            **{"*": 2.23, "*_hip_roll": 1.92, "*_knee": 1.92, "*_ankle_*": 1.92},
            **{"*_shoulder_yaw": 3.56, "*_elbow": 3.56, "*_forearm_yaw": 3.56},
            "*_wrist_roll": 3.21,
        },
        "full_speed": {
            **{"*": 1.49, "*_hip_roll": 1.28, "*_knee": 1.28, "*_ankle_*": 1.28},
            **{"*_shoulder_yaw": 2.37, "*_elbow": 2.37, "*_forearm_yaw": 2.37},
            "*_wrist_roll": 2.14,
        },
    },
    # Largest speeds and frictions are the maker's (github.com/unitreerobotics/unitree_ros,
    # robots/go1_description/xacro/const.xacro; an earlier version has 21 rad/s for all joints).
    # Where the line begins to fall is what the maker gives for the motor of the same size in its
    # next robot, of the same speed (github.com/unitreerobotics/unitree_rl_lab,
    # unitree_actuators.py, Go2HV: 13.5 of 30 rad/s); the knee's is behind a further gear of 3:2.
    # The file's damping stands for both frictions at 10 rad/s.
    "go1": {
        "no_load_speed": {"*": 30.1, "*_knee": 20.06},
        "full_speed": {"*": 13.5, "*_knee": 9.0},
        "viscous_friction": 0.01,
        "dry_friction": 0.2,
    },
    # Of the maker's motors N5020-16, N7520-14.3, N7520-22.5, a pair of N5020-16, W4010-25
    # (github.com/unitreerobotics/unitree_rl_lab, unitree_actuators.py: X2, X1, Fd, Fs). Argued: a
    # pair has twice the friction of one.
    "g1": {
        "no_load_speed": _by_motor(40.13, 35.52, 22.7, 40.13, 24.76),
        "full_speed": _by_motor(30.86, 22.63, 14.5, 30.86, 15.3),
        "viscous_friction": _by_motor(0.06, 0.16, 0.24, 0.12, 0.06),
        "dry_friction": _by_motor(0.6, 1.6, 2.4, 1.2, 0.6),
    },
}
"""Name of a built-in robot -> the table of its motors."""


def motor_sheet(robot: Robot) -> Mapping[str, Any] | None:
    """Return the table of a built-in robot's motors; None of others.

    A robot of the user's may have the name of a built-in one.
    """
    known = robot.name in BUILT_IN and load(robot.name) is robot
    return SHEETS[robot.name] if known else None
