"""[M10] figures 6 and 7: weights that spare the left knee, eq. (16), in a squat at 2 Hz."""

import numpy as np
from scipy.optimize import brentq

from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import Law, orthogonal, rivals
from eval.papers.trial import Trial, simulate
from eval.wording import number
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


def summary(robot: Robot, log: Log) -> Numbers:
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


def changes(row: Numbers, free: Numbers) -> dict[str, float]:
    """Torque of each joint, of that without weights."""
    return dict(zip(NAMES, np.divide(row["torque"], free["torque"]), strict=True))


@experiment(
    "Figures 6 and 7: sparing a knee",
    """Sinusoids of 2 Hz at hip, knee and ankle over 6 s. W of eq. (16) is the identity but for the
    left knee's entry, 100,000 (the paper's 10⁻⁵ is the entry of W⁻¹, in which eq. (16) is
    written); beside it the entry at which the knee is spared as much as in the paper.""",
    minutes=0.7,
)
def fig6_7_weights(setting: Setting) -> Measured:
    """Squat with each weight, without, with PD alone, and with the paper's rivals."""
    robot = load("biped")
    trial = Trial(robot, following(periodic_squat(robot, frequency=2.0)), setting.pick(6.0, 3.0))
    gains, costs = PdGains.of(robot, *GAINS), setting.pick(COSTS, (1.0, 10.0, COST))
    laws: dict[str, Law | None] = {"PD alone": None}
    laws |= {f"cost {cost:g}": orthogonal(knee_cost(robot, cost)) for cost in costs}
    laws |= rivals(robot)
    rows: Numbers = {}
    for name in setting.each(laws, 0.7):
        rows[name] = summary(robot, simulate(trial, JointController(robot, gains, laws[name])))
    free, spared, alone = rows["cost 1"], rows[f"cost {COST:g}"], rows["PD alone"]

    def as_paper(decade: float) -> float:
        law = orthogonal(knee_cost(robot, 10.0**decade))
        rows["as the paper"] = summary(robot, simulate(trial, JointController(robot, gains, law)))
        return float(np.log(changes(rows["as the paper"], free)["left knee"] * SPARED))

    cost = 10.0 ** brentq(as_paper, 0.0, np.log10(COST), xtol=0.01)
    errors = {name: float(np.linalg.norm(row["error"])) for name, row in rows.items()}
    weighted = {name: changes(rows[name], free) for name in (f"cost {c:g}" for c in costs)}
    change, as_there = weighted[f"cost {COST:g}"], changes(rows["as the paper"], free)
    beside = {"left knee": 1.0 / SPARED, **PAYING}
    order = ("left knee", "left ankle", "right knee", "right hip", "left hip")
    numbers = {"rows": rows, "costs": list(costs), "cost as the paper": cost}
    return numbers, {
        **{"free": free, "spared": spared, "alone": alone, "cost": cost, "error": errors},
        **{"change": change, "as_there": as_there, "names": NAMES, "paying": PAYING},
        "errors": [errors[name] for name in ("cost 1", f"cost {COST:g}", "PD alone")],
        "decades": [float(np.log10(cost)) for cost in costs],
        "torques": [(j, k, [one[j] for one in weighted.values()]) for k, j in enumerate(order)],
        "strayed": [("weighted", 0, [1e3 * errors[name] for name in weighted])]
        + [("PD alone", 5, [1e3 * errors["PD alone"]] * len(costs))],
        "beside": list(beside),
        "compared": [
            ("paper", 7, list(beside.values())),
            (f"cost {number(cost, 2)}", 2, [as_there[name] for name in beside]),
            (f"cost {COST:,.0f}", 0, [change[name] for name in beside]),
        ],
        "shown": [
            {"name": label} | row
            for label, row in (("W = I", free), ("weighted", spared), ("PD alone", alone))
        ],
    }
