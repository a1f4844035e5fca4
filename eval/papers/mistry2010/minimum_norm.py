"""[M10] III-B.3: eq. (15) gives the least torque, and what limits on the forces add to it."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.inertial_parameters.estimation import free_motions
from eval.papers.mistry2010.force_feedback import Equation, inertia_weighted
from eval.papers.mistry2010.laws import planned_points, posed
from fbid_gym.control import (
    ContactLimits,
    LimitedInverseDynamics,
    limited_inverse_dynamics,
    orthogonal_inverse_dynamics,
)
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import MotionTable, periodic_squat, squat_bow, stepping
from fbid_gym.robots import load

FRICTION = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0)
ASSUMED = 0.7
SIZES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""m/s^2 of horizontal base acceleration, what a balance controller adds to the reference's."""

ADDED = 1.0
"""m/s^2 at which friction is varied."""

_BASE_FIRST = 1e3
_EDGES = 12


class MotionProblem(NamedTuple):
    """Accelerations that are asked for at T states of a motion of the biped."""

    asked: Equation  # equation of motion with these accelerations
    achieved: Equation  # the same with the nearest that the contacts allow
    force: np.ndarray  # (T, nv) generalized forces of these motions, M a + h
    least: np.ndarray  # (T, n) N·m of eq. (15)
    point_map: np.ndarray  # (T, k, 3 P) from forces of the contact points to rows of contacts
    active: np.ndarray  # (T, P) bool, points that are planned to be down


def problem_of(motion: MotionTable, every: int, size: float) -> MotionProblem:
    """Ask for the reference's accelerations and `size` m/s^2 of the base in random directions."""
    robot, rows = load("biped"), np.arange(0, motion.period, every)
    reference = motion.reference(rows, np.zeros(len(rows)))
    active = planned_points(robot, reference)
    angle = np.random.default_rng(1).uniform(-np.pi, np.pi, len(rows))
    command = reference.qacc.copy()
    command[:, :2] += size * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    asked, point_map = posed(robot, reference.qpos, reference.qvel, command, active)
    found = orthogonal_inverse_dynamics(*asked, base_priority=_BASE_FIRST)
    force = np.matvec(asked.mass_matrix, found.acceleration) + asked.bias
    achieved = asked._replace(acceleration=found.acceleration)
    return MotionProblem(asked, achieved, force, found.torque, point_map, active)


def limited(problem: MotionProblem, friction: float) -> LimitedInverseDynamics:
    """Torques with limited forces, and the share of the weight that these miss."""
    return limited_inverse_dynamics(
        *problem.asked,
        ContactLimits(friction),
        point_map=problem.point_map,
        active=problem.active,
        base_priority=_BASE_FIRST,
        length=Stance.of(load("biped")).radius,
        accuracy=DEFAULT_ACCURACY._replace(max_iterations=50),
    )


def compared(problem: MotionProblem, friction: float) -> dict[str, float]:
    """The limited form beside eq. (15): norm, wrench that is missed, forces that are at fault."""
    found = limited(problem, friction)
    sizes = (np.linalg.norm(torque, axis=1) for torque in (found.torque, problem.least))
    return {
        "ratio": float(np.divide(*sizes).mean()),
        "missed": float(found.residual.mean()),
        "impossible": float(_impossible(problem, friction).mean()),
    }


def _others(problem: MotionProblem, rng: np.random.Generator) -> list[np.ndarray]:
    """Torques with the same accelerations, away from the least in random directions."""
    rows, _ = free_motions(problem.achieved.jacobian)
    found = []
    for scale in (1e-3, 1e-1, 10.0):
        guess = rng.normal(size=problem.least.shape) * scale
        # Less the part that the constrained dynamics can feel.
        felt = _of_free_motions(rows, np.matvec(rows[:, :, 6:], guess))
        found.append(problem.least + guess - felt)
    return found


def _impossible(problem: MotionProblem, friction: float) -> np.ndarray:
    """Whether the forces that belong to eq. (15), by eq. (17), need a pull or a slip: (T,) bool.

    A sole's four points can share its wrench in many ways. It counts as possible if any of them
    keeps every point's force within its friction cone, here a pyramid of 12 edges.
    """
    left = problem.force - np.pad(problem.least, [(0, 0), (6, 0)])
    points = problem.achieved.jacobian.mT @ problem.point_map
    angle = np.arange(_EDGES) * 2 * np.pi / _EDGES
    edges = np.stack([friction * np.cos(angle), friction * np.sin(angle), np.ones(_EDGES)])
    spread = points.reshape(*points.shape[:2], -1, 3) @ edges
    spread = spread.reshape(*points.shape[:2], -1)
    missed = [nnls(s, f)[1] for s, f in zip(spread, left, strict=True)]
    return np.array(missed) > 1e-3 * load("biped").weight


def _of_free_motions(rows: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Least torques (T, n) whose part along the free motions, `rows` (T, k, nv), is `force`."""
    return np.matvec(np.linalg.pinv(rows[:, :, 6:], rcond=1e-9), force)


@experiment(
    "Claim: the least torque, and the price of limits",
    """Torques for the biped's references, at the reference states: eq. (15), others that give the
    same accelerations, and the form with contact forces limited to friction cones. Norms are over
    all joints, relative to eq. (15).""",
    minutes=0.3,
)
def claim_minimum_norm(setting: Setting) -> Measured:
    """Compare torques along the references of the biped's motions."""
    robot, every = load("biped"), setting.pick(10, 40)
    motions = {
        "slow squat and bow": squat_bow(robot),
        "the same, 5 times faster": squat_bow(robot, speed=5.0),
        "squat at 2 Hz": periodic_squat(robot, frequency=2.0),
        "stepping": stepping(robot),
    }
    rows: list[Numbers] = []
    for name in setting.each(motions):
        problems = {size: problem_of(motions[name], every, size) for size in SIZES}
        problem = problems[ADDED]
        least = np.linalg.norm(problem.least, axis=1)
        others = _others(problem, np.random.default_rng(0))
        free, _ = free_motions(problem.achieved.jacobian)
        literal = _of_free_motions(free, np.matvec(free, problem.force))
        projected = inertia_weighted(problem.achieved).torque
        rows.append(
            {
                "name": name,
                "below": float(min((np.linalg.norm(t, axis=1) - least).min() for t in others)),
                "literal": float(np.abs(literal - problem.least).max()),
                "projected": float(np.abs(projected - problem.least).max()),
                "by_size": [compared(problems[size], ASSUMED) for size in SIZES],
                "by_friction": [compared(problem, mu) for mu in FRICTION],
            }
        )
    found = limited(problem, ASSUMED)
    norms = (np.linalg.norm(torque, axis=1) for torque in (problem.least, found.torque))
    sweeps = {
        f"{what} {sweep}": [(r["name"], k, [c[what] for c in r[sweep]]) for k, r in enumerate(rows)]
        for sweep in ("by_size", "by_friction")
        for what in ("ratio", "missed", "impossible")
    }
    return {"rows": rows, "friction": list(FRICTION), "sizes": list(SIZES)}, {
        **{"ASSUMED": ASSUMED, "ADDED": ADDED, "sweeps": sweeps},
        "below": min(r["below"] for r in rows),
        "still": [r["by_size"][0] for r in rows],
        "moving": [r["by_size"][SIZES.index(ADDED)] for r in rows],
        "time": np.arange(0, motions[name].period, every) / motions[name].hz,
        "torques": list(zip(("eq. (15)", "limited"), (0, 2), norms, strict=True)),
        "residual": [("limited", 2, found.residual)],
    }
