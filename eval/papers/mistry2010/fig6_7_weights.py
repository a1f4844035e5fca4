"""[M10] figures 6 and 7: weights that spare the left knee, eq. (16), in a squat at 2 Hz."""

from typing import Any

import numpy as np

from eval.page.figures import bars, lines
from eval.page.html import columns, figure, text
from eval.papers.experiment import Experiment, Result, Setting, main
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains
from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.laws import Law, orthogonal, rivals
from eval.papers.page import Finding, fate, judged
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
SHOWN = ("hip_pitch", "knee", "ankle_pitch")
LABELS = ("hip", "knee", "ankle")
PAYING = {"left ankle": 1.9, "right hip": 2.4, "right knee": 1.7}
"""The paper's increases."""


def run(setting: Setting) -> Result:
    """Squat with each weight, without, with PD alone, and with the paper's rivals."""
    robot = load("biped")
    motion = periodic_squat(robot, frequency=2.0)
    trial = Trial(robot, following(motion), setting.pick(6.0, 3.0))
    gains = PdGains.of(robot, *GAINS)
    costs = setting.pick(COSTS, (1.0, 10.0, COST))
    laws: dict[str, Law | None] = {"PD alone": None}
    laws |= {f"cost {cost:g}": orthogonal(knee_cost(robot, cost)) for cost in costs}
    laws |= rivals(robot)
    rows: dict[str, Any] = {}
    for name, progress in setting.progress.each(laws):
        log = simulate(trial, JointController(robot, gains, laws[name]), progress)
        rows[name] = summary(robot, log)
    numbers = {"rows": rows, "costs": list(costs)}
    return Result(findings(numbers), numbers, {})


def knee_cost(robot: Robot, cost: float) -> np.ndarray:
    """Return W's diagonal (n,): `cost` for the left knee, 1 for the others."""
    weights = np.ones(robot.num_joints)
    weights[robot.joint_names.index("left_knee")] = cost
    return weights


def summary(robot: Robot, log: Log) -> dict[str, Any]:
    """RMS torque and error of the six joints that move, the greatest slip of a foot, the fall."""
    columns = [robot.joint_names.index(f"{side}_{j}") for side in ("left", "right") for j in SHOWN]
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


def names() -> list[str]:
    """Name the six joints as the paper does."""
    return [f"{side} {label}" for side in ("left", "right") for label in LABELS]


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's numbers beside ours."""
    rows = numbers["rows"]
    free, spared, alone = rows["cost 1"], rows[f"cost {COST:g}"], rows["PD alone"]
    change = dict(zip(names(), np.divide(spared["torque"], free["torque"]), strict=True))
    less = 1.0 / change["left knee"]
    paying = ", ".join(f"{name} {number(change[name], 2)}" for name in PAYING)
    others = ", ".join(f"{name} {number(change[name], 2)}" for name in ("left hip", "right ankle"))
    wrong = [float(np.linalg.norm(row["error"])) for row in (free, spared, alone)]
    return [
        judged(
            "RMS torque of the left knee, times smaller", "3.0", number(less, 2), "at least 3.0",
            less >= 3.0 and spared["fell"] is None,
        ),
        Finding(
            "what other joints pay, times larger",
            ", ".join(f"{name} {value}" for name, value in PAYING.items()),
            f"{paying}; {others}",
        ),
        judged(
            "RMS tracking error without weights, with, PD alone, rad",
            "small increase beside PD alone (plot)",
            ", ".join(number(value, 2) for value in wrong),
            "nearer to none than to PD's",
            wrong[1] < 0.5 * (wrong[0] + wrong[2]),
        ),
    ]  # fmt: skip


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers = result.numbers
    rows, costs = numbers["rows"], numbers["costs"]
    free, spared, alone = rows["cost 1"], rows[f"cost {COST:g}"], rows["PD alone"]
    relative = {c: np.divide(rows[f"cost {c:g}"]["torque"], free["torque"]) for c in costs}
    decades = [float(np.log10(c)) for c in costs]
    shown = ((1, "left knee", 0), (0, "left hip", 4), (3, "right hip", 3), (4, "right knee", 2),
             (2, "left ankle", 1))  # fmt: skip
    errors = [1e3 * float(np.linalg.norm(rows[f"cost {c:g}"]["error"])) for c in costs]
    still = 1e3 * float(np.linalg.norm(alone["error"]))
    return [
        figure(
            [
                bars(
                    names(),
                    [("W = I", 1, free["torque"]), ("weighted", 0, spared["torque"])],
                    "RMS torque, N·m",
                ),
                bars(
                    names(),
                    [
                        ("W = I", 1, [1e3 * e for e in free["error"]]),
                        ("weighted", 0, [1e3 * e for e in spared["error"]]),
                        ("PD alone", 5, [1e3 * e for e in alone["error"]]),
                    ],
                    "RMS tracking error, mrad",
                ),
            ],
            "As the paper's figures 6 and 7.",
        ),
        figure(
            [
                lines(
                    decades,
                    [(label, c, [relative[k][j] for k in costs]) for j, label, c in shown],
                    "RMS torque, of that with W = I",
                    "cost of the left knee, log10",
                ),
                lines(
                    decades,
                    [("weighted", 0, errors), ("PD alone", 5, [still] * len(costs))],
                    "RMS tracking error, mrad",
                    "cost of the left knee, log10",
                ),
            ],
            "How the choice of the weight matters. From 100 on the knee is spared as far as it "
            "can be. What is left is feedback: eq. (16) presses the feet against each other "
            "through forces that the ground cannot all give, corners of the soles lift and "
            "slip, and the joints stray.",
        ),
        text(
            "The paper's rivals have no choice among torques to make: the measured or the "
            "estimated force decides it. Beside them here, the same motion and gains:"
        ),
        _table(rows),
    ]


def _table(rows: dict[str, Any]) -> str:
    def title(name: str) -> str:
        name = name.replace("cost 1e+05", f"cost {COST:,.0f}").replace("cost", "eq. (16), cost")
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


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.fig6_7_weights",
    title="Figures 6 and 7: sparing a knee",
    about=(
        "Sinusoids of 2 Hz at hip, knee and ankle over 6 s. W of eq. (16) is the identity but for "
        "the left knee's entry, 100,000 (the paper's 10⁻⁵ is the entry of W⁻¹, in which eq. (16) "
        "is written)."
    ),
    run=run,
    show=show,
    minutes=0.5,
)

if __name__ == "__main__":
    main(EXPERIMENT)
