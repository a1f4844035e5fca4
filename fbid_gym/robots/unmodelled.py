"""What a file may ask of MuJoCo that no law knows of: refused, with the name of the part.

The laws' equation of motion has inertia, gravity, what velocities make of both, motors, springs,
dampers and dry friction of joints, and contacts of the feet; nothing else.
"""

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import listed, object_name, object_names

_OBJ = mujoco.mjtObj

# What makes of a tendon more than a length that sensors read.
_ACTING = (
    *("stiffness", "stiffnesspoly", "damping", "dampingpoly"),
    *("frictionloss", "armature", "limited"),
)
_DISABLED = {
    "actuation": mujoco.mjtDisableBit.mjDSBL_ACTUATION,
    "gravity": mujoco.mjtDisableBit.mjDSBL_GRAVITY,
}
_FLUID = ("density", "viscosity", "wind")


def refuse_unmodelled(model: mujoco.MjModel) -> None:
    """Refuse forces that the laws' equation of motion lacks, and contacts that terrain lacks.

    Tendons that only measure are none of these.

    Raises:
        RobotError: tendons that act, compensated gravity, motors or gravity switched off, a fluid,
            or a `<pair>` of the robot and the static world.
    """
    _refuse_tendons(model)
    _refuse_compensation(model)
    _refuse_switches(model)
    _refuse_fluid(model)
    _refuse_pairs(model)


def _refuse_tendons(model: mujoco.MjModel) -> None:
    acting = [
        tendon
        for tendon in range(model.ntendon)
        if any(np.any(getattr(model, f"tendon_{name}")[tendon]) for name in _ACTING)
    ]
    if acting:
        names = object_names(model, _OBJ.mjOBJ_TENDON, acting)
        raise RobotError(
            f"Tendons that act are not supported: {listed(names)}. Expected none with stiffness, "
            "damping, frictionloss, armature or a range; joints may have springs and dampers."
        )


def _refuse_compensation(model: mujoco.MjModel) -> None:
    bodies = np.flatnonzero(model.body_gravcomp)
    if bodies.size:
        names = object_names(model, _OBJ.mjOBJ_BODY, bodies)
        raise RobotError(
            f"Compensated gravity is not supported: gravcomp of the bodies {listed(names)}. "
            "Expected bodies that weigh what their mass says."
        )


def _refuse_switches(model: mujoco.MjModel) -> None:
    for name, bit in _DISABLED.items():
        if model.opt.disableflags & bit:
            raise RobotError(
                f'The file switches {name} off: <flag {name}="disable"/>. Expected it to be on.'
            )
    off = int(model.opt.disableactuator)
    if off:
        groups = [str(group) for group in range(off.bit_length()) if off >> group & 1]
        raise RobotError(
            f"The file switches actuators off: actuatorgroupdisable of the groups {listed(groups)}."
            " Expected motors that work."
        )


def _refuse_fluid(model: mujoco.MjModel) -> None:
    for name in _FLUID:
        value = getattr(model.opt, name)
        if np.any(value):
            raise RobotError(
                f"A fluid about the robot is not supported: {name} {value} of <option>. Expected 0."
            )


def _refuse_pairs(model: mujoco.MjModel) -> None:
    """Terrain is in no pair, and a pair has a friction of its own, which nothing randomises."""
    for pair in zip(model.pair_geom1, model.pair_geom2, strict=True):
        static = [model.body_weldid[model.geom_bodyid[geom]] == 0 for geom in pair]
        if static[0] != static[1]:
            ground, geom = (pair[static.index(kind)] for kind in (True, False))
            body = object_name(model, _OBJ.mjOBJ_BODY, int(model.geom_bodyid[geom]))
            names = object_names(model, _OBJ.mjOBJ_GEOM, (geom, ground))
            raise RobotError(
                f"Geom {names[0]!r} of body {body!r} touches the ground ({names[1]!r}) by a "
                "<pair>. Expected feet that touch by contype and conaffinity, as every terrain "
                "does, and no pair with the ground."
            )
