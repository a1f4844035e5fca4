"""[M10] figures 10 and 11: a quadruped walks over ground that it does not know."""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from eval.page.figures import bars, lines, traces
from eval.page.html import columns, figure, heading, text
from eval.papers.camera import Camera
from eval.papers.experiment import Finding, Progress, Result, Setting, experiment, judged, row
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import limited, orthogonal
from eval.papers.mistry2010.laws import rivals as rival_laws
from eval.papers.trial import RATES, Trial, simulate
from eval.wording import number, percent
from fbid_gym.actions.contact_belief import contact_belief
from fbid_gym.motions import crawl
from fbid_gym.robots import Robot, load
from fbid_gym.robots.terrain import make_terrain, world_of

SPEED, SECONDS = 0.06, 12.0
LOW, HIGH = (4.0, 0.7), (16.0, 0.7)
"""Hz and damping ratio of the gains."""

HERTZ = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0)
ENOUGH = 0.5
"""Share of the commanded way that a walk shall make to count as a success."""

GROUNDS = {
    "flat": ("flat", 0.0),
    "obstacles 2 cm": ("obstacles", 0.02),
    "obstacles 3 cm": ("obstacles", 0.03),
    "obstacles 4 cm": ("obstacles", 0.04),
    "rock board 4 cm": ("rocks", 0.04),
}
"""Kinds of ground: name and height in m of `fbid_gym.robots.terrain`."""

FLAT, MIDDLE, BOARD = "flat", "obstacles 3 cm", "rock board 4 cm"
FF, LOW_PD, HIGH_PD = "PD+FF, low gains", "PD, low gains", "PD, high gains"
COLOURS = {FF: 0, LOW_PD: 5, HIGH_PD: 1}
_EVERY, _SEED = 10, 41


def controllers(robot: Robot) -> dict[str, JointController]:
    """Return the paper's three, and what is shown beside them at the low gains."""
    low, high = PdGains.of(robot, *LOW), PdGains.of(robot, *HIGH)
    belief = contact_belief("measured", robot, RATES.control)
    laws = {"PD+FF, limited forces": limited(robot), **rival_laws(robot)}
    return {
        FF: JointController(robot, low, orthogonal()),
        LOW_PD: JointController(robot, low),
        HIGH_PD: JointController(robot, high),
        "PD+FF, measured contacts": JointController(robot, low, orthogonal(), belief),
        **{name: JointController(robot, low, law) for name, law in laws.items()},
    }


def on(robot: Robot, ground: str) -> tuple[Robot, np.ndarray]:
    """Return the robot in a world with this ground, and places (K, 2) to start from."""
    name, height = GROUNDS[ground]
    terrain = make_terrain(name, robot, height=height, seed=_SEED)
    return replace(robot, model=world_of(robot, terrain).compile()), terrain.starts


def courses(starts: np.ndarray, count: int) -> np.ndarray:
    """Return random places and headings, (N, 3): a course each."""
    rng = np.random.default_rng(_SEED)
    turn = rng.permutation(count) * 2 * np.pi / count
    return np.concatenate([starts[rng.integers(len(starts), size=count)], turn[:, None]], axis=1)


class Kept(NamedTuple):
    """A robot worth pictures: its world, its log and its heading, rad."""

    world: Robot
    log: Log
    heading: float

    def camera(self, width: int, height: int) -> Camera:
        """Return a camera at its side."""
        return Camera(self.world, width, height, float(np.degrees(self.heading)) + 115.0, -22.0)


def summary(log: Log, pose: np.ndarray, seconds: float) -> dict[str, float]:
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


def _telling(log: Log, up: bool) -> int:
    """Which robot climbed most of those that stayed up, or of those that fell."""
    height = log["qpos"][:, :, 2]
    climb = np.ptp(np.where(log.up, height, height[:1]), axis=0)
    return int(np.argmax(np.where(log.survived == up, climb, climb - 1.0)))


def _sweep(
    robot: Robot, hertz: tuple[float, ...], setting: Setting, progress: Progress
) -> dict[str, list[dict[str, float]]]:
    """Success against gains over the middle obstacles, with and without inverse dynamics."""
    each, seconds = setting.pick(16, 4), setting.pick(SECONDS, 4.0)
    world, starts = on(robot, MIDDLE)
    course = courses(starts, each)
    pose = np.tile(course, (len(hertz), 1))
    gains = PdGains.of(world, np.repeat(hertz, each), np.full(len(pose), LOW[1]))
    plan = following(crawl(robot), SPEED, pose)
    trial = Trial(world, plan, seconds, len(pose), every=_EVERY)
    laws, found = {"PD+FF": orthogonal(), "PD": None}, {}
    for name, part in progress.each(laws):
        log = simulate(trial, JointController(world, gains, laws[name]), part)
        found[name] = [summary(some, course, seconds) for some in log.groups(each)]
    return found


@experiment(
    "Figures 10 and 11: a quadruped on unknown ground",
    """A statically stable walk of a robot of LittleDog's size, planned for flat ground, on flat
    ground, over unperceived planks and over a rock board. The paper shows a video and one plot;
    ours counts random courses. Neither controller knows where it is: joints only.""",
    minutes=6.0,
)
def fig10_11_quadruped(setting: Setting) -> Result:
    """Walk over every ground with every controller."""
    robot = load("quadruped")
    motion = crawl(robot)
    count, seconds = setting.pick(52, 8), setting.pick(SECONDS, 4.0)
    grounds = setting.pick(tuple(GROUNDS), (FLAT, MIDDLE, BOARD))
    beside = [name for name in controllers(robot) if name not in COLOURS]
    cells = [(ground, name) for ground in grounds for name in COLOURS]
    cells += [(ground, name) for ground in (FLAT, MIDDLE) for name in beside]
    rows: list[dict[str, Any]] = []
    kept: dict[tuple[str, str], Kept] = {}
    walks = setting.progress.part(0.0, 0.8)
    for (ground, name), progress in walks.each(cells, lambda cell: f"{cell[1]}, {cell[0]}"):
        world, starts = on(robot, ground)
        pose = courses(starts, count)
        trial = Trial(world, following(motion, SPEED, pose), seconds, count, every=_EVERY)
        log = simulate(trial, controllers(world)[name], progress)
        rows.append({"ground": ground, "name": name, **summary(log, pose, seconds)})
        one = _telling(log, up=name == FF)
        kept[ground, name] = Kept(world, log.of([one]), float(pose[one, 2]))
    hertz = setting.pick(HERTZ, HERTZ[::3])
    sweep = _sweep(robot, hertz, setting, setting.progress.part(0.8, 0.95, "gains"))
    steady = simulate(
        Trial(robot, following(motion, SPEED), 2 * motion.period / motion.hz + 1e-9),
        controllers(robot)[FF],
        setting.progress.part(0.95, 1.0, "torques"),
    )
    numbers = {
        "rows": rows, "count": count, "seconds": seconds, "hertz": list(hertz), "sweep": sweep,
        "grounds": list(grounds),
    }  # fmt: skip
    return Result(findings(numbers), numbers, _body(numbers, kept, steady))


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """What the paper shows by video and plot, in numbers."""
    cell, order = partial(row, numbers["rows"]), (FF, HIGH_PD, LOW_PD)
    rough = [ground for ground in numbers["grounds"] if ground != FLAT]
    success = {g: [cell(ground=g, name=name)["success"] for name in order] for g in rough}
    mean = [float(np.mean(shares)) for shares in zip(*success.values(), strict=True)]
    errors = [1e3 * cell(ground=FLAT, name=name)["error"] for name in order]
    flat = cell(ground=FLAT, name=FF)
    return [
        judged(
            "success on unknown ground: low-gain PD+FF, high-gain PD, low-gain PD",
            "PD+FF walks, high-gain PD is too stiff",
            ", ".join(percent(share) for share in mean),
            "PD+FF ahead of both",
            mean[0] > max(mean[1:]),
        ),
        *(
            Finding(f"{ground}, in the same order", "PD+FF walks", ", ".join(map(percent, shares)))
            for ground, shares in success.items()
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


def _body(numbers: dict[str, Any], kept: dict[tuple[str, str], Kept], steady: Log) -> list[str]:
    grounds, cell = numbers["grounds"], partial(row, numbers["rows"])
    knee = load("quadruped").joint_names.index("hind_right_knee")
    feedforward, feedback = (steady[k][:, 0, knee] for k in ("feedforward", "feedback"))
    on_board = kept[BOARD, FF]
    with on_board.camera(640, 480) as camera:
        caption = f"Low-gain PD+FF on the {BOARD}, which it does not know."
        film = camera.film(on_board.log, 20.0, caption)
    success = [
        (name, colour, [cell(ground=g, name=name)["success"] for g in grounds])
        for name, colour in COLOURS.items()
    ]
    by_gain = [
        (name, colour, [cell["success"] for cell in numbers["sweep"][name]])
        for name, colour in (("PD+FF", 0), ("PD", 1))
    ]
    angles = [
        ("desired", 7, steady["target"][:, 0, knee]),
        ("PD+FF", 0, steady["qpos"][:, 0, 7 + knee]),
    ]
    torques = [
        ("total", 7, feedforward + feedback),
        ("feedforward", 2, feedforward),
        ("feedback", 5, feedback),
    ]
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
    return [
        film,
        _strip(kept[MIDDLE, FF], "Low-gain PD+FF over obstacles that it does not know."),
        _strip(kept[MIDDLE, HIGH_PD], "High-gain PD on a course where it falls, if any."),
        figure(
            [
                bars(grounds, success, "Success", percent, 1.0),
                lines(
                    numbers["hertz"], by_gain, f"Success, {MIDDLE}", "gains, Hz", (0.0, 1.04),
                    percent,
                ),
            ],
            f"{numbers['count']} random courses each, {number(numbers['seconds'])} s at "
            f"{number(100 * SPEED)} cm/s. Success: does not fall, and makes at least half of the "
            "way. Right: all gains of PD, with and without inverse dynamics.",
        ),
        figure(
            [
                traces(steady.time, angles, "Right hind knee, rad"),
                traces(steady.time, torques, "Its torque, N·m"),
            ],
            "A steady walk on flat ground, two periods, as the paper's figure 11. The torque jumps "
            "where the planned contacts switch.",
        ),
        heading("Beside it, at the same low gains"),
        columns(sorted(numbers["rows"], key=lambda r: grounds.index(r["ground"])), cells),
        text(
            "The planned contacts are wrong on this ground most of the time: feet touch early or "
            "late, and the body tilts. PD+FF with measured contacts uses the contacts that there "
            "are."
        ),
    ]  # fmt: skip


def _strip(kept: Kept, caption: str) -> str:
    log = kept.log
    end = log.time[-1] if log.survived[0] else min(log.fell[0] + 0.1, log.time[-1])
    with kept.camera(300, 240) as camera:
        moments = np.linspace(max(end - 4.0, 0.0), end, 6)
        return camera.strip(log, moments, caption, f"the quadruped on {MIDDLE}")
