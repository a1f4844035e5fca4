"""[M10] figures 10 and 11: a quadruped walks over ground that it does not know."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from eval.page.figures import bars, lines, traces
from eval.page.html import columns, figure, heading, text
from eval.papers.camera import Camera
from eval.papers.experiment import Experiment, Progress, Result, Setting, main, row
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, measured_contacts
from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.laws import Limited, orthogonal
from eval.papers.mistry2010.laws import rivals as rival_laws
from eval.papers.page import Finding, judged
from eval.papers.trial import Trial, simulate
from eval.wording import number, percent
from fbid_gym.motions import Crawl, crawl
from fbid_gym.robots import Robot, load
from fbid_gym.robots.terrain import make_terrain, world_of

SPEED, SECONDS = 0.06, 12.0
LOW, HIGH = (4.0, 0.7), (16.0, 0.7)
"""Hz and damping ratio of the gains."""
HERTZ = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0)
ENOUGH = 0.5
"""Share of the commanded way that a walk shall make to count as a success."""
EVERY = 10
SEED = 41


@dataclass(frozen=True)
class Ground:
    """A kind of ground: name and height in m of `fbid_gym.robots.terrain`."""

    label: str
    name: str
    height: float


GROUNDS = (
    Ground("flat", "flat", 0.0),
    Ground("obstacles 2 cm", "obstacles", 0.02),
    Ground("obstacles 3 cm", "obstacles", 0.03),
    Ground("obstacles 4 cm", "obstacles", 0.04),
    Ground("rock board 4 cm", "rocks", 0.04),
)
MIDDLE = "obstacles 3 cm"

FF, LOW_PD, HIGH_PD = "PD+FF, low gains", "PD, low gains", "PD, high gains"
COLOURS = {FF: 0, LOW_PD: 5, HIGH_PD: 1}


def controllers(robot: Robot) -> dict[str, JointController]:
    """Return the paper's three."""
    low, high = PdGains.of(robot, *LOW), PdGains.of(robot, *HIGH)
    return {
        FF: JointController(robot, low, orthogonal()),
        LOW_PD: JointController(robot, low),
        HIGH_PD: JointController(robot, high),
    }


def rivals(robot: Robot) -> dict[str, JointController]:
    """Return what is shown beside them, at the low gains."""
    gains, measured = PdGains.of(robot, *LOW), measured_contacts(robot)
    laws = {"PD+FF, limited forces": Limited.of(robot), **rival_laws(robot)}
    return {
        "PD+FF, measured contacts": JointController(robot, gains, orthogonal(), measured),
        **{name: JointController(robot, gains, law) for name, law in laws.items()},
    }


def on(robot: Robot, ground: Ground) -> tuple[Robot, np.ndarray]:
    """Return the robot in a world with this ground, and places (K, 2) to start from."""
    terrain = make_terrain(ground.name, robot, height=ground.height, seed=SEED)
    return replace(robot, model=world_of(robot, terrain).compile()), terrain.starts


def courses(starts: np.ndarray, count: int) -> np.ndarray:
    """Return random places and headings, (N, 3): a course each."""
    rng = np.random.default_rng(SEED)
    turn = rng.permutation(count) * 2 * np.pi / count
    return np.concatenate([starts[rng.integers(len(starts), size=count)], turn[:, None]], axis=1)


def run(setting: Setting) -> Result:
    """Walk over every ground with every controller."""
    robot = load("quadruped")
    motion = crawl(robot)
    count, seconds = setting.pick(52, 8), setting.pick(SECONDS, 4.0)
    grounds = setting.pick(GROUNDS, (GROUNDS[0], GROUNDS[2], GROUNDS[4]))
    cells = [(ground, name) for ground in grounds for name in controllers(robot)]
    beside = [g for g in grounds if g.label in ("flat", MIDDLE)]
    cells += [(ground, name) for ground in beside for name in rivals(robot)]
    rows: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    walks = setting.progress.part(0.0, 0.8)
    for (ground, name), progress in walks.each(cells, lambda cell: f"{cell[1]}, {cell[0].label}"):
        world, starts = on(robot, ground)
        pose = courses(starts, count)
        trial = Trial(world, following(motion, SPEED, pose), seconds, count, every=EVERY)
        log = simulate(trial, (controllers(world) | rivals(world))[name], progress)
        rows.append({"ground": ground.label, "name": name, **_summary(log, pose, seconds)})
        if name in (FF, HIGH_PD) and ground.label in (MIDDLE, GROUNDS[-1].label):
            chosen = _telling(log, pose, up=name == FF)
            arrays |= log.of([chosen]).arrays(f"{ground.label}.{name}.")
            arrays[f"heading.{ground.label}.{name}"] = pose[chosen, 2]
    hertz = setting.pick(HERTZ, HERTZ[::3])
    sweep = _sweep(robot, motion, hertz, setting, setting.progress.part(0.8, 0.95, "gains"))
    log = simulate(
        Trial(robot, following(motion, SPEED), 2 * motion.period / motion.hz + 1e-9),
        controllers(robot)[FF],
        setting.progress.part(0.95, 1.0, "torques"),
    )
    arrays |= log.arrays("steady.")
    numbers = {
        "rows": rows, "count": count, "seconds": seconds, "hertz": list(hertz), "sweep": sweep,
        "grounds": [ground.label for ground in grounds],
    }  # fmt: skip
    return Result(findings(numbers), numbers, arrays)


def _summary(log: Log, pose: np.ndarray, seconds: float) -> dict[str, float]:
    """Share of successes, way, tracking error, and where the torque comes from."""
    way = _way(log, pose)
    good = log.survived & (way >= ENOUGH * SPEED * seconds)
    total = float(np.nanmean(log.rms(log["torque"])))
    return {
        "success": float(good.mean()),
        "up": float(log.survived.mean()),
        "way": float(np.median(way)),
        "error": float(np.nanmean(log.rms_of_joints(log.error))),
        "torque": total,
        "feedforward": float(np.nanmean(log.rms(log["feedforward"]))) / total,
        "feedback": float(np.nanmean(log.rms(log["feedback"]))) / total,
    }


def _way(log: Log, pose: np.ndarray) -> np.ndarray:
    """How far each robot got along its first heading before it fell, if it did: (N,) m."""
    last = np.maximum(log.up.sum(axis=0) - 1, 0)
    place = log["qpos"][:, :, :2]
    path = place[last, np.arange(len(last))] - place[0]
    return path[:, 0] * np.cos(pose[:, 2]) + path[:, 1] * np.sin(pose[:, 2])


def _telling(log: Log, pose: np.ndarray, up: bool) -> int:
    """A robot worth a picture: the one that climbed most of those that stayed up, or fell."""
    height = log["qpos"][:, :, 2]
    climb = np.ptp(np.where(log.up, height, height[:1]), axis=0)
    wanted = log.survived if up else ~log.survived
    return int(np.argmax(np.where(wanted, climb, climb - 1.0)))


def _sweep(
    robot: Robot, motion: Crawl, hertz: tuple[float, ...], setting: Setting, progress: Progress
) -> dict[str, list[dict[str, float]]]:
    """Success against gains over the middle obstacles, with and without inverse dynamics."""
    each, seconds = setting.pick(16, 4), setting.pick(SECONDS, 4.0)
    world, starts = on(robot, next(g for g in GROUNDS if g.label == MIDDLE))
    course = courses(starts, each)
    pose = np.tile(course, (len(hertz), 1))
    gains = PdGains.of(world, np.repeat(hertz, each), np.full(len(pose), LOW[1]))
    trial = Trial(world, following(motion, SPEED, pose), seconds, len(pose), every=EVERY)
    laws, found = {"PD+FF": orthogonal(), "PD": None}, {}
    for name, part in progress.each(laws):
        log = simulate(trial, JointController(world, gains, laws[name]), part)
        found[name] = [_summary(some, course, seconds) for some in log.groups(each)]
    return found


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """What the paper shows by video and plot, in numbers."""
    cell = partial(row, numbers["rows"])
    rough = [ground for ground in numbers["grounds"] if ground != "flat"]

    def success(name: str) -> float:
        return float(np.mean([cell(ground=ground, name=name)["success"] for ground in rough]))

    flat = cell(ground="flat", name=FF)
    three = [success(name) for name in (FF, HIGH_PD, LOW_PD)]
    errors = [1e3 * cell(ground="flat", name=name)["error"] for name in (FF, HIGH_PD, LOW_PD)]
    return [
        judged(
            "success on unknown ground: low-gain PD+FF, high-gain PD, low-gain PD",
            "PD+FF walks, high-gain PD is too stiff",
            ", ".join(percent(share) for share in three),
            "PD+FF ahead of both",
            three[0] > max(three[1:]),
        ),
        *(
            Finding(
                f"{ground}, in the same order",
                "PD+FF walks",
                ", ".join(
                    percent(cell(ground=ground, name=name)["success"])
                    for name in (FF, HIGH_PD, LOW_PD)
                ),
            )
            for ground in rough
        ),
        judged(
            "RMS tracking error on flat ground, in the same order, mrad",
            "tracks (plot)",
            ", ".join(number(value) for value in errors),
            "PD+FF below both",
            errors[0] < min(errors[1:]),
        ),
        judged(
            "share of feedforward and of feedback in the torque, flat ground",
            "feedforward is the main contributor",
            f"{percent(flat['feedforward'])} and {percent(flat['feedback'])}",
            "feedforward larger",
            flat["feedforward"] > flat["feedback"],
        ),
    ]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers, arrays = result.numbers, result.arrays
    grounds, cell = numbers["grounds"], partial(row, numbers["rows"])
    names = tuple(COLOURS)
    steady = Log.from_arrays(arrays, "steady.")
    robot = load("quadruped")
    knee = robot.joint_names.index("hind_right_knee")
    feedforward, feedback = (steady[k][:, 0, knee] for k in ("feedforward", "feedback"))
    return [
        _film(arrays, GROUNDS[-1].label, FF, robot),
        _strip(arrays, MIDDLE, FF, robot, "Low-gain PD+FF over obstacles that it does not know."),
        _strip(arrays, MIDDLE, HIGH_PD, robot, "High-gain PD on a course where it falls, if any."),
        figure(
            [
                bars(
                    grounds,
                    [
                        (n, COLOURS[n], [cell(ground=g, name=n)["success"] for g in grounds])
                        for n in names
                    ],
                    "Success", percent, 1.0,
                ),
                lines(
                    numbers["hertz"],
                    [
                        (n, c, [cell["success"] for cell in numbers["sweep"][n]])
                        for n, c in (("PD+FF", 0), ("PD", 1))
                    ],
                    f"Success, {MIDDLE}", "gains, Hz", (0.0, 1.04), percent,
                ),
            ],
            f"{numbers['count']} random courses each, {number(numbers['seconds'])} s at "
            f"{number(100 * SPEED)} cm/s. Success: does not fall, and makes at least half of the "
            "way. Right: all gains of PD, with and without inverse dynamics.",
        ),
        figure(
            [
                traces(
                    steady.time,
                    [
                        ("desired", 7, steady["target"][:, 0, knee]),
                        ("PD+FF", 0, steady["qpos"][:, 0, 7 + knee]),
                    ],
                    "Right hind knee, rad",
                ),
                traces(
                    steady.time,
                    [
                        ("total", 7, feedforward + feedback),
                        ("feedforward", 2, feedforward),
                        ("feedback", 5, feedback),
                    ],
                    "Its torque, N·m",
                ),
            ],
            "A steady walk on flat ground, two periods, as the paper's figure 11. The torque jumps "
            "where the planned contacts switch.",
        ),
        heading("Beside it, at the same low gains"),
        _table(numbers),
        text(
            "The planned contacts are wrong on this ground most of the time: feet touch early or "
            "late, and the body tilts. PD+FF with measured contacts uses the contacts that there "
            "are."
        ),
    ]  # fmt: skip


def _kept(
    arrays: dict[str, np.ndarray], label: str, name: str, robot: Robot, width: int, height: int
) -> tuple[Log, Camera]:
    """The robot that was kept of a ground and a controller, and a camera at its side."""
    world, _ = on(robot, next(ground for ground in GROUNDS if ground.label == label))
    azimuth = float(np.degrees(arrays[f"heading.{label}.{name}"])) + 115.0
    camera = Camera(world, width, height, azimuth, -22.0)
    return Log.from_arrays(arrays, f"{label}.{name}."), camera


def _film(arrays: dict[str, np.ndarray], label: str, name: str, robot: Robot) -> str:
    log, camera = _kept(arrays, label, name, robot, 640, 480)
    with camera:
        return camera.film(log, 20.0, f"Low-gain PD+FF on the {label}, which it does not know.")


def _strip(arrays: dict[str, np.ndarray], label: str, name: str, robot: Robot, caption: str) -> str:
    log, camera = _kept(arrays, label, name, robot, 300, 240)
    end = log.time[-1] if log.survived[0] else min(log.fell[0] + 0.1, log.time[-1])
    with camera:
        moments = np.linspace(max(end - 4.0, 0.0), end, 6)
        return camera.strip(log, moments, caption, f"the quadruped on {label}")


def _table(numbers: dict[str, Any]) -> str:
    cells = (
        ("", lambda r: f"{r['ground']}: {r['name']}"),
        ("success", lambda r: percent(r["success"])),
        ("stays up", lambda r: percent(r["up"])),
        ("way, m", lambda r: number(r["way"], 2)),
        ("error, mrad", lambda r: number(1e3 * r["error"])),
        ("torque, N·m", lambda r: number(r["torque"])),
        ("feedforward", lambda r: percent(r["feedforward"])),
        ("feedback", lambda r: percent(r["feedback"])),
    )
    order = numbers["grounds"].index
    return columns(sorted(numbers["rows"], key=lambda r: order(r["ground"])), cells)


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.fig10_11_quadruped",
    title="Figures 10 and 11: a quadruped on unknown ground",
    about=(
        "A statically stable walk of a robot of LittleDog's size, planned for flat ground, on "
        "flat ground, over unperceived planks and over a rock board. The paper shows a video and "
        "one plot; ours counts random courses. Neither controller knows where it is: joints only."
    ),
    run=run,
    show=show,
    minutes=6.0,
)

if __name__ == "__main__":
    main(EXPERIMENT)
