"""Fresh episodes are those of a rollout, kept with the policy that played them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from eval.results import Estimate
from eval.robustness.curves import digest
from eval.rollout import Player, play_player
from eval.study.__main__ import StudyConfig, main
from eval.study.findings import findings
from eval.study.fresh import FIRST_SEED, Falls, fresh_file, kept, measure
from eval.study.page import page
from eval.study.tables import table
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from tests.eval.study.small import FEW, STUDY, fill, policy
from train.environments import make_env
from train.runs.folder import RunFolder
from train.runs.reading import load
from train.runs.study import read_study
from train.runs.tables import EVALUATIONS, to_csv


@pytest.fixture(scope="module")
def standing_and_thrashing():
    """Two policies of `one`, of which the first stands by its zero action and the other falls."""
    env = make_env("fbid_gym/QuadrupedWalk-v0", {"action_layer": "torque"})
    (seen,), (moved,) = env.observation_space.shape, env.action_space.shape
    env.close()
    return [
        Policy(
            "fbid_gym/QuadrupedWalk-v0",
            {"action_layer": "torque", "episode_seconds": 0.6},
            np.zeros(seen),
            np.ones(seen),
            (np.zeros((moved, seen)),),
            (np.full(moved, bias),),
        )
        for bias in (0.0, 1.0)
    ]


@pytest.fixture
def played(study, standing_and_thrashing):
    """The study with two trainings done, and told what it was played by."""
    done = study.cells[0], study.cells[2]
    for cell, each in zip(done, standing_and_thrashing, strict=True):
        fill(cell, 10.0 + cell.config.seed, 0.1)
        folder = RunFolder.of(cell.config.folder)
        each.save(folder.policy)
        folder.versions.write_text("{}")
    said = []
    measure(study, 3, lambda *told: said.append(told))
    assert len(said) == 2
    return study


def test_fresh_episodes_are_those_of_a_rollout_and_are_played_once(played):
    found, warnings = kept(played)
    assert not warnings and len(found) == 2
    falls = []
    for name, its in found.items():
        folder = played.cells[0].config.folder.with_name(name)
        episodes = play_player(Player.of(load(folder)), 3, FIRST_SEED)
        for column, values in (
            ("survival", episodes.survived),
            ("return_mean", episodes.returned),
            ("velocity_error", episodes.velocity_error),
        ):
            assert its[column].item() == pytest.approx(values.mean(), rel=1e-12)
        falls.append(3 - int(episodes.survived.sum()))
    assert sorted(falls) == [0, 3]
    assert Falls.of(list(found.values())) == Falls(3, 6) and str(Falls(12, 3456)) == "12 of 3,456"
    before, again = fresh_file(played).read_bytes(), []
    measure(played, 3, lambda *told: again.append(told))
    assert (again, fresh_file(played).read_bytes()) == ([], before)


def test_fresh_episodes_are_none_of_an_evaluation(played, tmp_path):
    path = tmp_path / "other.toml"
    seen = f"eval = {{ seed = {FIRST_SEED + 2}, every = 100_000 }}\n"
    path.write_text(f"{seen}{STUDY}")
    study = read_study(path, tmp_path / "elsewhere")
    fill(study.cells[0], 10.0, 0.1)
    with pytest.raises(FbidError, match=f"was evaluated from seeds {FIRST_SEED + 2} to"):
        measure(study, 3, print)
    assert not fresh_file(study).exists()


def test_fresh_episodes_of_different_commits_are_said_to_be(played):
    file = fresh_file(played)
    head, first, second = file.read_text().splitlines()
    at = head.split(",").index("commit")
    assert first.split(",")[at] == second.split(",")[at] != ""
    older = second.split(",")
    older[at] = "0123456789ab"
    file.write_text("\n".join([head, first, ",".join(older)]) + "\n")
    found, (warning,) = kept(played)
    assert len(found) == 2
    assert "different commits" in warning and "0123456789ab" in warning
    # A table of before the commit was kept.
    rows = [",".join(row.split(",")[:at] + row.split(",")[at + 1 :]) for row in (head, first)]
    file.write_text("\n".join(rows) + "\n")
    measure(played, 3, print)
    assert "unknown" in kept(played)[1][0] and file.read_text().splitlines()[1].split(",")[at] == ""


def test_fresh_episodes_are_on_the_page_and_in_the_table(played, tmp_path):
    out = tmp_path / "page.html"
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", out, video_seconds=0.0)
    assert main(replace(config, fresh_episodes=3)) == 0
    assert "fell in 3 of 6 fresh episodes" in out.read_text()
    assert "<h3>In fresh episodes</h3>" in out.read_text()
    first, second = table(played).splitlines()[2:]
    assert first.endswith("| 3 of 6 |") and second.endswith("| – |")
    told = json.loads(out.with_suffix(".json").read_text())["arms"][0]["fresh"]
    assert told["falls"] == {"fallen": 3, "episodes": 6} and told["each"]["falls"] == [0.0, 1.0]
    fresh_file(played).unlink()
    assert "fresh" not in table(played)
    for wrong in (
        replace(config, robustness=True, out=None),
        replace(config, write_docs=True),  # there is no such page
        replace(config, out=tmp_path / "page.txt"),
    ):
        with pytest.raises(FbidError):
            main(replace(wrong, fresh_episodes=3))
        assert not fresh_file(played).exists()


def test_fresh_episodes_judge_arms_as_evaluations_do(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(STUDY.replace("BipedSquat", "QuadrupedWalk").replace("seeds = [0]\n", ""))
    study = read_study(path, tmp_path / "out")
    rows = []
    for cell in study.cells:
        fill(cell, 10.0, 0.1)
        name, folder = cell.config.folder.name, RunFolder.of(cell.config.folder)
        policy(0.1).save(folder.policy)
        better = cell.arm == "other"
        known = {"episodes": 100, "return_mean": 9.0 + better, "survival": 0.9 + 0.1 * better}
        rows.append({"run": name, "policy": digest(policy(0.1)), **known})
    columns = ("run", "policy", *EVALUATIONS[2:])
    fresh_file(study).write_text(
        to_csv(columns, [dict.fromkeys(columns, float("nan")) | row for row in rows])
    )
    one, other = findings(study, FEW).arms
    assert (str(one.fresh.falls), str(other.fresh.falls)) == ("20 of 200", "0 of 200")
    assert one.fresh.versus == {} and other.fresh.versus.keys() == {"return_mean", "falls"}
    for versus in other.fresh.versus.values():
        assert versus.probability == Estimate(1.0, 1.0, 1.0)
    assert other.fresh.final["falls"].value == 0.0 and "velocity_error" not in other.fresh.final
    assert other.versus["return_mean"].probability.value == 0.5  # of the evaluations
    assert page(findings(study, FEW)).count("does better</th>") == 3 + 2


def test_fresh_episodes_of_policies_that_have_changed_are_left_out_and_played_again(
    played, standing_and_thrashing
):
    first, second = (played.cells[i].config.folder for i in (0, 2))
    standing_and_thrashing[0].save(RunFolder.of(second).policy)
    found, (warning,) = kept(played)
    assert found.keys() == {first.name} and f"of {second.name}, and are left out" in warning
    assert warning in findings(played, FEW).warnings
    said = []
    measure(played, 3, lambda *told: said.append(told))
    assert said == [(0, 1, second.name)]
    assert Falls.of(list(kept(played)[0].values())) == Falls(0, 6)


def test_kept_fresh_episodes_that_are_none_are_one_clear_error(played):
    file = fresh_file(played)
    good = file.read_text()
    with pytest.raises(FbidError, match=re.escape("is of 3 episodes, not of 4. Expected as many")):
        measure(played, 4, print)
    assert file.read_text() == good
    head, *rows = good.splitlines()
    for bad in (
        good.replace("survival", "survived"),
        f"{head}\n{rows[0].partition(',')[0]}\n",
        f"{head}\n{rows[0].replace(',3,', ',inf,', 1)}\n",
        f"{head}\n{rows[0].replace(',3,', ',0,', 1)}\n",
        f"{head}\n{rows[0].replace(',3,', ',<b>,', 1)}\n",
    ):
        file.write_text(bad)
        for read in (kept, table, lambda study: measure(study, 3, print)):
            with pytest.raises(FbidError, match="not the table of eval.study, or corrupt"):
                read(played)
