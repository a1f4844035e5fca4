"""A policy in another physics engine: trained in MuJoCo, it walks in Bullet."""

import argparse

import numpy as np

from eval.engines.bullet import BulletWorld
from fbid_gym.runtime import Controller


def main(policy: str, seconds: float) -> None:
    """Walk on a velocity command, be pushed, and say where that leads."""
    controller = Controller.load(policy)
    robot, rates = controller.robot, controller.rates
    world = BulletWorld(robot, hz=1000)
    world.place(robot.home_qpos, np.zeros(robot.nv))
    controller.set_command(0.4, 0.0, 0.2)
    for tick in range(round(seconds * rates.control)):
        torque = controller.tick(world.sensors())
        time = tick / rates.control
        push = np.array([0.0, 0.2 * robot.weight, 0.0]) * (0.5 < time < 0.65)
        for _ in range(world.hz // rates.control):
            world.step(torque, push)
    qpos, qvel = world.state()
    print(f"{np.hypot(*qpos[:2]):.2f} m away after {seconds:g} s, {qpos[2]:.3f} m high")
    world.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", default="shipped:QuadrupedWalk-v0/base_acceleration")
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    main(options.policy, options.seconds)
