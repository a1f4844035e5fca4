"""Standing up on soles, where the pose to begin from tilts them: feet known by their bodies.

A foot that is tilted touches level ground with less than its sole: with an edge, a corner, or a
sliver of what is round. What it shall stand on is then what touches where the file draws it, with
its joints within their ranges or not, or as it is, each tipped until the flat side that comes down
first is level.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import Foot, foot_of_body, named_by_body
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.stand import standing_pose
from fbid_gym.robots.touching import side_below

_DOWN = np.array([0.0, 0.0, -1.0])

TILTED = np.radians(5.0)
"""Soles that are tilted by more are not stood on."""

_NARROW = 0.05
"""Width per length below which points span no area."""

_LARGER = 1.2
"""Area, or length where there is none, by which what a foot may stand on is better."""


def stand_up(
    start: MeasuredModel, feet: tuple[Foot, ...], named: Mapping[str, Sequence[str]] | None
) -> tuple[tuple[Foot, ...], np.ndarray]:
    """Find a standing pose, see `standing_pose`: on soles, where feet known by bodies have some.

    Args:
        start: the pose to begin with.
        feet: as they touch in that pose.
        named: how the feet were named; None: not at all.

    Returns:
        The feet, and qpos (nq,).

    Raises:
        RobotError: no such pose was found.
    """
    soles = tuple(
        _sole(start, foot)
        if named is None or named_by_body(start.model, named[foot.name])
        else foot
        for foot in feet
    )
    if soles != feet:
        with suppress(RobotError):
            return soles, standing_pose(start, soles)
    return feet, standing_pose(start, feet)


def tilt_of(pose: MeasuredModel, body: int) -> float | None:
    """Return how far the flat side of a body that faces down the most is from level, rad.

    None where no side of some size is nearer to that than to upright.
    """
    side = _side_below(pose, body)
    return None if side is None else float(np.arccos(np.clip(-side[2], -1.0, 1.0)))


def _sole(start: MeasuredModel, foot: Foot) -> Foot:
    """What a foot shall stand on, which as it is given touches in the pose to begin with."""
    area, tilt = _extent(foot.points), tilt_of(start, foot.body)
    if area[0] > 0.0 and tilt is not None and tilt <= TILTED:
        return foot
    drawn = np.concatenate([start.qpos[:7], start.model.qpos0[7:]])
    others = [
        foot_of_body(_tipped(pose, foot.body), foot.name, foot.body)
        for pose in (MeasuredModel(start.model, drawn), start)
    ]
    for size in range(2):
        for other in others:
            if _extent(other.points)[size] > _LARGER * area[size]:
                return other
        if area[size] > 0.0:
            break
    return foot


def _extent(places: np.ndarray) -> tuple[float, float]:
    """Measures of the area that points (P, 3) span, 0 for a line, and of their length."""
    sizes = np.zeros(3)
    found = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    sizes[: len(found)] = found
    wide = sizes[1] > _NARROW * sizes[0]
    return float(wide * sizes[0] * sizes[1]), float(sizes[0])


def _tipped(pose: MeasuredModel, body: int) -> MeasuredModel:
    """The whole robot turned until the flat side of a body that comes down first is level."""
    turned, side = pose.qpos.copy(), _side_below(pose, body)
    if side is not None:
        turned[3:7] = _turned(pose.qpos[3:7], side, _DOWN)
    return MeasuredModel(pose.model, turned)


def _side_below(pose: MeasuredModel, body: int) -> np.ndarray | None:
    """The flat side of a body, with what is welded to it, that faces down the most."""
    return side_below(pose, body, pose.welded_geoms(body))


def _turned(quaternion: np.ndarray, this: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """An orientation, turned the shortest way that takes one unit vector (3,) onto another."""
    turn, result = np.append(1.0 + this @ onto, np.cross(this, onto)), np.empty(4)
    mujoco.mju_mulQuat(result, turn / np.linalg.norm(turn), quaternion)
    return result
