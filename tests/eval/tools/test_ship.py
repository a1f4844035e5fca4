"""What is shipped is the best policy of a finished run, and its card says what it does."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from eval.tools.policies import cards
from eval.tools.ship import ShipConfig, ship
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy, shipped
from train.runs.folder import RunFolder

NAME = "StandIn-v0/base"


@pytest.fixture
def config(run_folder, tmp_path):
    return ShipConfig(run_folder(), NAME, episodes=20, out=tmp_path / "policies")


def test_a_shipped_policy_is_the_best_of_its_run_and_plays_as_its_card_says(config):
    done = ship(config)
    (found,) = shipped(config.out)
    assert found.name == NAME and found.layer == "base_acceleration"
    card, original = found.card, Policy.load(RunFolder.of(config.run).best_policy)
    assert (found.path, card, found.lines()) == (done.path, done.card, done.lines())
    observation = np.random.default_rng(0).normal(size=(4, 3))
    np.testing.assert_array_equal(Policy.load(done.path)(observation), original(observation))
    assert found.policy.trained_steps == original.trained_steps and card.evaluations == 21
    assert card.command.startswith("python -m train.ppo --env eval_tests/StandIn-v0")
    assert set(card.metrics) >= {"returned", "survived", "height_error"}
    assert "velocity_error" not in card.metrics  # nothing is commanded there
    for value in card.metrics.values():
        assert value.low <= value.mean <= value.high
    assert card.metrics["survived"].low < card.metrics["survived"].high  # also where all survive
    assert f"`{NAME}`" in cards(shipped(config.out))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("QuadrupedWalk-v0/base", "Invalid as: 'QuadrupedWalk-v0/base'. Expected StandIn-v0/ARM"),
        ("StandIn-v0", "Expected StandIn-v0/ARM"),
        ("StandIn-v0/../x", "Expected StandIn-v0/ARM"),
        ("StandIn-v0/..", "Expected StandIn-v0/ARM"),
    ],
)
def test_names_are_those_of_the_environment_and_of_one_folder(config, name, message):
    with pytest.raises(FbidError, match=re.escape(message)):
        ship(replace(config, name=name))
    assert not config.out.exists()


def test_what_is_not_finished_or_no_run_is_refused(run_folder, tmp_path, config):
    run = RunFolder.of(config.run)
    rows = run.evaluations.read_text().splitlines(keepends=True)
    run.evaluations.write_text("".join(rows[:-3]))
    with pytest.raises(FbidError, match="trained for 850000 of 1000000 steps"):
        ship(config)
    with pytest.raises(FbidError, match="a policy alone. Expected a run folder"):
        ship(replace(config, run=run.policy))
    run.evaluations.write_text("".join(rows))
    replace(Policy.load(run.policy), trained_steps=7).save(run.best_policy)
    with pytest.raises(FbidError, match="its best policy is that of step 7"):
        ship(config)
    assert not config.out.exists()


@pytest.mark.parametrize(("first", "ours"), [(30, False), (31, True), (69, True), (70, False)])
def test_cards_are_of_episodes_that_no_evaluation_has_seen(config, first, ours):
    file = RunFolder.of(config.run).config
    known = json.loads(file.read_text())
    file.write_text(json.dumps(known | {"eval": {"every": 1, "seed": 50, "episodes": 20}}))
    asked = replace(config, seed=first)
    if not ours:
        ship(asked)
        return
    with pytest.raises(FbidError, match="was evaluated from seeds 50 to 69. Expected none of"):
        ship(asked)
    assert not config.out.exists()
