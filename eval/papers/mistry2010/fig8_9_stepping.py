"""[M10] figures 8 and 9: squatting at 2 Hz, stepping every 3 s, pushed with 200 N."""

from typing import Any

import numpy as np

from eval.papers.experiment import Experiment, Progress, Result, Setting, main, row
from eval.papers.log import Log
from eval.papers.mistry2010 import stepping_cases as cases
from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.stepping_cases import EVERY, FORCE, LIMITED, OURS, PAPER, UNPUSHED
from eval.papers.mistry2010.stepping_section import show
from eval.papers.page import Finding, judged
from eval.papers.trial import Push, Trial, pushed, simulate
from fbid_gym.motions import stepping
from fbid_gym.robots import Robot, load


def run(setting: Setting) -> Result:
    """The long run of each controller and motion, then how much each takes, then the rivals."""
    robot = load("biped")
    motions = {name: stepping(robot, steps) for name, steps in cases.MOTIONS.items()}
    count, every = setting.pick(cases.ROBOTS, 4), setting.pick(cases.EVERY_SECONDS, 1.0)
    seconds = setting.pick(cases.SECONDS, 2.0)
    soon = setting.pick(cases.SOON_SECONDS, seconds)
    times = tuple(np.arange(every, seconds - 1e-9, every).tolist())
    start = np.random.default_rng(2).uniform(0.0, 3.0, count + UNPUSHED)
    pushes = cases.random_pushes(FORCE, times, count, 1)
    long: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    runs = setting.progress.part(0.0, 0.7, "200 N")
    for (motion, name), progress in runs.each(cases.CELLS, ", ".join):
        # Others than ours fall soon enough.
        spare, span = (UNPUSHED, seconds) if name == OURS else (0, soon)
        counted = ("steps", "captures") if name == OURS else ()
        trial = Trial(
            robot, following(motions[motion]), span, count + spare, start=start[: count + spare],
            disturb=pushed(*(_and_none(push, spare) for push in pushes)), every=EVERY,
            watch=("base", "base_target", *counted),
        )  # fmt: skip
        log = simulate(trial, cases.controller(robot, motion, name), progress)
        run = {"motion": motion, "name": name, "seconds": span}
        run |= _summary(log.of(slice(count)))
        for what in counted:
            run[what] = float(log[what][-1, :count].sum())
        if spare:
            run["unpushed"] = float(log.survived[count:].mean())
        long.append(run)
        if (motion, name) in cases.SHOWN:
            arrays |= log.of([0]).arrays(f"{motion}.{name}.")
    numbers = {
        "long": long, "count": count, "unpushed": UNPUSHED, "seconds": seconds, "every": every,
        "pushes": len(times), "forces": list(setting.pick(cases.FORCES, cases.FORCES[::4])),
    }  # fmt: skip
    numbers["carried"] = {k: cases.carried(robot, steps) for k, steps in cases.MOTIONS.items()}
    numbers["half_sole"] = cases.half_sole(robot)
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
    fell = log.fell[~np.isnan(log.fell)]
    return {
        "up": float(log.survived.mean()),
        "first": None if not len(fell) else float(fell.min()),
        "fell": [log.fall(k) for k in range(len(log.fell))],
        "error": float(np.nanmean(log.rms_of_joints(log.error))),
        "base": float(np.nanmean(log.rms(log["base"] - log["base_target"]))),
        "torque": float(np.nanmean(log.rms(log["torque"]))),
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
    pushes = (
        Push(np.resize(begin, count), span, size * np.tile(force, (len(forces), 1)))
        for begin, span, force in cases.random_pushes(1.0, times, each, 4)
    )
    rows = []
    names = (PAPER, LIMITED, OURS)
    motion = following(stepping(robot, cases.CROUCHED))
    trial = Trial(robot, motion, seconds, count, start=start, disturb=pushed(*pushes), every=EVERY)
    for name, part in progress.each(names):
        log = simulate(trial, cases.controller(robot, "crouched", name), part)
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
        for push in cases.random_pushes(50.0, setting.pick((1.0, 4.0), (0.2,)), each, 5)
    )
    rows = []
    named = cases.rivals(robot)
    plan = following(stepping(robot, cases.UPRIGHT))
    trial = Trial(
        robot, plan, seconds, 2 * each, start=start, every=EVERY, disturb=pushed(*pushes),
        watch=("base", "base_target"),
    )  # fmt: skip
    for name, part in progress.each(named):
        log = simulate(trial, named[name], part)
        for force, part_of in ((0.0, slice(each, None)), (50.0, slice(each))):
            rows.append({"name": name, "force": force, **_summary(log.of(part_of))})
    return rows


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's claim, for its controller and for ours."""
    count = numbers["count"]
    ours, paper, limited = (
        row(numbers["long"], motion="crouched", name=name) for name in (OURS, PAPER, LIMITED)
    )
    upright = row(numbers["long"], motion="upright", name=PAPER)
    pushes = f"s, {FORCE:.0f} N every {numbers['every']:g} s"
    whole, soon = (f"{run['seconds']:g} {pushes}" for run in (ours, paper))
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
            cases.outcome(paper),
            "all stay up",
            paper["up"] == 1.0,
        ),
        Finding(
            f"{soon}: the paper's controller with limited forces, crouched",
            "",
            cases.outcome(limited),
        ),
        Finding(
            f"{soon}: the paper's controller, upright and swaying over each foot",
            "",
            cases.outcome(upright),
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
    main(EXPERIMENT)
