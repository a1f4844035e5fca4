"""Your own robot walks: a quadruped of a few lines of MJCF, on a zero action."""

import argparse

import gymnasium as gym
import numpy as np

import fbid_gym  # noqa: F401  registers the environments
from fbid_gym.robots import Robot

LEG = """
<body name="{name}_hip" pos="{x} {y} 0">
  <joint name="{name}_roll" axis="1 0 0" range="-45 45"/>
  <geom type="sphere" size="0.04" mass="0.5"/>
  <body name="{name}_thigh" pos="0 {out} 0">
    <joint name="{name}_pitch" axis="0 1 0" range="-120 120"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.6"/>
    <body name="{name}_shank" pos="0 0 -0.2">
      <joint name="{name}_knee" axis="0 1 0" range="-150 -10"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.012" mass="0.2"/>
      <geom name="{name}_foot" type="sphere" pos="0 0 -0.2" size="0.02" mass="0.05"/>
    </body>
  </body>
</body>"""
CORNERS = {"fl": (1, 1), "fr": (1, -1), "rl": (-1, 1), "rr": (-1, -1)}
LEGS = "".join(
    LEG.format(name=name, x=0.2 * ahead, y=0.07 * side, out=0.08 * side)
    for name, (ahead, side) in CORNERS.items()
)
MJCF = f"""
<mujoco>
  <worldbody>
    <body name="trunk" pos="0 0 0.4">
      <freejoint/>
      <geom type="box" size="0.22 0.08 0.05" mass="6"/>{LEGS}
    </body>
  </worldbody>
</mujoco>"""


def main(steps: int) -> None:
    """Walk for a number of policy steps, and say how far."""
    feet = [f"{name}_foot" for name in CORNERS]
    robot = Robot.from_mjcf(MJCF, feet, home="stand", torque_limit=30.0, armature=0.01)
    print(robot, *robot.check(), sep="\n")
    envs = gym.make_vec("fbid_gym/QuadrupedWalk-v0", num_envs=8, robot=robot)
    envs.reset(seed=0)
    for _ in range(steps):
        *_, info = envs.step(np.zeros(envs.action_space.shape))
    errors = info["velocity_error"].round(2)
    print(f"ways of {info['distance'].round(1)} m, speeds off by {errors} m/s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=500)
    main(parser.parse_args().steps)
