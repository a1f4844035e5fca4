"""Bad input: one FbidError each, which names the value and what would have been valid."""

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    RobotError,
    ShapeError,
)
from fbid_gym.robots import Robot
from tests.robots.similar import turned

BIPED = next(iter(ENVIRONMENTS))
ALL_ROBOTS = "biped, quadruped, humanoid, go1, g1"
ALL_LAYERS = (
    "torque, joint_position, joint_position_feedforward, joint_acceleration, base_acceleration, "
    "com_wrench"
)
FEEDFORWARD = "joint_position_feedforward"
BASE = {"action_layer": "base_acceleration"}


def options(layer="base_acceleration", **values):
    return {"action_layer": layer, "layer_options": values}


ARGUMENTS = [
    ({"action_layer": "force"}, f"Unknown action layer 'force'. Valid choices: {ALL_LAYERS}."),
    ({"action_layer": None}, f"Unknown action layer None. Valid choices: {ALL_LAYERS}."),
    ({"action_layer": ["torque"]}, r"Unknown action layer \['torque'\]. Valid choices: torque,"),
    (
        {"action_layr": "torque"},
        "argument 'action_layr'. Did you mean 'action_layer'",
    ),
    (
        {"zzz": 1},
        "The environment got an unexpected keyword argument 'zzz'. Valid choices: robot, t",
    ),
    ({"robot": "horse"}, f"Unknown robot 'horse'. Valid choices: {ALL_ROBOTS}, a Robot such"),
    (
        {"robot": "dog.xml"},
        r"Unknown robot 'dog.xml'. .* a Robot such as Robot.load\(path\) makes.",
    ),
    ({"robot": 3}, f"Invalid robot: 3. Expected a Robot or one of {ALL_ROBOTS}."),
    # Options of the layers.
    (
        options("torque", gain=1.0),
        "'gain' of action layer 'torque'. Valid choices: footholds, step",
    ),
    (options(gain=1.0), "option 'gain' of action layer 'base_acceleration'. Valid choices: "),
    ({"layer_options": "none"}, "Invalid layer_options: 'none'. Expected a dictionary"),
    ({"layer_options": {1: 2}}, "Invalid layer_options: {1: 2}. Expected a dictionary"),
    (
        options("joint_position", scale=-1.0),
        "Invalid scale: -1.0. Expected a number from 0.000001 to 100 rad",
    ),
    (options("joint_position", damping_ratio=np.nan), "Invalid damping_ratio: nan"),
    (
        options(FEEDFORWARD, target_frequency=0.0),
        "Invalid target_frequency: 0.0. Expected a number from 0.001 to 1,000 Hz",
    ),
    (
        options(FEEDFORWARD, balance_frequency=-1),
        "balance_frequency: -1. Expected a number from 0 to 1,000 Hz",
    ),
    (
        options(FEEDFORWARD, natural_frequency=90.0),
        "natural_frequency: 90.0. Expected at most .* H",
    ),
    (options(FEEDFORWARD, scale=np.inf), "Invalid scale: inf. Expected a number from"),
    (options("joint_acceleration", natural_frequency="fast"), "natural_frequency: 'fast'"),
    (options(rotation_frequency=0), "Invalid rotation_frequency: 0. Expected a number"),
    (options(contact_limits="cone"), "contact_limits 'cone'. Valid choices: friction, none."),
    (options(contacts="some"), "Unknown contacts 'some'. Valid choices: planned, all, measured"),
    (options(contacts=[(1.0, ["arm"])]), "foot 'arm' in contacts. Valid choices: left, right."),
    (options(contacts=[(1.0, "left")]), "Invalid contacts: .*'left'.*Expected phases .seconds >="),
    (options(contacts=[(0.0, ["left"])]), "Invalid contacts: .*Expected phases"),
    (options(contacts=[("long", ["left"])]), "Invalid contacts: .*'long'.*Expected phases"),
    (options(contacts=[("left",)]), "Invalid contacts: .*Expected phases"),
    (options(contacts=[]), r"Invalid contacts: \[\]. Expected at least one phase"),
    (options(contacts=7), "Invalid contacts: 7. Expected phases"),
    (options(contact_ramp=-0.01), "Invalid contact_ramp: -0.01. Expected a number from 0 to 10 s"),
    (options(contact_ramp=np.inf), "Invalid contact_ramp: inf. Expected a number"),
    (options(contact_ramp="slow"), "Invalid contact_ramp: 'slow'"),
    (options("joint_position", contact_ramp=0.1), "option 'contact_ramp' of action layer 'joint_p"),
    (options(friction=-0.1), "Invalid friction: -0.1. Expected a number from 0 to 10"),
    (options(friction="ice"), "Invalid friction: 'ice'"),
    (options(min_normal_force="low"), "Invalid min_normal_force: 'low'. Expected a number"),
    (options(min_normal_force=2.0, max_normal_force=1.0), "Invalid min_normal_force"),
    (options(max_normal_force=np.nan), "Invalid max_normal_force: nan. Expected a number"),
    (options(compensate_damping="yes"), "compensate_damping: 'yes'. Expected True or False"),
    # Tasks and ground.
    ({"task": "fly"}, "Unknown task 'fly'. Valid choices: balance, squat, step, crawl."),
    ({"task": None}, "Unknown task None. Valid choices: balance, squat"),
    (
        {"task": "squat", "height_range": (0.9, 1.0)},
        "unexpected keyword argument 'height_range'",
    ),
    ({"task": "squat", "speed": -1.0}, "Invalid speed: -1.0. Expected a number from 0.01 to 20"),
    ({"task": "squat", "speed": "fast"}, "Invalid speed: 'fast'. Expected a number"),
    ({"task": "step", "lift_seconds": 2.0}, "Invalid .*2.0. Expected seconds between 0 and half"),
    ({"task": "crawl"}, "Robot 'biped' cannot crawl: it has 16 joints and the feet left, right."),
    ({"terrain": "lava"}, "Unknown terrain 'lava'. Valid choices: flat, obstacles, rocks, sl"),
    ({"terrain": 3}, "Unknown terrain 3. Valid choices: flat, obstacles, rocks, slopes, "),
    ({"terrain": "stairs", "difficulty": 1.5}, "Invalid difficulty: 1.5. Expected a number from 0"),
    ({"terrain": "stairs", "difficulty": "hard"}, "Invalid difficulty: 'hard'. Expected a number"),
    ({"curriculum": 1}, "Invalid curriculum: 1. Expected True or False"),
    ({"terrain": "mixed", "curriculum": True}, r"\('balance', 'mixed'\). Expected task 'walk' on"),
    ({"height_scan": True}, "unexpected keyword argument 'height_scan'"),
    ({"terrain": "rocks", "terrain_height": 5.0}, "terrain height: 5.0. Expected metres from 0 to"),
    (
        {"terrain": "rocks", "terrain_height": -0.1},
        "Invalid terrain_height: -0.1. Expected a number from 0",
    ),
    (
        {"terrain": "stairs", "terrain_height": 0},
        "Invalid terrain_height: 0.0. Expected none on terrain 'stairs', whose size follows diff",
    ),
    ({"terrain_height": "high"}, "Invalid terrain_height: 'high'. Expected a number"),
    ({"terrain_seed": 0.5}, "Invalid terrain_seed: 0.5. Expected a whole number from 0 to"),
    # Rates and times.
    ({"physics_hz": 0}, "Invalid physics_hz: 0. Expected a whole number from 1 to 100,000 Hz"),
    ({"physics_hz": 999.5}, "Invalid physics_hz: 999.5. Expected a whole number"),
    ({"control_hz": "fast"}, "Invalid control_hz: 'fast'. Expected a whole number"),
    ({"policy_hz": True}, "Invalid policy_hz: True. Expected a whole number"),
    ({"policy_hz": np.inf}, "Invalid policy_hz: inf"),
    ({"control_hz": 300}, r"control_hz: 300. Expected a divisor of physics_hz = 1000 .*3.33333"),
    ({"policy_hz": 60}, r"policy_hz: 60. Expected a divisor of control_hz = 500"),
    ({"control_hz": 2000}, r"control_hz: 2000. Expected a divisor of physics_hz = 1000"),
    ({"episode_seconds": 0.01}, "episode_seconds: 0.01. Expected a time of at least 0.02 s"),
    ({"episode_seconds": 0}, "Invalid episode_seconds: 0. Expected a number from 0.0001 to 1,000,"),
    ({"episode_seconds": np.inf}, "Invalid episode_seconds: inf. Expected a number"),
    ({"episode_seconds": "long"}, "Invalid episode_seconds: 'long'. Expected a number"),
    # The task.
    ({"push_force": (100.0, 20.0)}, r"Invalid push_force: \(100.0, 20.0\). Expected a pair 0 <="),
    (
        {"push_force": 50.0},
        "Invalid push_force: 50.0. Expected a pair 0 <= least <= most <= 1,000,000 N",
    ),
    ({"push_force": "12"}, "Invalid push_force: '12'. Expected a pair"),
    ({"push_force": (1, 2, 3)}, r"Invalid push_force: \(1, 2, 3\). Expected a pair"),
    ({"push_force": (0, np.nan)}, r"Invalid push_force: \(0, nan\). Expected a pair"),
    ({"push_velocity": 0.5}, "Invalid push_velocity: 0.5. Expected a pair 0 <= least"),
    ({"push_velocity": (-0.5, 0.5)}, r"push_velocity: \(-0.5, 0.5\). Expected a pair 0 <= least"),
    ({"push_duration": 0.0001}, "push_duration: 0.0001. Expected a time of at least 0.002 s"),
    ({"push_duration": None}, "Invalid push_duration: None. Expected a number"),
    ({"push_interval": (0.1, 1.0)}, "push_interval: .*Expected at least push_duration = 0.15 s"),
    ({"height_range": (0.5, 1.0)}, r"Invalid height_range: \(0.5, 1.0\). Expected a pair 0.61 <="),
    ({"height_range": None}, "Invalid height_range: None. Expected a pair"),
    ({"height_interval": (0, 1)}, "Invalid height_interval: .*Expected a pair 0.0001 <= least"),
    ({"joint_noise": -1}, "Invalid joint_noise: -1. Expected a number from 0 to 1"),
    ({"joint_noise": [0.1]}, r"Invalid joint_noise: \[0.1\]. Expected a number"),
    ({"velocity_noise": "some"}, "Invalid velocity_noise: 'some'. Expected a number"),
    # Domain randomisation.
    ({"randomisation": {"masses": 0.1}}, "randomisation 'masses'. Valid choices: mass, com, fric"),
    ({"randomisation": True}, "Invalid randomisation: True. Expected a dictionary"),
    ({"randomisation": {"mass": 1.0}}, "randomisation mass: 1.0. Expected a number from 0 to 0.99"),
    ({"randomisation": {"model_mass": "big"}}, "Invalid randomisation model_mass: 'big'"),
    ({"randomisation": {"com": -0.1}}, "randomisation com: -0.1. Expected a number from 0 to 1 m"),
    ({"randomisation": {"friction": 0.5}}, "randomisation friction: 0.5. Expected a pair"),
    ({"randomisation": {"friction": (0, 1)}}, "randomisation friction: .*a pair 0.001 <= least"),
    ({"randomisation": {"motor_strength": 0.9}}, "randomisation motor_strength: 0.9. .*a pair"),
    (
        {"randomisation": {"motor_strength": (1.2, 0.8)}},
        "motor_strength: .*a pair 0.001 <= least <=",
    ),
    ({"randomisation": {"total_mass": 1.3}}, "randomisation total_mass: 1.3. .*a pair"),
    ({"randomisation": {"model_inertia": (0, 1)}}, "model_inertia: .*a pair 0.001 <= least"),
    ({"randomisation": {"model_com_ahead": (0.1, 0)}}, "com_ahead: .*a pair -1 <= least"),
    ({"randomisation": {"action_delay": 0.02}}, "randomisation action_delay: 0.02. .*a pair"),
    (
        {"randomisation": {"action_delay": (-0.01, 0.02)}},
        r"action_delay: \(-0.01, 0.02\). Expected a pair 0 <= least <= most <= 1 s",
    ),
    ({"randomisation": {"action_delay": (0.0, 2.0)}}, "action_delay: .*most <= 1 s"),
    ({"randomisation": {"action_delay": (0.0, np.nan)}}, "action_delay: .*a pair"),
]


@pytest.mark.parametrize(("arguments", "message"), ARGUMENTS)
def test_bad_arguments_through_every_door(arguments, message):
    for make in (
        lambda: gym.make(BIPED, **arguments),
        lambda: gym.make_vec(BIPED, num_envs=2, **arguments),
        lambda: fbid_gym.make_sb3(BIPED, 2, **arguments),
    ):
        with pytest.raises(FbidError, match=message):
            make()


def test_the_list_of_layers_above_is_complete():
    assert ", ".join(LAYERS) == ALL_LAYERS


def test_bad_render_modes():
    message = "Unknown render_mode 'ascii'. Valid choices: human, rgb_array."
    # gymnasium warns first, and goes on.
    with pytest.raises(FbidError, match=message), pytest.warns(UserWarning, match="ascii"):
        gym.make(BIPED, render_mode="ascii")
    with pytest.raises(FbidError, match=message):
        gym.make_vec(BIPED, num_envs=2, render_mode="ascii")
    with pytest.raises(FbidError, match=message):
        fbid_gym.make_sb3(BIPED, 2, render_mode="ascii")


def test_bad_vector_arguments():
    with pytest.raises(FbidError, match="autoreset_mode 'LATER'. Valid choices: NEXT_STEP, SAME"):
        gym.make_vec(BIPED, num_envs=2, autoreset_mode="LATER")
    for value in (0, -1, 1.5, "two", None, True):
        with pytest.raises(FbidError, match="Invalid num_envs: .* a whole number from 1 to 65,536"):
            gym.make_vec(BIPED, num_envs=value)
        with pytest.raises(
            FbidError, match="Invalid num_threads: .* a whole number from 1 to 1,024"
        ):
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


@pytest.mark.parametrize(("spoil", "error", "message"), BAD_ACTIONS)
def test_bad_actions_step_nothing(spoil, error, message):
    """In every interface; afterwards everything goes on as if nothing had been tried."""
    scalar = gym.make(BIPED, **BASE, disable_env_checker=True)
    vector = gym.make_vec(BIPED, num_envs=3, **BASE, num_threads=2)
    sb3 = fbid_gym.make_sb3(BIPED, 3, seed=0, **BASE)
    scalar.reset(seed=0)
    vector.reset(seed=0)
    sb3.reset()
    for env, state_of, count in (
        (scalar, scalar.unwrapped.batch.state_dict, ()),
        (vector, vector.chunks.state_dict, (3,)),
        (sb3, sb3.state_dict, (3,)),
    ):
        before = state_of()
        with pytest.raises(error, match=message):
            env.step(spoil(np.zeros((*count, 6))))
        for key, value in state_of().items():
            np.testing.assert_array_equal(value, before[key], err_msg=key)


def test_bad_actions_through_gymnasiums_checker():
    """With gym.make's own checks in front it is still our error that arrives."""
    env = gym.make(BIPED, **BASE)
    env.reset(seed=0)
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
    axis, angle = (1.0, 0.0, 0.0), np.pi
    upside_down = turned("go1", axis, angle, as_drawn=False)
    assert upside_down.check()[0].endswith("mm below the feet at home.")
    with pytest.raises(RobotError, match="centre of mass of 'go1 turned' is .* below its feet"):
        gym.make(f"fbid_gym/{env}-v0", robot=upside_down)
