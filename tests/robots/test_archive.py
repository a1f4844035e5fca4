"""A robot is written into one file, and read back from it to the bit."""

import io
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import FbidError, InvalidValueError, RobotError
from fbid_gym.robots import Robot, load, zoo
from tests.robots.test_copies import same
from tests.robots.test_source_urdf import urdf

TETRAHEDRON = "v 0 0 .1\nv .1 0 -.1\nv -.1 .1 -.1\nv -.1 -.1 -.1\n" + (
    "f 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n"
)


def told(seed: int) -> Robot:
    """A robot of the zoo, with all that can be said of it."""
    animal = zoo.draw(seed)
    options: dict[str, Any] = {"torque_limit": 40.0, "armature": {"*": 0.01, "*knee": 0.02}}
    options |= {"home": "stand", "name": "mine"}
    return Robot.from_mjcf(zoo.mjcf(animal), animal.foot_names, **options)


def again(robot: Robot, folder: Path) -> Robot:
    robot.save(folder / "robot.zip")
    return Robot.load(folder / "robot.zip")


def close(one: Robot, other: Robot) -> None:
    """Equal but for the digits that MuJoCo leaves out when it writes."""
    for name in ("body_mass", "body_inertia", "body_pos", "geom_size", "dof_armature"):
        two = getattr(one.model, name), getattr(other.model, name)
        np.testing.assert_allclose(*two, rtol=1e-5, atol=1e-6, err_msg=name)
    # Found anew, from lengths and masses of six digits, each of which it depends on.
    np.testing.assert_allclose(one.home_qpos, other.home_qpos, atol=1e-5)
    np.testing.assert_allclose(one.torque_limit, other.torque_limit, rtol=1e-6)
    assert (one.name, one.foot_names) == (other.name, other.foot_names)


@pytest.mark.parametrize("seed", [2, 3, 22])
def test_what_is_read_back_is_what_was_written(seed: int, tmp_path: Path) -> None:
    robot = told(seed)
    portable = robot.portable()
    close(robot, portable)
    read = again(portable, tmp_path)
    assert same(portable, read) and same(portable, again(robot, tmp_path))
    assert robot.digest == portable.digest == read.digest


def test_a_urdf_comes_back_as_it_was_prepared(tmp_path: Path) -> None:
    robot = Robot.from_mjcf(urdf(), home="stand")
    close(robot, again(robot, tmp_path))


def test_files_that_a_robot_needs_are_in_it(tmp_path: Path) -> None:
    """Meshes and included files; then the original may go."""
    animal = zoo.draw(22)
    parts = '<asset><mesh name="hull" file="parts/hull.obj"/></asset><include file="sky.xml"/>'
    text = zoo.mjcf(animal).replace("<worldbody>", f"{parts}<worldbody>")
    text = text.replace("<freejoint", '<geom type="mesh" mesh="hull" density="1"/><freejoint', 1)
    assert text.count('mesh="hull"') == 1
    source = tmp_path / "from"
    (source / "parts").mkdir(parents=True)
    (source / "parts" / "hull.obj").write_text(TETRAHEDRON)
    (source / "sky.xml").write_text("<mujoco><option gravity='0 0 -3.7'/></mujoco>")
    (source / "dog.xml").write_text(text)
    robot = Robot.from_mjcf(source / "dog.xml", animal.foot_names)
    robot.save(tmp_path / "robot.zip")
    for file in (*source.glob("*.xml"), source / "parts" / "hull.obj"):
        file.unlink()
    read = Robot.load(tmp_path / "robot.zip")
    close(robot, read)
    assert read.gravity == pytest.approx(3.7) and read.model.nmesh == 1
    assert read.portable().digest == read.digest


def test_a_spec_put_together_from_several_folders(tmp_path: Path) -> None:
    """Each part's meshes lie beside its own file, placed as that says."""
    trunk = """<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/>
      <geom type="box" size="0.1 0.1 0.1"/><site name="socket" pos="0 0 -0.1"/></body></worldbody>
      </mujoco>"""
    leg = """<mujoco><compiler meshdir="parts"/><asset>
        <mesh name="hull" file="hull.obj" scale="1 2 1" refpos="0.1 0 0" refquat="1 1 0 0"/></asset>
      <worldbody><body name="shank"><joint name="hip" axis="0 1 0" range="-1 1"/>
        <geom type="mesh" mesh="hull" pos="0 0 -0.4"/><site name="tip" pos="0 0 -0.4"/></body>
      </worldbody></mujoco>"""
    for folder, text in (("a", trunk), ("b", leg)):
        (tmp_path / folder / "parts").mkdir(parents=True)
        (tmp_path / folder / "part.xml").write_text(text)
    (tmp_path / "b" / "parts" / "hull.obj").write_text(TETRAHEDRON)
    whole, part = (mujoco.MjSpec.from_file(str(tmp_path / f / "part.xml")) for f in ("a", "b"))
    whole.attach(part, prefix="leg_", site=whole.site("socket"))
    robot = Robot.from_mjcf(whole, ["leg_tip"], torque_limit=5.0)
    read = again(robot, tmp_path)
    close(robot, read)
    for name in ("geom_pos", "geom_quat", "mesh_vert", "body_ipos", "mesh_face"):
        two = getattr(robot.model, name), getattr(read.model, name)
        np.testing.assert_allclose(*two, atol=1e-6, err_msg=name)
    assert robot.digest == read.digest


def test_the_digest_tells_robots_apart() -> None:
    animal = zoo.draw(22)
    plain: dict[str, Any] = {"feet": animal.foot_names}
    others: list[dict[str, Any]] = [{"home": "stand"}, {"armature": 0.1}, {"torque_limit": 3.0}]
    others += [{"name": "b"}, {"feet": animal.foot_names[::-1]}]
    heavier = replace(animal, mass=1.01 * animal.mass)
    digests = [Robot.from_mjcf(zoo.mjcf(animal), **(plain | other)).digest for other in others]
    digests += [Robot.from_mjcf(zoo.mjcf(its), **plain).digest for its in (animal, heavier)]
    assert len(set(digests)) == len(digests)
    assert digests[-2] == Robot.from_mjcf(zoo.mjcf(animal), list(animal.foot_names)).digest


def test_what_cannot_be_written() -> None:
    with pytest.raises(RobotError, match="was changed after it was loaded"):
        replace(load("go1"), mass=3.0).save("x.zip")
    with pytest.raises(InvalidValueError, match="a name that ends in '.zip'"):
        load("go1").save("x.xml")


def packed(entries: dict[str, str], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, text in entries.items():
            archive.writestr(name, text)
    return file.getvalue()


XML = zoo.mjcf(zoo.draw(22))
LZMA = packed({"a.xml": XML}, zipfile.ZIP_LZMA).replace(b"\x5d\x00\x00", b"\xff\xff\xff", 1)


def told_with(arguments: str) -> bytes:
    return packed({"robot.json": arguments, "a.xml": XML})


BAD = {
    "no zip": (lambda: b"robot", "not a zip that can be read"),
    "no LZMA": (lambda: LZMA, "not a zip that can be read"),
    "no arguments": (lambda: packed({"a.xml": XML}), "holds no robot.json"),
    "no robot": (lambda: packed({"robot.json": "{}"}), "not a valid MJCF"),
    "no MJCF": (lambda: packed({"robot.json": "{}", "a.xml": "<x/>"}), "not a valid MJCF"),
    "deep": (lambda: told_with("[" * 10**5), "not JSON, truncated"),
    "a list": (lambda: told_with("[]"), "Expected a JSON object"),
    "a key": (lambda: told_with('{"code": 1}'), "code"),
    "its feet": (lambda: told_with('{"feet": [3]}'), "feet"),
    "bomb": (lambda: packed({"robot.json": "{}", "a.xml": " " * (2**28 + 1)}), "more than 256 MB"),
}


@pytest.mark.parametrize("name", BAD)
def test_files_that_are_no_robot_are_refused(name: str, tmp_path: Path) -> None:
    content, message = BAD[name]
    (tmp_path / "robot.zip").write_bytes(content())
    with pytest.raises(FbidError, match=message):
        Robot.load(tmp_path / "robot.zip")


def test_every_damaged_archive_is_refused_or_is_another_robot(tmp_path, rng):
    path = tmp_path / "robot.zip"
    told(22).save(path)
    whole, digest = path.read_bytes(), told(22).digest
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        cut = damaged if rng.random() < 0.7 else damaged[: rng.integers(len(whole))]
        path.write_bytes(bytes(cut))
        try:
            robot = Robot.load(path)
        except FbidError:
            continue
        assert robot.digest == digest  # a bit that means nothing, such as a date
