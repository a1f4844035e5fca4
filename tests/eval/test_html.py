"""Pages run no script but their own, whatever the text of files says."""

import base64
import hashlib
import re

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
