"""[M10] figures 8 and 9: is it our choice of numbers that makes the paper's controller fall?"""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from eval.page.figures import lines
from eval.page.html import columns, figure
from eval.papers.experiment import Finding, Progress, Result, Setting, experiment, judged, prose
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import following
from eval.papers.mistry2010.laws import orthogonal
from eval.papers.mistry2010.stepping import FORCE, MOTIONS, PUSH_SECONDS, papers
from eval.papers.trial import Push, Trial, pushed, simulate
from eval.wording import percent
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
    robot: Robot,
    case: tuple[str, float],
    gains: np.ndarray,
    force: np.ndarray,
    seconds: float,
    progress: Progress,
) -> tuple[Log, np.ndarray]:
    """Push robots once, each in a direction and at a phase of its own.

    Args:
        robot: the biped.
        case: stance and softness.
        gains: (N, 3) as in `GAINS`.
        force: (N,) N.
        seconds: that they have to stay up.
        progress: to be told.

    Returns:
        The log, and the directions (N,) rad, 0 forward.
    """
    rng, count = np.random.default_rng(20100508), len(force)
    angle, start = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.0, 3.0, count)
    vector = force[:, None] * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    push = pushed(Push(np.full(count, _AT), PUSH_SECONDS, vector))
    trial = Trial(
        robot, following(stepping(robot, STANCES[case[0]])), seconds, count, start=start,
        prepare=soft(case[1]), disturb=push, every=_EVERY,
    )  # fmt: skip
    hertz, zeta, base = gains.T
    return simulate(trial, papers(robot, orthogonal(), hertz, zeta, base[:, None]), progress), angle


@experiment(
    "Figures 8 and 9: a search for numbers with which the paper's controller stays up",
    """The paper gives neither its gains nor its robot's mass, stance or contacts. Gains, stance and
    softness of the ground in all combinations, each pushed once in random directions and at random
    phases of the motion; the best of them under more pushes.""",
    minutes=5.0,
)
def fig8_9_search(setting: Setting) -> Result:
    """Search, then push the best and the one of the section before harder and harder."""
    robot, seconds = load("biped"), setting.pick(4.0, 2.0)
    gains, forces = setting.pick(GAINS, (OURS, GAINS[-1])), setting.pick(FORCES, FORCES[::3])
    searched = np.repeat(SEARCHED, setting.pick(2, 1))
    stances = setting.pick(tuple(STANCES), ("upright", "crouched"))
    cells = tuple(product(stances, setting.pick(SOFTNESS, (1.0,))))
    every = np.repeat(gains, len(searched), axis=0)
    tried: list[dict[str, Any]] = []
    for case, part in setting.progress.part(0.0, 0.7).each(cells, lambda case: case[0]):
        force = np.tile(searched, len(gains))
        log, _ = pushed_once(robot, case, every, force, seconds, part)
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
    for row, part in setting.progress.part(0.7, 1.0).each(chosen.values(), lambda row: "pushes"):
        same = np.tile(row["gains"], (len(force), 1))
        log, angle = pushed_once(
            robot, (row["stance"], row["softness"]), same, force, seconds, part
        )
        ahead, hard = np.abs(np.cos(angle)) > np.sqrt(0.5), force == forces[-1]
        row["by force"] = log.survived.reshape(-1, each).mean(axis=1).tolist()
        row["sides"] = [float(log.survived[hard & side].mean()) for side in (ahead, ~ahead)]
        row["kept"] = kept(forces, row["by force"])
    numbers = {"tried": tried, "chosen": chosen, "forces": list(forces), "each": each}
    return Result(findings(numbers, robot.mass), numbers, _body(numbers))


def kept(forces: tuple[float, ...], up: list[float]) -> float:
    """Return the largest force up to which the share that stays up is enough, N; 0 if none is."""
    enough = [share >= KEPT for share in up]
    first = enough.index(False) if False in enough else len(enough)
    return forces[first - 1] if first else 0.0


def told(row: dict[str, Any]) -> str:
    """Name a setting."""
    hertz, zeta, base = row["gains"]
    milliseconds = 20.0 * row["softness"]
    gains = f"{hertz:g} Hz, ζ {zeta:g}, base {base:g} Hz"
    return f"{row['stance']}, {gains}, contacts of {milliseconds:g} ms"


def findings(numbers: dict[str, Any], mass: float) -> list[Finding]:
    """What the best numbers keep, and the robot's mass at which that were the paper's push."""
    best, before = numbers["chosen"].values()
    count = len(numbers["tried"])
    heavy = f"{mass * FORCE / best['kept']:.0f} kg" if best["kept"] else "none"
    return [
        judged(
            f"push that the best of {count} settings of eqs. (15), (18)-(20) keeps in "
            f"{percent(KEPT)}, N for 150 ms",
            f"{FORCE:g} (one shown)",
            f"{best['kept']:g} ({told(best)}); as in the section before: {before['kept']:g}",
            f"{FORCE:g}",
            best["kept"] >= FORCE,
        ),
        Finding(
            f"mass of a robot of these proportions for which that is the paper's {FORCE:g} N",
            "not given",
            f"{heavy}; ours has {mass:.0f} kg",
        ),
        Finding(
            f"stay up under {numbers['forces'][-1]:g} N by the best: pushed forward or backward, "
            "sideways",
            "stays up",
            ", ".join(percent(share) for share in best["sides"]),
        ),
    ]


def _body(numbers: dict[str, Any]) -> list[str]:
    tried = numbers["tried"]
    curves = [(n, k, row["by force"]) for k, (n, row) in enumerate(numbers["chosen"].items())]
    title = "Survival of one push"
    cases = dict.fromkeys((row["stance"], row["softness"]) for row in tried)
    of = {c: [row for row in tried if (row["stance"], row["softness"]) == c] for c in cases}
    cells = (
        ("best of its stance and ground", lambda rows: told(max(rows, key=lambda r: r["up"]))),
        ("stay up", lambda rows: percent(max(r["up"] for r in rows))),
        ("mean of all gains", lambda rows: percent(float(np.mean([r["up"] for r in rows])))),
    )
    pushes = ", ".join(f"{force:g}" for force in SEARCHED)
    return [
        figure(
            [lines(numbers["forces"], curves, title, "N for 150 ms", (0.0, 1.04), percent)],
            f"{numbers['each']} robots for each force, in random directions at random phases of "
            "the motion.",
            1,
        ),
        prose(f"""
Each setting was pushed with {pushes} N. All forces scale with a robot's mass: one of the same
proportions that is twice as heavy takes twice the push in the same way, so the mass is not searched
but told."""),
        columns(of.values(), cells),
    ]
