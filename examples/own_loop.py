"""A policy without an environment: sensors in, torques out, in a loop of your own on MuJoCo."""

import argparse
import copy

import mujoco
import numpy as np

from fbid_gym.runtime import Controller


def main(policy: str, seconds: float) -> None:
    """Walk on a velocity command, and say how far and how well it is followed."""
    controller = Controller.load(policy)
    robot, hz = controller.robot, controller.rates.control
    model, command = copy.copy(robot.model), np.array([0.4, 0.0, 0.2])
    model.opt.timestep = 0.001
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home_qpos
    mujoco.mj_forward(model, data)
    controller.set_command(*command)
    errors = []
    for _ in range(round(seconds * hz)):
        sensors = {
            "position": data.qpos[:3],
            "orientation": data.qpos[3:7],
            "velocity": data.qvel[:3],
            "angular_velocity": data.qvel[3:6],
            "joint_position": data.qpos[7:],
            "joint_velocity": data.qvel[6:],
            "contact_force": data.sensordata[robot.contact_sensor],
        }
        data.ctrl[robot.actuator] = controller.tick(sensors) / robot.gear
        mujoco.mj_step(model, data, round(1.0 / (hz * model.opt.timestep)))
        world_from_base = data.xmat[robot.base_body].reshape(3, 3)
        velocity = world_from_base.T @ data.qvel[:3]
        errors.append(np.hypot(*(velocity - command)[:2]))
    way = np.hypot(*data.qpos[:2])
    print(f"{way:.2f} m away after {seconds:g} s, {np.mean(errors):.3f} m/s off on average")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", default="shipped:QuadrupedWalk-v0/base_acceleration")
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    main(options.policy, options.seconds)
