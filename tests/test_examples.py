"""Examples run, and fit on a screen; code on the pages runs, too."""

import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SHORT = {
    "law_alone": ["--steps", "100"],
    "other_engine": ["--seconds", "0.5"],
    "own_layer": ["--steps", "10"],
    "own_loop": ["--seconds", "0.5"],
    "own_robot": ["--steps", "10"],
    "own_task": ["--steps", "10"],
    "ppo": ["--steps", "128", "--num-envs", "4"],
    "recurrent": ["--steps", "64", "--num-envs", "2"],
    "sb3": ["--steps", "96", "--num-envs", "2"],
}
NEEDS = {"other_engine": ("pybullet", "pip install -c constraints.txt 'fbid_gym[bullet]'")}
DOCS = "any_robot", "arguments", "deploy", "index", "layers/index", "measured", "motors"
DOCS = *DOCS, "own_task_and_layer", "pictures", "policies"
PAGES = ("README.md", *(f"docs/{name}.md" for name in DOCS))

pytestmark = pytest.mark.usefixtures("registries")


@pytest.mark.parametrize("name", [path.stem for path in EXAMPLES])
def test_it_runs(name, monkeypatch, capsys):
    if name in NEEDS:
        module, remedy = NEEDS[name]
        pytest.importorskip(module, reason=f"{module} is not installed: {remedy}")
    monkeypatch.setattr(sys, "argv", [name, *SHORT[name]])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    assert capsys.readouterr().out.strip()


def blocks(page: str) -> list[str]:
    """The Python on a page; what names a file of the reader's is tested elsewhere."""
    found = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.M | re.S)
    return [block for block in found if ".xml" not in block]


@pytest.mark.parametrize("page", PAGES)
def test_code_on_a_page_runs(page, tmp_path, monkeypatch):
    """All of a page's, one block after another; what it writes is not left behind."""
    assert blocks(page)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "page.py").write_text("\n".join(blocks(page)))
    runpy.run_path("page.py", run_name="__main__")


def test_no_page_has_code_that_nothing_runs():
    # tests/robots/test_own_robot_doc.py, tests/eval/test_clients.py
    elsewhere = {"docs/own_robot.md", "docs/clients.md"}
    with_code = {
        path.relative_to(ROOT).as_posix()
        for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        if "```python" in path.read_text()
    }
    assert with_code == {*PAGES, *elsewhere}
