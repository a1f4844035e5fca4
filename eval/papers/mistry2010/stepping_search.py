"""[M10] figures 8 and 9: is it our choice of numbers that makes the paper's controller fall?"""

from collections.abc import Callable
from itertools import product

import numpy as np

from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import following
from eval.papers.mistry2010.laws import orthogonal
from eval.papers.mistry2010.stepping import FORCE, MOTIONS, PUSH_SECONDS, papers
from eval.papers.trial import Trial, pushed, simulate
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import Steps, stepping
from fbid_gym.robots import Robot, load

GAINS = tuple(product((2.0, 4.0, 8.0), (0.5, 1.0), (0.5, 1.0, 2.0)))
"""Hz and damping ratio of the joints, Hz of the base's return."""

STANCES = MOTIONS | {"half crouched, feet apart": Steps(knee=1.1, spread=0.05)}
SOFTNESS = (0.25, 1.0, 2.5)
"""Time constant of the ground's contacts, of the usual 20 ms."""

SEARCHED = (50.0, 100.0, 150.0, 200.0)
FORCES = (0.0, 25.0, 50.0, 75.0, 100.0, 125.0, 150.0, 200.0)
"""N, of the one push of each robot: in the search, and afterwards."""

KEPT = 0.95
OURS = (2.0, 0.5, 1.0)
_AT = 1.0  # s, of the push
_EVERY = 25


def soft(factor: float) -> Callable[[Simulation], None]:
    """Give contacts another time constant, and the same damping ratio."""

    def prepare(simulation: Simulation) -> None:
        simulation.batch.expand("geom_solref")[:, :, 0] *= factor

    return prepare


def pushed_once(
    robot: Robot, case: tuple[str, float], gains: np.ndarray, force: np.ndarray, seconds: float
) -> tuple[Log, np.ndarray]:
    """Push robots once, each in a direction and at a phase of its own.

    Args:
        robot: the biped.
        case: stance and softness.
        gains: (N, 3) as in `GAINS`.
        force: (N,) N.
        seconds: that they have to stay up.

    Returns:
        The log, and the directions (N,) rad, 0 forward.
    """
    rng, count = np.random.default_rng(20100508), len(force)
    angle, start = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.0, 3.0, count)
    vector = force[:, None] * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    push = pushed(np.full((count, 1), _AT), vector[:, None], PUSH_SECONDS)
    trial = Trial(
        robot, following(stepping(robot, STANCES[case[0]])), seconds, count, start=start,
        prepare=soft(case[1]), disturb=push, every=_EVERY,
    )  # fmt: skip
    hertz, zeta, base = gains.T
    return simulate(trial, papers(robot, orthogonal(), hertz, zeta, base[:, None])), angle


@experiment(
    "Figures 8 and 9: a search for numbers with which the paper's controller stays up",
    """The paper gives neither its gains nor its robot's mass, stance or contacts. Gains, stance and
    softness of the ground in all combinations, each pushed once in random directions and at random
    phases of the motion; the best of them under more pushes.""",
    minutes=5.0,
)
def fig8_9_search(setting: Setting) -> Measured:
    """Search, then push the best and the one of the section before harder and harder."""
    robot, seconds = load("biped"), setting.pick(4.0, 2.0)
    gains, forces = setting.pick(GAINS, (OURS, GAINS[-1])), setting.pick(FORCES, FORCES[::3])
    searched = np.repeat(SEARCHED, setting.pick(2, 1))
    stances = setting.pick(tuple(STANCES), ("upright", "crouched"))
    cells = tuple(product(stances, setting.pick(SOFTNESS, (1.0,))))
    every = np.repeat(gains, len(searched), axis=0)
    tried: list[Numbers] = []
    for case in setting.each(cells, 0.7):
        log, _ = pushed_once(robot, case, every, np.tile(searched, len(gains)), seconds)
        for one, some in zip(gains, log.groups(len(searched)), strict=True):
            row = {"stance": case[0], "softness": case[1], "gains": list(one)}
            tried.append(row | {"up": float(some.survived.mean())})
    best = max(tried, key=lambda row: row["up"])
    chosen = {
        "the best of the search": best,
        "the section before": {"stance": "crouched", "softness": 1.0, "gains": list(OURS)},
    }
    each = setting.pick(40, 4)
    force = np.repeat(forces, each)
    for name in setting.each(chosen):
        row = chosen[name]
        same = np.tile(row["gains"], (len(force), 1))
        log, angle = pushed_once(robot, (row["stance"], row["softness"]), same, force, seconds)
        ahead, hard = np.abs(np.cos(angle)) > np.sqrt(0.5), force == forces[-1]
        row["by force"] = log.survived.reshape(-1, each).mean(axis=1).tolist()
        row["sides"] = [float(log.survived[hard & side].mean()) for side in (ahead, ~ahead)]
        row["kept"] = kept(forces, row["by force"])
    numbers = {"tried": tried, "chosen": chosen, "forces": list(forces), "each": each}
    of_case = [[r for r in tried if (r["stance"], r["softness"]) == case] for case in cells]
    return numbers, {
        **{"best": best, "before": chosen["the section before"], "mass": robot.mass},
        **{"FORCE": FORCE, "KEPT": KEPT, "searched": ", ".join(f"{f:g}" for f in SEARCHED)},
        "survival": [(name, k, row["by force"]) for k, (name, row) in enumerate(chosen.items())],
        "cases": [
            (max(rows, key=lambda r: r["up"]), float(np.mean([r["up"] for r in rows])))
            for rows in of_case
        ],
    }


def kept(forces: tuple[float, ...], up: list[float]) -> float:
    """Return the largest force up to which the share that stays up is enough, N; 0 if none is."""
    enough = [share >= KEPT for share in up]
    first = enough.index(False) if False in enough else len(enough)
    return forces[first - 1] if first else 0.0
