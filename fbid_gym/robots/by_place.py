"""Feet in the order of their places, which is the same for every robot of so many feet."""

from dataclasses import replace

import numpy as np

from fbid_gym.robots import contact_sensors
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.mjcf import compile_spec
from fbid_gym.robots.robot import Robot

_AHEAD = 1e-6  # rad, by which a foot straight ahead may lie to the right and still come first


@once_for_robot
def by_place(robot: Robot) -> Robot:
    """Return the robot with its feet counter-clockwise as seen from above, from straight ahead.

    A quadruped's are then front left, hind left, hind right, front right, whatever the order in
    its file.
    """
    touches = [foot.touching(robot.at_home.data) for foot in robot.feet]
    place = np.array([touch[:, :2].mean(axis=0) for touch in touches])
    place -= place.mean(axis=0)
    angle = (np.arctan2(place[:, 1], place[:, 0]) + _AHEAD) % (2.0 * np.pi)
    order = np.argsort(angle)
    if (order == np.arange(robot.num_feet)).all():
        return robot
    feet, spec = tuple(robot.feet[foot] for foot in order), robot.spec.copy()
    # The forces on its points lie side by side, in their order.
    contact_sensors.remove_contact_sensors(spec)
    compile_spec(spec, robot.name)
    bodies = {body.id: body for body in spec.bodies}
    sensors = contact_sensors.add_contact_sensors(spec, robot.at_home, bodies, feet)
    model = compile_spec(spec, robot.name)
    changed = {"model": model, "contact_sensor": contact_sensors.sensor_columns(model, sensors)}
    return replace(robot, feet=feet, spec=spec, **changed).made_by(by_place, robot)
