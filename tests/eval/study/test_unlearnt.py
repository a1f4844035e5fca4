"""Arms that learn nothing: one policy, whose chance is that of episodes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from eval.results import Estimate
from eval.robustness.__main__ import RobustnessConfig, gathered
from eval.rollout import Player, play_player
from eval.study.__main__ import StudyConfig, main
from eval.study.findings import findings
from eval.study.fresh import FIRST_SEED, kept, level_file, levels, measure
from eval.study.page import page
from eval.study.tables import drawn, table
from eval.wording import steps
from tests.eval.conftest import zero_policy
from tests.eval.study.small import FEW, fill, written
from train.runs.endpoints import register
from train.runs.study import arms, read_study

WALK = "fbid_gym/QuadrupedWalk-v0"
SHORT = 'action_layer = "torque"\nenv_args = { episode_seconds = 0.6 }\n'
STUDY = f"""
seeds = [0, 1]
total_steps = 1000
eval = {{ episodes = 4 }}
reference = "nothing"
[[endpoints]]
measure = "return_mean"
arm = "learnt"
against = "nothing"
[[arms]]
name = "learnt"
env = "{WALK}"
{SHORT}
[[arms]]
name = "nothing"
env = "{WALK}"
policy = "zero"
{SHORT}
"""


@pytest.fixture(scope="module")
def still():
    """The policy of a training that has learnt nothing but the zero action."""
    return zero_policy(WALK, (62, 12), action_layer="torque", episode_seconds=0.6)


@pytest.fixture(scope="module")
def played(still, tmp_path_factory):
    """Two trainings: one stands by the zero action, the other thrashes; and the zero action."""
    study = written(tmp_path_factory.mktemp("played"), STUDY)
    register(study.name, study.runs, study.endpoints)
    policies = still, replace(still, biases=(np.ones(12),))
    for cell, policy in zip(study.cells, policies, strict=True):
        fill(cell, 10.0 + cell.config.seed, 0.1, policy=policy)
    measure(study, 3, lambda *told: None)
    return study


def test_it_plays_the_episodes_of_the_others_and_those_of_their_evaluations(played):
    (cell,) = played.unlearnt
    name, player = cell.config.folder.name, Player.of_cell(cell)
    fresh, evaluated = kept(played)[0], levels(played)
    assert fresh.keys() == {name, *(cell.config.folder.name for cell in played.cells)}
    assert evaluated.keys() == {name} and player.policy is None
    for its, seed, count in ((fresh, FIRST_SEED, 3), (evaluated, cell.config.eval.seed, 4)):
        episodes = play_player(player, count, seed)
        np.testing.assert_allclose(its[name].each["return_mean"], episodes.returned, rtol=1e-6)
        assert its[name].means["return_mean"].item() == episodes.returned.mean()
    first = fresh[played.cells[0].config.folder.name]
    np.testing.assert_array_equal(fresh[name].each["return_mean"], first.each["return_mean"])
    before, said = level_file(played).read_bytes(), []
    measure(played, 3, lambda *told: said.append(told))
    assert said == [] and level_file(played).read_bytes() == before


def test_its_intervals_are_over_episodes_and_runs_are_set_against_it_in_pairs(played):
    found = findings(played, FEW)
    learnt, nothing = found.arms
    (cell,) = played.unlearnt
    each = levels(played)[cell.config.folder.name].each["return_mean"]
    its = nothing.final["return_mean"]
    assert its.value == pytest.approx(each.mean())
    assert each.min() <= its.low < its.high <= each.max()
    assert (nothing.ready, nothing.cells, nothing.policy) == (True, [], "zero")
    assert not learnt.versus
    assert learnt.fresh.versus.keys() == {"return_mean", "velocity_error", "falls"}
    # The run that stands is as good, the other worse in every episode.
    assert learnt.fresh.versus["return_mean"].probability == Estimate(0.25)
    (answer,) = found.answers
    assert answer.paired and answer.fresh and answer.difference.value < 0.0
    assert answer.means[1] == nothing.fresh.final["return_mean"].value
    assert 0.05 < answer.p_value < 1.0  # of two runs one cannot know


def test_trainings_reach_its_return_by_their_own_evaluations(played):
    """Filled in: 10 and 11 at first, twice as much after 1000 steps and 9 s."""
    best = levels(played)[played.unlearnt[0].config.folder.name].means["return_mean"].item()
    assert 11.0 < best < 22.0
    found = findings(played, FEW)
    assert found.levels[WALK].share == best / 30.0  # steps of an episode
    reached = found.arms[0].level_to
    expected = [1000.0 * (best / first - 1.0) for first in (10.0, 11.0)]
    assert reached["steps"].each == pytest.approx([x if x <= 1e3 else np.inf for x in expected])
    assert reached.keys() == {"steps", "wall"}  # falls were not counted
    html = page(found)
    assert "Samples and time to the best without learning" in html and "no training, zero" in html
    assert html.count("<tr") == html.count("</tr>") and html.count("<td") == html.count("</td>")


def test_it_stands_beside_the_trainings_everywhere(played, tmp_path):
    head, _, one, other, *_, fresh = table(played).splitlines()
    assert "| nothing | no training | – |" in other and other.endswith("| – |")
    assert "| nothing | 1 | 0 of 3 |" in fresh
    assert head.endswith("| To the best return without training |")
    best = levels(played)[played.unlearnt[0].config.folder.name].means["return_mean"].item()
    share = np.median([best / first - 1.0 for first in (10.0, 11.0)])
    # Filled in, see above; falls were not counted.
    assert one.endswith(f"| {steps(1000.0 * share)}, {9.0 * share / 60.0:.1f} min |")
    assert drawn(played).count("nothing") >= 2
    out, folder = tmp_path / "page.html", played.runs.parent
    config = StudyConfig(folder / "mine.toml", played.runs, out, video_seconds=0.0)
    assert main(config) == 0
    told = json.loads(out.with_suffix(".json").read_text())
    assert [arm["policy"] for arm in told["arms"]] == ["", "zero"]


def test_robustness_tries_it_as_an_arm(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.toml"
    file.write_text(STUDY)
    found, _ = gathered(RobustnessConfig(runs=(file,)))
    assert [(arm.name, arm.runs) for arm in found] == [("nothing", ("QuadrupedWalk-v0-nothing",))]
    assert arms(read_study(file))[1].finished() and found[0].players[0].policy is None
