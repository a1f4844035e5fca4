"""A four-legged robot of any size."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fbid_gym.robots import Robot

CORNERS = {
    "front_left": (1, 1),
    "front_right": (1, -1),
    "hind_left": (-1, 1),
    "hind_right": (-1, -1),
}

LEG = """
<body name="{name}_hip" pos="{x} {y} 0">
  <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
  <joint name="{name}_roll" axis="1 0 0" range="-0.8 0.8"/>
  <body name="{name}_upper">
    <inertial pos="0 0 -{half}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
    <joint name="{name}_pitch" axis="0 1 0" range="-2 3"/>
    <body name="{name}_lower" pos="0 0 -{link}">
      <inertial pos="0 0 -{half}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <joint name="{name}_knee" axis="0 1 0" range="-2.5 -0.1"/>
      <geom name="{name}" size="{radius}" pos="0 0 -{link}" mass="0"/>
    </body>
  </body>
</body>
"""


@pytest.fixture(scope="session")
def dog(tmp_path_factory: pytest.TempPathFactory) -> Callable[[float], Robot]:
    """Return a robot, legs of 2 × 0.2 m times a scale; masses grow with its cube."""

    def build(scale: float = 1.0) -> Robot:
        numbers = {
            "mass": 0.5 * scale**3,
            "inertia": 0.002 * scale**5,
            "half": 0.1 * scale,
            "link": 0.2 * scale,
            "radius": 0.02 * scale,
        }
        legs = "".join(
            LEG.format(name=name, x=0.2 * scale * x, y=0.13 * scale * y, **numbers)
            for name, (x, y) in CORNERS.items()
        )
        motors = "".join(
            f'<motor name="{name}_{joint}" joint="{name}_{joint}" ctrlrange="-30 30"/>'
            for name in CORNERS
            for joint in ("roll", "pitch", "knee")
        )
        inertia = f"{0.05 * scale**5} {0.1 * scale**5} {0.1 * scale**5}"
        path: Path = tmp_path_factory.mktemp("dog") / "dog.xml"
        path.write_text(
            f'<mujoco model="dog"><compiler angle="radian"/><worldbody><body name="trunk">'
            f'<freejoint/><inertial pos="0 0 0" mass="{6.0 * scale**3}" diaginertia="{inertia}"/>'
            f"{legs}</body></worldbody><actuator>{motors}</actuator></mujoco>"
        )
        home = {f"{name}_pitch": 0.8 for name in CORNERS}
        home |= {f"{name}_knee": -1.6 for name in CORNERS}
        return Robot.from_mjcf(path, list(CORNERS), home=home)

    return build
