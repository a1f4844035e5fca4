"""A standing pose found from the model: legs bent, the centre of mass above the feet."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import Foot
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import joint_range, moving_joints, refuse

_STRETCH = {False: 0.95, True: 0.8}
"""Length of a leg in the pose, of its length when straight: on two feet, and on more."""

# Weights of what matters: firmly, as wished, and where nothing else says.
_FIRM, _WISH, _FACING, _SHY = 100.0, 0.3, 0.1, 0.02
_TOLERANCE = 0.01  # of a leg's length
_STRAIGHT = 0.995
_DIGITS = 7


class Leg(NamedTuple):
    """A leg as a triangle."""

    hip: int  # id of its first joint
    knee: int  # id of the joint farthest from both its ends
    foot: Foot  # the foot


def standing_pose(model: mujoco.MjModel, start: np.ndarray, feet: Sequence[Foot]) -> np.ndarray:
    """Find a pose in which the robot stands: the joints change, the base keeps its orientation.

    All contact points are level, the centre of mass is above the middle of them, the hips are 95 %
    of a straight leg's length from their feet (80 % on more than two feet) and joints are within
    their ranges; least squares decides what is left: feet under their hips and soles facing as in
    `start`, joints near to it, knees towards the middle of their range.

    Args:
        model: compiled model.
        start: (nq,) the pose to begin with.
        feet: of the robot.

    Returns:
        qpos (nq,), the height of the base as at the start.

    Raises:
        RobotError: no such pose was found.
    """
    # Half a second that only those who ask for a pose should wait for.
    from scipy.optimize import least_squares

    legs = _legs(MeasuredModel(model, start), feet)
    low, high = joint_range(model).T
    refuse(
        *(model, mujoco.mjtObj.mjOBJ_JOINT, np.array(moving_joints(model))[low >= high]),
        "No standing pose found: joints {} have no range to move in.",
    )
    scene = _Scene(model, start, legs)
    knees = [int(model.jnt_dofadr[leg.knee]) - 6 for leg in legs]
    wanted = scene.bent(start[7:], low, high, knees)
    found = least_squares(
        lambda angles: np.concatenate([scene.residuals(angles), _SHY * (angles - wanted)]),
        wanted,
        bounds=(low, high),
        max_nfev=200,
    )
    uneven, off = scene.failings(found.x)
    if max(uneven, off) > _TOLERANCE:
        raise RobotError(
            f"No standing pose found: contact points differ by {uneven * scene.length:.3g} m in "
            f"height, and the centre of mass is {off * scene.length:.3g} m off their middle, at "
            "best. Give home= as a whole pose."
        )
    return np.concatenate([start[:7], np.clip(np.round(found.x, _DIGITS), low, high)])


class _View(NamedTuple):
    """What a pose looks like, world."""

    points: np.ndarray  # (P, 3) m, contacts
    com: np.ndarray  # (3,) m
    triangles: list[tuple[np.ndarray, np.ndarray, np.ndarray]]  # m, each leg's hip, knee and foot
    soles: list[np.ndarray]  # (3, 3) orientation of each foot


class _Scene:
    """Poses to choose from, in lengths of a straight leg."""

    def __init__(self, model: mujoco.MjModel, start: np.ndarray, legs: Sequence[Leg]) -> None:
        self._model, self._start, self._legs = model, start, legs
        self._before = self._look(start[7:])
        self._straight = np.array(
            [np.linalg.norm(k - h) + np.linalg.norm(f - k) for h, k, f in self._before.triangles]
        )
        self.length = float(self._straight.mean())
        self._stretch = _STRETCH[len(legs) > 2]

    def bent(
        self, angles: np.ndarray, low: np.ndarray, high: np.ndarray, knees: Sequence[int]
    ) -> np.ndarray:
        """Bend knees: a straight leg does not know which way.

        Towards the middle of their range; where that is straight, with the knee ahead.
        """
        angles = angles.copy()
        for knee in knees:
            if np.isfinite(low[knee]) and np.isfinite(high[knee]):
                angles[knee] += 0.4 * (0.5 * (low[knee] + high[knee]) - angles[knee])
        before = self._look(angles).triangles
        for leg, knee in enumerate(knees):
            hip, _, foot = before[leg]
            if np.linalg.norm(foot - hip) > _STRAIGHT * self._straight[leg]:
                turned = angles.copy()
                turned[knee] += 0.5
                ahead = self._look(turned).triangles[leg][2][0] - foot[0]
                angles[knee] += -0.5 if ahead > 0.0 else 0.5
        return np.clip(angles, low + 1e-9, high - 1e-9)

    def residuals(self, angles: np.ndarray) -> np.ndarray:
        """What shall vanish."""
        points, com, triangles, soles = self._look(angles)
        stretch = [np.linalg.norm(f - h) for h, _, f in triangles] / self._straight
        under = _beside_hips(triangles) - _beside_hips(self._before.triangles)
        turned = [
            _turned(before, sole)
            for leg, before, sole in zip(self._legs, self._before.soles, soles, strict=True)
            if leg.foot.num_points > 1
        ]
        parts = [
            _FIRM * (points[:, 2] - points[:, 2].mean()) / self.length,
            _FIRM * (com - points.mean(axis=0))[:2] / self.length,
            stretch - self._stretch,
            _WISH * under.ravel() / self.length,
            _FACING * np.array(turned),
        ]
        return np.concatenate(parts)

    def failings(self, angles: np.ndarray) -> tuple[float, float]:
        """How far the points are from level, and the centre of mass from above their middle."""
        points, com, _, _ = self._look(angles)
        off = float(np.linalg.norm((com - points.mean(axis=0))[:2]))
        return float(np.ptp(points[:, 2])) / self.length, off / self.length

    def _look(self, angles: np.ndarray) -> _View:
        pose = MeasuredModel(self._model, np.concatenate([self._start[:7], angles]))
        anchor = pose.data.xanchor.copy()
        touches = [leg.foot.touching(pose.data) for leg in self._legs]
        triangles = [
            (anchor[leg.hip], anchor[leg.knee], touch.mean(axis=0))
            for leg, touch in zip(self._legs, touches, strict=True)
        ]
        soles = [pose.rotation(leg.foot.body) for leg in self._legs]
        return _View(np.concatenate(touches), pose.com, triangles, soles)


def _beside_hips(triangles: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> np.ndarray:
    """(L, 2) m, how far each foot is from below its hip."""
    return np.array([foot[:2] - hip[:2] for hip, _, foot in triangles])


def _turned(before: np.ndarray, sole: np.ndarray) -> float:
    """How far a sole is turned about the vertical from where it was, as a sine."""
    change = sole @ before.T
    return 0.5 * float(change[1, 0] - change[0, 1])


def _legs(start: MeasuredModel, feet: Sequence[Foot]) -> list[Leg]:
    """Find the hip and knee above each foot.

    Raises:
        RobotError: no hinge moves a foot and no other.
    """
    data, chains = start.data, [start.hinges_above(foot.body) for foot in feet]
    legs = []
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
        legs.append(Leg(own[0], own[int(np.argmax(reach))], foot))
    return legs
