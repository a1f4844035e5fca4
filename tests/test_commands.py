"""The commands of the package: found from any folder, called as they are, and kind to mistakes."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from fbid_gym.__main__ import COMMANDS, Subcommand, called, main
from fbid_gym.errors import RobotError, UnknownOptionError
from fbid_gym.robots import Robot, source

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(autouse=True)
def kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A command changes the path and the environment of its process; this one has others to run."""
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in ("PYTHONPATH", "PYTHONSAFEPATH"):
        monkeypatch.setenv(name, os.environ.get(name, ""))


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_has_a_help_that_calls_it_by_its_name(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if COMMANDS[name].extra == "play":
        pytest.importorskip("tyro", reason="the extra 'play' is not installed")
    for module in (COMMANDS[name].module, f"{COMMANDS[name].module}.__main__"):
        monkeypatch.delitem(sys.modules, module, raising=False)  # as in a process of its own
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    told = capsys.readouterr().out
    assert ended.value.code == 0 and told.startswith(f"usage: fbid-gym {name} ")
    assert f"python -m {COMMANDS[name].module} " not in told


def test_the_help_lists_all(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["--help"]):
        assert main(arguments) == 0
        told = capsys.readouterr().out
        assert all(f"\n  {name} " in told for name in COMMANDS)


def test_extras_are_those_of_the_package_and_programs_are_there() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for command in COMMANDS.values():
        assert command.extra in ("", *project["optional-dependencies"])
        path = ROOT / command.module.replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file()
    assert project["scripts"] == {"fbid-gym": "fbid_gym.__main__:main"}


def test_a_module_is_called_as_the_user_did(monkeypatch: pytest.MonkeyPatch) -> None:
    assert called("train.ppo") == ("python", "-m", "train.ppo")
    monkeypatch.setattr(sys, "argv", ["fbid-gym compare", "runs/a"])
    assert called("train.ppo") == ("fbid-gym", "train")
    assert called("eval.tools.bench") == ("python", "-m", "eval.tools.bench")


def test_nonsense_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An unknown command, and a program whose library is not there."""
    (tmp_path / "needs_more.py").write_text("import no_such_library.part\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(COMMANDS, "more", Subcommand("needs_more", "", "play"))
    for name, message in (
        ("pley", "Unknown command 'pley'. Valid choices: play, demo, train, eval"),
        ("more", "fbid-gym more needs no_such_library, which is not installed. It comes with the "
                 "extra 'play': pip install 'fbid_gym[play]'."),
    ):  # fmt: skip
        assert main([name]) == 2
        told = capsys.readouterr().err
        assert told.startswith("error: ") and told.count("\n") == 1 and message in told


def test_folders_of_the_user_that_are_called_train_are_not_run(tmp_path: Path) -> None:
    """Neither by the command nor by the trainings that it begins."""
    for name in ("train", "eval"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('that of the user')\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    script = (
        "import subprocess, sys\n"
        "from fbid_gym.__main__ import main\n"
        "try:\n    main(['sweep', '--help'])\n"
        "except SystemExit as end:\n    assert end.code == 0, end\n"
        "child = [sys.executable, '-m', 'train.sweep', 'no.toml']\n"
        "done = subprocess.run(child, capture_output=True, text=True)\n"
        "assert done.returncode == 2 and 'no.toml' in done.stderr, done.stderr\n"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", script], cwd=tmp_path, env=environment, capture_output=True
    )
    assert done.returncode == 0, done.stderr


def test_a_robot_of_the_menagerie_goes_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder in place of what the package fetches."""
    pytest.importorskip("mujoco_menagerie", reason="the extra 'menagerie' is not installed")
    (tmp_path / "unitree_go2").mkdir()
    text = (ROOT / "assets" / "go1.xml").read_text()
    (tmp_path / "unitree_go2" / "go2.xml").write_text(text)
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    name = "menagerie:unitree_go2"
    robot = Robot.load(name)
    assert robot.num_feet == 4 and robot.mass == pytest.approx(Robot.load(f"{name}/go2").mass)
    from fbid_gym.runtime.config import EnvConfig
    from train.runs.robots import chosen

    assert EnvConfig(robot=name).load_robot() is EnvConfig(robot=name).load_robot()
    assert chosen(name).mass == robot.mass  # type: ignore[union-attr]
    with pytest.raises(UnknownOptionError, match="Did you mean 'unitree_go2'?"):
        Robot.load("menagerie:unitree_go3")
    with pytest.raises(UnknownOptionError, match="Valid choices: go2, go2_mjx, scene"):
        Robot.load(f"{name}/dog")
    with pytest.raises(RobotError, match="mujoco_menagerie cannot provide 'menagerie:unitree_g1'"):
        Robot.load("menagerie:unitree_g1")


def test_without_the_menagerie_the_line_for_pip_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RobotError, match="pip install 'fbid_gym\\[menagerie\\]'") as told:
        Robot.load("menagerie:unitree_go2")
    assert "\n" not in str(told.value)
