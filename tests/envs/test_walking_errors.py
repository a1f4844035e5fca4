"""Bad arguments of walking environments: one clear error each."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.errors import FbidError, RobotError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.motions.target import MotionKind
from tests.batches import begun
from tests.dogs import CORNERS, dog

QUADRUPED, BIPED = "fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0"


@pytest.mark.parametrize(
    ("env", "arguments", "message"),
    [
        (QUADRUPED, {"gait": "canter"}, f"gait 'canter'. .*{', '.join(PATTERNS)}"),
        (BIPED, {"gait": "trot"}, "gait 'trot' of a biped. .*walk"),
        (QUADRUPED, {"gait_period": 0.0}, "gait_period: 0.0. Expected .* from 0.5 to 10"),
        (QUADRUPED, {"forward_range": (0.0, 5.0)}, r"forward_range: .*a pair -2 <= least <= most"),
        (
            QUADRUPED,
            {"action_layer": "com_wrench", "layer_options": {"balancer": "ott2011"}},
            "balancer: 'ott2011'. Expected \"inverse_dynamics\" on a gait",
        ),
        (QUADRUPED, {"height_range": (0.9, 1.0)}, "'height_range'. Nearest of .*height_scan"),
    ],
)
def test_bad_arguments(env, arguments, message):
    with pytest.raises(FbidError, match=message):
        gym.make(env, **arguments)


def test_a_gait_for_a_robot_with_too_few_feet():
    one, *others = CORNERS
    with pytest.raises(RobotError, match="has 3 feet: .*Expected four to walk on"):
        gait_of(dog(feet=others), 250)
    for names in ([one], others):
        with pytest.raises(RobotError, match=f"has {len(names)} feet: .*Expected four to walk on"):
            gym.make(QUADRUPED, robot=dog(feet=names))


def test_feet_that_no_inverse_kinematics_places():
    message = "Foot 'front_left' .* hangs from 2 joints .* at least three"
    with pytest.raises(RobotError, match=message):
        make_layer("joint_acceleration", dog(rolls=False), 250, MotionKind(True, 6.0))
    with pytest.raises(RobotError, match=message):
        gym.make(QUADRUPED, robot=dog(rolls=False), action_layer="joint_position")


def test_clipped_footholds_are_counted():
    """A foothold as far away as the action can put it is out of reach at a high speed."""
    fast = {"forward_range": (2.0, 2.0), "sideways_range": (0.0, 0.0), "turning_range": (0.0, 0.0)}
    env = begun(QUADRUPED, seed=1, action_layer="torque", layer_options={"footholds": True}, **fast)
    action = np.zeros(env.action_space.shape, np.float32)
    action[-8::2] = 1.0
    counts = [env.step(action)[4]["clipped_footholds"] for _ in range(15)]
    assert counts == sorted(counts) and counts[-1] > 0
