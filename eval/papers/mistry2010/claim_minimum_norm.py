"""[M10] III-B.3: eq. (15) gives the least torque, and what limits on the forces add to it."""

from typing import Any

import numpy as np
from scipy.optimize import nnls

from eval.papers.charts import lines, traces
from eval.papers.experiment import Experiment, Result, Setting, main
from eval.papers.mistry2010.controllers import contact_points
from eval.papers.mistry2010.laws import equation
from eval.papers.parts import Finding, figure, judged, text
from eval.wording import number, percent
from fbid_gym.control import (
    ContactLimits,
    inertia_weighted_inverse_dynamics,
    limited_inverse_dynamics,
    metric_inverse_dynamics,
    orthogonal_inverse_dynamics,
)
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.identification import free_motions
from fbid_gym.dynamics.support import Support
from fbid_gym.motions import MotionTable, periodic_squat, squat_bow, stepping
from fbid_gym.robots import Robot, load

FRICTION = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0)
ASSUMED = 0.7
SIZES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""m/s^2 of horizontal base acceleration, what a balance controller adds to the reference's."""
ADDED = 1.0
"""m/s^2 at which friction is varied."""
_BASE_FIRST = 1e3
_EDGES = 12


def run(setting: Setting) -> Result:
    """Compare torques along the references of the biped's motions."""
    robot = load("biped")
    every = setting.pick(10, 40)
    motions: dict[str, MotionTable] = {
        "slow squat and bow": squat_bow(robot),
        "the same, 5 times faster": squat_bow(robot, speed=5.0),
        "squat at 2 Hz": periodic_squat(robot, frequency=2.0),
        "stepping": stepping(robot),
    }
    rows: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for name, _ in setting.progress.each(motions):
        motion = motions[name]
        problems = {size: _Problem.along(robot, motion, every, size) for size in SIZES}
        least = {size: problem.least() for size, problem in problems.items()}
        by_size = [_compared(problems[size], least[size], ASSUMED) for size in SIZES]
        by_friction = [_compared(problems[ADDED], least[ADDED], mu) for mu in FRICTION]
        problem, tau = problems[ADDED], least[ADDED]
        size = np.linalg.norm(tau, axis=1)
        others = problem.others(np.random.default_rng(0), tau)
        torque, residual = problem.limited(ASSUMED)
        arrays[f"{name}.time"] = np.arange(0, motion.period, every) / motion.hz
        arrays[f"{name}.least"] = size
        arrays[f"{name}.limited"] = np.linalg.norm(torque, axis=1)
        arrays[f"{name}.residual"] = residual
        rows.append(
            {
                "name": name,
                "below": float(min((np.linalg.norm(t, axis=1) - size).min() for t in others)),
                "literal": float(np.abs(problem.literal() - tau).max()),
                "projected": float(np.abs(problem.projected() - tau).max()),
                "weighted": float((np.linalg.norm(problem.metric(), axis=1) / size).mean()),
                "by_size": by_size,
                "by_friction": by_friction,
            }
        )
    numbers = {"rows": rows, "friction": list(FRICTION), "sizes": list(SIZES)}
    return Result(findings(numbers), numbers, arrays)


def _compared(problem: "_Problem", least: np.ndarray, friction: float) -> dict[str, float]:
    """The limited form beside eq. (15): norm, wrench that is missed, forces that are at fault."""
    torque, residual = problem.limited(friction)
    return {
        "ratio": float((np.linalg.norm(torque, axis=1) / np.linalg.norm(least, axis=1)).mean()),
        "missed": float(residual.mean()),
        "impossible": float(problem.impossible(least, friction).mean()),
    }


class _Problem:
    """The dynamics at T states of a motion, and torques for its accelerations there."""

    def __init__(self, robot: Robot, arguments: tuple[np.ndarray, ...], rest: Any) -> None:
        self._arguments, self._robot = arguments, robot
        self._contacts, self._active, self._length = rest

    @classmethod
    def along(cls, robot: Robot, motion: MotionTable, every: int, size: float) -> "_Problem":
        """The reference's accelerations and `size` m/s^2 of the base in random directions."""
        rows = np.arange(0, motion.period, every)
        reference = motion.reference(rows, np.zeros(len(rows)))
        terms = MuJoCoDynamics(robot).terms(reference.qpos, reference.qvel)
        geometry = ContactGeometry.of(robot)
        active = contact_points(geometry, reference.planted)
        contacts = reduced_contacts(geometry, terms, active)
        angle = np.random.default_rng(1).uniform(-np.pi, np.pi, len(rows))
        command = reference.qacc.copy()
        command[:, :2] += size * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        rest = contacts, active, Support.of(robot).radius
        return cls(robot, equation(terms, contacts, command), rest)

    def least(self) -> np.ndarray:
        """Eq. (15)."""
        found = orthogonal_inverse_dynamics(*self._arguments, base_priority=_BASE_FIRST)
        self._achieved = found.acceleration
        return np.asarray(found.torque)

    def literal(self) -> np.ndarray:
        """Eq. (15) by its formula, with an orthonormal basis of the null space of J."""
        mass, bias, jacobian, _, _ = self._arguments
        rows, _ = free_motions(jacobian)
        return _of_free_motions(rows, np.matvec(rows, np.matvec(mass, self._achieved) + bias))

    def others(self, rng: np.random.Generator, least: np.ndarray) -> list[np.ndarray]:
        """Torques with the same accelerations, away from the least in random directions."""
        rows, _ = free_motions(self._arguments[2])
        found = []
        for scale in (1e-3, 1e-1, 10.0):
            guess = rng.normal(size=least.shape) * scale
            # Less the part that the constrained dynamics can feel.
            felt = _of_free_motions(rows, np.matvec(rows[:, :, 6:], guess))
            found.append(least + guess - felt)
        return found

    def projected(self) -> np.ndarray:
        """Eq. (7)'s least torque for the same accelerations."""
        mass, bias, jacobian, _, drift = self._arguments
        return np.asarray(
            inertia_weighted_inverse_dynamics(mass, bias, jacobian, self._achieved, drift).torque
        )

    def metric(self) -> np.ndarray:
        """The torque that is least in the metric of the kinetic energy."""
        mass, bias, jacobian, _, drift = self._arguments
        return np.asarray(
            metric_inverse_dynamics(mass, bias, jacobian, self._achieved, drift, mass).torque
        )

    def limited(self, friction: float) -> tuple[np.ndarray, np.ndarray]:
        """Torques with limited forces, and the share of the weight that these miss."""
        mass, bias, jacobian, command, drift = self._arguments
        found = limited_inverse_dynamics(
            mass,
            bias,
            jacobian,
            command,
            drift,
            ContactLimits(friction),
            point_map=self._contacts.point_map,
            active=self._active,
            base_priority=_BASE_FIRST,
            length=self._length,
            max_iterations=50,
        )
        return np.asarray(found.torque), np.asarray(found.residual)

    def impossible(self, torque: np.ndarray, friction: float) -> np.ndarray:
        """Whether the forces that belong to torques, by eq. (17), need a pull or a slip: (T,) bool.

        A sole's four points can share its wrench in many ways. It counts as possible if any of them
        keeps every point's force within its friction cone, here a pyramid of 12 edges.
        """
        mass, bias, jacobian, _, _ = self._arguments
        load = np.matvec(mass, self._achieved) + bias
        load[:, 6:] -= torque
        points = jacobian.swapaxes(1, 2) @ self._contacts.point_map
        angle = np.arange(_EDGES) * 2 * np.pi / _EDGES
        edges = np.stack([friction * np.cos(angle), friction * np.sin(angle), np.ones(_EDGES)])
        spread = np.einsum("tvpk,ke->tvpe", points.reshape(*points.shape[:2], -1, 3), edges)
        spread = spread.reshape(*points.shape[:2], -1)
        missed = [nnls(s, f)[1] for s, f in zip(spread, load, strict=True)]
        return np.array(missed) > 1e-3 * self._robot.weight


def _of_free_motions(rows: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Least torques (T, n) whose part along the free motions, `rows` (T, k, nv), is `force`."""
    return np.matvec(np.linalg.pinv(rows[:, :, 6:], rcond=1e-9), force)


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The property, and what moves away from it."""
    rows, at = numbers["rows"], numbers["sizes"].index(ADDED)
    below = min(row["below"] for row in rows)
    ratio = [row["by_size"][at]["ratio"] for row in rows]
    still = [row["by_size"][0]["ratio"] for row in rows]
    return [
        judged(
            "least norm: other torques with the same motion, how much smaller at best, N·m",
            "none is smaller",
            "none is smaller" if below >= -1e-9 else f"{-below:.1e}",
            "none is smaller",
            below >= -1e-9,
        ),
        Finding(
            "eq. (15) against its formula with a null-space basis, and against eq. (7)",
            "the same",
            f"differ by {max(r['literal'] for r in rows):.0e} N·m and by "
            f"{max(r['projected'] for r in rows):.0e} N·m",
        ),
        Finding(
            f"|τ| with forces limited to friction {ASSUMED:g}, of eq. (15)'s, along the references",
            "",
            f"{number(min(still))} to {number(max(still))}",
        ),
        Finding(
            f"the same with {ADDED:g} m/s² of the base asked for beside",
            "",
            f"{number(min(ratio))} to {number(max(ratio))}",
        ),
        Finding(
            "ticks at which eq. (15)'s forces would pull or slip, without and with that",
            "assumed not to matter",
            "; ".join(
                f"{row['name']} {percent(row['by_size'][0]['impossible'])} and "
                f"{percent(row['by_size'][at]['impossible'])}"
                for row in rows
            ),
        ),
    ]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers, arrays = result.numbers, result.arrays
    rows = numbers["rows"]
    name = rows[-1]["name"]

    def curves(sweep: str, what: str) -> list[tuple[str, int, list[float]]]:
        return [(row["name"], k, [cell[what] for cell in row[sweep]]) for k, row in enumerate(rows)]

    asked, sizes, friction = "base acceleration added, m/s²", numbers["sizes"], numbers["friction"]
    return [
        figure(
            [
                lines(
                    sizes,
                    curves("by_size", "impossible"),
                    "Ticks at which eq. (15) pulls or slips",
                    asked,
                    y_range=(0.0, 1.02),
                    y_format=percent,
                ),
                lines(sizes, curves("by_size", "missed"), "Wrench missed, of the weight", asked),
                lines(sizes, curves("by_size", "ratio"), "|τ| limited, of eq. (15)'s", asked),
                lines(
                    friction,
                    curves("by_friction", "ratio"),
                    f"The same at {ADDED:g} m/s²",
                    "friction",
                ),
                traces(
                    arrays[f"{name}.time"],
                    [
                        ("eq. (15)", 0, arrays[f"{name}.least"]),
                        ("limited", 2, arrays[f"{name}.limited"]),
                    ],
                    f"|τ|, {name} with {ADDED:g} m/s², N·m",
                ),
                traces(
                    arrays[f"{name}.time"],
                    [("limited", 2, arrays[f"{name}.residual"])],
                    "Wrench missed by the same, of the weight",
                ),
            ],
            "At the references' states, with horizontal accelerations of the base in random "
            "directions added, as a balance controller would after a push.",
        ),
        text(
            "Two things move the limited form away from the least torque. Where no limit is "
            "felt it takes the least contact forces, not the least torques; in a squat, the "
            "same on both sides, these are the same. Where a limit is felt, the forces deliver "
            "less than is asked for, the motion gives way, and the torque is smaller, too."
        ),
    ]


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.claim_minimum_norm",
    title="Claim: the least torque, and the price of limits",
    about=(
        "Torques for the biped's references, at the reference states: eq. (15), others that give "
        "the same accelerations, and the form with contact forces limited to friction cones. "
        "Norms are over all joints, relative to eq. (15)."
    ),
    run=run,
    show=show,
    minutes=0.3,
)

if __name__ == "__main__":
    main(EXPERIMENT)
