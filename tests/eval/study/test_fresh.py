"""Fresh episodes are those of a rollout, kept with the policy that played them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from eval.rollout import Player, play_player
from eval.study.__main__ import StudyConfig, main
from eval.study.findings import findings
from eval.study.fresh import FIRST_SEED, PUSHED, Falls, fresh_file, kept, measure
from eval.study.tables import table
from fbid_gym.errors import FbidError
from fbid_gym.tasks import task_kind
from tests.eval.conftest import zero_policy
from tests.eval.study.small import FEW, fill
from train.runs.folder import RunFolder
from train.runs.reading import load
from train.runs.tables import read_rows, to_csv


@pytest.fixture(scope="module")
def standing_and_thrashing():
    """Two policies of `one`, of which the first stands by its zero action and the other falls."""
    args = {"action_layer": "torque", "episode_seconds": 0.6}
    still = zero_policy("fbid_gym/QuadrupedWalk-v0", (62, 12), **args)
    return [still, replace(still, biases=(np.ones(12),))]


@pytest.fixture
def played(study, standing_and_thrashing):
    """The study with two trainings done, and told what it was played by."""
    done = study.cells[0], study.cells[2]
    for cell, each in zip(done, standing_and_thrashing, strict=True):
        fill(cell, 10.0 + cell.config.seed, 0.1, policy=each)
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
            assert its.means[column].item() == pytest.approx(values.mean(), rel=1e-12)
            np.testing.assert_allclose(its.each[column], values, rtol=1e-6)
        falls.append(3 - int(episodes.survived.sum()))
        for column, share in PUSHED.items():
            weights = (share * task_kind("walk").push[1],) * 2
            pushed = play_player(Player.of(load(folder), push_weights=weights), 3, FIRST_SEED)
            assert its.means[column].item() == pushed.survived.mean()
    assert sorted(falls) == [0, 3]
    assert Falls.of(list(found.values())) == Falls(3, 6) and str(Falls(12, 3456)) == "12 of 3,456"
    before, again = fresh_file(played).read_bytes(), []
    measure(played, 3, lambda *told: again.append(told))
    assert (again, fresh_file(played).read_bytes()) == ([], before)
    # Of a table that was kept before pushes were played, these alone are played.
    rows = read_rows(fresh_file(played))
    older = [name for name in rows[0] if name not in PUSHED]
    changed = [{name: "7.5" if name == "slip" else row[name] for name in older} for row in rows]
    fresh_file(played).write_text(to_csv(older, changed))
    measure(played, 3, lambda *told: again.append(told))
    now = read_rows(fresh_file(played))
    assert len(again) == 2 and now == [row | {"slip": "7.5"} for row in rows]


def test_fresh_episodes_are_on_the_page_and_in_the_table(played, tmp_path):
    out = tmp_path / "page.html"
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", out, video_seconds=0.0)
    assert main(replace(config, fresh_episodes=3)) == 0
    assert "fell in 3 of 6 fresh episodes" in out.read_text()
    assert "<h3>In fresh episodes</h3>" in out.read_text()
    *_, said, _, head, _, row = table(played).splitlines()
    assert said == "In fresh episodes:" and "| Falls | Return | Velocity error (m/s) |" in head
    assert row.startswith("| QuadrupedWalk-v0 | one | 2 | 3 of 6 |") and row.count("%") == 6
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
