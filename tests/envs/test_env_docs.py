"""The page of an environment has what Gymnasium's pages have, and names all that the code has."""

import re
from pathlib import Path

import gymnasium as gym
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.__main__ import arguments_page
from fbid_gym.envs.page import INFO, page
from tests.batches import begun
from tests.pairs import pairs


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


@pytest.mark.parametrize(("layer", "task"), pairs(LAYERS, ["Balance", "Squat", "Walk"], 1))
def test_all_of_info_has_a_meaning(layer, task):
    env = begun(f"fbid_gym/Biped{task}-v0", action_layer=layer)
    *_, info = env.step(0.0 * env.action_space.sample())
    assert {name for name in info if not name.startswith("reward_")} <= INFO.keys()


def test_the_page_of_arguments_is_current():
    """Written by `python -m fbid_gym.envs > docs/arguments.md`."""
    path = Path(__file__).resolve().parents[2] / "docs" / "arguments.md"
    assert path.read_text(encoding="utf-8") == arguments_page()
