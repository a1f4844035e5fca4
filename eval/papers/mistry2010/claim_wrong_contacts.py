"""[M10] III-B.6: wrong beliefs about contacts degrade tracking but do not blow up."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eval.page.figures import lines
from eval.page.html import figure, folded, table, text
from eval.papers.experiment import Experiment, Result, Setting, main, row
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import (
    ContactBelief,
    JointController,
    PdGains,
    base_returning,
    planned_contacts,
)
from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.laws import (
    EstimatedForce,
    Law,
    Limited,
    MeasuredForce,
    equation,
    orthogonal,
)
from eval.papers.page import Finding, judged
from eval.papers.trial import RATES, Trial, simulate
from eval.wording import number, percent
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import MotionTable, stepping
from fbid_gym.quantities import ContactGeometry, RobotState, Target
from fbid_gym.robots import Robot, load

LATE = (-200, -100, -50, -20, 0, 20, 50, 100, 200)
"""ms by which the controller switches contacts later than planned."""

FRICTION = (0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.1, 0.05)
GAINS = (2.0, 0.5)
BASE = 1.0
"""Hz of eq. (20), critically damped."""


def laws(robot: Robot) -> dict[str, Law]:
    """Return what is compared, by name."""
    return {
        "eq. (15)": orthogonal(),
        "eq. (15), limited": Limited.of(robot),
        "eq. (8), measured force": MeasuredForce.of(robot),
        "eq. (8), previous torque": EstimatedForce(),
    }


COLOURS = {
    "eq. (15)": 0,
    "eq. (15), limited": 2,
    "eq. (8), measured force": 3,
    "eq. (8), previous torque": 4,
}


def shifted(
    motion: MotionTable, geometry: ContactGeometry, late: np.ndarray, rest: np.ndarray
) -> ContactBelief:
    """Believe in the contacts that were planned `late` (N,) ms ago; the last K in `rest` (K, P)."""
    points = motion.rows.planted[:, geometry.foot_of_point]
    ticks = np.round(late * RATES.control / 1000).astype(int)

    def belief(state: RobotState, reference: Target) -> np.ndarray:
        moving = points[(state.tick[: len(ticks)] - ticks) % len(points)]
        return np.concatenate([moving, rest])

    return belief


def slippery(friction: np.ndarray) -> Callable[[Simulation], None]:
    """Give every robot's soles a friction of its own, (N,)."""

    def prepare(simulation: Simulation) -> None:
        model = simulation.robot.model
        geoms = np.tile(model.geom_friction, (simulation.num_robots, 1, 1))
        geoms[:, :, 0] = friction[:, None]
        simulation.batch.expand("geom_friction")[:] = geoms

    return prepare


def run(setting: Setting) -> Result:
    """Step in place with wrong beliefs, on slippery ground; then random states and beliefs."""
    robot = load("biped")
    motion, geometry = stepping(robot), contact_geometry(robot)
    seconds, each = setting.pick(12.0, 4.0), setting.pick(4, 2)
    starts = np.arange(each) * motion.seconds / each
    late = setting.pick(LATE, (-100, 0, 100))
    friction = setting.pick(FRICTION, (0.8, 0.2))
    plan = following(motion)
    left = np.array([name == "left" for name in robot.foot_names])[geometry.foot_of_point]
    fixed = {"both feet down": left | True, "left foot down": left, "right foot down": ~left}
    fixed["no foot down"] = left & False
    chosen = laws(robot)
    delays, mu = np.repeat(late, each), np.repeat(friction, each)
    forever = np.repeat(np.array(list(fixed.values())), each, axis=0)
    # Every belief and every start in one batch, then every friction.
    wrong = shifted(motion, geometry, delays, forever)
    beliefs = [f"{d:+d} ms" if d else "as planned" for d in late] + list(fixed)
    slips = [f"friction {value:g}" for value in friction]
    cases = (
        ("beliefs", beliefs, wrong, None),
        ("slip", slips, planned_contacts(robot), slippery(mu)),
    )
    rows: list[dict[str, Any]] = []
    for name, progress in setting.progress.each(chosen):
        for (_, labels, belief, prepare), part in progress.each(cases, lambda case: case[0]):
            count = each * len(labels)
            trial = Trial(
                robot, plan, seconds, count, np.resize(starts, count), prepare=prepare, every=5
            )
            log = simulate(trial, _controller(robot, chosen[name], belief), part)
            for label, some in zip(labels, log.groups(each), strict=True):
                rows.append({"law": name, "belief": label, **_summary(some, robot)})
    numbers = {
        "rows": rows, "late": list(late), "friction": list(friction), "fixed": list(fixed),
        "static": _static(robot, setting.pick(4000, 500)), "each": each,
    }  # fmt: skip
    return Result(findings(numbers), numbers, {})


def _controller(robot: Robot, law: Law, belief: ContactBelief) -> JointController:
    gains, desire = PdGains.of(robot, *GAINS), base_returning(robot, BASE)
    return JointController(robot, gains, law, belief, desire)


def _summary(log: Log, robot: Robot) -> dict[str, float]:
    asked = np.abs(np.where(log.up[:, :, None], log["feedforward"] + log["feedback"], 0.0))
    return {
        "error": float(np.nanmean(log.rms_of_joints(log.error))),
        "torque": float(np.nanmean(log.rms_of_joints(log["torque"]))),
        "peak": float((asked / robot.torque_limit).max()),
        "up": float(log.survived.mean()),
        "finite": bool(np.isfinite(log["feedforward"]).all()),
    }


def _static(robot: Robot, count: int) -> dict[str, Any]:
    """Eq. (15) at random states with every number of points believed down: how large is tau?"""
    rng = np.random.default_rng(5)
    home = np.tile(robot.home_qpos, (count, 1))
    low, high = robot.joint_range.T
    home[:, 7:] = np.clip(home[:, 7:] + rng.normal(size=(count, robot.num_joints)) * 0.4, low, high)
    half = 0.15 * rng.normal(size=(count, 3))
    home[:, 4:7] = half
    home[:, 3] = 1.0
    home[:, 3:7] /= np.linalg.norm(home[:, 3:7], axis=1, keepdims=True)
    qvel = rng.normal(size=(count, robot.nv))
    terms = MuJoCoDynamics(robot).terms(home, qvel)
    command = 3.0 * rng.normal(size=(count, robot.nv))
    geometry = contact_geometry(robot)
    number_down = rng.integers(0, geometry.num_points + 1, count)
    order = rng.permuted(np.tile(np.arange(geometry.num_points), (count, 1)), axis=1)
    active = order < number_down[:, None]
    contacts = reduced_contacts(geometry, terms, active)
    torque = orthogonal_inverse_dynamics(*equation(terms, contacts, command)).torque
    size = np.abs(torque).max(axis=1)
    by_count = [size[number_down == k] for k in range(geometry.num_points + 1)]
    return {
        "finite": bool(np.isfinite(torque).all()),
        "median": [float(np.median(part)) for part in by_count],
        "largest": [float(part.max()) for part in by_count],
        "states": count,
    }


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The claim, measured."""
    ours = [r for r in numbers["rows"] if r["law"] == "eq. (15)"]
    right, both = row(ours, belief="as planned"), row(ours, belief="both feet down")
    worst = max(ours, key=lambda r: r["error"])
    finite = all(r["finite"] for r in ours) and numbers["static"]["finite"]
    wrong = [r for r in ours if r["belief"] != "as planned"]
    peak = max(r["peak"] for r in ours)
    static = numbers["static"]
    return [
        judged(
            "torques under every wrong belief, eq. (15)",
            "degrade, do not become singular",
            f"{'all finite' if finite else 'not finite'}, at most {number(peak, 2)} of a limit",
            "finite",
            finite,
        ),
        Finding(
            "RMS tracking error, planned contacts and both feet believed down, mrad",
            "degrades",
            f"{number(1e3 * right['error'])} and {number(1e3 * both['error'])}",
        ),
        Finding(
            "the worst of all sweeps, mrad",
            "",
            f"{number(1e3 * worst['error'])} ({worst['belief']})",
        ),
        Finding(
            "wrong beliefs of the sweeps under which all robots stay up",
            "",
            f"{sum(r['up'] == 1.0 for r in wrong)} of {len(wrong)}",
        ),
        Finding(
            f"largest torque at {static['states']:,} random states, any points believed down, N·m",
            "",
            f"{number(max(static['largest']))}; {number(static['largest'][-1])} with all eight",
        ),
    ]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers = result.numbers
    late, friction = numbers["late"], numbers["friction"]
    delays = [f"{d:+d} ms" if d else "as planned" for d in late]
    slips = [f"friction {value:g}" for value in friction]

    def curves(beliefs: list[str], what: str, scale: float) -> list[tuple[str, int, list[float]]]:
        return [
            (law, colour, [scale * row(numbers["rows"], law=law, belief=b)[what] for b in beliefs])
            for law, colour in COLOURS.items()
        ]

    static = numbers["static"]
    return [
        figure(
            [
                lines(
                    late, curves(delays, "error", 1e3), "RMS tracking error, mrad",
                    "contacts switched late, ms",
                ),
                lines(
                    late, curves(delays, "up", 1.0), "Robots that stay up",
                    "contacts switched late, ms", (0.0, 1.04), percent,
                ),
                lines(
                    friction, curves(slips, "error", 1e3), "RMS tracking error, mrad",
                    "friction of the ground",
                ),
                lines(
                    friction, curves(slips, "up", 1.0), "Robots that stay up",
                    "friction of the ground", (0.0, 1.04), percent,
                ),
                lines(
                    list(range(len(static["median"]))),
                    [("largest", 5, static["largest"]), ("median", 0, static["median"])],
                    "Eq. (15) at random states, largest joint torque, N·m",
                    "points believed down",
                ),
            ],
            "Stepping in place for 12 s with the controller of the section on stepping, "
            f"{numbers['each']} starts each. Errors are up to a fall. The limited form assumes "
            "a friction of 0.7 whatever the ground has. Last: no simulation, 2 or 3 points of "
            "one sole are underactuated.",
        ),
        folded("Every belief as a table", _table(numbers)),
    ]  # fmt: skip


def _table(numbers: dict[str, Any]) -> str:
    names = list(COLOURS)
    beliefs = list(dict.fromkeys(r["belief"] for r in numbers["rows"]))
    rows = []
    for belief in beliefs:
        cells = [row(numbers["rows"], law=law, belief=belief) for law in names]
        rows.append(
            [
                belief,
                *(
                    f"{number(1e3 * c['error'])} mrad, {number(c['torque'])} N·m, "
                    f"{percent(c['up'])} up"
                    for c in cells
                ),
            ]
        )
    return table(["", *names], rows) + text(
        "RMS tracking error, RMS torque, share of robots that stay up."
    )


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.claim_wrong_contacts",
    title="Claim: wrong contact beliefs degrade tracking but never blow up",
    about=(
        "The biped steps in place while the controller switches contacts early or late, believes "
        "for ever in both feet, one or none, or stands on ground that is more slippery than any "
        "contact it believes in."
    ),
    run=run,
    show=show,
    minutes=2.5,
)

if __name__ == "__main__":
    main(EXPERIMENT)
