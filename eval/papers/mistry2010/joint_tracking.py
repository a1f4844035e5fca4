"""What figures 4 and 5 share: the squat/bow under PD alone and under PD with inverse dynamics."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eval.page.figures import lines
from eval.page.html import columns, folded
from eval.papers.camera import Camera, logged
from eval.papers.experiment import Progress, Result, Setting
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains
from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.laws import Law, Limited, MeasuredForce, orthogonal, rivals
from eval.papers.page import fate
from eval.papers.trial import Trial, simulate
from eval.wording import number, percent
from fbid_gym.motions import squat_bow
from fbid_gym.quantities import Target
from fbid_gym.robots import Robot, load

JOINTS = ("left_hip_pitch", "left_knee", "left_ankle_pitch")
LABELS = ("hip", "knee", "ankle")

ZETAS = (0.3, 0.5, 1.0)
HERTZ = (1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0)
"""The sweep of the gains of PD alone: natural frequencies in stance, and damping ratios."""

SOFT = (1.6, 0.5)
"""Hz and damping ratio at which PD alone errs in the slow motion about as the paper's PD does."""

EVERY = 5
"""Control ticks from one logged tick to the next."""


PD, FF = 1, 0
SHOWN = (
    ("PD, soft gains", "PD, soft", 5),
    ("PD, best gains", "PD, best", PD),
    ("PD+FF, soft gains", "PD+FF, soft", FF),
)
RIVALS = (
    ("force from the previous torque", "previous torque", 4),
    ("measured force, 10 ms late", "measured, 10 ms late", 3),
    ("measured force, ideal sensor", "measured, ideal", 2),
    ("PD+FF, soft gains", "PD+FF", FF),
)
"""Name, label and colour of the controllers whose curves are drawn."""


def joint_columns(robot: Robot) -> list[int]:
    """Return the places of the joints that the paper shows."""
    return [robot.joint_names.index(name) for name in JOINTS]


def sweep(
    trial: Trial[Target], setting: Setting, law: Law | None, progress: Progress
) -> list[dict[str, Any]]:
    """Run the motion with every gain of the sweep, all in one batch.

    Returns:
        hertz, zeta, fell (s or None) and rms (rad of the three joints) of each gain.
    """
    pairs = [(f, z) for z in ZETAS for f in HERTZ]
    if setting.quick:
        pairs = [(f, z) for z in (0.3, 1.0) for f in HERTZ[1::2]]
    hertz, zeta = np.array(pairs).T
    robot = trial.robot
    many = replace(trial, num_robots=len(pairs))
    log = simulate(many, JointController(robot, PdGains.of(robot, hertz, zeta), law), progress)
    rms = log.rms(log.error)[:, joint_columns(robot)]
    return [
        {"hertz": f, "zeta": z, "fell": log.fall(k), "rms": rms[k].tolist()}
        for k, (f, z) in enumerate(pairs)
    ]


def best(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the gains that stayed up, the one whose three RMS errors have the least sum."""
    standing = [row for row in rows if row["fell"] is None]
    return min(standing or rows, key=lambda row: sum(row["rms"]))


def controllers(robot: Robot, stiff: PdGains) -> dict[str, JointController]:
    """Return what is compared beside the sweep, by name."""
    soft = PdGains.of(robot, *SOFT)
    ideal, late, previous = rivals(robot).items()
    noisy = MeasuredForce.of(robot, noise=5.0, cutoff_hz=20.0)
    laws: dict[str, tuple[PdGains, Law | None]] = {
        "PD, best gains": (stiff, None),
        "PD, soft gains": (soft, None),
        "PD+FF, soft gains": (soft, orthogonal()),
        "PD+FF, gains of best PD": (stiff, orthogonal()),
        "PD+FF with limited forces": (soft, Limited.of(robot)),
    }
    beside = dict([ideal, ("measured force, 5 N noise, 20 Hz filter", noisy), late, previous])
    laws |= {name: (soft, law) for name, law in beside.items()}
    return {name: JointController(robot, gains, law) for name, (gains, law) in laws.items()}


def run(speed: float, setting: Setting) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Run the sweep of the gains, then each controller on its own; return numbers and arrays."""
    robot = load("biped")
    motion = squat_bow(robot, speed=speed)
    seconds = motion.seconds * setting.pick(1.0, 0.2 if speed < 2 else 0.4)
    trial = Trial(robot, following(motion), seconds, every=EVERY)
    joints, progress = joint_columns(robot), setting.progress
    alone = sweep(trial, setting, None, progress.part(0.0, 0.2, "gains of PD"))
    both = sweep(trial, setting, orthogonal(), progress.part(0.2, 0.45, "gains of PD+FF"))
    chosen = best(alone)
    compared = controllers(robot, PdGains.of(robot, chosen["hertz"], chosen["zeta"]))
    rows: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for name, part in progress.part(0.45, 1.0).each(compared):
        log = simulate(trial, compared[name], part)
        rows.append(
            {
                "name": name,
                "rms": log.rms(log.error)[0, joints].tolist(),
                "torque": float(log.rms(log["torque"]).mean()),
                "feedback": float(log.rms(log["feedback"]).mean() / log.rms(log["torque"]).mean()),
                "fell": log.fall(),
            }
        )
        arrays |= log.arrays(f"{name}.")
    numbers = {
        "speed": speed, "seconds": seconds, "rows": rows, "alone": alone, "both": both,
        "best": chosen,
    }  # fmt: skip
    return numbers, arrays


def triple(values: Sequence[float]) -> str:
    """Write the errors of hip, knee and ankle."""
    return ", ".join(error(value) for value in values)


def error(value: float) -> str:
    """Write an RMS error in rad; what is smaller than 0.00005 is not told from zero."""
    return number(value, 2) if value >= 5e-5 else "< 0.00005"


def controllers_table(numbers: dict[str, Any]) -> str:
    """All controllers: errors, effort, fate."""
    cells = (
        ("", lambda row: row["name"]),
        ("hip, rad", lambda row: error(row["rms"][0])),
        ("knee, rad", lambda row: error(row["rms"][1])),
        ("ankle, rad", lambda row: error(row["rms"][2])),
        ("torque, N·m", lambda row: number(row["torque"])),
        ("feedback's share", lambda row: percent(row["feedback"])),
        ("", lambda row: fate(row["fell"])),
    )
    return columns(numbers["rows"], cells)


def gains_table(numbers: dict[str, Any]) -> str:
    """The whole sweep, folded away."""
    cells = (
        ("gains", lambda both: f"{both[0]['hertz']:g} Hz, ζ {both[0]['zeta']:g}"),
        ("PD: hip, knee, ankle", lambda both: triple(both[0]["rms"])),
        ("", lambda both: fate(both[0]["fell"])),
        ("PD+FF: hip, knee, ankle", lambda both: triple(both[1]["rms"])),
        ("", lambda both: fate(both[1]["fell"])),
    )
    pairs = zip(numbers["alone"], numbers["both"], strict=True)
    return folded("The sweep of the gains", columns(pairs, cells))


def gains_chart(numbers: dict[str, Any], zeta: float = 0.5) -> str:
    """Knee error against gain; a fall ends a curve."""
    curves = []
    for name, colour, rows in (("PD", PD, numbers["alone"]), ("PD+FF", FF, numbers["both"])):
        chosen = [r for r in rows if r["zeta"] == zeta] or [r for r in rows if r["zeta"] == 1.0]
        curves.append(
            (name, colour, [1e3 * r["rms"][1] if r["fell"] is None else np.nan for r in chosen])
        )
    hertz = [r["hertz"] for r in chosen]
    return lines(hertz, curves, "Knee, RMS error, mrad", "gains, Hz")


def joint_charts(result: Result) -> list[str]:
    """Joint angles of the paper's three joints over time."""
    logs = _logs(result, SHOWN)
    longest = max((log for _, _, log in logs), key=lambda log: len(log.time))
    return [
        logged(
            [("desired", 7, longest, longest["target"][:, 0, k])]
            + [(*curve, curve[-1]["qpos"][:, 0, 7 + k]) for curve in logs],
            f"Left {label}, rad",
        )
        for k, label in zip(joint_columns(load("biped")), LABELS, strict=True)
    ]


def error_charts(result: Result) -> list[str]:
    """Tracking errors of the same joints over time, mrad."""
    logs = _logs(result, RIVALS)
    return [
        logged(
            [(*curve, 1e3 * curve[-1].error[:, 0, k]) for curve in logs],
            f"Left {label}, error in mrad",
        )
        for k, label in zip(joint_columns(load("biped")), LABELS, strict=True)
    ]


def _logs(result: Result, shown: Sequence[tuple[str, str, int]]) -> list[tuple[str, int, Log]]:
    return [(label, c, Log.from_arrays(result.arrays, f"{name}.")) for name, label, c in shown]


def pictures(result: Result, name: str, moments: Sequence[float], caption: str) -> str:
    """A strip of frames of one controller's robot.

    Args:
        result: of `run`.
        name: of the controller.
        moments: s; those beyond the log are left out.
        caption: HTML.
    """
    log = Log.from_arrays(result.arrays, f"{name}.")
    there = [t for t in moments if t <= log.time[-1]]
    with Camera(load("biped"), 224, 300, nearer=1.25) as camera:
        times = ", ".join(f"{t:.1f} s" for t in log.time[log.at(there)])
        return camera.strip(log, there, caption, f"the robot at {times}")
