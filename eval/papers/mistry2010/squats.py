"""[M10] figures 3 to 5: the squat/bow under PD alone and under PD with inverse dynamics."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from eval.page.figures import lines
from eval.page.html import columns, figure, folded, text
from eval.papers.camera import Camera, logged
from eval.papers.experiment import (
    Finding,
    Progress,
    Result,
    Setting,
    experiment,
    fate,
    judged,
    prose,
    row,
)
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import Law, limited, measured, orthogonal, rivals
from eval.papers.trial import Trial, simulate
from eval.papers.wrong_models import believing, wrong_model
from eval.wording import number, percent
from fbid_gym.motions import squat_bow
from fbid_gym.robots import Robot, load

JOINTS = {"hip": "left_hip_pitch", "knee": "left_knee", "ankle": "left_ankle_pitch"}
ZETAS = (0.3, 0.5, 1.0)
HERTZ = (1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0)
"""The sweep of the gains of PD alone: natural frequencies in stance, and damping ratios."""

SOFT = (1.6, 0.5)
"""Hz and damping ratio at which PD alone errs in the slow motion about as the paper's PD does."""

WRONG, MODELS = (0.02, 0.05), 5
"""Largest relative errors of the masses and centres of mass of wrong models, and how many each."""

EVERY = 5
"""Control ticks from one logged tick to the next."""

PD, FF, BEST = "PD, soft gains", "PD+FF, soft gains", "PD, best gains"
SHOWN = ((PD, "PD, soft", 5), (BEST, "PD, best", 1), (FF, "PD+FF, soft", 0))
RIVALS = (
    ("force from the previous torque", "previous torque", 4),
    ("measured force, 10 ms late", "measured, 10 ms late", 3),
    ("measured force, ideal sensor", "measured, ideal", 2),
    (FF, "PD+FF", 0),
)
"""Name, label and colour of the controllers whose curves are drawn."""


def joint_columns(robot: Robot) -> list[int]:
    """Return the places of the joints that the paper shows."""
    return [robot.joint_names.index(name) for name in JOINTS.values()]


class Measured(NamedTuple):
    """What came out.

    Attributes:
        numbers: for the record.
        logs: of each controller on its own.
    """

    numbers: dict[str, Any]
    logs: dict[str, Log]


def measure(speed: float, setting: Setting) -> Measured:
    """Run the sweep of the gains, then each controller on its own."""
    robot = load("biped")
    motion = squat_bow(robot, speed=speed)
    seconds = motion.seconds * setting.pick(1.0, 0.2 if speed < 2 else 0.4)
    trial = Trial(robot, following(motion), seconds, every=EVERY)
    joints, progress = joint_columns(robot), setting.progress
    pairs = setting.pick(
        [(f, z) for z in ZETAS for f in HERTZ], [(f, z) for z in (0.3, 1.0) for f in HERTZ[1::2]]
    )
    sweeps: dict[str, list[dict[str, Any]]] = {}
    for name, law, part in (
        ("alone", None, progress.part(0.0, 0.2, "gains of PD")),
        ("both", orthogonal(), progress.part(0.2, 0.45, "gains of PD+FF")),
    ):
        gains = PdGains.of(robot, *np.array(pairs).T)
        many = replace(trial, num_robots=len(pairs))
        log = simulate(many, JointController(robot, gains, law), part)
        rms = log.rms(log.error)[:, joints]
        sweeps[name] = [
            {"hertz": f, "zeta": z, "fell": log.fall(k), "rms": rms[k].tolist()}
            for k, (f, z) in enumerate(pairs)
        ]
    standing = [row for row in sweeps["alone"] if row["fell"] is None]
    best = min(standing or sweeps["alone"], key=lambda row: sum(row["rms"]))
    soft, stiff = PdGains.of(robot, *SOFT), PdGains.of(robot, best["hertz"], best["zeta"])
    ideal, late, previous = rivals(robot).items()
    noisy = measured(robot, noise=5.0, cutoff_hz=20.0)
    compared: dict[str, tuple[PdGains, Law | None]] = {
        BEST: (stiff, None),
        PD: (soft, None),
        FF: (soft, orthogonal()),
        "PD+FF, gains of best PD": (stiff, orthogonal()),
        "PD+FF with limited forces": (soft, limited(robot)),
        ideal[0]: (soft, ideal[1]),
        "measured force, 5 N noise, 20 Hz filter": (soft, noisy),
        late[0]: (soft, late[1]),
        previous[0]: (soft, previous[1]),
    }
    rows, logs = [], {}
    for name, part in progress.part(0.45, 0.9).each(compared):
        log = logs[name] = simulate(trial, JointController(robot, *compared[name]), part)
        torque = log.rms(log["torque"]).mean()
        rms, feedback = log.rms(log.error)[0, joints], log.rms(log["feedback"]).mean() / torque
        row = {"name": name, "rms": rms.tolist(), "torque": float(torque)}
        rows.append(row | {"feedback": float(feedback), "fell": log.fall()})
    numbers = {"speed": speed, "seconds": seconds, "rows": rows, **sweeps, "best": best}
    numbers["wrong"] = _wrong(trial, soft, setting.pick(MODELS, 2), progress.part(0.9, 1.0))
    return Measured(numbers, logs)


def _wrong(trial: Trial, gains: PdGains, count: int, progress: Progress) -> list[dict[str, Any]]:
    """Run PD+FF with wrong models of each size, all in one batch."""
    robot, rng = trial.robot, np.random.default_rng(20100503)
    models = [wrong_model(robot, size, rng) for size in WRONG for _ in range(count)]
    trial = replace(trial, num_robots=len(models), believe=believing(models))
    log = simulate(trial, JointController(robot, gains, orthogonal()), progress)
    rows = []
    for size, some in zip(WRONG, log.groups(count), strict=True):
        rms = some.rms(some.error)[:, joint_columns(robot)]
        found = {"rms": np.median(rms, axis=0), "least": rms.min(axis=0), "most": rms.max(axis=0)}
        row = {"size": size, "models": count, "up": float(some.survived.mean())}
        rows.append(row | {name: value.tolist() for name, value in found.items()})
    return rows


def triple(values: Sequence[float]) -> str:
    """Write the errors of hip, knee and ankle."""
    return ", ".join(error(value) for value in values)


def error(value: float) -> str:
    """Write an RMS error in rad; what is smaller than 0.00005 is not told from zero."""
    return number(value, 2) if value >= 5e-5 else "< 0.00005"


def no_worse(ours: dict[str, Any], paper: Sequence[float]) -> Finding:
    """Judge the errors of PD+FF by the paper's."""
    small = all(a <= b for a, b in zip(ours["rms"], paper, strict=True))
    what = "RMS error of hip, knee, ankle with PD+FF, rad"
    stood = small and ours["fell"] is None
    return judged(what, triple(paper), triple(ours["rms"]), "no worse than the paper's", stood)


def wrong_models(numbers: dict[str, Any], paper: Sequence[float]) -> list[Finding]:
    """Tell the errors of PD+FF with wrong models beside the paper's."""
    return [
        Finding(
            f"the same with links wrong by up to {percent(row['size'])}, median of "
            f"{row['models']} models",
            triple(paper),
            f"{triple(row['rms'])} (from {triple(row['least'])} to {triple(row['most'])}); "
            f"{percent(row['up'])} stay up",
        )
        for row in numbers["wrong"]
    ]


def best_gains(numbers: dict[str, Any]) -> str:
    """Name the gains with which PD alone erred least."""
    best = numbers["best"]
    return f"the best gains of the sweep ({best['hertz']:g} Hz, ζ {best['zeta']:g})"


def controllers_table(found: Measured) -> str:
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
    return columns(found.numbers["rows"], cells)


def gains_table(found: Measured) -> str:
    """The whole sweep, folded away."""
    cells = (
        ("gains", lambda both: f"{both[0]['hertz']:g} Hz, ζ {both[0]['zeta']:g}"),
        ("PD: hip, knee, ankle", lambda both: triple(both[0]["rms"])),
        ("", lambda both: fate(both[0]["fell"])),
        ("PD+FF: hip, knee, ankle", lambda both: triple(both[1]["rms"])),
        ("", lambda both: fate(both[1]["fell"])),
    )
    pairs = zip(found.numbers["alone"], found.numbers["both"], strict=True)
    return folded("The sweep of the gains", columns(pairs, cells))


def joint_charts(found: Measured, zeta: float = 0.5) -> list[str]:
    """The paper's three joints over time, and the knee's error against the gain: falls end it."""
    logs = [(label, colour, found.logs[name]) for name, label, colour in SHOWN]
    longest = max(found.logs.values(), key=lambda log: len(log.time))
    charts = [
        logged(
            [("desired", 7, longest, longest["target"][:, 0, k])]
            + [(*curve, curve[-1]["qpos"][:, 0, 7 + k]) for curve in logs],
            f"Left {label}, rad",
        )
        for k, label in zip(joint_columns(load("biped")), JOINTS, strict=True)
    ]
    curves = []
    for name, colour, rows in (
        ("PD", 1, found.numbers["alone"]),
        ("PD+FF", 0, found.numbers["both"]),
    ):
        some = [r for r in rows if r["zeta"] == zeta] or [r for r in rows if r["zeta"] == 1.0]
        errors = [1e3 * r["rms"][1] if r["fell"] is None else np.nan for r in some]
        curves.append((name, colour, errors))
    hertz = [r["hertz"] for r in some]
    return [*charts, lines(hertz, curves, "Knee, RMS error, mrad", "gains, Hz")]


def error_charts(found: Measured) -> list[str]:
    """Tracking errors of the rivals at the same joints over time, mrad."""
    logs = [(label, colour, found.logs[name]) for name, label, colour in RIVALS]
    return [
        logged(
            [(*curve, 1e3 * curve[-1].error[:, 0, k]) for curve in logs],
            f"Left {label}, error in mrad",
        )
        for k, label in zip(joint_columns(load("biped")), JOINTS, strict=True)
    ]


def pictures(log: Log, moments: Sequence[float], caption: str) -> str:
    """A strip of one controller's robot at some moments, s; those beyond the log are left out."""
    there = [t for t in moments if t <= log.time[-1]]
    with Camera(load("biped"), 224, 300, nearer=1.25) as camera:
        times = ", ".join(f"{t:.1f} s" for t in log.time[log.at(there)])
        return camera.strip(log, there, caption, f"the robot at {times}")


@experiment(
    "Figures 3 and 4: a slow squat and bow",
    """A deep squat every 5 s with a bow every 10 s, 30 s in all, planned in the null space of the
    contacts; no balance controller. The gains of PD alone are the best of a sweep of natural
    frequencies from 1 to 10 Hz and damping ratios from 0.3 to 1.""",
)
def fig4_slow_squat(setting: Setting) -> Result:
    """Run every controller over the slow motion."""
    found = measure(1.0, setting)
    rows = found.numbers["rows"]
    ours, stiff, soft = (row(rows, name=name) for name in (FF, BEST, PD))
    alone = f"with PD alone, gains that err like the paper's ({SOFT[0]:g} Hz, ζ {SOFT[1]:g})"
    paper = (0.001, 0.011, 0.005)
    findings = [
        no_worse(ours, paper),
        *wrong_models(found.numbers, paper),
        Finding(
            alone, triple((0.008, 0.076, 0.021)), f"{triple(soft['rms'])}; {fate(soft['fell'])}"
        ),
        Finding(
            f"with PD alone, {best_gains(found.numbers)}",
            "not given",
            f"{triple(stiff['rms'])}; {fate(stiff['fell'])}",
        ),
    ]
    body = [
        pictures(
            found.logs[FF],
            (0.0, 2.5, 5.0, 7.5, 10.0, 17.5, 22.5),
            "PD with inverse dynamics. The trunk bows while the legs squat; from 20 s the knees "
            "reach full extension between squats.",
        ),
        figure(
            joint_charts(found),
            "Left leg, as the paper's figure 4. Where PD+FF covers what is desired, the curves "
            "cannot be told apart. Last: the error against the gains; PD has to be stiff to be "
            "accurate, and too stiff it shakes itself down. PD+FF does not depend on the gains.",
        ),
        prose("""The same motion with every controller, at the same soft gains but for the best PD.
            Contact-force feedback, eq. (8), knows the same model; what it does not have is the
            force that its own torque is about to cause."""),
        controllers_table(found),
        figure(
            error_charts(found),
            "Errors of the paper's rivals. A force that is measured arrives a step after the "
            "torque that caused it; nothing restores the part of the torque that only presses the "
            "feet against each other, so it wanders, and delay makes it swing. The estimate from "
            "the previous torque adds the feedback's share of that part up.",
            3,
        ),
        gains_table(found),
    ]
    return Result(findings, found.numbers, body)


@experiment(
    "Figure 5: five times faster",
    """The same motion in 6 s: a squat a second, full extension of the knees at their joint limit
    from 4 s on. No balance controller.""",
)
def fig5_fast_squat(setting: Setting) -> Result:
    """Run every controller over the fast motion."""
    found = measure(5.0, setting)
    rows, sweep = found.numbers["rows"], found.numbers["alone"]
    ours, stiff, soft = (row(rows, name=name) for name in (FF, BEST, PD))
    paper = (0.005, 0.109, 0.052)
    stood, slow = fate(ours["fell"]), "gains that err like the paper's in the slow motion"
    findings = [
        judged(
            "PD+FF through full knee extension", "stays up", stood, "stays up", ours["fell"] is None
        ),
        no_worse(ours, paper),
        *wrong_models(found.numbers, paper),
        judged(
            f"PD alone, {slow}", "falls within 1 s", fate(soft["fell"]), "falls",
            soft["fell"] is not None,
        ),
        Finding(
            f"PD alone, {best_gains(found.numbers)}",
            "not given",
            f"{fate(stiff['fell'])}; {triple(stiff['rms'])}",
        ),
        Finding(
            "PD alone, gains of the sweep that fall",
            "",
            f"{sum(gains['fell'] is not None for gains in sweep)} of {len(sweep)}",
        ),
    ]  # fmt: skip
    body = [
        pictures(
            found.logs[FF],
            (0.0, 0.5, 1.0, 1.5, 4.0, 4.5, 5.0),
            "PD with inverse dynamics. At 4 and 5 s the knees are at their limit.",
        ),
        pictures(
            found.logs[PD], (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5), "PD alone at the same gains."
        ),
        figure(
            joint_charts(found),
            "Left leg, as the paper's figure 5. A curve ends where the robot falls.",
        ),
        controllers_table(found),
        figure(
            error_charts(found),
            "Errors of the paper's rivals on the same motion, at the same gains.",
            3,
        ),
        text(
            "PD alone does not have to fall: stiff enough, it follows the planned motion, which "
            "keeps the centre of mass over the feet. It falls at gains at which it errs as much as "
            "the paper's PD does."
        ),
        gains_table(found),
    ]
    return Result(findings, found.numbers, body)
