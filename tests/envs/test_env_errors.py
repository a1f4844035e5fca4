"""Bad input: one FbidError each, which names the value and what would have been valid."""

import itertools

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym
from fbid_gym.actions import make_layer
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError, InvalidValueError, NonFiniteError, RobotError, ShapeError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.motions.target import MotionKind
from fbid_gym.robots import Robot
from tests.batches import assert_same, begun
from tests.dogs import CORNERS, dog
from tests.robots.similar import turned

BIPED = next(iter(ENVIRONMENTS))
WALK, BIPED_WALK = "fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0"
ALL_ROBOTS = "biped, quadruped, humanoid, go1, g1"
FEEDFORWARD = "joint_position_feedforward"
BASE = {"action_layer": "base_acceleration"}


def options(layer="base_acceleration", **values):
    return {"action_layer": layer, "layer_options": values}


# A value outside its option's kind is refused in tests/envs/test_bad_arguments.py; here is one of
# each kind, for the words and the doors, and all that no kind can know.
BALANCE = [
    ({"action_layer": ["torque"]}, r"Unknown action layer \['torque'\]. Valid choices: torque,"),
    ({"action_layr": "torque"}, "argument 'action_layr'. Did you mean 'action_layer'"),
    ({"robot": "horse"}, f"Unknown robot 'horse'. Valid choices: {ALL_ROBOTS}, a Robot such"),
    ({"robot": "dog.xml"}, r"robot 'dog.xml'. .* a Robot such as Robot.load\(path\) makes."),
    # Options of the layers.
    (options("torque", gain=1.0), "'gain' of action layer 'torque'. Valid choices: footholds, ste"),
    ({"layer_options": "none"}, "Invalid layer_options: 'none'. Expected a dictionary"),
    (options(FEEDFORWARD, natural_frequency=90.0), "frequency: 90.0. Expected at most .* H"),
    (options(contacts=[(1.0, ["arm"])]), "foot 'arm' in contacts. Valid choices: left, right."),
    (options(contacts=[(1.0, "left")]), "Invalid contacts: .*'left'.*Expected phases .seconds >="),
    (options(min_normal_force=2.0, max_normal_force=1.0), "Invalid min_normal_force"),
    # Tasks and ground.
    ({"task": "squat", "height_range": (0.9, 1.0)}, "unexpected keyword argument 'height_range'"),
    ({"task": "crawl"}, "Robot 'biped' cannot crawl: it has 16 joints and the feet left, right."),
    ({"terrain": "mixed", "curriculum": True}, r"\('balance', 'mixed'\). Expected task 'walk' on"),
    ({"terrain": "stairs", "terrain_height": 0}, "height: 0.0. Expected none on terrain 'stairs'"),
    # Rates and times.
    ({"control_hz": 300}, r"control_hz: 300. Expected a divisor of physics_hz = 1000 .*3.33333"),
    ({"policy_hz": 60}, r"policy_hz: 60. Expected a divisor of control_hz = 500"),
    ({"episode_seconds": 0.01}, "episode_seconds: 0.01. Expected a time of at least 0.02 s"),
    # The task.
    ({"push_duration": 0.0001}, "push_duration: 0.0001. Expected a time of at least 0.002 s"),
    ({"push_interval": (0.1, 1.0)}, "push_interval: .*Expected at least push_duration = 0.15 s"),
    ({"height_range": (0.5, 1.0)}, r"Invalid height_range: \(0.5, 1.0\). Expected a pair 0.61 <="),
    # Domain randomisation.
    ({"randomisation": {"masses": 0.1}}, "randomisation 'masses'. Valid choices: mass, com, fric"),
    # What would take too much memory, or never end.
    ({"episode_seconds": 1e6}, r"push_interval: \(1.5, 3.0\). Expected at least 10 s at epi"),
    ({"height_interval": (1e-4, 1.0), "episode_seconds": 100.0}, "height_interval: .*100,000"),
    ({"task": "squat", "speed": 0.01}, "Invalid speed: 0.01. Expected what makes a motion of"),
    (options(contacts=[(1e6, ["left"])]), "contacts: .*200 s in all"),
    (options(contacts=[(0.0005, ["left"])]), "contacts: .*seconds >= 0.002"),
    (options(contacts=itertools.repeat((1.0, ["left"]))), "contacts: repeat"),
    (options(contacts={(1.0, ("left",))}), "contacts: {.*Expected phases"),
    (options(contacts=[(1.0, itertools.repeat("left"))]), "contacts: .*repeat"),
]
WALKING = [
    ({"gait": "canter"}, f"gait 'canter'. .*{', '.join(PATTERNS)}"),
    ({"gait_period": 0.0}, "gait_period: 0.0. Expected .* from 0.5 to 10"),
    ({"forward_range": (0.0, 5.0)}, r"forward_range: .*a pair -2 <= least <= most"),
    (
        options("com_wrench", balancer="ott2011"),
        "balancer: 'ott2011'. Expected \"inverse_dynamics\" on a gait",
    ),
    ({"height_range": (0.9, 1.0)}, "'height_range'. Nearest of .*height_scan"),
    # Rewards.
    (
        {"reward_weights": {"torqe": 0.1}},
        "reward term 'torqe' of task 'walk'. Did you mean 'torque'",
    ),
    ({"reward_scales": {"speed": 0.1}}, "with a scale 'speed' of task 'walk'.*velocity"),
    ({"reward_scales": {"torque": 0}}, r"reward_scales\['torque'\]: 0. Expected a number from"),
    # Sensors.
    ({"sensors": "best"}, "sensors 'best'"),
    ({"sensors": {"like": "mems", "imu_rate": 90}}, "a divisor of control_hz = 250"),
    ({"state": "estimated"}, "state"),
    ({"state": "guessed", "sensors": "mems"}, "'guessed'"),
    ({"observation": "measured"}, "observation"),
    ({"observation": "seen", "sensors": "mems"}, "'seen'"),
    ({"history": 900, "episode_seconds": 10.0}, "at most the 500 steps"),
]
ARGUMENTS = [(BIPED, *row) for row in BALANCE] + [(WALK, *row) for row in WALKING]
ARGUMENTS += [(BIPED_WALK, {"gait": "trot"}, "gait 'trot' of a biped. .*walk")]


@pytest.mark.parametrize(("env", "arguments", "message"), ARGUMENTS)
def test_bad_arguments_through_every_door(env, arguments, message):
    for make in (gym.make, gym.make_vec, fbid_gym.make_sb3):
        with pytest.raises(FbidError, match=message):
            make(env, **arguments)


def test_bad_render_modes():
    message = "Unknown render_mode 'ascii'. Valid choices: human, rgb_array."
    # gymnasium warns first, and goes on.
    with pytest.raises(FbidError, match=message), pytest.warns(UserWarning, match="ascii"):
        gym.make(BIPED, render_mode="ascii")
    for make in (gym.make_vec, fbid_gym.make_sb3):
        with pytest.raises(FbidError, match=message):
            make(BIPED, render_mode="ascii")


def test_bad_vector_arguments():
    with pytest.raises(FbidError, match="autoreset_mode 'LATER'. Valid choices: NEXT_STEP, SAME"):
        gym.make_vec(BIPED, num_envs=2, autoreset_mode="LATER")
    for value in (0, -1, 1.5, "two", None, True):
        with pytest.raises(FbidError, match="Invalid num_envs: .* a whole number from 1 to 65,536"):
            gym.make_vec(BIPED, num_envs=value)
        words = "Invalid num_threads: .* a whole number from 1 to 1,024"
        with pytest.raises(FbidError, match=words):
            gym.make_vec(BIPED, num_envs=2, num_threads=value)


BAD_ACTIONS = [
    (lambda a: np.where(np.arange(a.size).reshape(a.shape) == 3, np.nan, a), NonFiniteError, "NaN"),
    (lambda a: a + np.inf, NonFiniteError, "action is not finite"),
    (lambda a: a[..., 1:], ShapeError, r"action has shape .*5,?\). Expected .*6,?\)"),
    (lambda a: a[None], ShapeError, "action has shape"),
    (lambda a: 0.0, ShapeError, r"action has shape \(\)"),
    (lambda a: None, FbidError, "action"),
    (lambda a: "forward", InvalidValueError, "Invalid action: 'forward'. Expected numbers of"),
    (lambda a: [[1.0], [1.0, 2.0]], InvalidValueError, "Invalid action"),
]


def test_bad_actions_step_nothing():
    """In every interface; afterwards everything goes on as if nothing had been tried."""
    scalar = begun(BIPED, **BASE, disable_env_checker=True)
    vector = begun(BIPED, 3, **BASE, num_threads=2)
    sb3 = fbid_gym.make_sb3(BIPED, 3, seed=0, **BASE)
    sb3.reset()
    for env, state_of, count in (
        (scalar, scalar.unwrapped.batch.state_dict, ()),
        (vector, vector.chunks.state_dict, (3,)),
        (sb3, sb3.state_dict, (3,)),
    ):
        before = state_of()
        for spoil, error, message in BAD_ACTIONS:
            with pytest.raises(error, match=message):
                env.step(spoil(np.zeros((*count, 6))))
            assert_same(state_of(), before)


def test_bad_actions_through_gymnasiums_checker():
    """With gym.make's own checks in front it is still our error that arrives."""
    env = begun(BIPED, **BASE)
    env.step(np.zeros(6, np.float32))
    with pytest.raises(NonFiniteError, match=r"index \(2,\)"):
        env.step(np.array([0, 0, np.nan, 0, 0, 0], np.float32))
    with pytest.raises(ShapeError, match=r"action has shape \(7,\). Expected \(6,\)"):
        env.step(np.zeros(7, np.float32))


def test_a_robot_without_joints_has_nothing_to_act_with():
    text = """<mujoco><worldbody><body name="ball" pos="0 0 1"><freejoint/><geom size="0.1"/>
      <site name="below" pos="0 0 -0.1"/></body></worldbody></mujoco>"""
    ball = Robot.from_mjcf(text, ["below"])
    with pytest.raises(RobotError, match="has no joints to act with"):
        gym.make("fbid_gym/QuadrupedBalance-v0", robot=ball)


@pytest.mark.parametrize("env", ["QuadrupedBalance", "QuadrupedWalk", "QuadrupedCrawl"])
def test_a_robot_below_its_feet_is_refused(env):
    upside_down = turned("go1", (1.0, 0.0, 0.0), np.pi, as_drawn=False)
    assert upside_down.check()[0].endswith("mm below the feet at home.")
    with pytest.raises(RobotError, match="centre of mass of 'go1 turned' is .* below its feet"):
        gym.make(f"fbid_gym/{env}-v0", robot=upside_down)


def test_a_gait_for_a_robot_with_too_few_feet():
    one, *others = CORNERS
    with pytest.raises(RobotError, match="has 3 feet: .*Expected four to walk on"):
        gait_of(dog(feet=others), 250)
    for names in ([one], others):
        with pytest.raises(RobotError, match=f"has {len(names)} feet: .*Expected four to walk on"):
            gym.make(WALK, robot=dog(feet=names))


def test_feet_that_no_inverse_kinematics_places():
    message = "Foot 'front_left' .* hangs from 2 joints .* at least three"
    with pytest.raises(RobotError, match=message):
        make_layer("joint_acceleration", dog(rolls=False), 250, MotionKind(True, 6.0))
    with pytest.raises(RobotError, match=message):
        gym.make(WALK, robot=dog(rolls=False), action_layer="joint_position")


def test_clipped_footholds_are_counted():
    """A foothold as far away as the action can put it is out of reach at a high speed."""
    fast = {"forward_range": (2.0, 2.0), "sideways_range": (0.0, 0.0), "turning_range": (0.0, 0.0)}
    env = begun(WALK, seed=1, action_layer="torque", layer_options={"footholds": True}, **fast)
    action = np.zeros(env.action_space.shape, np.float32)
    action[-8::2] = 1.0
    counts = [env.step(action)[4]["clipped_footholds"] for _ in range(15)]
    assert counts == sorted(counts) and counts[-1] > 0
