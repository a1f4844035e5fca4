"""A URDF becomes a floating robot with motors, with or without its meshes."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import Robot
from tests.postures import posed

LEGS = {"front_left": (0.2, 0.1), "front_right": (0.2, -0.1), "hind_left": (-0.2, 0.1)}
LEGS["hind_right"] = (-0.2, -0.1)

BOX = '<box size="0.5 0.15 0.1"/>'
MESH = '<mesh filename="package://dog/meshes/trunk.stl"/>'


def urdf(trunk: str = BOX, extension: str = "") -> str:
    """A dog with drawn meshes that are nowhere, and feet on fixed joints."""
    legs = "".join(_leg(name, *place) for name, place in LEGS.items())
    return f"""
    <robot name="dog">
      {extension}
      <link name="base"/>
      <link name="trunk">
        {_inertial(5.0, 0.1)}
        <visual><geometry><mesh filename="package://dog/meshes/trunk.dae"/></geometry></visual>
        <collision><geometry>{trunk}</geometry></collision>
      </link>
      <joint name="base_to_trunk" type="fixed"><parent link="base"/><child link="trunk"/></joint>
      {legs}
    </robot>"""


def _inertial(mass: float, moment: float) -> str:
    return f"""<inertial><mass value="{mass}"/>
      <inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>"""


def _leg(name: str, x: float, y: float) -> str:
    def hinge(joint: str, parent: str, child: str, place: str, effort: float) -> str:
        return f"""<joint name="{joint}" type="revolute"><origin xyz="{place}"/><axis xyz="0 1 0"/>
          <parent link="{parent}"/><child link="{child}"/><dynamics damping="0.1"/>
          <limit effort="{effort}" velocity="9" lower="-2" upper="2"/></joint>"""

    return f"""
      <link name="{name}_upper">{_inertial(0.6, 0.003)}</link>
      {hinge(f"{name}_hip", "trunk", f"{name}_upper", f"{x} {y} 0", 20)}
      <link name="{name}_lower">{_inertial(0.3, 0.002)}
        <visual><geometry><mesh filename="meshes/leg.stl"/></geometry></visual></link>
      {hinge(f"{name}_knee", f"{name}_upper", f"{name}_lower", "0 0 -0.2", 30)}
      <link name="{name}_foot">{_inertial(0.05, 1e-4)}
        <collision><geometry><sphere radius="0.02"/></geometry></collision></link>
      <joint name="{name}_ankle" type="fixed"><origin xyz="0 0 -0.2"/>
        <parent link="{name}_lower"/><child link="{name}_foot"/></joint>"""


def test_a_urdf_floats_and_has_motors_as_strong_as_its_effort() -> None:
    robot = Robot.from_mjcf(urdf())
    assert robot.num_joints == 8 and robot.mass == pytest.approx(5.0 + 4 * 0.95)
    assert robot.model.body(robot.base_body).name == "base"
    assert robot.foot_names == tuple(f"{leg}_foot" for leg in LEGS)
    assert all(foot.num_points == 1 and foot.radius == 0.02 for foot in robot.feet)
    limit = dict(zip(robot.joint_names, robot.torque_limit, strict=True))
    assert {limit[f"{leg}_hip"] for leg in LEGS} == {20.0}
    assert {limit[f"{leg}_knee"] for leg in LEGS} == {30.0}
    assert "Body 'base' was made to float." in robot.notes


@pytest.mark.parametrize("kind", ["floating", "fixed"])
def test_a_link_called_world_is_the_world(kind: str) -> None:
    joint = f'<joint name="root" type="{kind}"><parent link="world"/><child link="base"/></joint>'
    text = urdf().replace('<link name="base"/>', f'<link name="world"/><link name="base"/>{joint}')
    robot = Robot.from_mjcf(text)
    assert robot.model.body(robot.base_body).name == "base" and robot.num_joints == 8
    assert ("Body 'base' was made to float." in robot.notes) == (kind == "fixed")


def test_feet_on_fixed_joints_can_be_named_and_carry_the_weight() -> None:
    robot = Robot.from_mjcf(urdf(), [f"{leg}_foot" for leg in LEGS], home="stand")
    data = posed(robot, robot.home_qpos - 1e-3 * np.eye(robot.nq)[2])
    total = data.sensordata[robot.contact_sensor].sum(axis=0)
    np.testing.assert_allclose(total, data.qfrc_constraint[:3], atol=1e-6)
    assert total[2] > 0.0 and robot.check() == []


def test_drawn_meshes_that_are_nowhere_are_dropped() -> None:
    drawn = '<mujoco><compiler discardvisual="false"/></mujoco>'
    robot = Robot.from_mjcf(urdf(extension=drawn))
    assert "2 meshes dropped, which were not found and only drawn." in robot.notes
    assert robot.mass == pytest.approx(Robot.from_mjcf(urdf()).mass)


def test_meshes_of_a_package_are_found_above_the_urdf(tmp_path: Path) -> None:
    folder = tmp_path / "dog" / "urdf"
    folder.mkdir(parents=True)
    path = folder / "dog.urdf"
    path.write_text(urdf(trunk=MESH))
    assert any("trunk collide with left out" in note for note in Robot.from_mjcf(path).notes)
    (tmp_path / "dog" / "meshes").mkdir()
    (tmp_path / "dog" / "meshes" / "trunk.stl").write_bytes(stl_box(np.array([0.25, 0.07, 0.05])))
    robot = Robot.from_mjcf(path)
    mesh = robot.model.geom_type[robot.model.body("trunk").geomadr[0]]
    assert mesh == mujoco.mjtGeom.mjGEOM_MESH


def stl_box(half: np.ndarray) -> bytes:
    """A box of twelve triangles, in binary STL."""
    faces = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3] * half, np.eye(3)[(axis + 2) % 3] * half
        for sign in (1.0, -1.0):
            corners = [a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            corners = [sign * np.eye(3)[axis] * half + c for c in corners[:: int(sign)]]
            faces += [corners[:3], [corners[0], corners[2], corners[3]]]
    triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
    data = np.zeros(len(faces), dtype=triangle)
    data["corners"] = np.array(faces)
    return b"\0" * 80 + np.uint32(len(faces)).tobytes() + data.tobytes()


def test_a_urdf_that_is_none() -> None:
    with pytest.raises(RobotError, match="description is not a valid URDF: "):
        Robot.from_mjcf("<robot><link/></robot>")
