"""A policy at work: task, gait, action layer and network from sensors to torques.

    from fbid_gym.runtime import Controller

    controller = Controller.load("shipped:QuadrupedWalk-v0/base_acceleration")
    controller.set_command(0.5, 0.0, 0.0)
    torques = controller.tick(sensors)      # at controller.rates.control

This is what the environments run, too, and all that it takes on a robot: without Gymnasium, without
physics.
"""

from fbid_gym.runtime.controller import Controller
from fbid_gym.runtime.readings import READINGS
from fbid_gym.runtime.sensors import SENSORS

__all__ = ["READINGS", "SENSORS", "Controller"]
