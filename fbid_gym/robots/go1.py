"""A quadruped of the Unitree Go1's class: 12 joints, 12.7 kg, four point feet."""

ASSET = "go1.xml"
"""The model; every mass, length and limit has its source there."""

FEET = {leg: (f"{leg}_foot",) for leg in ("front_left", "front_right", "hind_left", "hind_right")}
"""One point contact per foot."""

HOME = {
    f"{end}_{side}_{joint}": angle
    for end in ("front", "hind")
    for side in ("left", "right")
    for joint, angle in (("hip_pitch", 0.8922), ("knee", -1.7686))
}
"""Joint angles in rad; hip rolls are 0.

The hips are 0.29 m above the floor. The feet are not quite below them: the trunk's centre of mass
lies ahead of its middle, and these angles put the feet's centre below the robot's (solved for; the
tests hold it to 1 mm).
"""

MOTORS = {
    "no_load_speed": {"*": 30.1, "*_knee": 20.06},
    "full_speed": {"*": 13.5, "*_knee": 9.0},
    "viscous_friction": 0.01,
    "dry_friction": 0.2,
}
"""Speeds in rad/s, friction in N·m·s/rad and N·m.

Largest speeds and frictions are the maker's (unitreerobotics/unitree_ros, go1_description). Where
the line begins to fall is what the maker gives for the motor of the same size in its next robot, of
the same speed (unitreerobotics/unitree_rl_lab, actuator Go2HV: 13.5 of 30 rad/s); the knee's is
behind a further gear of 3:2. The file's damping stands for both frictions at 10 rad/s.
"""
