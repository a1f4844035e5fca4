"""The examples of docs/own_robot.md run as they stand, and are short."""

import re
from pathlib import Path

import pytest

from fbid_gym.robots import Robot, zoo
from tests.robots.test_source_urdf import urdf

DOC = (Path(__file__).parents[2] / "docs" / "own_robot.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", DOC, re.DOTALL)
TOML = re.findall(r"```toml\n(.*?)```", DOC, re.DOTALL)[0]


def animal(legs: int, actuators: str, feet: list[str]) -> str:
    drawn = next(a for a in map(zoo.draw, range(200)) if (a.legs, a.actuators) == (legs, actuators))
    text = zoo.mjcf(drawn)
    for number, foot in enumerate(feet):
        text = text.replace(f'"foot{number}"', f'"{foot}"')
    return text


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    dog = animal(4, "servo", ["FL_foot", "FR_foot", "RL_foot", "RR_foot"])
    (tmp_path / "dog.xml").write_text(dog)
    (tmp_path / "walker.xml").write_text(animal(2, "none", ["left_foot", "right_foot"]))
    (tmp_path / "dog.urdf").write_text(urdf())
    return tmp_path


def test_the_examples_run_and_are_short(folder: Path) -> None:
    scope: dict[str, object] = {}
    joints, notes = [], []
    for example in EXAMPLES:
        assert sum(bool(line.strip()) for line in example.splitlines()) <= 5
        exec(example, scope)
        robot = scope["robot"]
        assert isinstance(robot, Robot)
        joints.append(robot.num_feet)
        notes.append(robot.notes)
    assert joints == [4, 2, 4]
    starts = ["Torque motors in place of", "Armature as given", "Body 'base' was made to float"]
    assert all(found[0].startswith(start) for found, start in zip(notes, starts, strict=True))


def test_the_description_is_read(folder: Path) -> None:
    (folder / "robot.toml").write_text(TOML)
    assert Robot.load("dog.xml").torque_limit.max() == 36.0
