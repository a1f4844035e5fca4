"""`python -m fbid_gym.robots`: what it prints and draws."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fbid_gym.envs import verdict as verdicts
from fbid_gym.robots import load, zoo
from fbid_gym.robots.__main__ import main
from fbid_gym.robots.built_in import asset_path
from fbid_gym.robots.home_check import CONTROL_HZ
from fbid_gym.robots.portrait import portrait
from tests.robots.test_source_urdf import urdf

ANIMAL = zoo.draw(26)  # of no actuators, four feet on two points each


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "zoo.xml"
    path.write_text(zoo.mjcf(ANIMAL))
    return path


@pytest.fixture(autouse=True)
def quiet(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let robots stand and walk where that is what is tested."""
    if "verdict" not in request.node.name:
        monkeypatch.setattr("fbid_gym.robots.__main__.verdict", lambda robot: [])


@pytest.mark.slow
def test_a_verdict_by_simulation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """go1 does both in every layer; with hips too weak to hold it, it falls and that is told."""
    assert main(["go1", "--picture", str(tmp_path / "go1.png")]) == 0
    told = capsys.readouterr().out
    for word in ("Stands", "Walks"):
        line = next(line for line in told.splitlines() if line.startswith(f"- {word} up to"))
        assert "joint_position 100%, base_acceleration 100%, com_wrench 100%" in line
    weak = ["--torque-limit", "2", "--picture", str(tmp_path / "weak.png")]
    assert main([str(asset_path("go1.xml")), *weak]) == 0
    assert "Walks up to the end: joint_position 0%" in capsys.readouterr().out


def test_a_verdict_is_at_the_rates_at_which_robots_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[dict[str, Any]]()
    monkeypatch.setattr(verdicts, "survival", lambda robot, given: asked.append(given) or 1.0)
    assert len(list(verdicts.verdict(load("biped")))) == 2
    assert {given["task"] for given in asked} == {"balance", "walk"}
    assert all(given["physics_hz"] == given["control_hz"] == CONTROL_HZ for given in asked)


def test_a_robot_is_described_and_drawn(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--feet", *ANIMAL.foot_names, "--torque-limit", '{"*": 20, "*knee": 40}']
    assert main([str(path), *options, "--home", "stand", "--name", "cat"]) == 0
    told = capsys.readouterr().out
    assert "cat: 16 joints, 4 feet on 8 points, 13.53 kg" in told
    rows = {line.split()[0]: line.split() for line in told.splitlines() if line.strip()}
    assert rows["leg3_knee"][4] == "40" and rows["leg3_hip_roll"][4] == "20"
    assert rows["foot2"][1:3] == ["foot2", "2"]
    assert "Torque motors added on all joints." in told
    assert "At home:\n- Nothing speaks against it." in told
    with Image.open("cat.png") as picture:
        assert picture.size == (1280, 960)


def test_feet_as_json_and_what_speaks_against_a_home(path, capsys):
    feet = '{"left": ["foot0"], "right": ["foot1"]}'
    assert main([str(path), "--feet", feet, "--torque-limit", "20", "--picture", "a/b.png"]) == 0
    told = capsys.readouterr().out
    assert "outside of the contact points at home" in told
    assert Path("a/b.png").is_file()


def test_a_urdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "dog.urdf"
    path.write_text(urdf())
    assert main([str(path), "--picture", str(tmp_path / "dog.png")]) == 0
    assert "Body 'base' was made to float." in capsys.readouterr().out


def test_errors_are_told_in_one_line(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(path), "--torque-limit", "{"]) == 2
    assert capsys.readouterr().err == "error: Invalid torque_limit: '{'. Expected JSON.\n"
    assert main([str(path), "--feet", "paw", "--torque-limit", "3"]) == 2
    assert capsys.readouterr().err.startswith("error: No site or geom 'paw'.")


def test_the_portrait_shows_points_hull_and_centre_of_mass() -> None:
    pixels = portrait(load("biped")).astype(int)
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    assert np.sum((red > 120) & (green < 0.5 * red) & (blue < 0.4 * red)) > 50
    assert np.sum((red > 120) & (green > 0.5 * red) & (blue < 0.4 * red)) > 200
    assert np.sum((blue > 100) & (red < 0.5 * blue)) > 100
