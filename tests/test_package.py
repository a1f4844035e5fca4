"""What the package says of itself, and what it does not load."""

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_package_says_that_it_is_typed_and_how_to_cite_it() -> None:
    assert (ROOT / "fbid_gym" / "py.typed").read_bytes() == b""
    assert "Typing :: Typed" in PROJECT["classifiers"]
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for line in (f"version: {PROJECT['version']}", f"license: {PROJECT['license']}"):
        assert f"\n{line}\n" in cited
    assert f"name: {PROJECT['authors'][0]['name']}\n" in cited


def test_importing_the_package_loads_no_learner() -> None:
    script = "import sys, fbid_gym; print({'torch', 'stable_baselines3'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("set()\n", 0), done.stderr
