"""[M10] figures 8 and 9: squatting at 2 Hz, stepping every 3 s, pushed with 200 N."""

import sys
from html import escape
from typing import Any

import numpy as np

from eval.papers.camera import Camera
from eval.papers.charts import lines, traces
from eval.papers.experiment import Experiment, Progress, Result, Setting, main
from eval.papers.log import Log
from eval.papers.mistry2010.balance import BaseTask, Stabiliser
from eval.papers.mistry2010.controllers import (
    Feedforward,
    Gains,
    Limited,
    Orthogonal,
    Tracking,
)
from eval.papers.mistry2010.joint_tracking import JOINTS, LABELS
from eval.papers.mistry2010.rivals import EstimatedForce, MeasuredForce
from eval.papers.parts import Finding, figure, frames, heading, judged, table, text, video
from eval.papers.trial import Push, Trial, simulate
from eval.wording import number, percent
from fbid_gym.control import ContactLimits
from fbid_gym.dynamics.support import Support
from fbid_gym.motions.stepping import Steps, stepping
from fbid_gym.robots import Robot, load

FORCE, PUSH_SECONDS, EVERY_SECONDS, SECONDS = 200.0, 0.15, 5.0, 60.0
ROBOTS = 24

UPRIGHT = Steps()
"""The centre of mass sways over one foot before the other is lifted."""

QUICK = Steps(knee=1.6, amplitude=0.05, sway=0.02, single=0.05, lift=(-0.1, 0.2, -0.1), ramp=0.07)
"""Deep in the knees, and each foot is up for 0.15 s only: the robot hops from foot to foot."""

MOTIONS = {"upright": UPRIGHT, "crouched": QUICK}
PAPER, LIMITED, OURS = "eqs. (15), (19)", "the same, limited forces", "stabiliser, limited forces"
COLOURS = {PAPER: 0, LIMITED: 2, OURS: 4}
FORCES = (50.0, 100.0, 150.0, 200.0)
EVERY = 10


def controllers(robot: Robot) -> dict[str, Tracking]:
    """Return the paper's controller, the same with limited forces, and ours."""
    soft, stiff = Gains.of(robot, 2.0, 0.5), Gains.of(robot, 3.0, 0.5)
    paper, base = BaseTask.of(robot, 1.0), 1e3
    length = Support.of(robot).radius
    free = Limited(ContactLimits(0.7), length, base)
    # Where the soles cannot give both, the trunk's moment yields to the push back.
    yielding = Limited(ContactLimits(0.7), length, base, (1.0, 1.0, 1.0, 0.3, 0.3, 0.3))
    return {
        PAPER: Tracking(robot, soft, Orthogonal(), motive=paper),
        LIMITED: Tracking(robot, soft, free, motive=paper),
        OURS: Tracking(robot, stiff, yielding, motive=Stabiliser.of(robot)),
    }


def rivals(robot: Robot) -> dict[str, Tracking]:
    """Return contact-force feedback with the paper's balance task."""
    gains, paper = Gains.of(robot, 2.0, 0.5), BaseTask.of(robot, 1.0)
    laws: dict[str, Feedforward] = {
        "measured force, ideal sensor": MeasuredForce.of(robot),
        "measured force, 10 ms late": MeasuredForce.of(robot, delay=5),
        "force from the previous torque": EstimatedForce(),
    }
    return {name: Tracking(robot, gains, law, motive=paper) for name, law in laws.items()}


def random_pushes(
    force: float, times: tuple[float, ...], count: int, seed: int
) -> tuple[Push, ...]:
    """Push every robot at these times, each time in a random horizontal direction."""
    rng = np.random.default_rng(seed)
    found = []
    for moment in times:
        angle = rng.uniform(-np.pi, np.pi, count)
        vector = force * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        found.append(Push(np.full(count, moment), PUSH_SECONDS, vector))
    return tuple(found)


def run(setting: Setting) -> Result:
    """The long run of each controller and motion, then how much each takes, then the rivals."""
    robot = load("biped")
    motions = {name: stepping(robot, steps) for name, steps in MOTIONS.items()}
    chosen = controllers(robot)
    count, seconds = setting.pick(ROBOTS, 6), setting.pick(SECONDS, 11.0)
    times = tuple(np.arange(EVERY_SECONDS, seconds - 1e-9, EVERY_SECONDS).tolist())
    start = np.random.default_rng(2).uniform(0.0, 3.0, count)
    pushes = random_pushes(FORCE, times, count, 1)
    cells = [(motion, name) for motion in MOTIONS for name in chosen]
    progress = iter(
        setting.progress.part(0.0, 0.6, "200 N").parts([f"{n}, {m}, 200 N" for m, n in cells])
    )
    long: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for motion, name in cells:
        trial = Trial(
            robot, motions[motion], seconds, count, start=start, pushes=pushes, every=EVERY,
            watch=("base", "base_target"),
        )  # fmt: skip
        log = simulate(trial, chosen[name], next(progress))
        long.append({"motion": motion, "name": name, **_summary(log)})
        if (motion, name) in (("crouched", OURS), ("upright", PAPER)):
            arrays |= log.of([0]).arrays(f"{motion}.{name}.")
    numbers = {
        "long": long, "count": count, "seconds": seconds, "pushes": len(times),
        "forces": list(setting.pick(FORCES, FORCES[::2])),
    }  # fmt: skip
    numbers["short"] = _forces(robot, setting, numbers["forces"], setting.progress.part(
        0.6, 0.85, "sizes of push"))  # fmt: skip
    numbers["rivals"] = _rivals(robot, setting, setting.progress.part(0.85, 0.95, "rivals"))
    # One robot in detail, pushed once at 5 s as in the paper's figure 9.
    shown = Trial(
        robot, motions["upright"], 8.0, pushes=(_sideways(),), watch=("base", "base_target"),
        every=2,
    )  # fmt: skip
    for name, progress_part in zip(
        (PAPER, OURS), setting.progress.part(0.95, 1.0, "detail").parts(["", ""]), strict=True
    ):
        arrays |= simulate(shown, chosen[name], progress_part).arrays(f"detail.{name}.")
    return Result(findings(numbers), numbers, arrays)


def _sideways() -> Push:
    """Half the paper's push, backwards and to the side: the most that the upright motion takes."""
    return Push(np.array([5.0]), PUSH_SECONDS, np.array([[-50.0, 86.6, 0.0]]))


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
    """Share of robots that survive three pushes of each size, all sizes in one batch."""
    each = setting.pick(16, 3)
    times = setting.pick((1.0, 4.0, 7.0), (1.0,))
    seconds = times[-1] + setting.pick(3.0, 2.0)
    count = each * len(forces)
    start = np.resize(np.random.default_rng(3).uniform(0.0, 3.0, each), count)
    unit = random_pushes(1.0, times, each, 4)
    size = np.repeat(forces, each)[:, None]
    pushes = tuple(
        Push(
            np.full(count, push.start[0]),
            push.duration,
            size * np.tile(push.force, (len(forces), 1)),
        )
        for push in unit
    )
    cells = [(motion, name) for motion in MOTIONS for name in controllers(robot)]
    rows = []
    for (motion, name), part in zip(
        cells, progress.parts([f"{n}, {m}" for m, n in cells]), strict=True
    ):
        trial = Trial(
            robot, stepping(robot, MOTIONS[motion]), seconds, count, start=start, pushes=pushes,
            every=EVERY,
        )  # fmt: skip
        log = simulate(trial, controllers(robot)[name], part)
        up = log.survived.reshape(len(forces), each).mean(axis=1)
        rows.append({"motion": motion, "name": name, "up": up.tolist()})
    return rows


def _rivals(robot: Robot, setting: Setting, progress: Progress) -> list[dict[str, Any]]:
    """Contact-force feedback while stepping, without pushes and with small ones."""
    each = setting.pick(8, 2)
    seconds = setting.pick(9.0, 3.0)
    start = np.arange(each) * 3.0 / each
    motion = stepping(robot, UPRIGHT)
    rows = []
    named = {PAPER: controllers(robot)[PAPER]} | rivals(robot)
    for (name, controller), part in zip(named.items(), progress.parts(list(named)), strict=True):
        for force in (0.0, 50.0):
            trial = Trial(
                robot, motion, seconds, each, start=start, every=EVERY,
                pushes=random_pushes(force, (1.0, 4.0), each, 5), watch=("base", "base_target"),
            )  # fmt: skip
            rows.append(
                {"name": name, "force": force, **_summary(simulate(trial, controller, part))}
            )
    return rows


def cell(numbers: dict[str, Any], motion: str, name: str) -> dict[str, Any]:
    """Return one long run."""
    return next(r for r in numbers["long"] if (r["motion"], r["name"]) == (motion, name))


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's claim, for its controller and for ours."""
    count, seconds = numbers["count"], numbers["seconds"]
    ours, paper = cell(numbers, "crouched", OURS), cell(numbers, "crouched", PAPER)
    limited, upright = cell(numbers, "crouched", LIMITED), cell(numbers, "upright", PAPER)
    span = f"{seconds:.0f} s with {numbers['pushes']} pushes of {FORCE:.0f} N"
    return [
        judged(
            f"{span}: our stabiliser with limited forces, crouched",
            "stays up (one run, one push shown)",
            f"{percent(ours['up'])} of {count} robots",
            "all stay up",
            ours["up"] == 1.0,
        ),
        judged(
            "the same with the paper's controller, eqs. (15), (18)-(20)",
            "stays up",
            f"{percent(paper['up'])}; the first falls at {_first(paper)}",
            "all stay up",
            paper["up"] == 1.0,
        ),
        Finding(
            "the paper's controller with limited forces",
            "",
            f"{percent(limited['up'])}; the first falls at {_first(limited)}",
        ),
        Finding(
            "the paper's controller, upright and swaying over each foot",
            "",
            f"{percent(upright['up'])}; the first falls at {_first(upright)}",
        ),
    ]


def _first(row: dict[str, Any]) -> str:
    return "no time" if row["first"] is None else f"{row['first']:.1f} s"


def show(result: Result) -> str:
    """Draw the section."""
    numbers = result.numbers
    forces = [0.0, *numbers["forces"]]
    charts = []
    for motion in MOTIONS:
        curves = [
            (name, COLOURS[name], [1.0, *row["up"]])
            for row in numbers["short"]
            for name in [row["name"]]
            if row["motion"] == motion
        ]
        charts.append(
            lines(
                forces, curves, f"Survival of three pushes, {motion}", "N for 150 ms",
                (0.0, 1.04), percent,
            )
        )  # fmt: skip
    return "".join(
        (
            _film(result, "crouched", OURS),
            _strip(result, "crouched", OURS),
            text(
                f"{numbers['count']} robots, each pushed in other directions and at other phases "
                "of the motion. Why the paper's controller falls: eq. (15) asks the ground for "
                "whatever force brings the base back, and the ground neither pulls nor holds "
                "beyond the soles' edge. Limited forces cure that. Why no controller holds 200 N "
                "in the upright motion: 30 N·s give this robot of 55 kg 0.54 m/s. Even with the "
                "centre of pressure at the edge of the soles from the first instant, the edge has "
                "to be (F/mω²)(1 − exp(−0.15 ω)) away, with ω² = g/h: 11.5 cm for h = 0.75 m and "
                "9.3 cm for h = 0.53 m. The soles reach 11.2 cm forward and back, and 13.2 cm "
                "sideways from the middle of the stance, less the sway. So a robot that stays on "
                "its feet's places has to be low, and must not stand on one foot for long. The "
                "paper does not give its robot's mass or stance."
            ),
            figure(
                charts,
                "Survival of three pushes in random directions at random phases, three seconds "
                "apart.",
            ),
            _table(numbers),
            heading("As the paper's figure 9"),
            figure(
                _detail(result),
                "Base and left leg, upright, pushed with 100 N at 5 s. Desired joint angles jump "
                "where a foot is lifted, and so does the torque where the contacts switch.",
                3,
            ),
            heading("Contact-force feedback on the same motion"),
            _rivals_table(numbers),
        )
    )


def _film(result: Result, motion: str, name: str) -> str:
    log = Log.from_arrays(result.arrays, f"{motion}.{name}.")
    rows = log.time < 20.0
    with Camera(load("biped"), 640, 480, azimuth=155.0, nearer=1.3) as camera:
        clip = camera.clip(log.time[rows], log.qpos[rows, 0], log.push[rows, 0], 20.0)
    return video(
        clip.mp4(31),
        f"{escape(name)}, {motion}: the first 20 s. A push every 5 s.",
    )


def _strip(result: Result, motion: str, name: str) -> str:
    log = Log.from_arrays(result.arrays, f"{motion}.{name}.")
    moments = EVERY_SECONDS + np.array([-0.1, 0.1, 0.3, 0.5, 0.8, 1.2, 2.0])
    rows = np.minimum(np.searchsorted(log.time, moments), len(log.time) - 1)
    with Camera(load("biped"), 224, 300, azimuth=155.0, nearer=1.25) as camera:
        labels = [f"{t:.1f} s" for t in log.time[rows]]
        images = camera.strip(log.qpos[rows, 0], log.push[rows, 0], labels)
    return frames(images, "A push of 200 N, as the paper's figure 8.", "the robot under a push")


def _detail(result: Result) -> list[str]:
    robot = load("biped")
    logs = {name: Log.from_arrays(result.arrays, f"detail.{name}.") for name in (PAPER, OURS)}
    longest = max(logs.values(), key=lambda log: len(log.time))
    charts = []
    for axis, label in ((1, "Base sideways, cm"), (0, "Base forward, cm")):
        curves = [("desired", 7, 100 * longest.watched["base_target"][:, 0, axis])]
        curves += [
            (name, COLOURS[name], _padded(100 * log.watched["base"][:, 0, axis], log, longest))
            for name, log in logs.items()
        ]
        charts.append(traces(longest.time, curves, label))
    for joint, label in zip(JOINTS, LABELS, strict=True):
        column = robot.joint_names.index(joint)
        curves = [("desired", 7, longest.target[:, 0, column])]
        curves += [
            (name, COLOURS[name], _padded(log.qpos[:, 0, 7 + column], log, longest))
            for name, log in logs.items()
        ]
        charts.append(traces(longest.time, curves, f"Left {label}, rad"))
    column = robot.joint_names.index("left_knee")
    curves = [
        (name, COLOURS[name], _padded(log.torque[:, 0, column], log, longest))
        for name, log in logs.items()
    ]
    charts.append(traces(longest.time, curves, "Left knee, torque in N·m"))
    return charts


def _padded(values: np.ndarray, log: Log, longest: Log) -> np.ndarray:
    shown = np.where(log.up[:, 0], values, np.nan)
    return np.concatenate([shown, np.full(len(longest.time) - len(shown), np.nan)])


def _table(numbers: dict[str, Any]) -> str:
    rows = [
        [
            f"{r['motion']}: {escape(r['name'])}",
            percent(r["up"]),
            _first(r),
            number(100 * r["base"], 2),
            number(1e3 * r["error"]),
            number(r["torque"]),
        ]
        for r in numbers["long"]
    ]
    heads = ["200 N every 5 s", "stay up", "first fall", "base, cm", "joints, mrad", "torque, N·m"]
    return table(heads, rows)


def _rivals_table(numbers: dict[str, Any]) -> str:
    rows = [
        [
            escape(r["name"]),
            f"{r['force']:.0f} N",
            percent(r["up"]),
            number(100 * r["base"], 2),
            number(1e3 * r["error"]),
            number(r["torque"]),
        ]
        for r in numbers["rivals"]
    ]
    return table(["", "pushes", "stay up", "base, cm", "joints, mrad", "torque, N·m"], rows)


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.fig8_9_stepping",
    title="Figures 8 and 9: squatting, stepping, pushed",
    about=(
        "A squat at 2 Hz, a step of either foot every 3 s with contacts that switch instantly, and "
        "200 N on the base for 150 ms every 5 s in random directions: 60 s. Two stepping motions: "
        "upright with a sway over each foot, and crouched with quick steps."
    ),
    run=run,
    show=show,
    minutes=8.0,
)

if __name__ == "__main__":
    sys.exit(main(EXPERIMENT))
