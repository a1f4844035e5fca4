"""A standing pose found from the model: legs bent, the centre of mass above the feet."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import Foot
from fbid_gym.robots.mjcf import hinges_above, listed, moving_joints, object_names, posed

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

    joints = moving_joints(model)
    legs = _legs(model, start, feet)
    low, high = _bounds(model, joints)
    scene = _Scene(model, start, legs)
    wanted = scene.bent(start[7:], low, high, [joints.index(leg.knee) for leg in legs])
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


class _Scene:
    """What a pose looks like, in lengths of a straight leg."""

    def __init__(self, model: mujoco.MjModel, start: np.ndarray, legs: Sequence[Leg]) -> None:
        self._model, self._start, self._legs = model, start, legs
        self._data = mujoco.MjData(model)
        points, _, triangles = self._look(start[7:])
        self._straight = np.array(
            [np.linalg.norm(k - h) + np.linalg.norm(f - k) for h, k, f in triangles]
        )
        self.length = float(self._straight.mean())
        self._under = np.array([f[:2] - h[:2] for h, _, f in triangles])
        self._facing = [self._rotation(leg).copy() for leg in legs]
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
        _, _, before = self._look(angles)
        for leg, knee in enumerate(knees):
            hip, _, foot = before[leg]
            if np.linalg.norm(foot - hip) > _STRAIGHT * self._straight[leg]:
                turned = angles.copy()
                turned[knee] += 0.5
                ahead = self._look(turned)[2][leg][2][0] - foot[0]
                angles[knee] += -0.5 if ahead > 0.0 else 0.5
        return np.clip(angles, low + 1e-9, high - 1e-9)

    def residuals(self, angles: np.ndarray) -> np.ndarray:
        """What shall vanish."""
        points, com, triangles = self._look(angles)
        stretch = [np.linalg.norm(f - h) for h, _, f in triangles] / self._straight
        under = np.array([f[:2] - h[:2] for h, _, f in triangles]) - self._under
        parts = [
            _FIRM * (points[:, 2] - points[:, 2].mean()) / self.length,
            _FIRM * (com - points.mean(axis=0))[:2] / self.length,
            stretch - self._stretch,
            _WISH * under.ravel() / self.length,
            _FACING * np.array(self._turned()),
        ]
        return np.concatenate(parts)

    def _rotation(self, leg: Leg) -> np.ndarray:
        return self._data.xmat[leg.foot.body].reshape(3, 3)

    def _turned(self) -> list[float]:
        """How far each sole is turned about the vertical from where it was, as a sine."""
        turned = []
        for leg, before in zip(self._legs, self._facing, strict=True):
            if leg.foot.num_points > 1:
                change = self._rotation(leg) @ before.T
                turned.append(0.5 * float(change[1, 0] - change[0, 1]))
        return turned

    def failings(self, angles: np.ndarray) -> tuple[float, float]:
        """How far the points are from level, and the centre of mass from above their middle."""
        points, com, _ = self._look(angles)
        off = float(np.linalg.norm((com - points.mean(axis=0))[:2]))
        return float(np.ptp(points[:, 2])) / self.length, off / self.length

    def _look(
        self, angles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        """Contacts (P, 3), centre of mass (3,); hip, knee and foot of each leg; m, world."""
        data = self._data
        data.qpos[:] = self._start
        data.qpos[7:] = angles
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        points, triangles = [], []
        for leg in self._legs:
            touch = leg.foot.touching(data)
            points.append(touch)
            anchors = data.xanchor[leg.hip].copy(), data.xanchor[leg.knee].copy()
            triangles.append((*anchors, touch.mean(axis=0)))
        base = self._model.jnt_bodyid[0]
        return np.concatenate(points), data.subtree_com[base].copy(), triangles


def _legs(model: mujoco.MjModel, start: np.ndarray, feet: Sequence[Foot]) -> list[Leg]:
    """Find the hip and knee above each foot.

    Raises:
        RobotError: no hinge moves a foot and no other.
    """
    data = posed(model, start)
    chains = [hinges_above(model, foot.body) for foot in feet]
    legs = []
    for foot, chain in zip(feet, chains, strict=True):
        # Joints of a spine move other feet as well.
        own = [j for j in chain if sum(j in other for other in chains) == 1]
        if not own:
            raise RobotError(
                f"No standing pose found: no hinge moves foot {foot.name!r} and no other."
            )
        end = data.xpos[foot.body] + data.xmat[foot.body].reshape(3, 3) @ foot.points.mean(axis=0)
        away = data.xanchor[own]
        reach = np.minimum(
            np.linalg.norm(away - away[0], axis=1), np.linalg.norm(away - end, axis=1)
        )
        legs.append(Leg(own[0], own[int(np.argmax(reach))], foot))
    return legs


def _bounds(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    limited = model.jnt_limited[joints].astype(bool)
    low = np.where(limited, model.jnt_range[joints, 0], -np.inf)
    high = np.where(limited, model.jnt_range[joints, 1], np.inf)
    locked = np.array(joints)[low >= high]
    if locked.size:
        names = object_names(model, mujoco.mjtObj.mjOBJ_JOINT, locked)
        raise RobotError(
            f"No standing pose found: joints {listed(names)} have no range to move in."
        )
    return low, high
