"""The shipped policies do what their cards say, and their names stand for paths."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval import compare, rollout
from eval.page.docs import POLICIES_PAGE, spliced
from eval.play import __main__ as play
from eval.robustness.__main__ import main as robustness_main
from eval.rollout import load_player, play_player
from eval.tools.policies import cards
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import UnknownOptionError
from fbid_gym.policy import Card, Measured, Policy, place_of, shipped
from fbid_gym.policy.__main__ import main as list_main
from tests.eval.conftest import zero_policy
from train.runs.environment import changed_meaning

EPISODES, SEED = 12, 50_000
SHIPPED = shipped()
every = pytest.mark.parametrize("policy", SHIPPED, ids=[each.name for each in SHIPPED])


@every
def test_a_shipped_policy_is_small_and_of_an_environment_of_today(policy):
    assert policy.path.stat().st_size <= 200_000
    loaded = Policy.load(f"shipped:{policy.name}")
    assert loaded.env_id in ENVIRONMENTS
    assert loaded.env_id.endswith(policy.name.partition("/")[0])
    assert changed_meaning(policy.path) is None


@pytest.mark.slow
@every
def test_a_shipped_policy_does_what_its_card_says(policy):
    if policy.card.note:
        pytest.skip(policy.card.note)
    player = load_player(Path(f"shipped:{policy.name}"), {})
    episodes = play_player(player, EPISODES, SEED)
    for name in {"velocity_error", "survived"} & policy.card.metrics.keys():
        # Twice as wide: two metrics of each of many policies are looked at.
        low, high = policy.card.expected(name, EPISODES)
        found, middle = float(np.mean(getattr(episodes, name))), (low + high) / 2
        assert abs(found - middle) <= high - low, name


def test_the_page_of_the_policies_is_current():
    assert POLICIES_PAGE.read_text() == spliced(POLICIES_PAGE, cards(SHIPPED))


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A policy on a shelf of its own, of nothing but numbers drawn by chance."""
    monkeypatch.setattr("fbid_gym.policy.policy_file.shelf", lambda: tmp_path)
    card = Card(
        environment={}, seed=1, total_steps=6, evaluations=2, best_return=3.0,
        command="python -m train.ppo", wall_seconds=60.0, trained_with={"commit": "abc"},
        measured_with={}, episodes=20, first_seed=0, confidence=0.95,
        metrics={"survived": Measured(1.0, 0.9, 1.0, "share")},
    )  # fmt: skip
    replace(zero_policy("fbid_gym/QuadrupedWalk-v0", (62, 12)), card=card).save(
        tmp_path / "QuadrupedWalk-v0" / "mine.safetensors"
    )
    return "shipped:QuadrupedWalk-v0/mine"


def test_a_name_stands_for_a_path(own, capsys):
    (found,) = shipped()
    assert "shipped:" + found.name == own and found.layer == "joint_position"
    assert place_of(own) == place_of(Path(own)) == found.path
    assert place_of("shipped:mine") == found.path  # of which there is one
    assert place_of("runs/mine") == Path("runs/mine")
    Policy.load(own)
    assert rollout.main([own, "--episodes", "1", "--env-args", '{"episode_seconds": 0.1}']) == 0
    assert "mine in fbid_gym/QuadrupedWalk-v0" in capsys.readouterr().out
    assert play.stage_of(play.PlayConfig(policy=(Path(own),))).policies.keys() == {own}
    assert list_main([]) == 0 and capsys.readouterr().out == "QuadrupedWalk-v0/mine\n"
    assert list_main(["mine"]) == 0
    assert "survived           1 (0.9 to 1) share" in capsys.readouterr().out


UNKNOWN = "Unknown shipped policy 'shipped:cat'. Valid choices: shipped:QuadrupedWalk-v0/mine."


def test_an_unknown_name_is_said_with_those_there_are(own, capsys):
    for main in (rollout.main, compare.main, robustness_main):
        assert main(["shipped:cat"]) == 2
        assert capsys.readouterr().err == f"error: {UNKNOWN}\n"
    assert play.main(["--policy", "shipped:cat"]) == 2
    assert list_main(["cat"]) == 2
    for name in ("cat", "QuadrupedWalk-v0/../QuadrupedWalk-v0/mine", "", "/etc"):
        with pytest.raises(UnknownOptionError):
            place_of(f"shipped:{name}")


def test_ten_lines_play_a_policy_without_torch(own):
    """Those of the page, where nothing else can be imported."""
    code = re.search(r"```python\n(.*?)```", POLICIES_PAGE.read_text(), re.DOTALL)
    assert code is not None
    lines = [line for line in code[1].splitlines() if line]
    assert len(lines) <= 10
    lines = [line.replace('render_mode="human"', "episode_seconds=0.2") for line in lines]
    lines = [re.sub(r"shipped:[^\"]*", str(place_of(own)), line) for line in lines]
    lines = [line.replace("range(1000)", "range(3)") for line in lines]
    banned = ["torch", "stable_baselines3", "rich", "tyro"]
    script = [f"import sys; sys.modules.update(dict.fromkeys({banned}))", *lines]
    command, root = [sys.executable, "-c", "\n".join(script)], Path(__file__).parents[3]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
