"""Pages run no script but their own, whatever the text of files says."""

import base64
import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from eval.compare import main
from eval.document import document
from eval.papers.experiment import Experiment, Result, drawn, load, save
from fbid_gym.errors import RunError

EVIL = "<script>alert(1)</script><img src=x onerror=alert(2)>"


def policy_of(html: str) -> str:
    found = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', html)
    assert len(found) == 1
    return found[0]


def test_the_only_script_is_the_one_that_the_policy_names() -> None:
    html = document("a <b>", "<p>body</p>", script="let a=1;")
    (script,) = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy_of(html)
    assert "<title>a &lt;b&gt;</title>" in html
    assert "script-src 'none'" in policy_of(document("a", ""))
    assert policy_of(html).startswith("default-src 'none'; img-src data:; media-src data:")


def test_words_of_run_folders_are_words(run_folder: Callable[..., Path], tmp_path: Path) -> None:
    run = run_folder()
    versions = json.loads((run / "versions.json").read_text())
    forged = versions | {"cpu_count": EVIL, "platform": EVIL, "packages": {EVIL: EVIL}}
    (run / "versions.json").write_text(json.dumps(forged))
    few = ["--episodes", "4", "--sweep-episodes", "2", "--samples", "50", "--video-seconds", "0"]
    assert main([str(run), "--out", str(tmp_path / "report.html"), *few]) == 0
    html = (tmp_path / "report.html").read_text()
    assert "&lt;script&gt;alert(1)" in html
    assert "<script" not in html and "<img" not in html


def show(result: Result) -> list[str]:
    return [f"{result.numbers['best']:.3f}", f"{result.arrays['error'].mean():.3f}"]


EXPERIMENT = Experiment("eval.papers.some.example", "A", "B.", run=lambda setting: None, show=show)  # type: ignore[arg-type, return-value]


def test_a_result_is_read_as_it_was_saved(tmp_path: Path) -> None:
    result = Result([], {"best": 2.0}, {"error": [1.0, 2.0]})
    save(EXPERIMENT, tmp_path, result, {"quick": True, "seconds": 3.0})
    read, run = load(EXPERIMENT, tmp_path)
    assert (run.quick, run.seconds) == (True, 3.0)
    assert drawn(EXPERIMENT, read) == "2.0001.500"


@pytest.mark.parametrize("name", ["numbers.json", "data.npz"])
@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b"PK\x03\x04", b"\x93NUMPY", b"\x00" * 99])
def test_damaged_results_are_refused_in_one_sentence(
    name: str, content: bytes, tmp_path: Path
) -> None:
    result = Result([], {"best": 2.0}, {"error": [1.0, 2.0]})
    save(EXPERIMENT, tmp_path, result, {"quick": True, "seconds": 3.0})
    (EXPERIMENT.folder(tmp_path) / name).write_bytes(content)
    with pytest.raises(RunError, match=name):
        load(EXPERIMENT, tmp_path)


@pytest.mark.parametrize("numbers", [{}, {"best": "x"}, {"best": None}])
def test_results_of_something_else_are_refused(numbers: dict, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="example: its data do not fit it"):
        drawn(EXPERIMENT, Result([], numbers, {"error": []}))
