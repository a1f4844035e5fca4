"""Pages run no script but their own, whatever the text of files says."""

import base64
import hashlib
import json
import re

from eval.compare import main
from eval.page.html import _PARTS, render

EVIL = "<script>alert(1)</script><img src=x onerror=alert(2)>"


def page(title: str, script: str = "") -> tuple[str, str]:
    """An empty page, and what it allows."""
    html = render("base.html", title=title, script=script)
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', html)
    return html, policy


def test_the_only_script_is_the_one_that_the_policy_names():
    html, policy = page("a <b>", "let a=1<2;")
    (script,) = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert script == "let a=1<2;" and f"script-src 'sha256-{digest}'" in policy
    assert "<title>a &lt;b&gt;</title>" in html
    assert "script-src 'none'" in page("a")[1]
    assert policy.startswith("default-src 'none'; img-src data:; media-src data:")


def test_what_is_not_html_of_ours_is_escaped():
    for part in (_PARTS.table([EVIL], [[EVIL, EVIL]]), _PARTS.folded(EVIL, EVIL)):
        assert "&lt;script&gt;" in part and "<script" not in part and "<img" not in part
    inner = _PARTS.table(["a"], [["b"]])
    assert inner in _PARTS.folded("c", inner)


def test_words_of_run_folders_are_words(run_folder, tmp_path):
    run = run_folder(name="a<b>&c")
    versions = json.loads((run / "versions.json").read_text())
    forged = versions | {"cpu_count": EVIL, "platform": EVIL, "packages": {EVIL: EVIL}}
    (run / "versions.json").write_text(json.dumps(forged))
    few = ["--episodes", "4", "--sweep-episodes", "2", "--samples", "50", "--video-seconds", "0"]
    assert main([str(run), "--out", str(tmp_path / "report.html"), *few]) == 0
    html = (tmp_path / "report.html").read_text()
    assert "&lt;script&gt;alert(1)" in html
    assert "<script" not in html and "<img" not in html and "a<b>" not in html
