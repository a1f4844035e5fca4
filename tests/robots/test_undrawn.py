import numpy as np
import pytest

from fbid_gym.robots import ROBOTS, Robot, load
from fbid_gym.robots.undrawn import undrawn
from tests.postures import fallen

_INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
_HEAVY = """
<mujoco>
  <worldbody>
    <body name="base" pos="0 0 0.3">
      <freejoint/>
      <geom name="shell" type="sphere" size="0.1" contype="0" conaffinity="0" mass="{mass}"/>
      {inertial}
      <body name="leg" pos="0 0 -0.1">
        <joint name="hip" type="hinge" axis="0 1 0"/>
        <geom name="rod" type="capsule" size="0.01" fromto="0 0 0 0 0 -0.1" mass="0.1"/>
        <geom name="foot" type="sphere" size="0.02" pos="0 0 -0.18" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="hip" ctrllimited="true" ctrlrange="-5 5"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_moves_the_same_without_what_is_drawn(name):
    robot = load(name)
    lean = undrawn(robot)
    assert lean.model.ngeom <= robot.model.ngeom
    drawn = (lean.model.geom_contype == 0) & (lean.model.geom_conaffinity == 0)
    assert not drawn.any()
    pull = 0.1 * np.sign(np.arange(robot.model.nu) % 2 - 0.5)
    whole, part = (fallen(each.model, robot, pull, 100) for each in (robot, lean))
    assert np.abs(whole).max() > 1.0  # it does something
    np.testing.assert_allclose(part, whole, rtol=0, atol=1e-9)


def test_a_robot_whose_drawing_is_its_mass_keeps_it():
    robot = Robot.from_mjcf(_HEAVY.format(mass=1, inertial=""), feet=["foot"])
    assert undrawn(robot) is robot
    robot = Robot.from_mjcf(_HEAVY.format(mass=0, inertial=_INERTIAL), feet=["foot"])
    assert undrawn(robot).model.ngeom == robot.model.ngeom - 1
