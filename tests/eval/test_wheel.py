"""What `make dist` checks without an environment, and that its checks find what is wrong."""

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from eval.wheel import archives
from eval.wheel.__main__ import build, failures, main
from eval.wheel.place import ROOT, Check, Place, call, expect
from fbid_gym.errors import FbidError

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Place:
    pytest.importorskip("build", reason="not installed: make dist")
    pytest.importorskip("hatchling", reason="not installed: make dist")
    folder = tmp_path_factory.mktemp("dist")
    build(folder)
    return Place(folder, folder, sys.executable)


def test_what_is_built_passes(built: Place, capsys: pytest.CaptureFixture[str]) -> None:
    assert failures(built, archives.CHECKS) == 0
    printed = capsys.readouterr().out
    assert all(f"ok      {check.name}\n" in printed for check in archives.CHECKS)


def altered(built: Place, folder: Path, leave_out: str, add: str) -> Place:
    """The wheel without some files, and with others."""
    place = Place(folder, folder, sys.executable)
    with zipfile.ZipFile(built.wheel) as old, zipfile.ZipFile(place.wheel, "w") as new:
        for name in old.namelist():
            if not re.search(leave_out, name):
                new.writestr(name, old.read(name))
        if add:
            new.writestr(add, "")
    return place


@pytest.mark.parametrize(
    ("leave_out", "add", "complaint"),
    [
        ("py.typed", "", "does not hold fbid_gym/py.typed"),
        ("g1.xml", "", "does not hold fbid_gym/assets/g1.xml"),
        ("^$", "train/ppo.py", "holds train/ppo.py"),
        ("^$", "fbid_gym/assets/policies/x.pickle", "holds fbid_gym/assets/policies/x.pickle"),
    ],
)
def test_a_wheel_that_holds_too_little_or_too_much_is_found(
    built: Place, tmp_path: Path, leave_out: str, add: str, complaint: str
) -> None:
    with pytest.raises(FbidError, match=complaint):
        archives.check_wheel(altered(built, tmp_path, leave_out, add))


def test_a_wheel_without_licence_is_found(built: Place, tmp_path: Path) -> None:
    with pytest.raises(FbidError, match="licence is not the project's"):
        archives.check_licence(altered(built, tmp_path, "LICENSE", ""))


def test_a_failed_check_is_counted_and_said(capsys: pytest.CaptureFixture[str]) -> None:
    place = Place(Path(), Path(), sys.executable)
    checks = [
        Check("one", lambda place: expect(False, "because")),
        Check("two", lambda place: expect(True, "")),
        Check("three", lambda place: print(call(["no such command"]))),
    ]
    assert failures(place, checks) == 2
    printed = capsys.readouterr().out
    assert "FAILED  one\n        because\nok      two\n" in printed
    assert "no such command is not installed" in printed


def test_without_anything_to_check_it_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = (Check("there", lambda place: expect(place.wheel.is_file(), "no wheel")),)
    monkeypatch.setattr("eval.wheel.__main__.CHECKS", checks)
    assert main(["--no-build", "--out", str(tmp_path)]) == 1
    assert "FAILED  there\n        no wheel" in capsys.readouterr().out


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


def test_scripts_of_users_have_ten_lines() -> None:
    text = (ROOT / "eval" / "wheel" / "user" / "plays.py").read_text(encoding="utf-8")
    code = [line for line in text.splitlines()[1:] if line]
    assert len(code) <= 12  # ten, and two that see whether it fell and what was imported
