"""Contact points from shapes, against the contacts that MuJoCo finds between them and a plane."""

from typing import Any

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import Robot
from fbid_gym.robots.contact_sensors import cells
from tests.postures import posed

FOOT = """
<mujoco>
  <asset>
    <mesh name="sole" vertex="{vertices}"/>
  </asset>
  <worldbody>
    <body name="trunk" pos="0 0 0.5" euler="0 0 30">
      <freejoint/>
      <geom type="box" size="0.1 0.1 0.1" mass="2"/>
      <body name="foot" pos="0 0 -0.3">
        <joint name="slide" type="slide" axis="0 0 1" range="-0.1 0.1" armature="0.01"/>
        <site name="mark"/>
        {shape}
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="slide" ctrlrange="-60 60"/></actuator>
</mujoco>
"""

BOX = '<geom type="box" size="0.1 0.06 0.02" mass="1"/>'
SPHERE = '<geom size="0.03" pos="{} {} 0" mass="0.2"/>'
MANY = "".join(SPHERE.format(x, y) for x in (-0.1, 0.0, 0.1) for y in (-0.05, 0.0, 0.05))
UNEQUAL = SPHERE.format(0.1, 0) + '<geom size="0.02" pos="-0.1 0 -0.01" mass="0.2"/>'
WELDED = f'<geom size="0.03" mass="1"/><body name="shoe" pos="0 0 -0.1">{BOX}</body>'
SHAPES = {
    "box": (BOX, 4, 0.0),
    "sphere": ('<geom name="tip" size="0.03" mass="1"/>', 1, 0.03),
    "lying capsule": ('<geom type="capsule" size="0.03 0.1" euler="0 90 0" mass="1"/>', 2, 0.03),
    "standing capsule": ('<geom type="capsule" size="0.03 0.1" mass="1"/>', 1, 0.03),
    "lying cylinder": ('<geom type="cylinder" size="0.03 0.1" euler="0 90 0" mass="1"/>', 2, 0.0),
    "standing cylinder": ('<geom type="cylinder" size="0.05 0.02" mass="1"/>', 8, 0.0),
    "ellipsoid": ('<geom type="ellipsoid" size="0.05 0.03 0.02" euler="0 20 0" mass="1"/>', 1, 0.0),
    "mesh": ('<geom type="mesh" mesh="sole" mass="1"/>', 4, 0.0),
    "many spheres": (MANY, 4, 0.03),
    "unequal spheres": (UNEQUAL, 2, 0.0),
    "a box on a welded body": (WELDED, 4, 0.0),
}


def sole(rng: np.random.Generator) -> str:
    """A sole of hundreds of vertices, rounded upwards, flat below but for its edge."""
    points = rng.uniform([-0.1, -0.05, 0.0], [0.1, 0.05, 0.04], (300, 3))
    bottom = [[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.05, 0.05)]
    return " ".join(f"{value:.6f}" for value in np.concatenate([points, bottom]).ravel())


@pytest.fixture(params=SHAPES)
def shape(request: pytest.FixtureRequest) -> str:
    return request.param


def build(shape: str, rng: np.random.Generator, feet: Any = ("foot",), **options: Any) -> Robot:
    return Robot.from_mjcf(FOOT.format(vertices=sole(rng), shape=SHAPES[shape][0]), feet, **options)


def settled(robot: Robot, steps: int = 100) -> mujoco.MjData:
    data = posed(robot)
    for _ in range(steps):
        data.ctrl[0] = -2 * 9.81 - 4000 * data.qpos[7] - 100 * data.qvel[6]
        mujoco.mj_step(robot.model, data)
    mujoco.mj_forward(robot.model, data)
    return data


def test_a_shape_touches_where_mujoco_says(shape: str, rng: np.random.Generator) -> None:
    """Every contact lies in the hull of the points, every point is near a contact."""
    robot = build(shape, rng)
    _, count, radius = SHAPES[shape]
    foot = robot.feet[0]
    assert (foot.num_points, foot.radius) == (count, radius)
    data = posed(robot, robot.home_qpos - 1e-4 * np.eye(robot.nq)[2])
    points = data.xpos[foot.body] + foot.points @ data.xmat[foot.body].reshape(3, 3).T
    contacts = data.contact.pos
    assert contacts[:, 2] == pytest.approx(0.0, abs=1e-4)
    assert np.ptp(points[:, 2]) < 1e-8 and points[0, 2] - radius == pytest.approx(-1e-4, abs=1e-8)
    for axis in np.random.default_rng(0).normal(size=(30, 2)):
        axis /= np.linalg.norm(axis)
        reach, found = np.max(contacts[:, :2] @ axis), np.max(points[:, :2] @ axis)
        eighths = 0.05 * (1.0 - np.cos(np.pi / 8))  # of the cylinder's rim
        assert found >= reach - (eighths if shape == "standing cylinder" else 2e-3)
        if shape not in ("standing cylinder", "mesh"):  # MuJoCo gives four contacts at most
            assert found <= reach + 2e-3


def test_the_points_carry_the_whole_weight(shape: str, rng: np.random.Generator) -> None:
    robot = build(shape, rng)
    data = settled(robot)
    total = data.sensordata[robot.contact_sensor].sum(axis=0)
    np.testing.assert_allclose(total, data.qfrc_constraint[:3], atol=1e-9)
    assert total[2] > 0.9 * robot.weight


def test_feet_are_found_without_being_told(shape: str, rng: np.random.Generator) -> None:
    told, found = build(shape, rng), build(shape, rng, feet=None)
    np.testing.assert_allclose(found.home_qpos, told.home_qpos)
    assert found.num_points == told.num_points
    assert found.notes == (f"Feet found: {found.foot_names[0]}.",)


@pytest.mark.parametrize("name", ["tip", "mark"])
def test_a_site_in_the_middle_of_a_sphere_means_the_sphere(
    name: str, rng: np.random.Generator
) -> None:
    """Whether or not they share a name."""
    shape = SHAPES["sphere"][0] + '<site name="tip"/>'
    robot = Robot.from_mjcf(FOOT.format(vertices=sole(rng), shape=shape), [name])
    assert robot.feet[0].radius == 0.03 and robot.check() == []
    data = settled(robot)
    assert data.sensordata[robot.contact_sensor][0, 2] > 0.9 * robot.weight


def test_bodies_that_cannot_touch(rng: np.random.Generator) -> None:
    shape = BOX.replace("/>", ' contype="0" conaffinity="0"/>')
    text = FOOT.format(vertices=sole(rng), shape=shape)
    with pytest.raises(RobotError, match="Body 'foot' has no geometry that can touch the ground"):
        Robot.from_mjcf(text, ["foot"])
    text = text.replace('<geom type="box" size="0.1 0.1 0.1" mass="2"/>', "")
    text = text.replace(
        "<freejoint/>", '<freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    )
    with pytest.raises(RobotError, match="No feet found: no limb ends in a geom that can touch"):
        Robot.from_mjcf(text)


def within(places: np.ndarray, cell: Any) -> np.ndarray:
    return np.all(np.abs((places - cell.centre) @ cell.axes) <= cell.half_size, axis=-1)


@pytest.mark.parametrize("count", range(2, 9))
def test_cells_share_out_space(rng: np.random.Generator, count: int) -> None:
    """Each point lies in its own cell; any place lies in exactly one."""
    for flat in (True, False):
        points = rng.normal(size=(count, 3)) * ([1.0, 0.4, 0.0] if flat else [1.0, 0.4, 0.1])
        found = cells(points, 20.0)
        places = np.concatenate([points, rng.normal(size=(500, 3))])
        inside = np.array([within(places, cell) for cell in found])
        np.testing.assert_array_equal(inside[:, :count], np.eye(count, dtype=bool))
        np.testing.assert_array_equal(inside.sum(axis=0), 1)


def test_cells_of_a_sole_are_its_quarters() -> None:
    corners = np.array([[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.05, 0.05)])
    for corner, cell in zip(corners, cells(corners, 1.0), strict=True):
        for place in corner * np.array([[0.1, 0.1, 0.0], [3.0, 0.1, 0.0], [0.1, 3.0, 0.0]]):
            assert within(place, cell)
