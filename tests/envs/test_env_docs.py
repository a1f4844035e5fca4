"""The page of an environment has what Gymnasium's pages have, and names all that the code has."""

import inspect
import re

import gymnasium as gym
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.page import INFO, page
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.envs.simulation import MAX_SPEED
from fbid_gym.robots import terrain
from fbid_gym.robots.terrain.patches import CLEARING, EDGE, HARDEST
from fbid_gym.tasks import walk
from fbid_gym.tasks.body import FALLEN_HEIGHT, FALLEN_TILT, TOUCHING_LOAD


@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_a_page(env_id):
    """It is made of the environment; its tables are tables, and nothing is left out of them."""
    said = page(env_id)
    batch = gym.make(env_id).unwrapped.batch
    assert f"| `{batch.robot.name}`: {batch.robot.mass:.3g} kg, " in said
    for name in (*batch.observation_names, *batch.action_names):
        assert f" | {name} |" in said
    for table in re.findall(r"(?:^\|.*\n?)+", said, re.MULTILINE):
        rows = table.replace(r"\|", "").splitlines()
        assert len({line.count("|") for line in rows}) == 1, rows[0]


def test_what_none_means_here():
    assert '| `gait` | `None`, here `"trot"` |' in page("fbid_gym/QuadrupedWalk-v0")
    assert "| `depth` | `None`, here `1.4` |" in page("fbid_gym/BipedSquat-v0")


def test_all_of_info_has_a_meaning():
    for env_id in ("fbid_gym/BipedBalance-v0", "fbid_gym/BipedSquat-v0", "fbid_gym/BipedWalk-v0"):
        for layer in LAYERS:
            env = gym.make(env_id, action_layer=layer)
            env.reset(seed=0)
            *_, info = env.step(0.0 * env.action_space.sample())
            own = {name for name in info if not name.startswith("reward_")}
            assert own <= INFO.keys(), layer


def test_numbers_in_prose():
    """What tables do not say stands in docstrings, with the numbers of the code."""
    said = inspect.getdoc(RobotEnv)
    assert f"lower than {FALLEN_HEIGHT:g} H" in said and f"{FALLEN_TILT:g} degrees" in said
    assert f"{MAX_SPEED:g} m/s" in said and f"{100 * TOUCHING_LOAD:g} % of the weight" in said
    ground = inspect.getdoc(terrain)
    assert f"each {EDGE:g} h long" in ground and CLEARING < 2.0
    for kind, size in HARDEST.items():
        (row,) = re.findall(rf"^\| `{kind}`.*", ground, re.MULTILINE)
        assert "gaps" in row or f"{size:.2g} c d" in row
    assert len(walk.SCAN) == 35 and "at 35 places" in inspect.getdoc(walk)
