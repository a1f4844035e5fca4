"""The home pose: what a user gives, checked, with the feet on the ground."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from fbid_gym.checks import check_choices, check_finite, check_shape, number, real_numbers
from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import Foot, contacts
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import joint_range

STAND = "stand"  # name of the home pose that `fbid_gym.robots.stand` finds
_KEYFRAME = "home"
_TOLERANCE = 1e-6  # rad: angles copied with rounding may sit on a limit
_VERTICAL = 0.25  # shorter than this seen from above, of 1, an axis points up or down


def home_pose(
    model: mujoco.MjModel,
    names: Sequence[str],
    home: Mapping[str, float] | Sequence[float] | np.ndarray | str | None,
) -> np.ndarray:
    """Return the home pose (nq,): above the origin, facing along x; its height is still as given.

    Where a robot is on level ground and which way it faces is decided where an episode begins. For
    `home` see `Robot.from_mjcf`; for STAND it is the pose from which to stand up. `names` are of
    the joints without the base, in the order of qpos. Raises FbidError for unknown names, no
    numbers, another shape, no orientation, or joints outside their range.
    """
    keyframes = {model.key(i).name: model.key(i).qpos.copy() for i in range(model.nkey)}
    if isinstance(home, str) and not stands_up(model, home):
        check_choices("keyframe", [home], [*filter(None, keyframes), STAND])
        qpos = keyframes[home]
    elif home is None or isinstance(home, str | Mapping):
        low, high = joint_range(model).T
        reference = np.concatenate([model.qpos0[:7], np.clip(model.qpos0[7:], low, high)])
        qpos = keyframes.get(_KEYFRAME, reference)
        for joint, value in (home if isinstance(home, Mapping) else {}).items():
            check_choices("joint in home", [joint], names)
            qpos[7 + list(names).index(joint)] = number(f"home of {joint}", value)
    else:
        expected = "a mapping joint -> angle, a qpos of numbers, or a keyframe's name"
        qpos = np.array(real_numbers("home", home, expected), float)
        check_shape("home", qpos, (model.nq,), "a whole qpos, (nq,)")
    check_finite("home", qpos)
    length = np.linalg.norm(qpos[3:7])
    if length < 1e-9:
        raise RobotError("The base quaternion home[3:7] is zero. Expected a unit quaternion.")
    qpos[3:7] /= length
    _check_ranges(model, names, qpos)
    return _at_the_origin(qpos)


def stands_up(model: mujoco.MjModel, home: object) -> bool:
    """Whether to search for a posture to stand in: a keyframe of that name goes first."""
    known = [model.key(i).name for i in range(model.nkey)]
    return isinstance(home, str) and home == STAND and STAND not in known


def unspecified(model: mujoco.MjModel, home: object) -> bool:
    """Whether neither the user nor a keyframe says what the home pose is."""
    return home is None and _KEYFRAME not in [model.key(i).name for i in range(model.nkey)]


def on_the_ground(model: mujoco.MjModel, qpos: np.ndarray, feet: Sequence[Foot]) -> np.ndarray:
    """Return a pose (nq,) with the lowest contact point at z = 0."""
    raised, data = qpos.copy(), MeasuredModel(model, qpos).data
    raised[2] -= contacts(feet, data)[:, 2].min()
    return raised


def _at_the_origin(qpos: np.ndarray) -> np.ndarray:
    """Return a pose (nq,) moved above the origin and turned about the vertical to face along x.

    A base whose x axis is within 15 degrees of the vertical keeps its orientation.
    """
    placed, rotation = qpos.copy(), np.empty(9)
    placed[:2] = 0.0
    mujoco.mju_quat2Mat(rotation, qpos[3:7])
    x, y = rotation[0], rotation[3]
    if np.hypot(x, y) > _VERTICAL:
        half = -0.5 * np.arctan2(y, x)
        turn = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
        mujoco.mju_mulQuat(placed[3:7], turn, qpos[3:7])
    return placed


def _check_ranges(model: mujoco.MjModel, names: Sequence[str], qpos: np.ndarray) -> None:
    outside = [
        f"{name} = {value:g} not in [{low:g}, {high:g}]"
        for name, value, (low, high) in zip(names, qpos[7:], joint_range(model), strict=True)
        if not low - _TOLERANCE <= value <= high + _TOLERANCE
    ]
    if outside:
        raise RobotError(f"Home joints outside their range: {'; '.join(outside)}.")
