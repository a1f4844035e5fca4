"""What a study shows is what was evaluated, of every cell, finished or not."""

import csv
import io
import json
import re
import shutil
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from eval.estimates import Chance, improvement, over_tasks
from eval.files import to_json
from eval.pages import DOCS, marks, spliced
from eval.results import Estimate
from eval.robustness.curves import Along, Budget, Curve, Robustness, digest
from eval.rollout import Player, play_player
from eval.study.__main__ import StudyConfig, main
from eval.study.cells import arms, check_cells, curve, exploring, robustness_file
from eval.study.findings import findings
from eval.study.fresh import FIRST_SEED, Falls, fresh_file, kept, measure
from eval.study.page import page
from eval.study.results import Settings
from eval.study.tables import drawn, numbers, table
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from train.environments import make_env
from train.runs.folder import RunFolder
from train.runs.reading import load
from train.runs.study import read_study
from train.runs.tables import EVALUATIONS, to_csv
from train.runs.training import log_of, standing

STUDY = """
seeds = [0, 1]
total_steps = 1000
[[arms]]
name = "one"
env = "fbid_gym/QuadrupedWalk-v0"
action_layer = "torque"
[[arms]]
name = "other"
env = "fbid_gym/BipedSquat-v0"
action_layer = "torque"
seeds = [0]
"""
COLUMNS = ("steps,wall_seconds,episodes,return_mean,return_std,return_q25,return_q75,length_mean,"
           "survival,velocity_error\n")  # fmt: skip


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(STUDY)
    return read_study(path, tmp_path / "out")


def fill(cell, height, error, until=1000):
    folder = RunFolder.of(cell.config.folder)
    folder.path.mkdir(parents=True)
    folder.config.write_text(json.dumps(cell.config.to_json()))
    folder.evaluations.write_text(
        f"{COLUMNS}0,0,8,{height},1,{height - 1},{height + 1},50,0.5,{2 * error}\n"
        f"1000,9,8,{2 * height},1,{height - 1},{height + 1},50,1.0,{error}\n"
    )
    folder.progress.write_text(f"steps,return_mean\n400,nan\n800,{height / 2}\n{until},{height}\n")


def test_numbers_hold_every_evaluation(study):
    for height, cell in zip((10.0, 20.0, 30.0), study.cells, strict=True):
        fill(cell, height, 0.1)
    rows = list(csv.DictReader(io.StringIO(numbers(study))))
    assert [(row["env"], row["arm"], row["seed"], float(row["return_mean"])) for row in rows] == [
        (cell.config.env, cell.arm, str(cell.config.seed), factor * height)
        for height, cell in zip((10.0, 20.0, 30.0), study.cells, strict=True)
        for factor in (1.0, 2.0)
    ]
    assert [row["return_exploring"] for row in rows][:4] == ["", "10.0", "", "20.0"]


def test_curves_are_means_over_seeds_between_the_worst_and_the_best(study):
    first, squat, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3)
    fill(squat, 5.0, float("nan"))
    walks, squats = arms(study)
    assert curve(walks, "velocity_error").values.tolist() == [[0.2, 0.1], [0.6, 0.3]]
    assert exploring(first.config) == ([800.0, 1000.0], [5.0, 10.0])
    text = table(study)
    assert "| QuadrupedWalk-v0 | one | 2 | 1" in text
    assert "0.400 → 0.200 (0.100 to 0.300)" in text
    assert "| BipedSquat-v0 | other | 1 |" in text and "| – |" in text
    picture = ElementTree.fromstring(drawn(study))
    # Where nothing is commanded there is no velocity error to draw.
    assert len(picture.findall("{http://www.w3.org/2000/svg}svg")) == 3
    assert squats.cells == (squat,)


def test_what_is_not_finished_counts_with_what_it_has_and_is_said(study):
    fill(study.cells[0], 10.0, 0.1, until=900)
    assert "0 of 2 finished" in table(study)
    drawn(study)


def test_what_has_only_begun_does_not_cut_short_what_has_finished(study):
    first, _, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3, until=900)
    walks = arms(study)[0]
    assert curve(walks, "velocity_error").values.tolist() == [[0.2, 0.1]]
    assert "| one | 1 of 2 finished |" in table(study)


def test_a_study_without_runs_is_said(study):
    assert "| none |" in table(study)
    with pytest.raises(FbidError, match=re.escape("has not been evaluated yet")):
        drawn(study)


FEW = Settings(samples=200)


def test_the_numbers_of_an_arm_are_of_the_trainings_that_are_done(study):
    first, squat, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3, until=900)  # evaluated, but not to its end
    walks, squats = findings(study, FEW).arms
    assert walks.counted == [first.config.folder.name] and (walks.done, walks.complete) == (
        1,
        False,
    )
    assert walks.final["velocity_error"] == Estimate(0.1)
    assert walks.before["velocity_error"] == 0.2 and walks.final["falls"].value == 0.0
    assert [cell.state for cell in walks.cells] == ["done", "90%"]
    assert (squats.counted, squats.cells[0].state) == ([], "not begun")


def test_where_none_is_done_numbers_are_as_far_as_all_are(study):
    first, _, second = study.cells
    fill(first, 10.0, 0.1, until=900)
    fill(second, 20.0, 0.3, until=600)
    evaluations = RunFolder.of(second.config.folder).evaluations
    evaluations.write_text(evaluations.read_text().replace("1000,9,", "500,9,"))
    arm = findings(study, FEW).arms[0]
    assert arm.done == 0 and len(arm.counted) == 2 and arm.steps == 500.0
    assert arm.each["velocity_error"] == pytest.approx([0.15, 0.3])


def test_thresholds_are_reached_by_who_stays_up(study):
    """Half the episodes fall at the first evaluation, where the error is twice as large."""
    first, _, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 10.0, 0.2)
    settings = replace(FEW, thresholds=(0.5, 0.2, 0.15, 0.05))
    arm = findings(study, settings).arms[0]
    inf = float("inf")
    assert [one.each for one in arm.steps_to] == [
        [1000, 1000],
        [1000, 1000],
        [1000, inf],
        [inf] * 2,
    ]
    assert arm.wall_to[0].each == [9.0, 9.0]
    lenient = findings(study, replace(settings, survival=0.5)).arms[0]
    assert [one.each for one in lenient.steps_to[:2]] == [[0, 0], [0, 1000]]
    assert lenient.steps_to[2].each[0] == pytest.approx(500.0)


def test_arms_are_set_against_the_reference(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(STUDY.replace("BipedSquat", "QuadrupedWalk").replace("seeds = [0]\n", ""))
    study = read_study(path, tmp_path / "out")
    for cell in study.cells:
        fill(cell, 10.0 + cell.config.seed, 0.1 if cell.arm == "other" else 0.2)
    one, other = findings(study, FEW).arms
    assert study.reference == "one" and not one.versus
    assert other.versus["velocity_error"].probability == Estimate(1.0, 1.0, 1.0)
    assert other.versus["return_mean"].probability.value == 0.5
    back, _ = findings(study, FEW, "other").arms
    assert back.versus["velocity_error"].probability.value == 0.0
    with pytest.raises(FbidError, match="Unknown reference 'cat'. Valid choices: one, other"):
        findings(study, FEW, "cat")


def test_environments_count_the_same_whatever_their_number_of_runs():
    chance = Chance(np.random.default_rng(0), 500, 0.95)
    both = over_tasks([np.zeros(8), np.ones(4)], chance)
    assert (both.value, both.low, both.high) == (0.5, 0.5, 0.5)
    better = improvement([np.ones(3), np.zeros(2)], [np.zeros(5), np.ones(2)], chance)
    assert (better.value, better.low, better.high) == (0.5, 0.5, 0.5)
    assert over_tasks([np.zeros(1), np.ones(4)], chance).low is None


def test_a_folder_of_another_study_is_one_clear_error(study, tmp_path):
    first = study.cells[0]
    fill(first, 10.0, 0.1)
    config = RunFolder.of(first.config.folder).config
    mine = json.loads(config.read_text())
    for changes, message in (
        ({"num_envs": 3}, "num_envs 512 instead of 3"),
        ({"total_steps": 5000}, "total_steps 1000 instead of 5000"),
    ):
        config.write_text(json.dumps(mine | changes))
        with pytest.raises(FbidError, match=f"is not what the study says.*{message}") as caught:
            findings(study, FEW)
        assert str(first.config.folder) in str(caught.value)
    config.write_text(json.dumps(mine | {"total_steps": 500}))  # will be continued
    findings(study, FEW)


def test_a_table_that_is_no_table_is_one_clear_error(study):
    fill(study.cells[0], 10.0, 0.1)
    evaluations = RunFolder.of(study.cells[0].config.folder).evaluations
    evaluations.write_text(evaluations.read_text().replace("1000,9,", "1000,<b>,"))
    with pytest.raises(FbidError, match="evaluations.csv: holds more than numbers"):
        findings(study, FEW)


def test_the_page_says_all_of_it_and_runs_nothing_of_files(study, tmp_path):
    first, squat, second = study.cells
    fill(first, 10.0, 0.1)
    fill(squat, 5.0, float("nan"))
    fill(second, 20.0, 0.3, until=900)
    log_of(second.config).parent.mkdir()
    log_of(second.config).write_text("error: <script>alert(1)</script> is full.\n")
    html = page(findings(study, FEW), command="python -m eval.study <b>")
    assert "2 of 3 trainings have finished; 1 failed." in html
    assert "&lt;script&gt;alert(1)&lt;/script&gt; is full." in html and "<script>" not in html
    assert 'name="viewport"' in html and not re.search(r"https?://|url\(|<link|src=", html)
    for cell in study.cells:
        assert cell.config.folder.name.rpartition("-s")[0].partition("-v0-")[0] in html
    assert html.count("<h2") == 2 + 2 and "How it was measured" in html
    assert html.count("<div") == html.count("</div>") and html.count("<tr") == html.count("</tr>")


def test_a_study_of_which_nothing_has_begun_has_a_page(study):
    html = page(findings(study, FEW))
    assert "0 of 3 trainings have finished." in html and "not begun" in html


def measured_robustness(arm, run):
    curve = Curve([Estimate(1.0, 0.9, 1.0), Estimate(0.5, 0.4, 0.6)], Estimate(0.7, 0.6, 0.8))
    along = [Along("push", [0.0, 0.5], {name: {arm: curve} for name in ("survived", "returned")})]
    return Robustness(
        "fbid_gym/QuadrupedWalk-v0", {}, Budget(4, 0), ("survived", "returned"),
        {arm: "torque"}, {arm: (run,)}, along, {},
    )  # fmt: skip


def test_the_command_writes_page_and_numbers_and_shows_kept_robustness(study, tmp_path, capsys):
    first = study.cells[0]
    fill(first, 10.0, 0.1)
    file = robustness_file(study, first.config.env)
    file.parent.mkdir()
    kept = measured_robustness("one", first.config.folder.name).to_dict()
    file.write_text(to_json(kept))
    out = tmp_path / "page.html"
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", out, video_seconds=0.0)
    assert main(config) == 0
    assert "What they stand that they were not trained for" in out.read_text()
    assert json.loads(out.with_suffix(".json").read_text())["reference"] == "one"
    assert main(replace(config, video_seconds=1.0)) == 0  # of a run that has no policy
    assert f"There is no clip of {first.config.folder.name}" in out.read_text()
    for data, message in (
        (
            {**kept, "runs": {"one": ["stranger"]}},
            "is of arm one, run stranger. Expected",
        ),
        ({**kept, "arms": {"one": "torque", "two": "torque"}}, "not the numbers of"),
        ({**kept, "along": [{**kept["along"][0], "name": "<b>"}]}, "not the numbers of"),
        ({**kept, "along": 3}, "not the numbers of eval.robustness, or corrupt"),
        ({**kept, "env_id": "x"}, "is of x. Expected"),
    ):
        file.write_text(to_json(data))
        with pytest.raises(FbidError, match=message):
            main(config)
    with pytest.raises(FbidError, match="Invalid out"):
        main(replace(config, out=tmp_path / "page.txt"))


def test_docs_are_written_whole_or_not_at_all(study, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("eval.study.__main__.DOCS", tmp_path / "docs")
    (tmp_path / "docs").mkdir()
    page_of_docs = tmp_path / "docs" / "mine.md"
    first, last = marks("mine")
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", write_docs=True)
    with pytest.raises(FbidError, match="There is no page"):
        main(config)
    page_of_docs.write_text(f"{first}\n{last}\n")
    with pytest.raises(FbidError, match="has not been evaluated yet"):
        main(config)
    assert [path.name for path in page_of_docs.parent.iterdir()] == ["mine.md"]
    fill(study.cells[0], 10.0, 0.1)
    assert main(config) == 0
    assert table(study) in page_of_docs.read_text()
    assert {path.suffix for path in page_of_docs.parent.iterdir()} == {".md", ".csv", ".svg"}
    with pytest.raises(FbidError, match="Invalid --robustness"):
        main(replace(config, write_docs=False, robustness=True))


def test_docs_are_of_the_runs_of_the_study_and_of_no_others(study, tmp_path, monkeypatch):
    monkeypatch.setattr("eval.study.__main__.DOCS", tmp_path)
    page_of_docs, (first, last) = tmp_path / "mine.md", marks("mine")
    page_of_docs.write_text(f"{first}\n{last}\n")
    fill(study.cells[0], 10.0, 0.1)
    other = STUDY.replace("total_steps", "ppo = { learning_rate = 0.5 }\ntotal_steps")
    (tmp_path / "mine.toml").write_text(other)
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", write_docs=True)
    for wrong, message in (
        (config, "is not what the study says: it says ppo.learning_rate 0.5 instead of"),
        (replace(config, write_docs=False), "is not what the study says"),
    ):
        with pytest.raises(FbidError, match=message):
            main(wrong)
    (tmp_path / "mine.toml").write_text(STUDY)
    with pytest.raises(FbidError, match="Unknown reference 'cat'. Valid choices: one, other"):
        main(replace(config, reference="cat"))
    assert page_of_docs.read_text() == f"{first}\n{last}\n"
    assert not (tmp_path / "mine.csv").exists()


def test_kept_robustness_of_policies_that_have_changed_is_said_to_be_that(study, tmp_path):
    first = study.cells[0]
    fill(first, 10.0, 0.1)
    name, folder = first.config.folder.name, RunFolder.of(first.config.folder)
    policy(0.1).save(folder.policy)
    found, file = measured_robustness("one", name), robustness_file(study, first.config.env)
    file.parent.mkdir()
    out = tmp_path / "page.html"
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", out, video_seconds=0.0)

    def warning(policies):
        file.write_text(to_json(replace(found, policies=policies).to_dict()))
        assert main(config) == 0
        said = json.loads(out.with_suffix(".json").read_text())["warnings"]
        return [one for one in said if "What the policies stand in QuadrupedWalk-v0" in one]

    assert warning({"one": (digest(policy(0.1)),)}) == []
    assert ["before it was noted" in one for one in warning({})] == [True]
    (text,) = warning({"one": (digest(policy(0.2)),)})
    assert f"have changed since, of {name}: --robustness" in text and text in out.read_text()
    shutil.rmtree(folder.policy)
    assert len(warning({"one": (digest(policy(0.1)),)})) == 1


def policy(bias):
    return Policy(
        "fbid_gym/QuadrupedWalk-v0", {"action_layer": "torque"}, np.zeros(3), np.ones(3),
        (np.zeros((2, 3)),), (np.full(2, bias),),
    )  # fmt: skip


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
    measure(study, 3, said.append)
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
    measure(played, 3, again.append)
    assert (again, fresh_file(played).read_bytes()) == ([], before)


def test_fresh_episodes_are_on_the_page_and_in_the_table(played, tmp_path):
    out = tmp_path / "page.html"
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", out, video_seconds=0.0)
    assert main(replace(config, fresh_episodes=3)) == 0
    assert "QuadrupedWalk-v0, falls in fresh episodes: one 3 of 6." in out.read_text()
    assert "<h3>In fresh episodes</h3>" in out.read_text()
    first, second = table(played).splitlines()[2:]
    assert first.endswith("| 3 of 6 |") and second.endswith("| – |")
    told = json.loads(out.with_suffix(".json").read_text())["arms"][0]["fresh"]
    assert told["falls"] == {"fallen": 3, "episodes": 6} and told["each"]["falls"] == [0.0, 1.0]
    fresh_file(played).unlink()
    assert "fresh" not in table(played)


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
    columns = fresh_columns()
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


def fresh_columns():
    return (
        "run",
        "policy",
        *[name for name in EVALUATIONS if name not in ("steps", "wall_seconds")],
    )


def test_fresh_episodes_of_policies_that_have_changed_are_left_out_and_played_again(
    played, standing_and_thrashing
):
    first, second = (played.cells[i].config.folder for i in (0, 2))
    standing_and_thrashing[0].save(RunFolder.of(second).policy)
    found, (warning,) = kept(played)
    assert found.keys() == {first.name} and f"of {second.name}, and are left out" in warning
    assert warning in findings(played, FEW).warnings
    said = []
    measure(played, 3, said.append)
    assert len(said) == 1 and second.name in said[0]
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


def test_what_is_not_measured_of_a_training_is_a_dash(study):
    first, squat, _ = study.cells
    fill(first, 10.0, 0.1)
    fill(squat, 5.0, float("nan"))
    html = page(findings(study, FEW))
    assert "nan" not in re.sub("<style>.*?</style>", "", html, flags=re.DOTALL)
    trainings = html.partition("<h2>Every training</h2>")[2]
    (row,) = [row for row in trainings.split("<tr>") if "BipedSquat-v0, " in row]
    assert row.count("<td>–</td>") == 1  # the velocity error


STUDIES = sorted((DOCS.parent / "studies").glob("*.toml"))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_study_has_a_page_of_docs(path, tmp_path):
    study = read_study(path, tmp_path)
    assert "here" in spliced(DOCS / f"{study.page}.md", "here", study.name)


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_kept_runs_are_those_of_their_study(path):
    study = read_study(path)
    check_cells(study)
    for cell in study.cells:
        if standing(cell.config).state == "done":
            assert load(cell.config.folder).seed == cell.config.seed


def test_returns_are_compared_as_shares_of_what_can_be_earned(tmp_path):
    """An arm that decides five times as often adds up five times as many rewards."""
    path = tmp_path / "rates.toml"
    fast = 'action_layer = "torque"\nenv_args = { policy_hz = 250 }\n'
    text = STUDY.replace("BipedSquat", "QuadrupedWalk").replace("seeds = [0]\n", "")
    first, _, last = text.rpartition('action_layer = "torque"\n')
    path.write_text(first + fast + last)
    study = read_study(path, tmp_path / "out")
    for cell in study.cells:
        fill(cell, 10.0 if cell.arm == "one" else 40.0, 0.1)
    slow, quick = findings(study, FEW).arms
    assert (slow.most, quick.most) == (1000.0, 5000.0)
    assert quick.versus["return_mean"].probability.value == 0.0
