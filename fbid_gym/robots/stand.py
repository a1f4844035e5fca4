"""A standing pose found from the model: legs bent, the centre of mass above the feet.

A foot that is tilted where this begins touches level ground with less than its sole: with an edge,
a corner, or a sliver of what is round. What a foot known by its body shall stand on is then what
touches where the file draws it, with its joints within their ranges or not, or as it is, each
tipped until the flat side that comes down first is level.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import Foot, contacts, foot_of_body, named_by_body
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import joint_range, moving_joints, refuse
from fbid_gym.robots.touching import TILTED, side_below, tilt_of

# Length of a leg in the pose, of its length when straight: on two feet, and on more, which walk
# like that: whoever stands higher sinks when a gait begins.
_STRETCH = {False: 0.95, True: 0.7}
# Weights of what matters: firmly, as wished, and where nothing else says.
_FIRM, _WISH, _FACING, _SHY = 100.0, 0.3, 0.1, 0.02
_TOLERANCE = 0.01  # of a leg's length
_STRAIGHT = 0.995
# Of a stance that a file draws: each leg is shorter than this share of its length when straight,
# and the centre of mass is no farther off the middle of the feet, in lengths of a leg.
_UPRIGHT, _OVER = 0.98, 0.1
_DIGITS = 7
_NARROW = 0.05  # width per length below which points span no area
_LARGER = 1.2  # area, or length where there is none, by which what a foot may stand on is better


def stand_up(
    start: MeasuredModel, feet: tuple[Foot, ...], named: Mapping[str, Sequence[str]] | None
) -> tuple[tuple[Foot, ...], np.ndarray]:
    """Return feet and a standing pose: on soles, where feet known by bodies have some.

    As `standing_pose` does. Feet are given as they touch in the pose to begin with; `named` says
    how they were named, None that they were not.
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


def stands(start: MeasuredModel, feet: Sequence[Foot]) -> bool:
    """Tell whether a pose may be a stance: no leg straight, the centre of mass above the feet."""
    try:
        scene = _Scene(start, feet)
    except RobotError:
        return True  # nor is there a way to find a better one
    return bool(scene.stretch.max() < _UPRIGHT and scene.failings(start.qpos[7:])[1] < _OVER)


def check_clear(pose: MeasuredModel, feet: Sequence[Foot]) -> None:
    """Refuse a pose in which something else is lower than the feet, naming the body."""
    weld, bodies = pose.model.body_weldid, pose.model.geom_bodyid
    of_feet = np.isin(weld[bodies], weld[[foot.body for foot in feet]])
    others = np.flatnonzero(pose.touching & ~pose.ground & ~of_feet).tolist()
    below = contacts(feet, pose.data)[:, 2].min() - pose.lowest(others)
    if below > _TOLERANCE * pose.com[2]:
        name = pose.body_name(bodies[min(others, key=lambda geom: pose.lowest([geom]))])
        raise RobotError(
            f"No standing pose found: body {name!r} would be {1e3 * below:.3g} mm in the ground."
        )


def standing_pose(start: MeasuredModel, feet: Sequence[Foot]) -> np.ndarray:
    """Return a pose (nq,) in which the robot stands: its legs bend, the base stays as it is.

    All contact points are level, the centre of mass is above the middle of them, the hips are 95 %
    of a straight leg's length from their feet (70 % on more than two feet) and joints are within
    their ranges; least squares decides what is left: feet under their hips and soles facing as in
    `start`, joints near to it, knees towards the middle of their range. Raises RobotError where
    no such pose is found.
    """
    # Half a second that only those who ask for a pose should wait for.
    from scipy.optimize import least_squares

    scene = _Scene(start, feet)
    model, (low, high) = start.model, joint_range(start.model).T
    refuse(
        *(model, mujoco.mjtObj.mjOBJ_JOINT, np.array(moving_joints(model))[low >= high]),
        "No standing pose found: joints {} have no range to move in.",
    )
    wanted = scene.bent(low, high)
    moving = np.array(sorted({j for foot in feet for j in start.hinges_above(foot.body)}))
    free = model.jnt_dofadr[moving] - 6  # arms stay

    def posed(angles: np.ndarray) -> np.ndarray:
        pose = wanted.copy()
        pose[free] = angles
        return pose

    found = least_squares(
        lambda x: np.concatenate([scene.residuals(posed(x)), _SHY * (x - wanted[free])]),
        wanted[free],
        bounds=(low[free], high[free]),
        jac="3-point",  # by one-sided differences it ends where rounding has it, 1e-4 rad apart
        max_nfev=200,
    )
    angles = posed(found.x)
    uneven, off = scene.failings(angles)
    if max(uneven, off) > _TOLERANCE:
        raise RobotError(
            f"No standing pose found: contact points differ by {uneven * scene.length:.3g} m in "
            f"height, and the centre of mass is {off * scene.length:.3g} m off their middle, at "
            "best. Give home= as a whole pose."
        )
    return np.concatenate([start.qpos[:7], np.clip(np.round(angles, _DIGITS), low, high)])


class _View(NamedTuple):
    """Geometry of a pose, world; F feet."""

    points: np.ndarray  # (P, 3) m, contacts
    off: np.ndarray  # (2,) m, of the centre of mass from above the middle of them
    legs: np.ndarray  # (F, 3, 3) m, hip, knee and foot of each
    soles: np.ndarray  # (S, 3, 3) orientation of the feet with more than a point

    @property
    def stretch(self) -> np.ndarray:
        """(F,) m, from hip to foot."""
        return np.asarray(np.linalg.norm(self.legs[:, 2] - self.legs[:, 0], axis=1))


class _Scene:
    """Poses to choose from."""

    def __init__(self, start: MeasuredModel, feet: Sequence[Foot]) -> None:
        self._start, self._feet = start, feet
        self._joints = _hips_and_knees(start, feet)
        self._before = self._look(start.qpos[7:])
        links = np.diff(self._before.legs, axis=1)
        self._straight = np.linalg.norm(links, axis=2).sum(axis=1)
        self.length = float(self._straight.mean())

    @property
    def stretch(self) -> np.ndarray:
        """(F,) lengths of the legs at the start, of theirs when straight."""
        return self._before.stretch / self._straight

    def bent(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Bend knees: a straight leg does not know which way.

        Towards the middle of their range; where that is straight, with the knee ahead.
        """
        angles = self._start.qpos[7:].copy()
        knees = self._start.model.jnt_dofadr[self._joints[:, 1]] - 6
        for knee in knees:
            if np.isfinite(low[knee]) and np.isfinite(high[knee]):
                angles[knee] += 0.4 * (0.5 * (low[knee] + high[knee]) - angles[knee])
        before = self._look(angles)
        for leg in np.flatnonzero(before.stretch > _STRAIGHT * self._straight):
            turned = angles.copy()
            turned[knees[leg]] += 0.5
            ahead = self._look(turned).legs[leg, 2, 0] - before.legs[leg, 2, 0]
            angles[knees[leg]] += -0.5 if ahead > 0.0 else 0.5
        return np.clip(angles, low + 1e-9, high - 1e-9)

    def residuals(self, angles: np.ndarray) -> np.ndarray:
        """Return the residuals of the pose, which shall vanish."""
        view, before = self._look(angles), self._before
        sideways = view.legs[:, 2] - view.legs[:, 0] - (before.legs[:, 2] - before.legs[:, 0])
        turned = view.soles @ before.soles.transpose(0, 2, 1)
        parts = [
            _FIRM * (view.points[:, 2] - view.points[:, 2].mean()) / self.length,
            _FIRM * view.off / self.length,
            view.stretch / self._straight - _STRETCH[len(self._feet) > 2],
            _WISH * sideways[:, :2].ravel() / self.length,
            _FACING * 0.5 * (turned[:, 1, 0] - turned[:, 0, 1]),  # sines, about the vertical
        ]
        return np.concatenate(parts)

    def failings(self, angles: np.ndarray) -> tuple[float, float]:
        """Measure how far points are from level, and the centre of mass from above their middle."""
        view = self._look(angles)
        uneven, off = float(np.ptp(view.points[:, 2])), float(np.linalg.norm(view.off))
        return uneven / self.length, off / self.length

    def _look(self, angles: np.ndarray) -> _View:
        pose = MeasuredModel(self._start.model, np.concatenate([self._start.qpos[:7], angles]))
        touches = [foot.touching(pose.data) for foot in self._feet]
        points, ends = np.concatenate(touches), [touch.mean(axis=0) for touch in touches]
        legs = np.concatenate([pose.data.xanchor[self._joints], np.array(ends)[:, None]], axis=1)
        soles = [pose.rotation(foot.body) for foot in self._feet if foot.num_points > 1]
        off = (pose.com - points.mean(axis=0))[:2]
        return _View(points, off, legs, np.array(soles).reshape(-1, 3, 3))


def _hips_and_knees(start: MeasuredModel, feet: Sequence[Foot]) -> np.ndarray:
    """(F, 2) ids: the first hinge that moves only this foot, and that farthest from its ends."""
    data, chains, found = start.data, [start.hinges_above(foot.body) for foot in feet], []
    for foot, chain in zip(feet, chains, strict=True):
        # Joints of a spine move other feet as well.
        own = [j for j in chain if sum(j in other for other in chains) == 1]
        if not own:
            raise RobotError(
                f"No standing pose found: no hinge moves foot {foot.name!r} and no other."
            )
        end = data.xpos[foot.body] + start.rotation(foot.body) @ foot.points.mean(axis=0)
        away = data.xanchor[own]
        reach = np.minimum(
            np.linalg.norm(away - away[0], axis=1), np.linalg.norm(away - end, axis=1)
        )
        found.append((own[0], own[int(np.argmax(reach))]))
    return np.array(found)


def _sole(start: MeasuredModel, foot: Foot) -> Foot:
    """Return the points that a foot shall stand on, from those that touch in the first pose."""
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
    turned, side, turn = pose.qpos.copy(), side_below(pose, body), np.empty(4)
    if side is not None:
        mujoco.mju_quatZ2Vec(turn, -side)
        mujoco.mju_mulQuat(turned[3:7], turn * [1.0, -1.0, -1.0, -1.0], pose.qpos[3:7])
    return MeasuredModel(pose.model, turned)
