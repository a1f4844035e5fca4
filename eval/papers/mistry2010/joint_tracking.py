"""What figures 4 and 5 share: the squat/bow under PD alone and under PD with inverse dynamics."""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from eval.papers.camera import Camera
from eval.papers.charts import lines, traces
from eval.papers.experiment import Progress, Result, Setting
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import Gains, Limited, Orthogonal, Tracking
from eval.papers.mistry2010.rivals import EstimatedForce, MeasuredForce
from eval.papers.parts import folded, frames, table
from eval.papers.trial import Trial, simulate
from eval.wording import number, percent
from fbid_gym.motions import squat_bow
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


PD, FF, SOFT_PD, LIMITED, MEASURED, ESTIMATED = 1, 0, 5, 2, 3, 4
"""Colours of the controllers."""


def joint_columns(robot: Robot) -> list[int]:
    """Return the places of the joints that the paper shows."""
    return [robot.joint_names.index(name) for name in JOINTS]


def sweep(
    trial: Trial, setting: Setting, law: Orthogonal | None, progress: Progress
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
    many = Trial(robot, trial.motion, trial.seconds, len(pairs), every=EVERY)
    log = simulate(many, Tracking(robot, Gains.of(robot, hertz, zeta), law), progress)
    rms = log.rms(log.error)[:, joint_columns(robot)]
    return [
        {"hertz": f, "zeta": z, "fell": None if np.isnan(t) else float(t), "rms": r.tolist()}
        for (f, z), t, r in zip(pairs, log.fell, rms, strict=True)
    ]


def best(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the gains that stayed up, the one whose three RMS errors have the least sum."""
    standing = [row for row in rows if row["fell"] is None]
    return min(standing or rows, key=lambda row: sum(row["rms"]))


def controllers(robot: Robot, stiff: Gains) -> dict[str, Tracking]:
    """Return what is compared beside the sweep, by name."""
    soft = Gains.of(robot, *SOFT)
    return {
        "PD, best gains": Tracking(robot, stiff),
        "PD, soft gains": Tracking(robot, soft),
        "PD+FF, soft gains": Tracking(robot, soft, Orthogonal()),
        "PD+FF, gains of best PD": Tracking(robot, stiff, Orthogonal()),
        "PD+FF with limited forces": Tracking(robot, soft, Limited.of(robot)),
        "measured force, ideal sensor": Tracking(robot, soft, MeasuredForce.of(robot)),
        "measured force, 5 N noise, 20 Hz filter": Tracking(
            robot, soft, MeasuredForce.of(robot, noise=5.0, cutoff_hz=20.0)
        ),
        "measured force, 10 ms late": Tracking(robot, soft, MeasuredForce.of(robot, delay=5)),
        "force from the previous torque": Tracking(robot, soft, EstimatedForce()),
    }


def run(speed: float, setting: Setting) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Run the sweep of the gains, then each controller on its own; return numbers and arrays."""
    robot = load("biped")
    motion = squat_bow(robot, speed=speed)
    seconds = motion.seconds * setting.pick(1.0, 0.2 if speed < 2 else 0.4)
    trial = Trial(robot, motion, seconds, every=EVERY)
    columns, progress = joint_columns(robot), setting.progress
    alone = sweep(trial, setting, None, progress.part(0.0, 0.2, "gains of PD"))
    both = sweep(trial, setting, Orthogonal(), progress.part(0.2, 0.45, "gains of PD+FF"))
    chosen = best(alone)
    compared = controllers(robot, Gains.of(robot, chosen["hertz"], chosen["zeta"]))
    rows: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for k, (name, controller) in enumerate(compared.items()):
        low, high = (0.45 + 0.55 * part / len(compared) for part in (k, k + 1))
        log = simulate(trial, controller, progress.part(low, high, name))
        rows.append(
            {
                "name": name,
                "rms": log.rms(log.error)[0, columns].tolist(),
                "torque": float(log.rms(log.torque).mean()),
                "feedback": float(log.rms(log.feedback).mean() / log.rms(log.torque).mean()),
                "fell": None if np.isnan(log.fell[0]) else float(log.fell[0]),
            }
        )
        arrays |= log.arrays(f"{name}.")
    numbers = {
        "speed": speed, "seconds": seconds, "rows": rows, "alone": alone, "both": both,
        "best": chosen,
    }  # fmt: skip
    return numbers, arrays


def row(numbers: dict[str, Any], name: str) -> dict[str, Any]:
    """Return what one controller did."""
    return next(found for found in numbers["rows"] if found["name"] == name)


def triple(values: Sequence[float]) -> str:
    """Write the errors of hip, knee and ankle."""
    return ", ".join(error(value) for value in values)


def error(value: float) -> str:
    """Write an RMS error in rad; what is smaller than 0.00005 is not told from zero."""
    return number(value, 2) if value >= 5e-5 else "< 0.00005"


def fate(fell: float | None) -> str:
    """Say whether a robot stayed up."""
    return "stays up" if fell is None else f"falls at {fell:.1f} s"


def controllers_table(numbers: dict[str, Any]) -> str:
    """All controllers: errors, effort, fate."""
    rows = [
        [
            escape(found["name"]),
            *(error(value) for value in found["rms"]),
            number(found["torque"]),
            percent(found["feedback"]),
            fate(found["fell"]),
        ]
        for found in numbers["rows"]
    ]
    heads = ["", *(f"{label}, rad" for label in LABELS)]
    return table([*heads, "torque, N·m", "feedback's share", ""], rows)


def gains_table(numbers: dict[str, Any]) -> str:
    """The whole sweep, folded away."""
    rows = []
    for alone, both in zip(numbers["alone"], numbers["both"], strict=True):
        rows.append(
            [
                f"{alone['hertz']:g} Hz, ζ {alone['zeta']:g}",
                triple(alone["rms"]),
                fate(alone["fell"]),
                triple(both["rms"]),
                fate(both["fell"]),
            ]
        )
    heads = ["gains", "PD: hip, knee, ankle", "", "PD+FF: hip, knee, ankle", ""]
    return folded("The sweep of the gains", table(heads, rows))


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


def joint_charts(result: Result, shown: Sequence[tuple[str, str, int]], robot: Robot) -> list[str]:
    """Joint angles of the paper's three joints over time.

    Args:
        result: of `run`.
        shown: (controller's name, label, colour) of each curve.
        robot: the biped.
    """
    logs = [(Log.from_arrays(result.arrays, f"{name}."), label, c) for name, label, c in shown]
    longest = max((log for log, _, _ in logs), key=lambda log: len(log.time))
    charts = []
    for column, label in zip(joint_columns(robot), LABELS, strict=True):
        curves = [("desired", 7, longest.target[:, 0, column])]
        for log, name, colour in logs:
            angle = np.where(log.up[:, 0], log.qpos[:, 0, 7 + column], np.nan)
            padding = np.full(len(longest.time) - len(angle), np.nan)
            curves.append((name, colour, np.concatenate([angle, padding])))
        charts.append(traces(longest.time, curves, f"Left {label}, rad"))
    return charts


def error_charts(result: Result, shown: Sequence[tuple[str, str, int]], robot: Robot) -> list[str]:
    """Tracking errors of the same joints over time, mrad."""
    logs = [(Log.from_arrays(result.arrays, f"{name}."), label, c) for name, label, c in shown]
    longest = max((log for log, _, _ in logs), key=lambda log: len(log.time))
    charts = []
    for column, label in zip(joint_columns(robot), LABELS, strict=True):
        curves = []
        for log, name, colour in logs:
            wrong = np.where(log.up[:, 0], 1e3 * log.error[:, 0, column], np.nan)
            padding = np.full(len(longest.time) - len(wrong), np.nan)
            curves.append((name, colour, np.concatenate([wrong, padding])))
        charts.append(traces(longest.time, curves, f"Left {label}, error in mrad"))
    return charts


def pictures(
    result: Result, name: str, moments: Sequence[float], caption: str, after: float = 0.0
) -> str:
    """A strip of frames of one controller's robot.

    Args:
        result: of `run`.
        name: of the controller.
        moments: s; those beyond the log are left out.
        caption: HTML.
        after: s of a fall to show.
    """
    log = Log.from_arrays(result.arrays, f"{name}.")
    rows = [int(np.searchsorted(log.time, t - 1e-6)) for t in moments if t <= log.time[-1] + after]
    rows = [min(k, len(log.time) - 1) for k in rows]
    with Camera(load("biped"), 224, 300, nearer=1.25) as camera:
        labels = [f"{log.time[k]:.1f} s" for k in rows]
        images = camera.strip(log.qpos[rows, 0], log.push[rows, 0], labels)
    return frames(images, caption, f"the robot at {', '.join(labels)}")
