"""Bad arguments of walking environments: one clear error each."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.errors import FbidError, RobotError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.target import MotionKind
from fbid_gym.robots import Robot

QUADRUPED, BIPED = "fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0"
TERRAIN = "fbid_gym/QuadrupedTerrain-v0"


@pytest.mark.parametrize(
    ("env", "arguments", "message"),
    [
        (QUADRUPED, {"gait": "canter"}, "gait 'canter'. .*trot, walk, pace, bound, stand"),
        (BIPED, {"gait": "trot"}, "gait of a biped 'trot'. .*walk"),
        (QUADRUPED, {"forward_range": (0.5, -0.5)}, r"Invalid forward_range: .*least"),
        (QUADRUPED, {"forward_range": (0.0, 5.0)}, r"forward_range: .*a pair -2 <= least <= most"),
        (TERRAIN, {"terrain": "lava"}, "terrain 'lava'. Valid choices: flat, .*slopes, .*stairs"),
        (
            QUADRUPED,
            {"action_layer": "joint_position", "layer_options": {"reference": "crawl"}},
            "reference 'crawl'. .*gait, home",
        ),
        (
            QUADRUPED,
            {"action_layer": "com_wrench", "layer_options": {"balancer": "ott2011"}},
            "balancer: 'ott2011'. Expected \"inverse_dynamics\" on a gait",
        ),
        (QUADRUPED, {"height_range": (0.9, 1.0)}, "'height_range'.*forward_range"),
    ],
)
def test_bad_arguments(env, arguments, message):
    with pytest.raises(FbidError, match=message):
        gym.make(env, **arguments)


LEG = """
<body name="{name}_upper" pos="{x} {y} 0">
  <inertial pos="0 0 -0.1" mass="0.5" diaginertia="0.002 0.002 0.002"/>
  <joint name="{name}_pitch" axis="0 1 0" range="-2 3"/>
  <body name="{name}_lower" pos="0 0 -0.2">
    <inertial pos="0 0 -0.1" mass="0.5" diaginertia="0.002 0.002 0.002"/>
    <joint name="{name}_knee" axis="0 1 0" range="-2.5 -0.1"/>
    <geom name="{name}" size="0.02" pos="0 0 -0.2" mass="0"/>
  </body>
</body>
"""
PLACES = {"fl": (0.2, 0.13), "fr": (0.2, -0.13), "hl": (-0.2, 0.13), "hr": (-0.2, -0.13)}


@pytest.fixture
def planar(tmp_path):
    """Build a robot whose legs cannot move sideways: two joints each."""

    def build(names):
        legs = "".join(LEG.format(name=name, x=x, y=y) for name, (x, y) in PLACES.items())
        joints = [f"{name}_{joint}" for name in PLACES for joint in ("pitch", "knee")]
        motors = "".join(
            f'<motor name="{joint}" joint="{joint}" ctrlrange="-30 30"/>' for joint in joints
        )
        path = tmp_path / "planar.xml"
        path.write_text(
            '<mujoco model="planar"><compiler angle="radian"/><worldbody><body name="trunk">'
            '<freejoint/><inertial pos="0 0 0" mass="6" diaginertia="0.05 0.1 0.1"/>'
            f"{legs}</body></worldbody><actuator>{motors}</actuator></mujoco>"
        )
        home = {joint: 0.8 if joint.endswith("pitch") else -1.6 for joint in joints}
        return Robot.from_mjcf(path, names, home=home)

    return build


def test_a_gait_for_a_robot_with_too_few_feet(planar):
    with pytest.raises(RobotError, match="has 3 feet: .*Expected four to walk on"):
        gait_of(planar(["fl", "fr", "hl"]), 250)
    for names in (["fl"], ["fl", "fr", "hl"]):
        with pytest.raises(RobotError, match=f"has {len(names)} feet: .*Expected four to walk on"):
            gym.make(QUADRUPED, robot=planar(names))


def test_feet_that_no_inverse_kinematics_places(planar):
    with pytest.raises(RobotError, match="Foot 'fl' .* hangs from 2 joints .* at least three"):
        kind = MotionKind(True, 6.0)
        make_layer("joint_acceleration", planar(list(PLACES)), 250, kind)
    with pytest.raises(RobotError, match="Foot 'fl' .* hangs from 2 joints .* at least three"):
        gym.make(QUADRUPED, robot=planar(list(PLACES)), action_layer="joint_position")


def test_clipped_footholds_are_counted():
    """A foothold as far away as the action can put it is out of reach at a high speed."""
    fast = {"forward_range": (2.0, 2.0), "sideways_range": (0.0, 0.0), "turning_range": (0.0, 0.0)}
    env = gym.make(QUADRUPED, action_layer="torque", layer_options={"footholds": True}, **fast)
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape, np.float32)
    action[-8::2] = 1.0
    counts = [env.step(action)[4]["clipped_footholds"] for _ in range(15)]
    assert counts == sorted(counts) and counts[-1] > 0
