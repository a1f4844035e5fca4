"""Tracking, which [G15] calls promising: a moving centre of mass, a turning hip, ever faster."""

from collections.abc import Callable

import numpy as np

from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.garofalo2015.balancer import COLOUR, INVERSE, Balancer, stance_angular_momentum
from eval.papers.garofalo2015.bout import Goal, GoalAt, balancing
from eval.papers.log import Log
from eval.papers.trial import Trial, simulate
from fbid_gym.control import BalanceTarget
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics, centroidal_terms
from fbid_gym.robots import Robot, load

HERTZ = (0.2, 0.4, 0.6, 0.8, 1.0, 1.25, 1.5)
SHIFT = np.array([0.01, 0.025, 0.015])
"""m, amplitudes of the centre of mass."""

TURN = np.array([0.08, 0.1, 0.15])
"""rad, amplitudes of roll, pitch and yaw of the hip."""

RAMP, SECONDS, EVERY = 2.0, 8.0, 5
"""s until the amplitude is reached, s in all, ticks per sample."""

_STEP = 1e-3  # s, of the differences that give the reference's rates
Pose = Callable[[float], tuple[np.ndarray, np.ndarray]]


def swaying(hertz: np.ndarray) -> Pose:
    """Return the motion: from a time (s) to offsets (N, 3) m and rotations (N, 3, 3)."""
    phase = np.array([0.0, 0.5, 1.0]) * np.pi

    def pose(time: float) -> tuple[np.ndarray, np.ndarray]:
        ramp = np.clip(time / RAMP, 0.0, 1.0)
        ramp = ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)
        angle = 2.0 * np.pi * hertz[:, None] * time
        shift = ramp * SHIFT * np.sin(angle + phase)
        roll, pitch, yaw = (ramp * TURN * np.sin(angle - phase)).T
        return shift, _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)

    return pose


def _turn(axis: int, angle: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) about a coordinate axis by `angle` (N,)."""
    result = np.zeros((len(angle), 3, 3))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    result[:, axis, axis] = 1.0
    result[:, one, one] = result[:, two, two] = np.cos(angle)
    result[:, two, one] = np.sin(angle)
    result[:, one, two] = -np.sin(angle)
    return result


def goals(robot: Robot, pose: Pose) -> GoalAt:
    """Return the goal that makes robots follow a motion, with its rates and feedforward.

    The angular momentum is the one that such a motion has in the home stance with planted feet.
    """
    momentum = stance_angular_momentum(robot)

    def rates(time: float) -> tuple[np.ndarray, np.ndarray]:
        (before, first), (after, last) = pose(time - _STEP), pose(time + _STEP)
        rate = (last - first) @ pose(time)[1].mT / (2.0 * _STEP)
        skew = 0.5 * (rate - rate.mT)
        spin = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        return (after - before) / (2.0 * _STEP), spin

    def goal(time: float, first: DynamicsTerms) -> Goal:
        shift, rotation = pose(time)
        velocity, spin = rates(time)
        later, sooner = rates(time + _STEP), rates(time - _STEP)
        linear, angular = ((a - b) / (2.0 * _STEP) for a, b in zip(later, sooner, strict=True))
        angular_rate = np.concatenate([linear, angular], axis=1) @ momentum.T
        target = BalanceTarget(
            com=first.com + shift,
            world_from_base=rotation @ first.world_from_base,
            com_velocity=velocity,
            angular_velocity=spin,
            angular_momentum=np.concatenate([velocity, spin], axis=1) @ momentum.T,
            momentum_rate=np.concatenate([robot.mass * linear, angular_rate], axis=1),
        )
        return Goal(target, robot.home_qpos[7:])

    return goal


def errors(log: Log, index: int) -> Numbers:
    """RMS errors of one robot once the motion has its full size.

    Returns:
        com (m); tilt and yaw (rad), of the hip about horizontal axes and the vertical; all None
        after a fall, and fell (s).
    """
    if not log.survived[index]:
        return {"com": None, "tilt": None, "yaw": None, "fell": log.fall(index)}
    late = log.time >= RAMP
    com, rotation = log["com"][late, index], log["rotation"][late, index]
    parts = {"com": com, "tilt": rotation[:, :2], "yaw": rotation[:, 2:]}
    return {key: _rms(x) for key, x in parts.items()} | {"fell": None}


def _rms(vectors: np.ndarray) -> float:
    """Root mean square length of (T, k)."""
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def left_out(robot: Robot, log: Log, index: int) -> dict[str, float]:
    """Compute what (36) leaves out of the angular momentum's rate, along a motion that was driven.

    (36) takes the rate to be the locked robot's inertia about the centre of mass times the base's
    angular acceleration; the rest, Mcheck_12 qddot and products of velocities, is neglected. (38)
    neglects nothing, since it has the momentum itself.

    Returns:
        rate, neglected: rms, N·m, and share of the two.
    """
    late, qvel = log.time >= RAMP, log["qvel"][:, index].astype(float)
    qpos = log["qpos"][:, index, : robot.nq].astype(float)
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    body = centroidal_terms(terms, qvel)
    omega = np.matvec(terms.world_from_base, qvel[:, 3:6])
    alpha = np.gradient(omega, log.time, axis=0)
    rate = np.gradient(body.momentum[:, 3:], log.time, axis=0)
    whole, rest = (_rms(x[late]) for x in (rate, rate - np.matvec(body.inertia, alpha)))
    return {"rate": whole, "neglected": rest, "share": rest / whole}


@experiment(
    "Left open: tracking a moving goal, and what (36) neglects",
    """Centre of mass and hip follow sinusoids in all six directions, with their velocities, momenta
    and rates ahead.""",
    minutes=0.6,
)
def tracking(setting: Setting) -> Measured:
    """Track at every frequency at once, under each balancer."""
    robot, hertz = load("humanoid"), setting.pick(HERTZ, (0.4, 1.0))
    plan = balancing(robot.home_qpos, goals(robot, swaying(np.array(hertz))))
    trial = Trial(robot, plan, setting.pick(SECONDS, 4.0), len(hertz), every=EVERY)
    rows: list[Numbers] = []
    for name in setting.each(COLOUR):
        log = simulate(trial, Balancer(robot, name, compensate_damping=True))
        rows += [{"name": name, "hertz": f} | errors(log, k) for k, f in enumerate(hertz)]
    # The last of them is inverse dynamics.
    neglected = [left_out(robot, log, k) for k in range(len(hertz))]
    fallen = {r["hertz"] for r in rows if r["fell"] is not None}
    fastest = max((f for f in hertz if f not in fallen), default=None)
    last = [] if fastest is None else [row(rows, name=name, hertz=fastest) for name in COLOUR]
    return {"hertz": list(hertz), "rows": rows, "neglected": neglected}, {
        **{"COLOUR": COLOUR, "INVERSE": INVERSE, "fastest": fastest, "last": last},
        "sizes": [
            ("of the momentum", 7, [r["rate"] for r in neglected]),
            ("left out by (36)", 1, [r["neglected"] for r in neglected]),
        ],
    }
