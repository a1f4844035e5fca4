"""An MJCF's spec and model: compiled, their joints and the names of their parts."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from fbid_gym.errors import RobotError

_JOINT = mujoco.mjtJoint


def compile_spec(spec: mujoco.MjSpec, label: str) -> mujoco.MjModel:
    """Compile a spec, which messages call `label`; raises RobotError where MuJoCo cannot."""
    try:
        with warnings_heard():
            return spec.compile()
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise RobotError(f"{label} does not compile: {error}") from error


@contextmanager
def warnings_heard() -> Iterator[list[str]]:
    """Collect what MuJoCo warns of, which else it writes into a file where one happens to be."""
    heard, before = list[str](), mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: heard.append(text.strip().rstrip(".")))
    try:
        with warnings.catch_warnings(record=True) as others:  # of its bindings
            warnings.simplefilter("always")
            yield heard
            heard += [str(other.message) for other in others]
    finally:
        mujoco.set_mju_user_warning(before)


def object_name(model: mujoco.MjModel, kind: int, index: int) -> str:
    """Name of a model element, or its number where the file gives none."""
    return mujoco.mj_id2name(model, kind, index) or f"#{index}"


def object_names(model: mujoco.MjModel, kind: int, indices: Iterable[int]) -> list[str]:
    """Names of model elements, see `object_name`."""
    return [object_name(model, kind, int(index)) for index in indices]


def listed(names: Iterable[str]) -> str:
    """Names as they appear in messages."""
    return ", ".join(names) or "(none)"


def refuse(model: mujoco.MjModel, kind: int, found: Sequence[int] | np.ndarray, why: str) -> None:
    """Raise RobotError if elements were found, with their names in place of the {} in `why`."""
    if len(found):
        raise RobotError(why.format(listed(object_names(model, kind, found))))


def moving_joints(model: mujoco.MjModel) -> list[int]:
    """Ids of the hinges and slides, in dof order."""
    return [int(j) for j in np.flatnonzero(model.jnt_type != _JOINT.mjJNT_FREE)]


def name_joints(spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[str, ...]:
    """Give joints without a name one that no other has; returns those that move, in dof order."""
    joints = {joint.id: joint for joint in spec.joints}
    for j, joint in joints.items():
        joint.name = joint.name or unused(f"joint_{j}", joints.values())
    return tuple(joints[j].name for j in moving_joints(model))


def unused(name: str, parts: Iterable[Any]) -> str:
    """Return a name of ours, longer if one of these parts of a file has it already."""
    taken = {part.name for part in parts}
    while name in taken:
        name += "_"
    return name


def joint_range(model: mujoco.MjModel) -> np.ndarray:
    """(n, 2) rad (m for slides), lower and upper limits in dof order; +-inf where unlimited."""
    joints = moving_joints(model)
    limited = model.jnt_limited[joints].astype(bool)[:, None]
    return np.where(limited, model.jnt_range[joints], [-np.inf, np.inf])
