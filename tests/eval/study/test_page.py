"""The page of a study says all of it, and runs nothing of files."""

import json
import re
from dataclasses import replace

import pytest

from eval.files import to_json
from eval.results import Estimate
from eval.robustness.curves import Along, Budget, Curve, Robustness, digest
from eval.study.__main__ import StudyConfig, main
from eval.study.cells import robustness_file
from eval.study.findings import findings
from eval.study.page import page
from fbid_gym.errors import FbidError
from tests.eval.study.small import FEW, fill, policy
from train.runs.folder import RunFolder
from train.runs.training import log_of


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
    assert 'name="viewport"' in html and not re.search(r"https?://|url\((?!#)|<link|src=", html)
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
    folder.policy.unlink()
    assert len(warning({"one": (digest(policy(0.1)),)})) == 1


def test_what_is_not_measured_of_a_training_is_a_dash(study):
    first, squat, _ = study.cells
    fill(first, 10.0, 0.1)
    fill(squat, 5.0, float("nan"))
    html = page(findings(study, FEW))
    assert "nan" not in re.sub("<style>.*?</style>", "", html, flags=re.DOTALL)
    trainings = html.partition("<h2>Every training</h2>")[2]
    (row,) = [row for row in trainings.split("<tr>") if "BipedSquat-v0, " in row]
    assert row.count("<td>–</td>") == 1  # the velocity error
