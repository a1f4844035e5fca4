"""Geoms become triangles of the same size in the same place."""

import mujoco
import numpy as np
import pytest

from fbid_gym.robots import ROBOTS, load

pytest.importorskip("trimesh", reason="the live page is not installed: make play")

from eval.play.shapes import shapes  # noqa: E402

KINDS = """
<mujoco>
  <asset>
    <mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
    <hfield name="h" nrow="3" ncol="3" size="1 2 0.5 0.1" elevation="0 0 0 0 1 0 0 0 0"/>
  </asset>
  <worldbody><body pos="0 0 1">{geom}</body></worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    ("geom", "extent"),
    [
        ('type="box" size="0.1 0.2 0.3"', (0.2, 0.4, 0.6)),
        ('type="sphere" size="0.2"', (0.4, 0.4, 0.4)),
        ('type="ellipsoid" size="0.1 0.2 0.3"', (0.2, 0.4, 0.6)),
        ('type="capsule" size="0.1 0.3"', (0.2, 0.2, 0.8)),
        ('type="cylinder" size="0.1 0.3"', (0.2, 0.2, 0.6)),
        ('type="cylinder" size="0.1 0.3" euler="90 0 0"', (0.2, 0.6, 0.2)),
        ('type="mesh" mesh="m"', (1.0, 1.0, 1.0)),
        ('type="hfield" hfield="h"', (2.0, 4.0, 0.5)),
    ],
)
def test_a_geom_keeps_its_extent_and_place(geom, extent):
    text = KINDS.format(geom=f'<geom {geom} pos="0.5 0 0" rgba="1 0 0 1"/>')
    if "hfield" in geom:
        text = text.replace("<body pos", "<body mocap='true' pos")
    model = mujoco.MjModel.from_xml_string(text)
    (shape,) = shapes(model)
    assert shape.colour == (255, 0, 0) and shape.body == 1 and shape.opacity == 1.0
    assert np.ptp(shape.vertices, axis=0) == pytest.approx(extent, rel=0.03)
    if "mesh" not in geom and "hfield" not in geom:
        middle = 0.5 * (shape.vertices.max(0) + shape.vertices.min(0))
        assert middle == pytest.approx([0.5, 0.0, 0.0], abs=0.01)


@pytest.mark.parametrize("robot", list(ROBOTS))
def test_every_robot_is_drawn_whole(robot):
    model = load(robot).model
    drawn = {shape.body for shape in shapes(model)}
    visible = (model.geom_group < 3) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    assert drawn == set(model.geom_bodyid[visible]) and len(drawn) > 3
