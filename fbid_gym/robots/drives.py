"""Torque of a robot's motors at a speed and over time, and their friction.

A motor gives torque up to its limit while it brakes, and while it drives until its voltage is used
up: from `full_speed` on the limit falls along a line, the torque-speed line, to nothing at
`no_load_speed`. "ideal" motors have no such line. Rotors' inertia is the file's armature, and no
matter of this page.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from fbid_gym.checks import by_name, check_choices
from fbid_gym.compiled import compiled
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number, check_fields, options_of
from fbid_gym.robots.by_joint import ByJoint, by_joint
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.robot import Robot

IDEAL, SHEET = "ideal", "data_sheet"


@dataclass(frozen=True)
class PerJoint:
    """A number, or such numbers by joint name or pattern; not 0."""

    one: Number

    @property
    def words(self) -> str:
        """See `fbid_gym.options.Kind`."""
        by_joint = 'a dictionary from joints or patterns such as "*_knee" to such numbers'
        return f"{self.one.words}, or {by_joint}"

    def check(self, name: str, value: Any) -> Any:
        """See `fbid_gym.options.Kind`."""
        if isinstance(value, Mapping):
            given = by_name(name, value).items()
            return {joint: self.one.check(f"{name} of {joint}", own) for joint, own in given}
        if not self.one.holds(value):
            raise InvalidValueError(name, value, self.words)
        return float(value)


Speed = Annotated[ByJoint, PerJoint(Number(1e-3, 1e6, "rad/s"))]
Torque = Annotated[ByJoint, PerJoint(Number(1e-6, 1e6, "N·m"))]


@dataclass(frozen=True)
class MotorTable:
    """A table `motors=`; for all joints, or by joint name or pattern. None: there is no such thing.

    Joints that a pattern leaves out are ideal in that respect. For slides read m and N.
    """

    base: str | None = None
    """"data_sheet": begin with the built-in robot's own; what else is given replaces it."""
    strength: Annotated[float, Number(1e-3, 1.0)] = 1.0
    """Share of the file's torque limits that the motors have. Every layer knows."""
    no_load_speed: Speed | None = None
    """rad/s at which a motor that drives has no torque left."""
    full_speed: Speed | None = None
    """rad/s up to which it has all of its limit. None: 0, a straight line."""
    viscous_friction: Annotated[ByJoint, PerJoint(Number(1e-9, 1e6, "N·m·s/rad"))] | None = None
    """N·m·s/rad, in place of the file's joint damping, which the laws go on to believe in."""
    dry_friction: Torque | None = None
    """N·m, in place of the file's."""
    lag: Annotated[ByJoint, PerJoint(Number(1e-6, 10.0, "s"))] | None = None
    """s, time constant with which the torque follows what is asked for."""
    continuous_torque: Torque | None = None
    """N·m that a motor bears for ever (I²t): a motor warms towards (torque / this)², and between
    0.9 and 1 of that its limit falls to this."""
    thermal_time: Annotated[float, Number(1e-3, 1e6, "s")] = 30.0
    """s, time constant of that warming."""
    battery_power: Annotated[float, Number(1e-3, 1e9, "W")] | None = None
    """W that the battery gives: if driving joints ask for more mechanical power together, each of
    them gets the same share of it."""

    def __post_init__(self) -> None:
        """Check the values that need no robot."""
        check_fields(self, "motors {}")
        if self.base not in (None, SHEET):
            raise InvalidValueError("motors base", self.base, f'"{SHEET}" or None')
        if self.full_speed is not None and self.no_load_speed is None and self.base is None:
            raise InvalidValueError("motors full_speed", self.full_speed, "a no_load_speed with it")


class TorqueLine(NamedTuple):
    """The torque-speed line of n motors."""

    torque: np.ndarray  # (n,) N·m, largest
    full_speed: np.ndarray  # (n,) rad/s up to which it is there
    fading: np.ndarray  # (n,) s/rad, share of it that is lost per rad/s beyond; 0 for ideal motors


class Drives(NamedTuple):
    """The motors of a robot, n joints."""

    line: TorqueLine  # what they can give at a speed
    lag: np.ndarray  # (n,) s; 0 for none
    continuous: np.ndarray  # (n,) N·m that they bear for ever; infinite where they do not warm
    thermal_time: float  # s
    battery: float  # W; may be infinite
    viscous: np.ndarray  # (n,) N·m·s/rad, of the joints
    dry: np.ndarray  # (n,) N·m, likewise


@compiled
def least_and_most(line: TorqueLine, j: int, speed: float, stretch: float) -> tuple[float, float]:
    """Return the torques between which the motor of joint j can give any at its speed: N·m, rad/s.

    The line's speeds are multiplied by `stretch`, as by a battery's voltage.
    """
    beyond = (abs(speed) / stretch - line.full_speed[j]) * line.fading[j]
    driving = line.torque[j] * min(1.0, max(0.0, 1.0 - beyond))
    return (-line.torque[j], driving) if speed > 0.0 else (-driving, line.torque[j])


def torque_line(robot: Robot) -> TorqueLine:
    """Return the torque-speed line of a robot's motors."""
    return drives_of(robot).line


def drives_of(robot: Robot) -> Drives:
    """Return the motors of a robot; ideal ones have torque limits, and nothing else."""
    if robot.drives is not None:
        return robot.drives
    none, forever = np.zeros(robot.num_joints), np.full(robot.num_joints, np.inf)
    line = TorqueLine(robot.torque_limit.copy(), *np.zeros((2, robot.num_joints)))
    return Drives(line, none, forever, 1.0, np.inf, none, none)


def with_motors(robot: Robot, motors: Any, sheet: Mapping[str, Any] | None = None) -> Robot:
    """Return a robot of ideal motors with those that are asked for; the same if these are ideal.

    The motors are "ideal", "data_sheet" (the robot's, a table `sheet`) or a table, see
    `MotorTable`. Raises FbidError for unknown names, invalid values, joints that the robot does not
    have, or a data sheet of a robot without one.
    """
    if motors == IDEAL:
        return robot
    return _equipped(robot, json.dumps(complete_table(robot, motors, sheet)))


def complete_table(robot: Robot, motors: Any, sheet: Mapping[str, Any] | None = None) -> Any:
    """Return what `motors` means for a robot today: one table without a base, as JSON holds it."""
    if motors == IDEAL:
        return motors
    table = motor_table(motors)
    if table.base is not None:
        if sheet is None:
            expected = f'"{IDEAL}" or a table: robot {robot.name!r} has no data sheet'
            raise InvalidValueError("motors", SHEET, expected)
        table = MotorTable(**{**sheet, **_given(replace(table, base=None))})
    return _given(table)


def motor_table(motors: Any) -> MotorTable:
    """Return the table that `motors` is or names, or raise an FbidError; that of IDEAL is empty."""
    if isinstance(motors, str):
        check_choices("motors", [motors], (IDEAL, SHEET, "a table"))
        return MotorTable(base=SHEET if motors == SHEET else None)
    if not isinstance(motors, Mapping):
        raise InvalidValueError("motors", motors, f'"{IDEAL}", "{SHEET}" or a table')
    given = by_name("motors", motors)
    check_choices("key in motors", given, options_of(MotorTable))
    return MotorTable(**given)


def _given(table: MotorTable) -> dict[str, Any]:
    """Return the entries of a table that differ from its defaults."""
    told = {field.name: (getattr(table, field.name), field.default) for field in fields(table)}
    return {name: value for name, (value, default) in told.items() if value != default}


@once_for_robot
def _equipped(robot: Robot, packed: str) -> Robot:
    table, joints = MotorTable(**json.loads(packed)), robot.joint_names

    def each(name: str, default: np.ndarray | float) -> np.ndarray:
        values = np.array(np.broadcast_to(default, len(joints)), float)
        for joint, value in by_joint(f"motors {name}", getattr(table, name), joints).items():
            values[joints.index(joint)] = value
        return values

    torque = table.strength * robot.torque_limit
    full, free = each("full_speed", 0.0), each("no_load_speed", np.inf)
    if not (full < free).all():
        j = int(np.argmin(full < free))
        expected = f"less than the no_load_speed, {free[j]:g} rad/s, at joint {joints[j]!r}"
        raise InvalidValueError("motors full_speed", float(full[j]), expected)
    drives = Drives(
        line=TorqueLine(torque.copy(), full, 1.0 / (free - full)),
        lag=each("lag", 0.0),
        continuous=each("continuous_torque", np.inf),
        thermal_time=table.thermal_time,
        battery=np.inf if table.battery_power is None else table.battery_power,
        viscous=each("viscous_friction", robot.joint_damping),
        dry=each("dry_friction", robot.model.dof_frictionloss[6:]),
    )
    equipped = replace(robot, torque_limit=torque, drives=drives)
    return equipped.made_by(_equipped, robot, packed)
