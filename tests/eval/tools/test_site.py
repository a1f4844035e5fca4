"""The documentation's site: its pages say what the code does, and it builds without a warning."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from eval.tools.site import pictures
from eval.tools.site.pages import pages
from fbid_gym.actions import LAYERS, layer_options

ROOT = Path(__file__).resolve().parents[3]
REMEDY = "what builds the site is not installed: make docs"


@pytest.fixture(scope="module")
def made():
    return pages()


@pytest.mark.slow
def test_a_page_for_everything_and_no_gap_left(made):
    text = (ROOT / "mkdocs.yml").read_text()
    assert "\nstrict: true\n" in text
    assert set(re.findall(r"- ([\w/-]+\.md)", text)) == made.keys()
    assert {f"layers/{name}.md" for name in LAYERS} < made.keys()
    for name in LAYERS:
        page = made[f"layers/{name}.md"]
        assert "<!--" not in page
        for option in layer_options(name):
            rows = re.findall(rf"^\| `{option}` \|.*\| (.*) \|$", page, re.M)
            assert rows and all(rows), f"{option} means nothing"
    for path in (ROOT / "examples").glob("*.py"):
        assert path.read_text().strip() in made["examples.md"]


def test_a_push_on_a_zero_action():
    """Torques without feedback fall before it; a stabiliser takes it."""
    held, limp = pictures.respond("base_acceleration"), pictures.respond("torque")
    assert limp.time[-1] < 0.0 and held.time[-1] == 2.0
    assert max(held.shift) > 1.0 > held.shift[-1] and max(held.torque) > held.torque[0]
    drawn = pictures.chart("torque", {"base_acceleration": held, "torque": limp})
    assert "<svg" in drawn and "nan" not in drawn


@pytest.mark.slow
def test_the_site_builds_and_asks_nobody(tmp_path):
    """No broken link, reference or anchor; no script, style, font or picture from elsewhere.

    No formula is left to a script, either.
    """
    pytest.importorskip("mkdocstrings", reason=REMEDY)
    pytest.importorskip("latex2mathml", reason=REMEDY)
    command = [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = {page: page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html")}
    assert len(made) > 50
    for page, html in made.items():
        loaded = re.findall(r'<(?:script|img|video|source|iframe)[^>]*\ssrc="([^"]*)"', html)
        kinds = r'rel="(?:stylesheet|preconnect|icon)"'
        loaded += re.findall(rf'<link[^>]*{kinds}[^>]*href="([^"]*)', html)
        assert not [name for name in loaded if "//" in name], page.name
        assert "arithmatex" not in html and "$$" not in html, page.name
    theory = (tmp_path / "theory" / "mistry2010.html").read_text(encoding="utf-8")
    assert 'display="block"' in theory and 'display="inline"' in theory and "<msub>" in theory
