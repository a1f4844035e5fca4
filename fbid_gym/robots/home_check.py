"""One check of a robot at home, which speaks: each finding a sentence, with the number.

What is found does not stop a robot from being simulated, but makes layers do worse than they could,
or numbers mean something else than they say.
"""

import copy
import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.robots.feet import Foot, contacts, is_point
from fbid_gym.robots.ground import heights_below
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import listed, moving_joints, object_names
from fbid_gym.robots.polygon import margin_within
from fbid_gym.robots.soles import TILTED, tilt_of

_OBJ = mujoco.mjtObj

CONTROL_HZ = 500
"""Control ticks per second that joints are checked for: the environments' default."""

ASSUMED_FRICTION = 0.6
"""What layers assume of the feet, if they are not told."""

_SUNK = 0.01
_UNEVEN = 0.02
"""Shares of the height of the centre of mass."""

_CARRIES_NOTHING = 0.001
"""Share of the weight."""

_TICKS_PER_PERIOD = 20
_SETTLING = 0.2  # s
_PATIENCE = 5  # times
_ENOUGH = 0.9  # of the weight
_STEP = 1e-3  # s

_LOCKED = 1e4
"""m²: this times the mass is an inertia that no contact moves."""


class _Home(NamedTuple):
    """A robot at home."""

    pose: MeasuredModel
    data: mujoco.MjData  # forward dynamics of the pose
    feet: Sequence[Foot]
    contact_sensor: np.ndarray  # (P, 3) columns of `sensordata`, the forces on the points
    points: np.ndarray  # (P, 3) m, world, where the contact points touch
    height: float  # m, of the centre of mass above the lowest of them

    @property
    def point_names(self) -> list[str]:
        """P names."""
        return [name for foot in self.feet for name in foot.point_names]


def findings(pose: MeasuredModel, feet: Sequence[Foot], contact_sensor: np.ndarray) -> list[str]:
    """Say what speaks against a robot's home pose and model.

    Args:
        pose: the robot at home, on level ground.
        feet: of the robot.
        contact_sensor: (P, 3) columns of `sensordata`, the forces on the points.

    Returns:
        A sentence for each finding.
    """
    points = contacts(feet, pose.data)
    height = float(pose.com[2] - points[:, 2].min())
    if height <= 0.0:
        return [f"The centre of mass is {-1e3 * height:.3g} mm below the feet at home."]
    data = mujoco.MjData(pose.model)
    data.qpos[:] = pose.qpos
    mujoco.mj_forward(pose.model, data)
    home = _Home(pose, data, feet, contact_sensor, points, height)
    checks = (
        *(_penetration, _ground, _uneven, _on_edges, _off_balance),
        *(_unloaded, _too_light, _springs, _slippery),
    )
    return [sentence for check in checks for sentence in check(home)]


def _penetration(home: _Home) -> Iterator[str]:
    pose = home.pose
    geoms = np.flatnonzero(pose.touching & ~pose.ground).tolist()
    if not geoms:
        yield "Nothing on the robot can touch the ground: no geom collides."
        return
    deepest = min(geoms, key=lambda geom: pose.lowest([geom]))
    low = pose.lowest([deepest])
    if low <= -_SUNK * home.height:
        body = pose.body_name(pose.model.geom_bodyid[deepest])
        yield f"Body {body!r} is {-1e3 * low:.3g} mm in the ground at home."
    elif low > _SUNK * home.height:
        yield (
            f"The robot hovers: its lowest geometry is {1e3 * low:.3g} mm above the "
            "ground, its contact points are on it."
        )


def _ground(home: _Home) -> Iterator[str]:
    """A file's ground that is not where robots begin, on z = 0."""
    heights = heights_below(home.pose, home.feet)
    bare = np.isnan(heights)
    if bare.any():
        names = itertools.compress(home.point_names, bare)
        yield f"There is nothing below the points {listed(names)} at home."
        return
    gap = float((home.points[:, 2] - heights).min())  # uneven feet are told of by themselves
    if abs(gap) > max(_SUNK, _UNEVEN) * home.height:
        side = "below" if gap > 0.0 else "above"
        yield (
            f"The file's ground is {1e3 * abs(gap):.3g} mm {side} the feet at home, "
            "which begin at z = 0."
        )


def _uneven(home: _Home) -> Iterator[str]:
    spread = float(np.ptp(home.points[:, 2]))
    if spread > _UNEVEN * home.height:
        yield f"The contact points differ by {1e3 * spread:.3g} mm in height at home."


def _on_edges(home: _Home) -> Iterator[str]:
    for foot in home.feet:
        if foot.radius > 0.0 or is_point(home.pose.model, foot.point_names[0]):
            continue  # round, or as somebody wants it
        tilt = tilt_of(home.pose, foot.body)
        if tilt is not None and tilt > TILTED:
            yield (
                f"Foot {foot.name!r} stands on an edge at home: the flat side nearest to the "
                f"ground is tilted by {np.degrees(tilt):.0f} degrees."
            )


def _off_balance(home: _Home) -> Iterator[str]:
    outside = -margin_within(home.points[:, :2], home.pose.com[:2])
    if outside > _SUNK * home.height:
        yield (
            f"The centre of mass is {1e3 * outside:.3g} mm outside of the contact points at home: "
            "the robot will fall over."
        )


def _unloaded(home: _Home) -> Iterator[str]:
    """Points that carry nothing of a robot that settles with its joints locked."""
    pose = home.pose
    if not pose.weight:
        return
    model = copy.copy(pose.model)
    model.opt.timestep = _STEP  # environments have one of their own, too
    model.dof_armature[6:] += _LOCKED * model.body_subtreemass[pose.base]
    data = mujoco.MjData(model)
    data.qpos[:] = pose.qpos
    steps, share = round(_SETTLING / _STEP), 0.0
    forces = np.zeros((steps, len(home.contact_sensor)))
    for _ in range(_PATIENCE):  # soft feet give way for long
        for step in range(steps):
            mujoco.mj_step(model, data)
            forces[step] = data.sensordata[home.contact_sensor[:, 2]]
        force = forces[steps // 2 :].mean(axis=0)
        share = float(force.sum()) / pose.weight
        if not np.isfinite(share) or share >= _ENOUGH:
            break
    if not np.isfinite(share):
        yield "The robot does not settle on its feet: the simulation diverges."
        return
    idle = list(itertools.compress(home.point_names, force < _CARRIES_NOTHING * pose.weight))
    if idle:
        yield f"Points {', '.join(idle)} carry nothing at home."
    if share < _ENOUGH:
        yield f"The contact points carry {share:.0%} of the weight at home, others the rest."


def _too_light(home: _Home) -> Iterator[str]:
    """Joints that cannot be held as stiffly as standing needs, at the rate of control.

    What stands on a joint falls over unless its stiffness makes up for the weight at its height.
    With that stiffness, the joint's own inertia in the air oscillates; torques that are held for
    a tick damp what they meet often enough in a period.
    """
    model = home.pose.model
    mass = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, home.data, mass)
    giving_way = 1.0 / np.diag(np.linalg.inv(mass))[6:]
    needed = home.pose.falling_stiffness([foot.body for foot in home.feet]) / len(home.feet)
    least = needed / (2.0 * np.pi * CONTROL_HZ / _TICKS_PER_PERIOD) ** 2
    names = object_names(model, _OBJ.mjOBJ_JOINT, moving_joints(model))
    for i in np.flatnonzero(giving_way < least):
        yield (
            f"Joint {names[i]!r} moves {giving_way[i]:.2g} kg·m² in the air, too little to be held "
            f"at {CONTROL_HZ} Hz by what standing needs: give it armature={least[i]:.2g} or more."
        )


def _springs(home: _Home) -> Iterator[str]:
    model = home.pose.model
    sprung = [j for j in moving_joints(model) if np.any(model.jnt_stiffness[j])]
    pulls = np.abs(home.data.qfrc_spring[model.jnt_dofadr[sprung]])
    if np.any(pulls > _CARRIES_NOTHING * home.pose.weight * home.height):
        names = object_names(model, _OBJ.mjOBJ_JOINT, sprung)
        yield (
            f"Springs on {len(names)} joints ({', '.join(names)}) pull with up to {pulls.max():.3g}"
            " N·m at home, which motors have to hold."
        )


def _slippery(home: _Home) -> Iterator[str]:
    friction = friction_of_feet(home.pose, home.feet)
    if friction < ASSUMED_FRICTION:
        yield (
            f"The feet's friction is {friction:.3g}: layers assume less than the "
            f"{ASSUMED_FRICTION:g} that they would of other feet."
        )


def friction_of_feet(pose: MeasuredModel, feet: Sequence[Foot]) -> float:
    """Least coefficient of sliding friction between a foot and the ground.

    As MuJoCo mixes it: that of the geom with the higher priority, else the larger of both; none
    where these have condim 1.
    """
    model, found = pose.model, [np.inf]
    soles = np.concatenate([pose.welded_geoms(foot.body) for foot in feet])
    for pair in itertools.product(soles, np.flatnonzero(pose.ground)):
        priority = model.geom_priority[list(pair)]
        mixed = [pair[np.argmax(priority)]] if np.ptp(priority) else list(pair)
        rubs = model.geom_condim[mixed].max() > 1
        found.append(float(model.geom_friction[mixed, 0].max()) * rubs)
    return min(found)
