"""Versions of the tasks: version 0 never changes, version 1 is in the robots' own units."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.runtime.randomisation import Randomisation

# What the studies of version 0 ran in.
WALK = {"task": "walk", "physics_hz": 250, "control_hz": 250, "policy_hz": 50}
WALK |= {"episode_seconds": 20.0, "friction_cone": "pyramidal"}
WALK |= {"solver_iterations": 20, "solver_warm_start": False}
WALK |= {"command_interval": [2.0, 5.0], "command_ramp": [0.0, 0.0], "lowered_range": [0.0, 0.0]}
WALK |= {"push_duration": 0.15, "push_interval": [1.5, 3.0], "push_velocity": [0.0, 0.0]}
WALK |= {"joint_noise": 0.02, "velocity_noise": 0.05}
WALK |= {"difficulty": 0.5, "curriculum": False, "command_curriculum": False}
WALK |= {"motors": "ideal", "sensors": "perfect", "state": "true"}
WALK |= {"observation": "full", "history": 1, "height_scan": False}
WEIGHTS = {"velocity": 0.4, "turning": 0.2, "clock": 0.15, "upright": 0.1, "steady": 0.05}
SCALES = {"velocity": 0.19, "turning": 0.09, "clock": 0.2, "upright": 0.2, "steady": 0.3}
WALK |= {"reward_weights": WEIGHTS | {"torque": 0.1}, "reward_scales": SCALES | {"torque": 0.5}}
POINTS = {"forward_range": [-0.35, 0.58], "sideways_range": [-0.23, 0.23]}
POINTS |= {"turning_range": [-0.13, 0.13], "gait": "trot"}
SOLES = {"forward_range": [-0.14, 0.14], "sideways_range": [-0.05, 0.05]}
SOLES |= {"turning_range": [-0.12, 0.12], "gait": "walk", "push_force": [0.0, 0.0]}
FROZEN = {
    "QuadrupedWalk-v0": POINTS
    | {"robot": "go1", "push_force": [0.0, 50.0058864], "terrain": "flat"},
    "BipedWalk-v0": SOLES | {"robot": "biped", "terrain": "flat"},
    "HumanoidWalk-v0": SOLES | {"robot": "humanoid", "terrain": "flat"},
    "QuadrupedTerrain-v0": POINTS
    | {"robot": "go1", "push_force": [0.0, 0.0], "terrain": "mixed", "terrain_seed": 0},
    "BipedTerrain-v0": SOLES | {"robot": "biped", "terrain": "mixed", "terrain_seed": 0},
}


@pytest.mark.parametrize("name", FROZEN)
def test_version_0_is_what_it_was(name):
    means = EnvConfig.of(ENVIRONMENTS[f"fbid_gym/{name}"]).resolved()
    frozen = WALK | FROZEN[name]
    assert {key: means[key] for key in frozen} == frozen
    drawn = EnvConfig.of({"randomisation": means["randomisation"]}).randomisations()
    assert drawn == Randomisation()


@pytest.mark.parametrize(
    ("name", "robot", "least"),
    [
        ("QuadrupedWalk", "go1", (1.5, 0.79, 1.2)),
        ("BipedWalk", "biped", (0.8, 0.1, 0.4)),
        ("HumanoidWalk", "g1", (0.8, 0.1, 0.4)),
    ],
)
def test_version_1_asks_for_the_speeds_of_others_and_any_robot_gets_its_own(name, robot, least):
    arguments = ENVIRONMENTS[f"fbid_gym/{name}-v1"]
    assert arguments["robot"] == robot
    for own in (robot, "quadruped" if name == "QuadrupedWalk" else "humanoid"):
        config = EnvConfig.of(arguments | {"robot": own})
        task, loaded = config.make_task(robots.load(own)), robots.load(own)
        height = task.body.stance.home_com[2]
        speed, rate = np.sqrt(9.81 * height), np.sqrt(9.81 / height)
        ranges = [arguments[f"{axis}_range"] for axis in ("forward", "sideways", "turning")]
        np.testing.assert_allclose(task.most, np.diag([speed, speed, rate]) @ ranges, rtol=1e-3)
        shares = np.array(task.pushes.force) / loaded.weight
        np.testing.assert_allclose(shares, arguments["push_weights"])
        if own == robot:
            assert (task.most[:, 1] >= least).all()
