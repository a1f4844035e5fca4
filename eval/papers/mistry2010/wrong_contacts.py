"""[M10] III-B.6: wrong beliefs about contacts degrade tracking but do not blow up."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eval.page.figures import lines
from eval.page.html import figure, folded, table, text
from eval.papers.experiment import Finding, Result, Setting, experiment, judged, row
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, base_returning, following
from eval.papers.mistry2010.laws import ESTIMATED, Law, equation, limited, measured, orthogonal
from eval.papers.trial import RATES, Trial, simulate
from eval.wording import number, percent
from fbid_gym.actions.contact_belief import ContactBelief, contact_belief
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import MotionTable, stepping
from fbid_gym.quantities import RobotState, Target
from fbid_gym.robots import Robot, load

LATE = (-200, -100, -50, -20, 0, 20, 50, 100, 200)
"""ms by which the controller switches contacts later than planned."""

FRICTION = (0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.1, 0.05)
GAINS, BASE = (2.0, 0.5), 1.0
"""Hz and damping ratio; Hz of eq. (20), critically damped."""

COLOURS = {
    "eq. (15)": 0,
    "eq. (15), limited": 2,
    "eq. (8), measured force": 3,
    "eq. (8), previous torque": 4,
}


def laws(robot: Robot) -> dict[str, Law]:
    """Return what is compared, by name."""
    return dict(
        zip(COLOURS, (orthogonal(), limited(robot), measured(robot), ESTIMATED), strict=True)
    )


def shifted(robot: Robot, motion: MotionTable, late: np.ndarray, rest: np.ndarray) -> ContactBelief:
    """Believe in the contacts that were planned `late` (N,) ms ago; the last K in `rest` (K, P)."""
    points = motion.rows.planted[:, contact_geometry(robot).foot_of_point]
    ticks = np.round(late * RATES.control / 1000).astype(int)

    def belief(state: RobotState, reference: Target) -> np.ndarray:
        moving = points[(state.tick[: len(ticks)] - ticks) % len(points)]
        return np.concatenate([moving, rest])

    return belief


def slippery(friction: np.ndarray) -> Callable[[Simulation], None]:
    """Give every robot's soles a friction of its own, (N,)."""

    def prepare(simulation: Simulation) -> None:
        simulation.batch.expand("geom_friction")[:, :, 0] = friction[:, None]

    return prepare


def _summary(log: Log, robot: Robot) -> dict[str, Any]:
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
    rng, geometry = np.random.default_rng(5), contact_geometry(robot)
    points = geometry.num_points
    qpos = np.tile(robot.home_qpos, (count, 1))
    joints = qpos[:, 7:] + rng.normal(size=(count, robot.num_joints)) * 0.4
    qpos[:, 7:] = np.clip(joints, *robot.joint_range.T)
    qpos[:, 3], qpos[:, 4:7] = 1.0, 0.15 * rng.normal(size=(count, 3))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    terms = MuJoCoDynamics(robot).terms(qpos, rng.normal(size=(count, robot.nv)))
    command = 3.0 * rng.normal(size=(count, robot.nv))
    down = rng.integers(0, points + 1, count)
    order = rng.permuted(np.tile(np.arange(points), (count, 1)), axis=1)
    contacts = reduced_contacts(geometry, terms, order < down[:, None])
    torque = orthogonal_inverse_dynamics(*equation(terms, contacts, command)).torque
    by_count = [np.abs(torque).max(axis=1)[down == k] for k in range(points + 1)]
    return {
        "finite": bool(np.isfinite(torque).all()),
        "median": [float(np.median(part)) for part in by_count],
        "largest": [float(part.max()) for part in by_count],
        "states": count,
    }


@experiment(
    "Claim: wrong contact beliefs degrade tracking but never blow up",
    """The biped steps in place while the controller switches contacts early or late, believes for
    ever in both feet, one or none, or stands on ground that is more slippery than any contact it
    believes in.""",
    minutes=2.5,
)
def claim_wrong_contacts(setting: Setting) -> Result:
    """Step in place with wrong beliefs, on slippery ground; then random states and beliefs."""
    robot = load("biped")
    motion, geometry = stepping(robot), contact_geometry(robot)
    seconds, each = setting.pick(12.0, 4.0), setting.pick(4, 2)
    starts = np.arange(each) * motion.seconds / each
    late, friction = setting.pick(LATE, (-100, 0, 100)), setting.pick(FRICTION, (0.8, 0.2))
    left = np.array([name == "left" for name in robot.foot_names])[geometry.foot_of_point]
    fixed = {"both feet down": left | True, "left foot down": left, "right foot down": ~left}
    fixed["no foot down"] = left & False
    forever = np.repeat(np.array(list(fixed.values())), each, axis=0)
    delays = [f"{d:+d} ms" if d else "as planned" for d in late]
    slips = [f"friction {value:g}" for value in friction]
    # Every belief and every start in one batch, then every friction.
    wrong = shifted(robot, motion, np.repeat(late, each), forever)
    planned = contact_belief("planned", robot, RATES.control)
    cases: list[tuple[str, list[str], ContactBelief, dict[str, Any]]] = [
        ("beliefs", [*delays, *fixed], wrong, {}),
        ("slip", slips, planned, {"prepare": slippery(np.repeat(friction, each))}),
    ]
    gains, desire = PdGains.of(robot, *GAINS), base_returning(robot, BASE)
    rows: list[dict[str, Any]] = []
    for (name, law), progress in setting.progress.each(laws(robot).items(), lambda item: item[0]):
        for (_, labels, belief, options), part in progress.each(cases, lambda case: case[0]):
            count = each * len(labels)
            start = np.resize(starts, count)
            trial = Trial(robot, following(motion), seconds, count, start, every=5, **options)
            log = simulate(trial, JointController(robot, gains, law, belief, desire), part)
            for label, some in zip(labels, log.groups(each), strict=True):
                rows.append({"law": name, "belief": label, **_summary(some, robot)})
    numbers = {
        "rows": rows, "late": list(late), "friction": list(friction), "fixed": list(fixed),
        "static": _static(robot, setting.pick(4000, 500)), "each": each,
    }  # fmt: skip
    return Result(findings(numbers), numbers, _body(numbers, delays, slips))


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The claim, measured."""
    ours, static = [r for r in numbers["rows"] if r["law"] == "eq. (15)"], numbers["static"]
    right, both = row(ours, belief="as planned"), row(ours, belief="both feet down")
    worst = max(ours, key=lambda r: r["error"])
    finite = all(r["finite"] for r in ours) and static["finite"]
    wrong = [r for r in ours if r["belief"] != "as planned"]
    peak = max(r["peak"] for r in ours)
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


def _body(numbers: dict[str, Any], delays: list[str], slips: list[str]) -> list[str]:
    rows, static = numbers["rows"], numbers["static"]
    charts = []
    for x, beliefs, below in (
        (numbers["late"], delays, "contacts switched late, ms"),
        (numbers["friction"], slips, "friction of the ground"),
    ):
        of = {law: [row(rows, law=law, belief=b) for b in beliefs] for law in COLOURS}
        errors = [(law, c, [1e3 * r["error"] for r in of[law]]) for law, c in COLOURS.items()]
        up = [(law, c, [r["up"] for r in of[law]]) for law, c in COLOURS.items()]
        charts.append(lines(x, errors, "RMS tracking error, mrad", below))
        charts.append(lines(x, up, "Robots that stay up", below, (0.0, 1.04), percent))
    torques = [("largest", 5, static["largest"]), ("median", 0, static["median"])]
    title = "Eq. (15) at random states, largest joint torque, N·m"
    charts.append(lines(range(len(static["median"])), torques, title, "points believed down"))
    cells = [
        [
            belief,
            *(
                f"{number(1e3 * c['error'])} mrad, {number(c['torque'])} N·m, {percent(c['up'])} up"
                for c in (row(rows, law=law, belief=belief) for law in COLOURS)
            ),
        ]
        for belief in dict.fromkeys(r["belief"] for r in rows)
    ]
    said = text("RMS tracking error, RMS torque, share of robots that stay up.")
    return [
        figure(
            charts,
            "Stepping in place for 12 s with the controller of the section on stepping, "
            f"{numbers['each']} starts each. Errors are up to a fall. The limited form assumes a "
            "friction of 0.7 whatever the ground has. Last: no simulation, 2 or 3 points of one "
            "sole are underactuated.",
        ),
        folded("Every belief as a table", table(["", *COLOURS], cells) + said),
    ]
