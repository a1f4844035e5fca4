"""Check a robot at home: a sentence for each finding, with the number.

What is found does not stop a robot from being simulated, but makes layers do worse than they could,
or numbers mean something else than they say.
"""

import copy
import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import Foot, is_point
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import listed, moving_joints, object_names
from fbid_gym.robots.polygon import margin_within
from fbid_gym.robots.scene import heights_below
from fbid_gym.robots.touching import TILTED, tilt_of

if TYPE_CHECKING:
    from fbid_gym.robots.robot import Robot

_OBJ = mujoco.mjtObj

CONTROL_HZ = 250  # control ticks per second that joints are checked for: as robots walk
ASSUMED_FRICTION = 0.6  # what layers assume of the feet, if they are not told
_SUNK, _UNEVEN = 0.01, 0.02  # of the height of the centre of mass
_CARRIES_NOTHING, _STILL, _ENOUGH = 0.001, 0.01, 0.9  # of the weight

# Held for a tick, a torque damps critically what it meets eight times in a period, or more often.
_TICKS_PER_PERIOD = 10
_STEP, _WINDOW, _PATIENCE = 1e-3, 200, 10  # s, steps, windows

_TOPPLED = 0.1  # rad, from home
_LOCKED = 1e4  # m²: this times the mass is an inertia that no contact moves


def findings(robot: "Robot") -> list[str]:
    """Say what speaks against a robot's home pose and model, a sentence each."""
    height = robot.at_home.com[2]  # the lowest contact point is at 0
    if height <= 0.0:
        return [f"The centre of mass is {-1e3 * height:.3g} mm below the feet at home."]
    checks = (
        *(_penetration, _ground, _uneven, _on_edges, _off_balance),
        *(_unloaded, _too_light, _springs, _slippery),
    )
    return [sentence for check in checks for sentence in check(robot)]


def check_upright(robot: "Robot") -> None:
    """Raise RobotError for a robot that cannot stand and walk, which the laws alone would take.

    That is one without joints, one that gravity does not pull down, or one not above its feet.
    """
    if not robot.num_joints:
        raise RobotError(f"Robot {robot.name!r} has no joints to act with.")
    gravity = robot.model.opt.gravity
    if np.any(gravity[:2] != 0.0) or not -np.inf < gravity[2] < 0.0:
        given = " ".join(f"{value:g}" for value in gravity)
        raise RobotError(f'gravity="{given}" does not pull down. Expected "0 0 -9.81" or the like.')
    above = robot.at_home.com[2] - robot.points_at_home[:, 2].mean()
    if above <= 0.0:
        raise RobotError(
            f"The centre of mass of {robot.name!r} is {-1e3 * above:.3g} mm below its feet at "
            "home. Expected a robot that stands on them: give home=."
        )


def _penetration(robot: "Robot") -> Iterator[str]:
    pose, sunk = robot.at_home, _SUNK * robot.at_home.com[2]
    geoms = np.flatnonzero(pose.touching & ~pose.ground).tolist()
    if not geoms:
        yield "Nothing on the robot can touch the ground: no geom collides."
        return
    deepest = min(geoms, key=lambda geom: pose.lowest([geom]))
    low = pose.lowest([deepest])
    if low <= -sunk:
        body = pose.body_name(pose.model.geom_bodyid[deepest])
        yield f"Body {body!r} is {-1e3 * low:.3g} mm in the ground at home."
    elif low > sunk:
        yield (
            f"The robot hovers: its lowest geometry is {1e3 * low:.3g} mm above the "
            "ground, its contact points are on it."
        )


def _ground(robot: "Robot") -> Iterator[str]:
    """A file's ground that is not where robots begin, on z = 0."""
    heights = heights_below(robot.at_home, robot.feet)
    bare = np.isnan(heights)
    if bare.any():
        names = itertools.compress(_point_names(robot), bare)
        yield f"There is nothing below the points {listed(names)} at home."
        return
    # Uneven feet are told of by themselves.
    gap = float((robot.points_at_home[:, 2] - heights).min())
    if abs(gap) > _UNEVEN * robot.at_home.com[2]:
        side = "below" if gap > 0.0 else "above"
        yield (
            f"The file's ground is {1e3 * abs(gap):.3g} mm {side} the feet at home, "
            "which begin at z = 0."
        )


def _uneven(robot: "Robot") -> Iterator[str]:
    spread = float(np.ptp(robot.points_at_home[:, 2]))
    if spread > _UNEVEN * robot.at_home.com[2]:
        yield f"The contact points differ by {1e3 * spread:.3g} mm in height at home."


def _on_edges(robot: "Robot") -> Iterator[str]:
    for foot in robot.feet:
        if foot.radius > 0.0 or is_point(robot.model, foot.point_names[0]):
            continue  # round, or as somebody wants it
        tilt = tilt_of(robot.at_home, foot.body)
        if tilt is not None and tilt > TILTED:
            yield (
                f"Foot {foot.name!r} stands on an edge at home: the flat side nearest to the "
                f"ground is tilted by {np.degrees(tilt):.0f} degrees."
            )


def _off_balance(robot: "Robot") -> Iterator[str]:
    outside = -margin_within(robot.points_at_home[:, :2], robot.at_home.com[:2])
    if outside > _SUNK * robot.at_home.com[2]:
        yield (
            f"The centre of mass is {1e3 * outside:.3g} mm outside of the contact points at home: "
            "the robot will fall over."
        )


def _unloaded(robot: "Robot") -> Iterator[str]:
    """Points that carry nothing of a robot that settles with its joints locked."""
    if not robot.weight:
        return
    loads = _settled(robot) / robot.weight
    share = float(loads.sum())
    if not np.isfinite(share):
        yield "The robot does not settle on its feet: the simulation diverges."
        return
    idle = list(itertools.compress(_point_names(robot), loads < _CARRIES_NOTHING))
    if idle:
        yield f"Points {listed(idle)} carry nothing at home."
    if share < _ENOUGH:
        yield f"The contact points carry {share:.0%} of the weight at home, others the rest."


def _settled(robot: "Robot") -> np.ndarray:
    """Forces upwards on the points, (P,) N, once they and the fall of the base change no more.

    Soft feet give way for long. Of a robot that topples it is what was before. Not finite where the
    simulation diverges.
    """
    model = copy.copy(robot.model)
    model.opt.timestep = _STEP  # environments have one of their own, too
    model.dof_armature[6:] += _LOCKED * robot.mass
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home_qpos
    forces, mean = np.zeros((_WINDOW, robot.num_points)), np.full(robot.num_points, np.inf)
    turned = np.empty(3)
    for _ in range(_PATIENCE):
        before, falling = mean, float(data.qvel[2])
        for step in range(_WINDOW):
            mujoco.mj_step(model, data)
            forces[step] = data.sensordata[robot.contact_sensor[:, 2]]
        mean = forces.mean(axis=0)
        mujoco.mju_subQuat(turned, data.qpos[3:7], robot.home_qpos[3:7])
        if np.linalg.norm(turned) > _TOPPLED:
            return before if np.isfinite(before).all() else mean
        lost = abs(data.qvel[2] - falling) / (_WINDOW * _STEP) * robot.mass
        if not max(lost, np.abs(mean - before).max()) > _STILL * robot.weight:
            break
    return mean


def _too_light(robot: "Robot") -> Iterator[str]:
    """Joints that cannot be held as stiffly as standing needs, at the rate of control.

    What stands on a joint falls over unless its stiffness makes up for the weight at its height.
    With that stiffness, the joint's own inertia in the air oscillates; torques that are held for
    a tick damp what they meet often enough in a period.
    """
    mass = np.empty((robot.nv, robot.nv))
    mujoco.mj_fullM(robot.model, robot.at_home.forward, mass)
    giving_way = 1.0 / np.diag(np.linalg.inv(mass))[6:]
    needed = robot.at_home.falling_stiffness([foot.body for foot in robot.feet]) / robot.num_feet
    least = needed / (2.0 * np.pi * CONTROL_HZ / _TICKS_PER_PERIOD) ** 2
    for i in np.flatnonzero(giving_way < least):
        yield (
            f"Joint {robot.joint_names[i]!r} moves {giving_way[i]:.2g} kg·m² in the air, too "
            f"little to be held at {CONTROL_HZ} Hz by what standing needs: give it "
            f"armature={least[i]:.2g} or more."
        )


def _springs(robot: "Robot") -> Iterator[str]:
    model = robot.model
    sprung = [j for j in moving_joints(model) if np.any(model.jnt_stiffness[j])]
    pulls = np.abs(robot.at_home.forward.qfrc_spring[model.jnt_dofadr[sprung]])
    if np.any(pulls > _CARRIES_NOTHING * robot.weight * robot.at_home.com[2]):
        names = object_names(model, _OBJ.mjOBJ_JOINT, sprung)
        yield (
            f"Springs on {len(names)} joints ({', '.join(names)}) pull with up to {pulls.max():.3g}"
            " N·m at home, which motors have to hold."
        )


def _slippery(robot: "Robot") -> Iterator[str]:
    friction = contact_of_feet(robot.at_home, robot.feet).friction
    if friction < ASSUMED_FRICTION:
        yield (
            f"The feet's friction is {friction:.3g}: layers assume less than the "
            f"{ASSUMED_FRICTION:g} that they would of other feet."
        )


def _point_names(robot: "Robot") -> list[str]:
    return [name for foot in robot.feet for name in foot.point_names]


class FeetContact(NamedTuple):
    """Properties of the contacts between feet and ground."""

    friction: float  # least coefficient of sliding; infinite without a contact, 0 with condim 1
    time: float  # s, longest time constant of those that a foot stands on; 0 without a contact


def contact_of_feet(pose: MeasuredModel, feet: Sequence[Foot]) -> FeetContact:
    """Measure the contacts between feet and ground, as MuJoCo makes them where they are near."""
    soles = [pose.welded_geoms(foot.body) for foot in feet]
    among = pose.ground.copy()
    among[np.concatenate(soles)] = True
    near = pose.with_contacts(pose.com[2], among).contact
    with_ground = pose.ground[near.geom].any(axis=1)
    met = [np.isin(near.geom, sole).any(axis=1) & with_ground for sole in soles]
    friction = np.where(near.dim > 1, near.friction[:, 0], 0.0)[with_ground]
    nearest = [np.where(own, near.dist, np.inf).argmin() for own in met if own.any()]
    times = [
        time if time > 0.0 else -2.0 / damping  # minus a stiffness and a damping
        for time, damping in near.solref[nearest]
    ]
    return FeetContact(float(friction.min(initial=np.inf)), float(max(times, default=0.0)))
