"""What stands in many files that nobody meant: set right, with a note of each."""

from collections.abc import Mapping

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import listed

_LEAST_ITERATIONS = 10
_ITERATIONS = 100
_LINE_SEARCHES = 50


def free_the_base(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Take from the free joint what no floating body has: its momentum would not be its own.

    Defaults for joints reach the free joint as well, if it is written as a joint.

    Args:
        spec: the spec to change.
        model: the same, compiled.

    Returns:
        Notes of what was changed.
    """
    held = {
        "armature": model.dof_armature[:6],
        "damping": model.dof_damping[:6],
        "frictionloss": model.dof_frictionloss[:6],
        "stiffness": model.jnt_stiffness[:1],
    }
    found = {name: float(values.max()) for name, values in held.items() if np.any(values != 0.0)}
    if not found:
        return []
    free = next(j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE)
    for name in found:
        setattr(free, name, np.zeros_like(getattr(free, name)))
    losses = ", ".join(f"{name} {value:g}" for name, value in found.items())
    return [f"Removed from the free joint, where it would falsify the momentum: {losses}."]


def set_armature(spec: mujoco.MjSpec, armature: Mapping[str, float]) -> list[str]:
    """Set joints' armature, kg·m² (kg for slides)."""
    for joint in spec.joints:
        if joint.name in armature:
            joint.armature = armature[joint.name]
    return [f"Armature as given on {listed(armature)}."] if armature else []


def set_solver(spec: mujoco.MjSpec) -> list[str]:
    """Set the solver: dense Jacobian, implicit integrator, and iterations enough to converge."""
    option, notes = spec.option, []
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if option.iterations < _LEAST_ITERATIONS:
        notes.append(f"Solver iterations raised from {option.iterations} to {_ITERATIONS}.")
        option.iterations = _ITERATIONS
    if option.ls_iterations < _LEAST_ITERATIONS:
        notes.append(f"Line searches raised from {option.ls_iterations} to {_LINE_SEARCHES}.")
        option.ls_iterations = _LINE_SEARCHES
    return notes
