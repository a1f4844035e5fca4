"""Whatever a robot is read from, it is the same robot; and how it fails to be read."""

import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.robots import Robot, zoo
from tests.robots.test_source_urdf import urdf

ANIMAL = zoo.draw(22)
TEXT = zoo.mjcf(ANIMAL)


def published(folder: Path, monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    """A package robot_descriptions with a single robot, `dog_description`."""
    package = folder / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "dog_description.py").write_text(module)
    monkeypatch.syspath_prepend(folder)
    for name in ("robot_descriptions", "robot_descriptions.dog_description"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_path_text_and_spec_give_the_same_robot(tmp_path: Path) -> None:
    path = tmp_path / "zoo.xml"
    path.write_text(TEXT)
    spec = mujoco.MjSpec.from_string(TEXT)
    sources: list[Any] = [path, str(path), TEXT, spec]
    robots = [Robot.from_mjcf(source, ANIMAL.foot_names) for source in sources]
    for robot in robots:
        assert robot.name == f"zoo{ANIMAL.seed}"
        assert robot.mass == pytest.approx(ANIMAL.mass)
        np.testing.assert_allclose(robot.home_qpos, robots[0].home_qpos, atol=1e-5)
    assert len(list(spec.sensors)) == 0  # the user's own spec stays as it was


@pytest.mark.parametrize("kind", ["MJCF", "URDF"])
def test_a_published_robot_is_loaded_by_its_name(tmp_path, monkeypatch, kind):
    path = tmp_path / ("dog.xml" if kind == "MJCF" else "dog.urdf")
    path.write_text(TEXT if kind == "MJCF" else urdf())
    published(tmp_path, monkeypatch, f"{kind}_PATH = {str(path)!r}")
    assert Robot.from_mjcf("dog_description").num_feet == 4
    with pytest.raises(RobotError, match="robot_descriptions has no robot 'cat_description'."):
        Robot.from_mjcf("cat_description")


@pytest.mark.parametrize(
    ("module", "message"),
    [
        ("", "has neither an MJCF nor a URDF"),
        ("raise OSError('git clone:\\nno network')", "cannot provide .*: git clone: no network"),
        ("import no_such_module", "cannot provide .*: No module named 'no_such_module'"),
    ],
)
def test_a_published_robot_that_is_none_or_cannot_be_fetched(
    tmp_path, monkeypatch, module, message
):
    published(tmp_path, monkeypatch, module)
    with pytest.raises(RobotError, match=message):
        Robot.from_mjcf("dog_description")


@pytest.mark.parametrize("source", [3, None, ["a.xml"]])
def test_nothing_that_holds_a_robot(source: Any) -> None:
    with pytest.raises(InvalidValueError, match="Expected the path or text of an MJCF or URDF"):
        Robot.from_mjcf(source)
