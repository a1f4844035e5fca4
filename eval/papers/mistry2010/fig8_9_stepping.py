"""[M10] figures 8 and 9: squatting at 2 Hz, stepping every 3 s, pushed with 200 N."""

import sys
from typing import Any

import numpy as np

from eval.papers.experiment import Experiment, Progress, Result, Setting, main
from eval.papers.log import Log
from eval.papers.mistry2010.stepping_cases import (
    CELLS,
    CROUCHED,
    EVERY,
    EVERY_SECONDS,
    FORCE,
    FORCES,
    LIMITED,
    MOTIONS,
    OURS,
    PAPER,
    ROBOTS,
    SECONDS,
    SHOWN,
    SOON_SECONDS,
    UNPUSHED,
    UPRIGHT,
    carried,
    cell,
    controller,
    fate,
    half_sole,
    random_pushes,
    rivals,
)
from eval.papers.mistry2010.stepping_section import show
from eval.papers.parts import Finding, judged
from eval.papers.trial import Push, Trial, simulate
from fbid_gym.motions.stepping import stepping
from fbid_gym.robots import Robot, load


def run(setting: Setting) -> Result:
    """The long run of each controller and motion, then how much each takes, then the rivals."""
    robot = load("biped")
    motions = {name: stepping(robot, steps) for name, steps in MOTIONS.items()}
    count, every = setting.pick(ROBOTS, 4), setting.pick(EVERY_SECONDS, 1.0)
    seconds = setting.pick(SECONDS, 2.0)
    soon = setting.pick(SOON_SECONDS, seconds)
    times = tuple(np.arange(every, seconds - 1e-9, every).tolist())
    start = np.random.default_rng(2).uniform(0.0, 3.0, count + UNPUSHED)
    pushes = random_pushes(FORCE, times, count, 1)
    progress = iter(
        setting.progress.part(0.0, 0.7, "200 N").parts([f"{n}, {m}, 200 N" for m, n in CELLS])
    )
    long: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for motion, name in CELLS:
        # Others than ours fall soon enough.
        spare, span = (UNPUSHED, seconds) if name == OURS else (0, soon)
        counted = ("steps", "captures") if name == OURS else ()
        trial = Trial(
            robot, motions[motion], span, count + spare, start=start[: count + spare],
            pushes=tuple(_and_none(push, spare) for push in pushes), every=EVERY,
            watch=("base", "base_target", *counted),
        )  # fmt: skip
        log = simulate(trial, controller(robot, motion, name), next(progress))
        row = {"motion": motion, "name": name, "seconds": span}
        row |= _summary(log.of(slice(count)))
        for what in counted:
            row[what] = float(log.watched[what][-1, :count].sum())
        if spare:
            row["unpushed"] = float(log.survived[count:].mean())
        long.append(row)
        if (motion, name) in SHOWN:
            arrays |= log.of([0]).arrays(f"{motion}.{name}.")
    numbers = {
        "long": long, "count": count, "unpushed": UNPUSHED, "seconds": seconds, "every": every,
        "pushes": len(times), "forces": list(setting.pick(FORCES, FORCES[::4])),
    }  # fmt: skip
    numbers["carried"] = {name: carried(robot, steps) for name, steps in MOTIONS.items()}
    numbers["half_sole"] = half_sole(robot)
    numbers["short"] = _forces(
        robot, setting, numbers["forces"], setting.progress.part(0.7, 0.9, "sizes of push")
    )
    numbers["rivals"] = _rivals(robot, setting, setting.progress.part(0.9, 1.0, "rivals"))
    return Result(findings(numbers), numbers, arrays)


def _and_none(push: Push, spare: int) -> Push:
    """The same push, and none for some more robots."""
    force = np.concatenate([push.force, np.zeros((spare, 3))])
    return Push(np.concatenate([push.start, np.zeros(spare)]), push.duration, force)


def _summary(log: Log) -> dict[str, Any]:
    error = np.sqrt((log.rms(log.error) ** 2).mean(axis=1))
    fell = log.fell[~np.isnan(log.fell)]
    return {
        "up": float(log.survived.mean()),
        "first": None if not len(fell) else float(fell.min()),
        "fell": [None if np.isnan(t) else float(t) for t in log.fell],
        "error": float(np.nanmean(error)),
        "base": float(np.nanmean(log.rms(log.watched["base"] - log.watched["base_target"]))),
        "torque": float(np.nanmean(log.rms(log.torque))),
    }


def _forces(
    robot: Robot, setting: Setting, forces: list[float], progress: Progress
) -> list[dict[str, Any]]:
    """Share of robots that survive pushes of each size, all sizes in one batch."""
    each = setting.pick(5, 2)
    times = setting.pick((1.0, 4.0), (0.2,))
    seconds = times[-1] + setting.pick(2.0, 1.0)
    count = each * len(forces)
    start = np.resize(np.random.default_rng(3).uniform(0.0, 3.0, each), count)
    size = np.repeat(forces, each)[:, None]
    pushes = tuple(
        Push(
            np.full(count, push.start[0]),
            push.duration,
            size * np.tile(push.force, (len(forces), 1)),
        )
        for push in random_pushes(1.0, times, each, 4)
    )
    rows = []
    names = (PAPER, LIMITED, OURS)
    motion = stepping(robot, CROUCHED)
    for name, part in zip(names, progress.parts(list(names)), strict=True):
        trial = Trial(robot, motion, seconds, count, start=start, pushes=pushes, every=EVERY)
        log = simulate(trial, controller(robot, "crouched", name), part)
        up = log.survived.reshape(len(forces), each).mean(axis=1)
        rows.append({"name": name, "up": up.tolist()})
    return rows


def _rivals(robot: Robot, setting: Setting, progress: Progress) -> list[dict[str, Any]]:
    """Contact-force feedback while stepping, without pushes and with small ones, side by side."""
    each = setting.pick(4, 2)
    seconds = setting.pick(5.5, 1.0)
    start = np.tile(np.arange(each) * 3.0 / each, 2)
    pushes = tuple(
        _and_none(push, each)
        for push in random_pushes(50.0, setting.pick((1.0, 4.0), (0.2,)), each, 5)
    )
    rows = []
    named = rivals(robot)
    for (name, law), part in zip(named.items(), progress.parts(list(named)), strict=True):
        trial = Trial(
            robot, stepping(robot, UPRIGHT), seconds, 2 * each, start=start, every=EVERY,
            pushes=pushes, watch=("base", "base_target"),
        )  # fmt: skip
        log = simulate(trial, law, part)
        for force, part_of in ((0.0, slice(each, None)), (50.0, slice(each))):
            rows.append({"name": name, "force": force, **_summary(log.of(part_of))})
    return rows


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's claim, for its controller and for ours."""
    count = numbers["count"]
    ours, paper = cell(numbers, "crouched", OURS), cell(numbers, "crouched", PAPER)
    limited, upright = cell(numbers, "crouched", LIMITED), cell(numbers, "upright", PAPER)
    pushed = f"s, {FORCE:.0f} N every {numbers['every']:g} s"
    whole, soon = (f"{row['seconds']:g} {pushed}" for row in (ours, paper))
    return [
        judged(
            f"{whole}: our controller, crouched",
            "stays up (one run, one push shown)",
            f"{round(ours['up'] * count)} of {count} robots stay up",
            "all stay up",
            ours["up"] == 1.0,
        ),
        judged(
            f"{soon}: the paper's controller, eqs. (15), (18)-(20), crouched",
            "stays up",
            fate(paper),
            "all stay up",
            paper["up"] == 1.0,
        ),
        Finding(
            f"{soon}: the paper's controller with limited forces, crouched",
            "",
            fate(limited),
        ),
        Finding(
            f"{soon}: the paper's controller, upright and swaying over each foot",
            "",
            fate(upright),
        ),
    ]


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.fig8_9_stepping",
    title="Figures 8 and 9: squatting, stepping, pushed",
    about=(
        "A squat at 2 Hz, a step of either foot every 3 s with contacts that switch instantly, and "
        "200 N on the base for 150 ms every 5 s in random directions: 60 s. Two stepping motions: "
        "upright with a sway over each foot, and crouched with quick steps. The paper's "
        "controller, and one of ours that also takes steps of its own."
    ),
    run=run,
    show=show,
    minutes=4.0,
)

if __name__ == "__main__":
    sys.exit(main(EXPERIMENT))
