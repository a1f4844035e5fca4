"""Files that MuJoCo could not read in bounded time and memory are refused before it sees them."""

import os
from pathlib import Path
from xml.parsers.expat import ExpatError

import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import Robot
from fbid_gym.robots.bounds import check_bounds

WORLD = "<mujoco><worldbody>{}</worldbody></mujoco>"
ASSET = "<mujoco><asset>{}</asset></mujoco>"
NESTED = '<replicate count="100">' * 4 + '<geom size="1"/>' + "</replicate>" * 4

# To MuJoCo what is in an attribute is no comment.
HIDDEN = '<site name="<!--"/><replicate count="1e9"/><site name="-->"/>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (WORLD.format('<replicate count="1e9"><geom size="1"/></replicate>'), "100000 elements"),
        (WORLD.format(NESTED), "100000 elements"),
        (WORLD.format('<composite type="cloth" count="999 999 999"/>'), "100000 elements"),
        (WORLD.format('<replicate name=">" count="1e12"/>'), "100000 elements"),
        (WORLD.format('<replicate name="<" count="1e12"/>'), "is not a valid MJCF"),
        (WORLD.format('<replicate count="&#49;000000000"/>'), "100000 elements"),
        (WORLD.format(HIDDEN), "is not a valid MJCF"),
        (WORLD.format("<body>" * 100_000), "nests more than 200 elements"),
        (WORLD.format('<body><joint range="nan 1"/></body>'), "<joint range='nan 1'>"),
        ('<mujoco><option timestep="1e999"/></mujoco>', "<option timestep='1e999'>"),
        ('<mujoco><size memory="900T"/></mujoco>', "more than 4 GB"),
        ('<mujoco><size nuser_geom="2000000000"/></mujoco>', "more than 100000 by"),
        (ASSET.format('<texture builtin="flat" width="99999" height="99999"/>'), "<texture> of"),
        (ASSET.format('<hfield nrow="99999" ncol="99999"/>'), "<hfield> of more"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "declares entities"),
        ('<!DOCTYPE a SYSTEM "><mujoco>"><mujoco/>', "declares entities"),
        ("<mujoco>\0</mujoco>", "is not a valid MJCF"),
        ('<mujoco model="\udc80"/>', "is not UTF-8 text"),
        ("<mujoco><!-- \ud800 --></mujoco>", "is not UTF-8 text"),
        ("<a " + '"' * 100_000, "is not a valid MJCF"),
    ],
)
def test_what_takes_for_ever_is_refused(text, message):
    with pytest.raises(RobotError, match=message):
        Robot.from_mjcf(text, ["foot"])


@pytest.mark.parametrize("unclosed", ["<!--", "<?", "<![CDATA["])
def test_what_is_never_closed_takes_no_longer(unclosed):
    """A search that began anew at each of them would take minutes."""
    with pytest.raises(ExpatError):
        check_bounds(unclosed * 300_000, "The robot's description")


def test_what_is_included_counts(tmp_path: Path):
    (tmp_path / "legs.xml").write_text(WORLD.format(NESTED))
    robot = tmp_path / "robot.xml"
    robot.write_text('<mujoco><include file="legs.xml"/><include file="robot.xml"/></mujoco>')
    with pytest.raises(RobotError, match="100000 elements"):
        Robot.from_mjcf(robot, ["foot"])
    (tmp_path / "legs.xml").unlink()
    os.mkfifo(tmp_path / "legs.xml")
    with pytest.raises(RobotError, match="no regular file"):
        Robot.from_mjcf(robot, ["foot"])


@pytest.mark.parametrize("folder", ["", "parts"])
@pytest.mark.parametrize(
    "asset", ['<mesh file="leg.stl"/>', '<texture type="2d" file="leg.stl" name="skin"/>']
)
def test_a_mesh_that_never_ends_is_refused(tmp_path: Path, folder: str, asset: str):
    """A pipe: whoever opens it waits for somebody to write."""
    (tmp_path / "parts").mkdir()
    os.mkfifo(tmp_path / folder / "leg.stl")
    robot = tmp_path / "robot.xml"
    robot.write_text(
        f'<mujoco><compiler meshdir="parts" texturedir="parts"/><asset>{asset}</asset></mujoco>'
    )
    with pytest.raises(RobotError, match=r"leg\.stl: cannot be read \(no regular file\)"):
        Robot.from_mjcf(robot, ["foot"])


def test_a_broken_encoding_is_one_error_but_a_comment_may_have_any(tmp_path: Path):
    robot = tmp_path / "robot.xml"
    robot.write_bytes(b"<mujoco><!-- caf\xe9 --- --></mujoco>")
    check_bounds(robot, "Robot file")
    robot.write_bytes(b'<mujoco model="caf\xe9"/>')
    with pytest.raises(RobotError, match="is not UTF-8 text"):
        Robot.from_mjcf(robot, ["foot"])
