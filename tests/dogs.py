"""A four-legged robot of any size, with or without joints that move its legs sideways."""

from collections.abc import Sequence

from fbid_gym.robots import Robot

CORNERS = {"front_left": (1, 1), "front_right": (1, -1)}
CORNERS |= {"hind_left": (-1, 1), "hind_right": (-1, -1)}
LEG = """
<body name="{name}_hip" pos="{x} {y} 0">
  <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
  {roll}
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
ROLL = '<joint name="{name}_roll" axis="1 0 0" range="-0.8 0.8"/>'


def dog(
    scale: float = 1.0, feet: Sequence[str] = tuple(CORNERS), *, rolls: bool = True, neck: int = 0
) -> Robot:
    """Legs of 2 × 0.2 m times a scale, with whose cube masses grow; so many joints carry a head."""
    numbers = {"half": 0.1 * scale, "link": 0.2 * scale, "radius": 0.02 * scale}
    numbers |= {"mass": 0.5 * scale**3, "inertia": 0.002 * scale**5}
    legs, motors = "", ""
    for name, (x, y) in CORNERS.items():
        roll = ROLL.format(name=name) if rolls else ""
        legs += LEG.format(name=name, x=0.2 * scale * x, y=0.13 * scale * y, roll=roll, **numbers)
        for joint in ("roll", "pitch", "knee")[0 if rolls else 1 :]:
            joint = f"{name}_{joint}"
            motors += f'<motor name="{joint}" joint="{joint}" ctrlrange="-30 30"/>'
    for k in range(neck):
        legs += f'<body pos="0.03 0 0"><joint name="neck{k}" axis="0 {k % 2} {1 - k % 2}"/>'
        legs += '<inertial pos="0 0 0" mass="0.05" diaginertia="0.001 0.001 0.001"/>'
        motors += f'<motor name="neck{k}" joint="neck{k}" ctrlrange="-30 30"/>'
    legs += neck * "</body>"
    inertia = f"{0.05 * scale**5} {0.1 * scale**5} {0.1 * scale**5}"
    text = (
        f'<mujoco model="dog"><compiler angle="radian"/><worldbody><body name="trunk">'
        f'<freejoint/><inertial pos="0 0 0" mass="{6.0 * scale**3}" diaginertia="{inertia}"/>'
        f"{legs}</body></worldbody><actuator>{motors}</actuator></mujoco>"
    )
    bent = ("pitch", 0.8), ("knee", -1.6)
    home = {f"{name}_{joint}": angle for name in CORNERS for joint, angle in bent}
    return Robot.from_mjcf(text, list(feet), home=home)
