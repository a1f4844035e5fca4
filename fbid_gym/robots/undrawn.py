"""A robot without what is only drawn of it: the same motion, for less."""

from dataclasses import replace

import numpy as np

from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.robot import Robot

_INERTIA = ("body_mass", "body_inertia", "body_ipos", "body_iquat")


@once_for_robot
def undrawn(robot: Robot) -> Robot:
    """Return a robot without the geoms that touch nothing, without lights and cameras.

    Placing them costs a tenth of a physics step. A robot that is told by them how heavy it is, or
    whose other parts name them, is returned as it is.
    """
    spec = robot.spec.copy()
    for geom in list(spec.geoms):
        if geom.contype == 0 and geom.conaffinity == 0:
            spec.delete(geom)
    for watching in (*spec.lights, *spec.cameras):
        spec.delete(watching)
    try:
        model = spec.compile()
    except ValueError:  # something names what is gone
        return robot
    same = all(
        np.allclose(getattr(model, name), getattr(robot.model, name), rtol=1e-12, atol=1e-12)
        for name in _INERTIA
    )
    return replace(robot, spec=spec, model=model).made_by(undrawn, robot) if same else robot
