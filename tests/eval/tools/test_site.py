"""The documentation's site: its pages say what the code does, and it builds without a warning."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from eval.tools.site import environments, pictures
from eval.tools.site.pages import pages
from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.errors import FbidError
from fbid_gym.policy import Shipped, shipped

ROOT = Path(__file__).resolve().parents[3]
REMEDY = "what builds the site is not installed: make docs"


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    return pages()


def test_a_page_for_everything_and_no_gap_left(made: dict[str, str]) -> None:
    text = (ROOT / "mkdocs.yml").read_text()
    assert "\nstrict: true\n" in text
    assert set(re.findall(r"- ([\w/]+\.md)", text)) == made.keys()
    assert {f"layers/{name}.md" for name in LAYERS} < made.keys()
    for name in LAYERS:
        page = made[f"layers/{name}.md"]
        assert "<!--" not in page
        for option in layer_options(name):
            rows = re.findall(rf"^\| `{option}` \|.*\| (.*) \|$", page, re.M)
            assert rows and all(rows), f"{option} means nothing"
    for path in (ROOT / "examples").glob("*.py"):
        assert path.read_text().strip() in made["examples.md"]


def test_a_push_on_a_zero_action() -> None:
    """Torques without feedback fall before it; a stabiliser takes it."""
    held, limp = pictures.respond("base_acceleration"), pictures.respond("torque")
    assert limp.time[-1] < 0.0 and held.time[-1] == 2.0
    assert max(held.shift) > 1.0 > held.shift[-1] and max(held.torque) > held.torque[0]
    drawn = pictures.chart("torque", {"base_acceleration": held, "torque": limp})
    assert "<svg" in drawn and "nan" not in drawn


@pytest.fixture
def shelf(monkeypatch: pytest.MonkeyPatch) -> tuple[Shipped, ...]:
    """The policies that are shipped, all of one environment, one of a layer alone last."""
    (first, *_), env_id = shipped(), "fbid_gym/BipedWalk-v0"
    both = {n: replace(first.policy, env_id=env_id, env_args={"action_layer": n})
            for n in ("torque", "base_acceleration")}  # fmt: skip
    shelf = tuple(first._replace(name=f"x/{n}", policy=policy) for n, policy in both.items())
    monkeypatch.setattr(environments, "shipped", lambda: shelf)
    return shelf


def test_a_clip_is_of_a_shipped_policy_or_says_that_none_is(shelf: tuple[Shipped, ...]) -> None:
    walk, stand = environments.Scene.of("fbid_gym/BipedWalk-v0"), "fbid_gym/BipedBalance-v0"
    assert walk.shipped is shelf[1] and walk.file.startswith("BipedWalk-")
    pages = environments.pages([walk.file, environments.Scene.of(stand).file])
    assert f'<video src="{walk.file}"' in pages["BipedWalk.md"]
    assert "The policy `shipped:x/base_acceleration`" in pages["BipedWalk.md"]
    assert "`shipped:x/torque`" in pages["BipedWalk.md"]
    assert "The zero action of `base_acceleration`" in pages["BipedBalance.md"]
    assert "](../policies.md)" not in pages["BipedBalance.md"]
    # A clip of another policy is not shown as if it were of this one.
    assert "<video " not in environments.pages(["BipedWalk-zero.mp4"])["BipedWalk.md"]


def test_without_a_renderer_there_are_no_clips(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def blind(scene: environments.Scene) -> bytes:
        raise FbidError("Cannot render without a display.")

    assert pictures.film(environments.Scene.of("fbid_gym/QuadrupedWalk-v0"), 0.1)[4:8] == b"ftyp"
    monkeypatch.setattr(pictures, "FOLDER", tmp_path)
    monkeypatch.setattr(pictures, "film", blind)
    monkeypatch.setattr(pictures, "LAYERS", {})
    pictures.main()
    assert capsys.readouterr().err == "No clips. Cannot render without a display.\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_site_builds_and_asks_nobody(tmp_path: Path) -> None:
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
        loaded += re.findall(
            r'<link[^>]*rel="(?:stylesheet|preconnect|icon)"[^>]*href="([^"]*)', html
        )
        assert not [name for name in loaded if "//" in name], page.name
        assert "arithmatex" not in html and "$$" not in html, page.name
    theory = (tmp_path / "theory" / "mistry2010.html").read_text(encoding="utf-8")
    assert 'display="block"' in theory and 'display="inline"' in theory and "<msub>" in theory
