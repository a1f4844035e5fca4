"""The page of a study says all of it, and runs nothing of files."""

import json
import re
from dataclasses import replace

import pytest

from eval.results import Estimate
from eval.robustness.curves import Along, Budget, Robustness, Trend
from eval.study.__main__ import StudyConfig, main
from eval.study.cells import robustness_file
from eval.study.findings import findings
from eval.study.page import page
from fbid_gym.errors import FbidError
from tests.eval.study.small import FEW, fill
from train.runs.files import to_json
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


def measured_robustness(arm, run):
    curve = Trend([Estimate(1.0, 0.9, 1.0), Estimate(0.5, 0.4, 0.6)], Estimate(0.7, 0.6, 0.8))
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
    assert "Other conditions than in training" in out.read_text()
    assert json.loads(out.with_suffix(".json").read_text())["reference"] == "one"
    assert main(replace(config, video_seconds=1.0)) == 0  # of a run that has no policy
    assert f"There is no clip of {first.config.folder.name}" in out.read_text()
    for data, message in (
        ({**kept, "runs": {"one": ["stranger"]}}, "is of arm one, run stranger. Expected"),
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
