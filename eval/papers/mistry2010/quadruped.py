"""[M10] figures 10 and 11: a quadruped walks over ground that it does not know."""

from dataclasses import replace

import numpy as np

from eval.papers.camera import Camera
from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import limited, orthogonal
from eval.papers.mistry2010.laws import rivals as rival_laws
from eval.papers.trial import RATES, Trial, simulate
from fbid_gym.actions.contact_options import contact_belief
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
BY_GAIN = {"PD+FF": 0, "PD": 1}
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
    """Measure how far each robot got along its first heading until it fell, if it did: (N,) m."""
    last = np.maximum(log.up.sum(axis=0) - 1, 0)
    place = log["qpos"][:, :, :2]
    path = place[last, np.arange(len(last))] - place[0]
    return path[:, 0] * np.cos(pose[:, 2]) + path[:, 1] * np.sin(pose[:, 2])


def _telling(log: Log, up: bool) -> int:
    """Choose the robot that climbed most of those that stayed up, or of those that fell."""
    height = log["qpos"][:, :, 2]
    climb = np.ptp(np.where(log.up, height, height[:1]), axis=0)
    return int(np.argmax(np.where(log.survived == up, climb, climb - 1.0)))


def _sweep(robot: Robot, hertz: tuple[float, ...], setting: Setting) -> dict[str, list[Numbers]]:
    """Success against gains over the middle obstacles, with and without inverse dynamics."""
    each, seconds = setting.pick(16, 4), setting.pick(SECONDS, 4.0)
    world, starts = on(robot, MIDDLE)
    course = courses(starts, each)
    pose = np.tile(course, (len(hertz), 1))
    gains = PdGains.of(world, np.repeat(hertz, each), np.full(len(pose), LOW[1]))
    plan = following(crawl(robot), SPEED, pose)
    trial = Trial(world, plan, seconds, len(pose), every=_EVERY)
    laws, found = {"PD+FF": orthogonal(), "PD": None}, {}
    for name in setting.each(laws, 0.95):
        log = simulate(trial, JointController(world, gains, laws[name]))
        found[name] = [summary(some, course, seconds) for some in log.groups(each)]
    return found


@experiment(
    "Figures 10 and 11: a quadruped on unknown ground",
    """A statically stable walk of a robot of LittleDog's size, planned for flat ground, on flat
    ground, over unperceived planks and over a rock board. The paper shows a video and one plot;
    ours counts random courses. Neither controller knows where it is: joints only.""",
    minutes=6.0,
)
def fig10_11_quadruped(setting: Setting) -> Measured:
    """Walk over every ground with every controller."""
    robot = load("quadruped")
    motion, knee = crawl(robot), robot.joint_names.index("hind_right_knee")
    count, seconds = setting.pick(52, 8), setting.pick(SECONDS, 4.0)
    grounds = setting.pick(tuple(GROUNDS), (FLAT, MIDDLE, BOARD))
    beside = [name for name in controllers(robot) if name not in COLOURS]
    cells = [(name, ground) for ground in grounds for name in COLOURS]
    cells += [(name, ground) for ground in (FLAT, MIDDLE) for name in beside]
    rows: list[Numbers] = []
    pictured: dict[tuple[str, str], tuple[Camera, Log]] = {}
    for name, ground in setting.each(cells, 0.8):
        world, starts = on(robot, ground)
        pose = courses(starts, count)
        trial = Trial(world, following(motion, SPEED, pose), seconds, count, every=_EVERY)
        log = simulate(trial, controllers(world)[name])
        rows.append({"ground": ground, "name": name, **summary(log, pose, seconds)})
        one = _telling(log, up=name == FF)
        side = float(np.degrees(pose[one, 2])) + 115.0
        camera = Camera(world, 300, 240, side, -22.0, nearer=1.0)
        pictured[name, ground] = camera, log.of([one])
    hertz = setting.pick(HERTZ, HERTZ[::3])
    sweep = _sweep(robot, hertz, setting)
    walk = Trial(robot, following(motion, SPEED), 2 * motion.period / motion.hz + 1e-9)
    steady = simulate(walk, controllers(robot)[FF])
    numbers = {
        "rows": rows, "count": count, "seconds": seconds, "hertz": list(hertz), "sweep": sweep,
        "grounds": list(grounds),
    }  # fmt: skip
    three = {g: [row(rows, ground=g, name=name) for name in (FF, HIGH_PD, LOW_PD)] for g in grounds}
    success = {g: [r["success"] for r in its] for g, its in three.items() if g != FLAT}
    camera, on_board = pictured[FF, BOARD]
    parts = [steady[k][:, 0, knee] for k in ("feedforward", "feedback")]
    return numbers, {
        **{"COLOURS": COLOURS, "SPEED": SPEED, "flat": three[FLAT][0], "success": success},
        "mean": np.mean(list(success.values()), axis=0).tolist(),
        "errors": [1e3 * r["error"] for r in three[FLAT]],
        "film": replace(camera, width=640, height=480).film(on_board, 20.0),
        "strips": [_end(*pictured[name, MIDDLE]) for name in (FF, HIGH_PD)],
        "by_gain": [(n, k, [cell["success"] for cell in sweep[n]]) for n, k in BY_GAIN.items()],
        "time": steady.time,
        "angles": [
            ("desired", 7, steady["target"][:, 0, knee]),
            ("PD+FF", 0, steady["qpos"][:, 0, 7 + knee]),
        ],
        "torques": [("total", 7, sum(parts)), ("feedforward", 2, parts[0])]
        + [("feedback", 5, parts[1])],
    }


def _end(camera: Camera, log: Log) -> list[np.ndarray]:
    """Pictures of the last seconds before the end, or before a robot lies."""
    end = log.time[-1] if log.survived[0] else min(log.fell[0] + 0.1, log.time[-1])
    return camera.strip(log, np.linspace(max(end - 4.0, 0.0), end, 6))
