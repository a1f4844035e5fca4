"""Motions that excite the biped's inertial parameters, who carries them out, and what is measured.

Sums of sinusoids at every joint and at the base, on both feet, on the left foot and on the right
foot, with the centre of mass over the feet that stand. The base follows from the joints and the
planted feet.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eval.papers.inertial_parameters.estimation import Samples
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import Desire
from eval.papers.mistry2010.laws import Tick
from eval.papers.trial import RATES, Memory
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.dynamics.frames import quaternion_to_matrix, rotation_vector
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.curves import Curve
from fbid_gym.motions.kinematics import (
    States,
    base_on_feet,
    foot_radius,
    home_points,
    joints_on_feet,
)
from fbid_gym.motions.target import planned_target
from fbid_gym.quantities import Target
from fbid_gym.robots import Robot

STANCES = {"both feet": (True, True), "left foot": (True, False), "right foot": (False, True)}
"""Which feet stand, in the order of the robot's feet, left and right."""

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_SINES = 5
_JOINT_HZ, _BASE_HZ = 1.2, 0.8
_TORSO, _TWIST, _SWING = 0.3, 0.25, 0.35  # rad
_TURN = 0.12  # rad, of the base
_HEIGHT, _LOWER = 0.03, {True: 0.03, False: 0.06}  # m, of the base: amplitude, and below home
_SWAY = {True: (0.02, 0.05), False: (0.015, 0.01)}  # m, forward and sideways, on both feet or one
_LIFT = {"hip_pitch": -0.5, "knee": 0.6, "hip_roll": 0.15}  # rad; roll outwards
_COARSE = 25


@dataclass(frozen=True, eq=False)
class Exciting:
    """Motions of M stances, in turns: robot i does motion i modulo M; T ticks each, repeated.

    Unlike in other motions the base is that of a fixed world, in which the feet stand still.
    """

    states: States  # (M, T, ...) of each stance
    planted: np.ndarray  # (M, F) bool

    @property
    def period(self) -> int:
        """Ticks of a period."""
        return int(self.states.qpos.shape[1])

    def reference(self, tick: np.ndarray, speed: np.ndarray | None = None) -> Target:
        """Return what the robots shall do at their `tick` (N,); of feet and body not where."""
        stance, row = np.arange(len(tick)) % len(self.planted), tick % self.period
        planted = self.planted[stance]
        unknown = np.full((*planted.shape, 9), np.nan)
        place, rate, body = unknown[..., :3], unknown[..., :6], unknown[:, 0, :3]
        feet = place, unknown.reshape(*planted.shape, 3, 3), rate, rate
        states = (part[stance, row] for part in self.states)
        return planned_target(planted, *feet, body, body, body, *states)


def exciting(robot: Robot, seconds: int, seed: int) -> Exciting:
    """Plan a motion for every stance.

    Args:
        robot: the biped.
        seconds: length of a period.
        seed: of the frequencies and phases.
    """
    rng = np.random.default_rng(seed)
    planned = [_plan(robot, planted, seconds * RATES.control, rng) for planted in STANCES.values()]
    states = States(*(np.stack(parts) for parts in zip(*planned, strict=True)))
    return Exciting(states, np.array(list(STANCES.values())))


def _plan(robot: Robot, planted: tuple[bool, bool], ticks: int, rng: np.random.Generator) -> States:
    """Plan the motion of one stance: joints that keep its feet and its centre of mass in place."""
    standing, points = np.array(planted), home_points(robot)
    both = bool(standing.all())
    names = robot.joint_names
    legs = [names.index(f"{side}_{name}") for side in robot.foot_names for name in _LEG]

    def waves(*sizes: float, hertz: float) -> np.ndarray:
        return np.stack([_wave(rng, ticks, size, hertz) for size in sizes], axis=1)

    guess = np.tile(robot.home_qpos[7:], (ticks, 1))
    others = [joint for joint in range(len(names)) if joint not in legs]
    sizes = [_TORSO if "torso" in names[joint] else _TWIST for joint in others]
    guess[:, others] += waves(*sizes, hertz=_JOINT_HZ)
    swing = np.zeros_like(guess)
    if not both:
        air = robot.foot_names[int(standing.argmin())]
        outwards = 1.0 if air == "left" else -1.0
        for joint, name in enumerate(names):
            if name.startswith(air):
                size = _TWIST if "roll" in name else _SWING
                lift = _LIFT.get(name.removeprefix(f"{air}_"), 0.0)
                swing[:, joint] = lift * (outwards if "roll" in name else 1.0)
                swing[:, joint] += _wave(rng, ticks, size, _JOINT_HZ)

    base = np.zeros((ticks, 7))
    base[:, :3] = Stance.of(robot).home_base - [0.0, 0.0, _LOWER[both]]
    base[:, 2] += _wave(rng, ticks, _HEIGHT, _BASE_HZ)
    base[:, 3], base[:, 4:] = 1.0, waves(_TURN, _TURN, _TURN, hertz=_BASE_HZ) / 2
    base[:, 3:] /= np.linalg.norm(base[:, 3:], axis=1, keepdims=True)

    foot_of_point = contact_geometry(robot).foot_of_point
    over = points[standing[foot_of_point], :2].mean(axis=0)
    wanted = over + waves(*_SWAY[both], hertz=_BASE_HZ)
    dynamics = MuJoCoDynamics(robot)

    def posture(rows: slice) -> np.ndarray:
        qpos = np.concatenate([base[rows], guess[rows]], axis=1)
        return _on_home_feet(robot, qpos, legs) + np.pad(swing[rows], [(0, 0), (7, 0)])

    # The centre of mass depends on the base, and through the legs on itself: a few rounds, on a
    # coarse grid of which the motion between is the interpolation.
    rows = slice(0, ticks, _COARSE)
    for _ in range(5):
        qpos = posture(rows)
        com = dynamics.terms(qpos, np.zeros((len(qpos), robot.nv))).com
        base[:, :2] += _refined(wanted[rows] - com[:, :2], ticks)
    joints = _periodic(posture(slice(None))[:, 7:])
    return base_on_feet(robot, joints, points, np.tile(standing, (ticks, 1)))


def _on_home_feet(robot: Robot, qpos: np.ndarray, legs: list[int]) -> np.ndarray:
    """Postures (T, nq) whose leg joints put both feet where they are at home."""
    rest, no_spin = np.zeros((len(qpos), robot.nv)), np.zeros((len(qpos), robot.num_feet, 3))
    home = np.concatenate([Stance.of(robot).home_base, robot.home_qpos[3:]])
    feet = MuJoCoDynamics(robot).terms(home[None], rest[:1]).foot_position
    feet = feet + foot_radius(robot)[:, None] * [0.0, 0.0, 1.0]
    here = Curve(np.broadcast_to(feet, no_spin.shape), no_spin, no_spin)
    planted, states = np.ones(no_spin.shape[:2], bool), States(qpos, rest, rest)
    return joints_on_feet(robot, states, lambda *_: here, planted, legs, qpos[:, 7:]).qpos


def _wave(rng: np.random.Generator, ticks: int, size: float, hertz: float) -> np.ndarray:
    """A sum of sinusoids (ticks,) up to a frequency; each repeats a whole number of times."""
    seconds = ticks / RATES.control
    cycles = rng.choice(np.arange(1, int(hertz * seconds) + 1), _SINES, replace=False)
    phase = rng.uniform(0.0, 2.0 * np.pi, _SINES)
    angle = 2.0 * np.pi * np.arange(ticks)[:, None] / ticks * cycles + phase
    total = np.sin(angle).sum(axis=1)
    return size * total / np.abs(total).max()


def _periodic(values: np.ndarray) -> Curve:
    """Rates and accelerations of a smooth periodic motion (T, n), exact to rounding."""
    spectrum = np.fft.rfft(values, axis=0)
    rate = 2j * np.pi * np.fft.rfftfreq(len(values), 1.0 / RATES.control)[:, None]
    return Curve(
        values,
        np.fft.irfft(spectrum * rate, len(values), axis=0),
        np.fft.irfft(spectrum * rate**2, len(values), axis=0),
    )


def _refined(values: np.ndarray, ticks: int) -> np.ndarray:
    """A smooth periodic motion (c, m) on a grid of more ticks."""
    spectrum = np.fft.rfft(values, axis=0)
    return np.fft.irfft(spectrum, ticks, axis=0) * (ticks / len(values))


def carrying_out(robot: Robot, base_hertz: float, joint_hertz: float) -> Desire:
    """Desire the reference's acceleration plus feedback of base and joints, critically damped.

    Args:
        robot: the biped.
        base_hertz: Hz, natural frequency of the base's feedback.
        joint_hertz: Hz, the same for the joints.
    """
    omega = 2.0 * np.pi * np.repeat([base_hertz, joint_hertz], [6, robot.num_joints])

    def desire(tick: Tick, memory: Memory) -> np.ndarray:
        state, reference = tick.state, tick.reference
        # Where the motion's world lies.
        origin = memory.setdefault("origin", state.qpos[:, :3] - reference.qpos[:, :3])
        turned = tick.terms.world_from_base.mT @ quaternion_to_matrix(reference.qpos[:, 3:7])
        position = reference.qpos[:, :3] + origin - state.qpos[:, :3]
        joints = reference.qpos[:, 7:] - state.qpos[:, 7:]
        error = np.concatenate([position, rotation_vector(turned), joints], axis=1)
        return reference.qacc + omega**2 * error + 2.0 * omega * (reference.qvel - state.qvel)

    return desire


class Noise(NamedTuple):
    """White noise of the sensors at every control tick, standard deviations."""

    joint: float = 2e-4  # rad
    joint_rate: float = 1e-2  # rad/s
    tilt: float = 1e-3  # rad, orientation of the base
    spin: float = 5e-3  # rad/s, angular velocity of the base
    drift: float = 1e-2  # m/s, linear velocity of the base
    torque: float = 0.5  # N·m


NOISE = Noise()


def smoothed(
    values: np.ndarray, derivative: int = 0, half: int = 100, order: int = 5, every: int = 5
) -> np.ndarray:
    """Smooth signals by local polynomials (Savitzky, Golay 1964), or differentiate them by time.

    The torques pass the same filter as the velocities, so that nothing lags behind.

    Args:
        values: (T, m) at the rate of control.
        derivative: which, 0 for the signals themselves.
        half: ticks of the window on either side of an instant.
        order: of the polynomials.
        every: ticks from one sample to the next.

    Returns:
        (samples, m), those instants that have a whole window.
    """
    time = np.arange(-half, half + 1) / RATES.control
    weights = np.linalg.pinv(np.vander(time, order + 1, increasing=True))[derivative]
    windows = np.lib.stride_tricks.sliding_window_view(values, len(time), axis=0)
    return np.asarray(windows[::every] @ weights)


def measured(
    robot: Robot,
    log: Log,
    index: int,
    planted: np.ndarray,
    level: float,
    rng: np.random.Generator,
    smooth: Callable[..., np.ndarray] = smoothed,
) -> Samples:
    """Return samples from what the sensors of one robot say.

    Torques are the commanded ones less the joints' damping, accelerations come from velocities.

    Args:
        robot: the true robot, for its damping and contact points.
        log: of its motion, all ticks.
        index: which robot of the log.
        planted: (F,) bool, feet that may carry force.
        level: of the noise, 0 for none and 1 for `NOISE`.
        rng: of the noise.
        smooth: the filter.
    """
    qpos, qvel, torque = (
        np.array(log[name][:, index], float) for name in ("qpos", "qvel", "torque")
    )
    # Near the identity of the orientation; the filter and the terms normalise.
    for values, deviation in (
        (qpos[:, 7:], NOISE.joint),
        (qpos[:, 4:7], NOISE.tilt / 2),
        (qvel[:, :3], NOISE.drift),
        (qvel[:, 3:6], NOISE.spin),
        (qvel[:, 6:], NOISE.joint_rate),
        (torque, NOISE.torque),
    ):
        values += level * deviation * rng.normal(size=values.shape)
    torque -= robot.joint_damping * qvel[:, 6:]
    position, velocity = smooth(qpos), smooth(qvel)
    active = np.tile(planted[contact_geometry(robot).foot_of_point], (len(position), 1))
    return Samples(position, velocity, smooth(qvel, 1), smooth(torque), active)
