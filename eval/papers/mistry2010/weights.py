"""[M10] figures 6 and 7: weights that spare the left knee, eq. (16), in a squat at 2 Hz."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from eval.page.figures import bars, lines
from eval.page.html import columns, figure, text
from eval.papers.experiment import Finding, Result, Setting, experiment, fate, judged
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import Law, orthogonal, rivals
from eval.papers.trial import Trial, simulate
from eval.wording import number, percent
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.motions import periodic_squat
from fbid_gym.robots import Robot, load

GAINS = (1.6, 0.5)
"""Hz and damping ratio: soft, as in figures 4 and 5."""

COST = 1e5
"""Entry of W for the left knee. The paper's 1e-5 is one of W^-1: eq. (16) minimises tau^T W tau."""

COSTS = (1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e5)
SHOWN = {"hip": "hip_pitch", "knee": "knee", "ankle": "ankle_pitch"}
NAMES = [f"{side} {label}" for side in ("left", "right") for label in SHOWN]
"""The six joints that move, as the paper names them."""

SPARED = 3.0
PAYING = {"left ankle": 1.9, "right hip": 2.4, "right knee": 1.7}
"""The paper's numbers: how much smaller the left knee's torque is, how much larger others' are."""


def knee_cost(robot: Robot, cost: float) -> np.ndarray:
    """Return W's diagonal (n,): `cost` for the left knee, 1 for the others."""
    weights = np.ones(robot.num_joints)
    weights[robot.joint_names.index("left_knee")] = cost
    return weights


def summary(robot: Robot, log: Log) -> dict[str, Any]:
    """RMS torque and error of the six joints that move, the greatest slip of a foot, the fall."""
    joints = [f"{side}_{name}" for side in ("left", "right") for name in SHOWN.values()]
    columns = [robot.joint_names.index(joint) for joint in joints]
    rows = np.flatnonzero(log.up[:, 0])[::10]
    qpos = np.asarray(log["qpos"][rows, 0], float)
    feet = MuJoCoDynamics(robot).terms(qpos, np.zeros((len(rows), robot.nv))).foot_position
    torque, error = log.rms(log["torque"])[0], log.rms(log.error)[0]
    return {
        "torque": torque[columns].tolist(),
        "norm": float(np.linalg.norm(torque)),
        "error": error[columns].tolist(),
        "slip": float(np.linalg.norm((feet - feet[0])[:, :, :2], axis=2).max()),
        "lifted": float((log["contact_force"][rows, 0, :, 2] <= 0.0).mean()),
        "fell": log.fall(),
    }


def changes(row: dict[str, Any], free: dict[str, Any]) -> dict[str, float]:
    """Torque of each joint, of that without weights."""
    return dict(zip(NAMES, np.divide(row["torque"], free["torque"]), strict=True))


def told(change: dict[str, float], joints: Any) -> str:
    """Write what some joints pay."""
    return ", ".join(f"{joint} {number(change[joint], 2)}" for joint in joints)


@experiment(
    "Figures 6 and 7: sparing a knee",
    """Sinusoids of 2 Hz at hip, knee and ankle over 6 s. W of eq. (16) is the identity but for the
    left knee's entry, 100,000 (the paper's 10⁻⁵ is the entry of W⁻¹, in which eq. (16) is
    written); beside it the entry at which the knee is spared as much as in the paper.""",
    minutes=0.7,
)
def fig6_7_weights(setting: Setting) -> Result:
    """Squat with each weight, without, with PD alone, and with the paper's rivals."""
    robot = load("biped")
    trial = Trial(robot, following(periodic_squat(robot, frequency=2.0)), setting.pick(6.0, 3.0))
    gains, costs = PdGains.of(robot, *GAINS), setting.pick(COSTS, (1.0, 10.0, COST))
    laws: dict[str, Law | None] = {"PD alone": None}
    laws |= {f"cost {cost:g}": orthogonal(knee_cost(robot, cost)) for cost in costs}
    laws |= rivals(robot)
    rows: dict[str, Any] = {}
    for name, progress in setting.progress.part(0.0, 0.7).each(laws):
        log = simulate(trial, JointController(robot, gains, laws[name]), progress)
        rows[name] = summary(robot, log)
    free, spared, alone = rows["cost 1"], rows[f"cost {COST:g}"], rows["PD alone"]

    def as_paper(decade: float) -> float:
        law = orthogonal(knee_cost(robot, 10.0**decade))
        rows["as the paper"] = summary(robot, simulate(trial, JointController(robot, gains, law)))
        return float(np.log(changes(rows["as the paper"], free)["left knee"] * SPARED))

    decade = brentq(as_paper, 0.0, np.log10(COST), xtol=0.01)
    change, as_there = changes(spared, free), changes(rows["as the paper"], free)
    less, others = 1.0 / change["left knee"], ("left hip", "right ankle")
    there = told(PAYING, PAYING)
    wrong = [float(np.linalg.norm(row["error"])) for row in (free, spared, alone)]
    findings = [
        judged(
            "RMS torque of the left knee, times smaller", f"{SPARED:.1f}", number(less, 2),
            "at least 3.0", less >= SPARED and spared["fell"] is None,
        ),
        Finding(
            "what other joints pay, times larger", there,
            f"{told(change, PAYING)}; {told(change, others)}",
        ),
        Finding(
            f"the same at the cost that spares the knee {1.0 / as_there['left knee']:.1f} times, "
            f"{number(10.0**decade, 2)}", there,
            f"{told(as_there, PAYING)}; {told(as_there, others)}",
        ),
        judged(
            "RMS tracking error without weights, with, PD alone, rad",
            "small increase beside PD alone (plot)", ", ".join(number(value, 2) for value in wrong),
            "nearer to none than to PD's", wrong[1] < 0.5 * (wrong[0] + wrong[2]),
        ),
    ]  # fmt: skip
    numbers = {"rows": rows, "costs": list(costs), "cost as the paper": 10.0**decade}
    return Result(findings, numbers, _body(rows, costs, 10.0**decade))


def _body(rows: dict[str, Any], costs: tuple[float, ...], there: float) -> list[str]:
    free, spared, alone = rows["cost 1"], rows[f"cost {COST:g}"], rows["PD alone"]
    as_paper, decades = rows["as the paper"], [float(np.log10(cost)) for cost in costs]
    relative = [np.divide(rows[f"cost {c:g}"]["torque"], free["torque"]) for c in costs]
    order = ("left knee", "left ankle", "right knee", "right hip", "left hip")
    torques = [(j, k, [one[NAMES.index(j)] for one in relative]) for k, j in enumerate(order)]
    errors = [1e3 * float(np.linalg.norm(rows[f"cost {c:g}"]["error"])) for c in costs]
    still = [1e3 * float(np.linalg.norm(alone["error"]))] * len(costs)
    pay = [changes(row, free) for row in (spared, as_paper)]
    beside = [("left knee", 1.0 / SPARED), *PAYING.items()]
    below = "cost of the left knee, log10"
    compared = [
        ("paper", 7, [value for _, value in beside]),
        (f"cost {number(there, 2)}", 2, [pay[1][name] for name, _ in beside]),
        (f"cost {COST:,.0f}", 0, [pay[0][name] for name, _ in beside]),
    ]
    shown = (("W = I", 1, free), ("weighted", 0, spared), ("PD alone", 5, alone))
    strayed = [("weighted", 0, errors), ("PD alone", 5, still)]
    return [
        figure(
            [
                bars(NAMES, [(n, c, row["torque"]) for n, c, row in shown[:2]], "RMS torque, N·m"),
                bars(
                    NAMES, [(n, c, [1e3 * e for e in row["error"]]) for n, c, row in shown],
                    "RMS tracking error, mrad",
                ),
            ],
            "As the paper's figures 6 and 7.",
        ),
        figure(
            [
                lines(decades, torques, "RMS torque, of that with W = I", below),
                lines(decades, strayed, "RMS tracking error, mrad", below),
                bars([name for name, _ in beside], compared, "RMS torque, of that with W = I"),
            ],
            "How the choice of the weight matters. From 100 on the knee is spared as far as it can "
            "be. What is left is feedback: eq. (16) presses the feet against each other through "
            "forces that the ground cannot all give, corners of the soles lift and slip, and the "
            "joints stray. Last: where the knee is spared as much as in the paper, what the joints "
            "pay for which the paper has a number.",
            3,
        ),
        text(
            "The paper's rivals have no choice among torques to make: the measured or the "
            "estimated force decides it. Beside them here, the same motion and gains:"
        ),
        _table(rows),
    ]  # fmt: skip


def _table(rows: dict[str, Any]) -> str:
    def title(name: str) -> str:
        name = name.replace("cost 1e+05", f"cost {COST:,.0f}").replace("cost", "eq. (16), cost")
        name = name.replace("as the paper", "eq. (16), the knee spared as in the paper")
        return "eq. (15)" if name == "eq. (16), cost 1" else name

    cells = (
        ("", lambda row: title(row["name"])),
        ("left knee, N·m", lambda row: number(row["torque"][1])),
        ("all joints, N·m", lambda row: number(row["norm"])),
        ("error, mrad", lambda row: number(1e3 * float(np.linalg.norm(row["error"])))),
        ("slip, mm", lambda row: number(1e3 * row["slip"], 2)),
        ("points off the ground", lambda row: percent(row["lifted"])),
        ("", lambda row: fate(row["fell"])),
    )
    return columns([{"name": name} | row for name, row in rows.items()], cells)
