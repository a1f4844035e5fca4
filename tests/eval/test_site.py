"""The documentation's site: its pages say what the code does, and it builds without a warning."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from eval.site import environments, layers, pictures, reference
from eval.site.examples import filled
from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError
from fbid_gym.policy import Shipped, shipped

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
REMEDY = "what builds the site is not installed: make docs"


def test_a_page_of_an_environment() -> None:
    """What the package says of it, below its title a clip."""
    env_id = "fbid_gym/BipedWalk-v0"
    page = environments._page(env_id, clip=True)
    assert page.startswith("# BipedWalk\n")
    assert page.count("<video ") == 1 and "<video " not in environments._page(env_id, False)
    for layer in LAYERS:
        assert f"(../layers/{layer}.md)" in page
    assert "\n## Info\n" in page


def test_a_page_for_everything() -> None:
    text = (ROOT / "mkdocs.yml").read_text()
    assert "\nstrict: true\n" in text
    listed = set(re.findall(r"- ([\w/]+\.md)", text))
    own = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    made = {f"environments/{environments.short(env_id)}.md" for env_id in ENVIRONMENTS}
    made |= {f"api/{name}" for name in reference.pages()}
    assert listed == own | made | {"environments/index.md", "security.md", "changelog.md"}
    assert {f"layers/{name}.md" for name in LAYERS} < own


@pytest.mark.parametrize("name", LAYERS)
def test_a_page_of_a_layer(name: str) -> None:
    said = (DOCS / "layers" / f"{name}.md").read_text()
    assert said.count(layers.OPTIONS) == said.count(layers.PICTURE) == 1
    page = layers.filled(f"layers/{name}.md", said, {name})
    assert f"]({name}.svg)" in page and ".svg" not in layers.filled(
        f"layers/{name}.md", said, set()
    )
    assert "<!--" not in page
    for option in layer_options(name):
        rows = re.findall(rf"^\| `{option}` \|.*\| (.*) \|$", page, re.M)
        assert rows and all(rows), f"{option} means nothing"


def test_a_push_on_a_zero_action() -> None:
    """Torques without feedback fall before it; a stabiliser takes it."""
    held, limp = pictures.respond("base_acceleration"), pictures.respond("torque")
    assert limp.time[-1] < 0.0 and held.time[-1] == 2.0
    assert max(held.shift) > 1.0 > held.shift[-1] and max(held.torque) > held.torque[0]
    drawn = pictures.chart("torque", {"base_acceleration": held, "torque": limp})
    assert drawn.startswith("<svg ") and "nan" not in drawn


@pytest.fixture
def shelf(monkeypatch: pytest.MonkeyPatch) -> tuple[Shipped, ...]:
    """The policies that are shipped, all of one environment, one of a layer alone last."""
    (first, *_), env_id = shipped(), "fbid_gym/BipedWalk-v0"
    both = ("torque", "base_acceleration")
    shelf = tuple(first._replace(name=f"x/{n}", env=env_id, layer=n) for n in both)
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


@pytest.mark.parametrize("env_id", ["fbid_gym/QuadrupedBalance-v0", "fbid_gym/QuadrupedWalk-v0"])
def test_a_clip(env_id: str) -> None:
    assert pictures.film(environments.Scene.of(env_id), seconds=0.1)[4:8] == b"ftyp"


def test_without_a_renderer_there_are_no_clips(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def blind(scene: environments.Scene) -> bytes:
        raise FbidError("Cannot render without a display.")

    monkeypatch.setattr(pictures, "FOLDER", tmp_path)
    monkeypatch.setattr(pictures, "film", blind)
    monkeypatch.setattr(pictures, "LAYERS", {})
    pictures.main()
    assert capsys.readouterr().err == "No clips. Cannot render without a display.\n"
    assert list(tmp_path.iterdir()) == []


def test_code_of_examples_is_on_their_page() -> None:
    page = filled((DOCS / "examples.md").read_text(), ROOT / "examples")
    for path in (ROOT / "examples").glob("*.py"):
        assert path.read_text().strip() in page
    assert "](../examples" not in page


def test_every_module_of_the_reference_is_there() -> None:
    for _, modules in reference.PAGES.values():
        for module in modules:
            path = ROOT / module.replace(".", "/")
            assert path.with_suffix(".py").exists() or (path / "__init__.py").exists(), module


def test_formulas_become_mathml() -> None:
    pytest.importorskip("latex2mathml", reason=REMEDY)
    from eval.site.mathematics import with_mathml

    page = with_mathml(r'a <span class="arithmatex">\(x &lt; \tau_1\)</span> b')
    assert page.startswith('a <math xmlns="http://www.w3.org/1998/Math/MathML" display="inline"')
    assert "<msub>" in page and "&lt;" in page.replace("&#x0003C;", "&lt;") and page.endswith(" b")
    block = with_mathml('<div class="arithmatex">\n\\[\nx\n\\]\n</div>')
    assert 'display="block"' in block


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built with every warning an error, and without any picture of robots."""
    pytest.importorskip("mkdocstrings", reason=REMEDY)
    pytest.importorskip("latex2mathml", reason=REMEDY)
    root = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(root)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return root


@pytest.mark.slow
def test_the_site_builds_and_asks_nobody(site: Path) -> None:
    """No broken link, reference or anchor; no script, style, font or picture from elsewhere."""
    pages = list(site.rglob("*.html"))
    assert len(pages) > 50
    for page in pages:
        html = page.read_text(encoding="utf-8")
        loaded = re.findall(r'<(?:script|img|video|source|iframe)[^>]*\ssrc="([^"]*)"', html)
        loaded += re.findall(
            r'<link[^>]*rel="(?:stylesheet|preconnect|icon)"[^>]*href="([^"]*)', html
        )
        assert not [name for name in loaded if "//" in name], page.name
        assert "arithmatex" not in html and "$$" not in html, page.name
