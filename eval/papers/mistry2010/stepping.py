"""[M10] figures 8 and 9: squatting at 2 Hz, stepping every 3 s, pushed with 200 N."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eval.papers.camera import Camera
from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, base_returning, following
from eval.papers.mistry2010.laws import Law, limited, orthogonal
from eval.papers.mistry2010.laws import rivals as rival_laws
from eval.papers.mistry2010.squats import JOINTS, joint_columns
from eval.papers.mistry2010.stepper import Stepper
from eval.papers.trial import Disturbance, TickController, Trial, pushed, simulate
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.motions import Steps, stepping
from fbid_gym.robots import Robot, load

FORCE, PUSH_SECONDS = 200.0, 0.15
UNPUSHED = 4
FORCES = (0.0, 100.0, 150.0, 200.0, 250.0)
MOTIONS = {
    # The centre of mass sways over one foot before the other is lifted.
    "upright": Steps(),
    # Deep in the knees, feet 28 cm apart, and each foot is up for 0.15 s only: it hops.
    "crouched": Steps(knee=1.6, amplitude=0.1, sway=0.06, single=0.05, lift=(-0.1, 0.2, -0.1),
                      ramp=0.07, spread=0.05),
}  # fmt: skip
PAPER, LIMITED, OURS = "eqs. (15), (19)", "the same, limited forces", "ours, with steps"
COLOURS = {PAPER: 0, LIMITED: 2, OURS: 4}
CELLS = (("crouched", OURS), ("crouched", LIMITED), ("crouched", PAPER), ("upright", PAPER))
EVERY = 10


def controller(robot: Robot, motion: str, name: str) -> TickController:
    """Return the paper's controller, the same with limited forces, or ours."""
    if name == OURS:
        return Stepper(robot, MOTIONS[motion])
    return papers(robot, orthogonal() if name == PAPER else limited(robot, base_priority=1e3))


def papers(
    robot: Robot,
    law: Law,
    hertz: float | np.ndarray = 2.0,
    zeta: float | np.ndarray = 0.5,
    base: float | np.ndarray = 1.0,
) -> JointController:
    """Return the paper's controller, eqs. (18) to (20).

    Args:
        robot: whose joints.
        law: inverse dynamics.
        hertz: Hz of the joints, or (N,).
        zeta: their damping ratio, or (N,).
        base: Hz of the base's return, or (N, 1).
    """
    gains, desire = PdGains.of(robot, hertz, zeta), base_returning(robot, base)
    return JointController(robot, gains, law, desire=desire)


def random_pushes(
    force: float | np.ndarray, times: Sequence[float], count: int, seed: int, spare: int = 0
) -> Disturbance:
    """Push `count` robots at these times, each time in a random direction, and `spare` never.

    The same directions again for as many robots as there are forces.
    """
    rng = np.random.default_rng(seed)
    angle = np.stack([rng.uniform(-np.pi, np.pi, count) for _ in times], axis=1)
    direction = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=2)
    pushes = np.concatenate([size * direction for size in np.atleast_1d(force)])
    pushes = np.concatenate([pushes, np.zeros((spare, len(times), 3))])
    return pushed(np.tile(times, (len(pushes), 1)), pushes, PUSH_SECONDS)


def half_sole(robot: Robot) -> float:
    """Return how far a sole reaches forward and backward of its middle, m."""
    return float(np.ptp(contact_geometry(robot).offset[:, 0])) / 2.0


def carried(robot: Robot, steps: Steps) -> float:
    """Return how far a push carries the point where the robot falls, m.

    That is xi = c + cdot / omega, with the centre of pressure at the end of the soles all the while
    and the centre of mass at the motion's mean height.
    """
    motion = stepping(robot, steps)
    height = motion.reference(np.arange(motion.period)).com[:, 2].mean()
    omega = np.sqrt(robot.weight / robot.mass / height)
    rise = np.exp(omega * PUSH_SECONDS) - 1.0
    return float(rise * (FORCE / (robot.mass * omega**2) - half_sole(robot)))


def summary(log: Log) -> Numbers:
    """Summarise who stayed up, and how well."""
    fell = log.fell[~np.isnan(log.fell)]
    return {
        "up": float(log.survived.mean()),
        "first": None if not len(fell) else float(fell.min()),
        "fell": [log.fall(k) for k in range(len(log.fell))],
        "error": float(np.nanmean(log.rms_of_joints(log.error))),
        "base": float(np.nanmean(log.rms(log["base"] - log["base_target"]))),
        "torque": float(np.nanmean(log.rms(log["torque"]))),
    }


@experiment(
    "Figures 8 and 9: squatting, stepping, pushed",
    """A squat at 2 Hz, a step of either foot every 3 s with contacts that switch instantly, and
    200 N on the base for 150 ms every 5 s in random directions: 60 s. Two stepping motions: upright
    with a sway over each foot, and crouched with quick steps. The paper's controller, and one of
    ours that also takes steps of its own.""",
    minutes=4.0,
)
def fig8_9_stepping(setting: Setting) -> Measured:
    """The long run of each controller and motion, then how much each takes, then the rivals."""
    robot = load("biped")
    motions = {name: stepping(robot, steps) for name, steps in MOTIONS.items()}
    count, every = setting.pick(24, 4), setting.pick(5.0, 1.0)
    seconds = setting.pick(60.0, 2.0)
    times = tuple(np.arange(every, seconds - 1e-9, every).tolist())
    start = np.random.default_rng(2).uniform(0.0, 3.0, count + UNPUSHED)
    long: list[Numbers] = []
    logs: dict[str, Log] = {}
    for motion, name in setting.each(CELLS, 0.7):
        # Others than ours fall soon enough.
        spare, span = (UNPUSHED, seconds) if name == OURS else (0, setting.pick(20.0, seconds))
        counted = ("steps", "captures") if name == OURS else ()
        trial = Trial(
            robot, following(motions[motion]), span, count + spare, start=start[: count + spare],
            disturb=random_pushes(FORCE, times, count, 1, spare), every=EVERY,
            watch=("base", "base_target", *counted),
        )  # fmt: skip
        log = simulate(trial, controller(robot, motion, name))
        run = {"motion": motion, "name": name, "seconds": span} | summary(log.of(slice(count)))
        run |= {what: float(log[what][-1, :count].sum()) for what in counted}
        if spare:
            run["unpushed"] = float(log.survived[count:].mean())
        long.append(run)
        if motion == "crouched":
            logs[name] = log.of([0])
    numbers = {
        "long": long, "count": count, "unpushed": UNPUSHED, "seconds": seconds, "every": every,
        "pushes": len(times), "forces": list(setting.pick(FORCES, FORCES[::4])),
        "carried": {k: carried(robot, steps) for k, steps in MOTIONS.items()},
        "half_sole": half_sole(robot),
    }  # fmt: skip
    numbers["short"] = _forces(robot, setting, numbers["forces"])
    numbers["rivals"] = _rivals(robot, setting)
    moments = every + np.array([-0.1, 0.1, 0.3, 0.5, 0.8, 1.2, 2.0])
    film = Camera(robot, 640, 480, azimuth=155.0, nearer=1.3).film(logs[OURS], 15.0, 12.0)
    runs = {"ours": ("crouched", OURS), "paper": ("crouched", PAPER)}
    runs |= {"bound": ("crouched", LIMITED), "upright": ("upright", PAPER)}
    return numbers, {
        **{label: row(long, motion=motion, name=name) for label, (motion, name) in runs.items()},
        **{"COLOURS": COLOURS, "FORCE": FORCE, "filmed": min(12.0, seconds), "film": film},
        "planned": 2.0 * seconds / MOTIONS["upright"].period,
        "strip": Camera(robot, azimuth=155.0).strip(logs[OURS], moments),
        "detail": _detail(robot, {name: logs[name] for name in (OURS, PAPER)}),
    }


def _forces(robot: Robot, setting: Setting, forces: list[float]) -> list[Numbers]:
    """Share of robots that survive pushes of each size, all sizes in one batch."""
    each, times = setting.pick(5, 2), setting.pick((1.0, 4.0), (0.2,))
    count = each * len(forces)
    start = np.resize(np.random.default_rng(3).uniform(0.0, 3.0, each), count)
    trial = Trial(
        robot, following(stepping(robot, MOTIONS["crouched"])), times[-1] + setting.pick(2.0, 1.0),
        count, start=start, disturb=random_pushes(np.array(forces), times, each, 4), every=EVERY,
    )  # fmt: skip
    rows = []
    for name in setting.each((PAPER, LIMITED, OURS), 0.9):
        log = simulate(trial, controller(robot, "crouched", name))
        up = log.survived.reshape(len(forces), each).mean(axis=1)
        rows.append({"name": name, "up": up.tolist()})
    return rows


def _rivals(robot: Robot, setting: Setting) -> list[Numbers]:
    """Contact-force feedback while stepping, without pushes and with small ones, side by side."""
    each, times = setting.pick(4, 2), setting.pick((1.0, 4.0), (0.2,))
    trial = Trial(
        robot, following(stepping(robot, MOTIONS["upright"])), setting.pick(5.5, 1.0), 2 * each,
        start=np.tile(np.arange(each) * 3.0 / each, 2), every=EVERY,
        disturb=random_pushes(50.0, times, each, 5, each), watch=("base", "base_target"),
    )  # fmt: skip
    laws = {PAPER: orthogonal()} | rival_laws(robot)
    rows = []
    for name in setting.each(laws):
        log = simulate(trial, papers(robot, laws[name]))
        for force, part_of in ((0.0, slice(each, None)), (50.0, slice(each))):
            rows.append({"name": name, "force": force, **summary(log.of(part_of))})
    return rows


def _detail(robot: Robot, logs: dict[str, Log]) -> dict[str, list[Any]]:
    """Curves of what the paper's figure 9 shows, by title: signal, column, what is desired."""
    legs = dict(zip(JOINTS, joint_columns(robot), strict=True))
    shown = {
        "Base sideways, cm": ("base", 1, ("base_target", 1), 100),
        "Base forward, cm": ("base", 0, ("base_target", 0), 100),
        **{f"Left {j}, rad": ("qpos", 7 + k, ("target", k), 1) for j, k in legs.items()},
        "Left knee, torque in N·m": ("torque", legs["knee"], None, 1),
    }
    curves: dict[str, list[Any]] = {}
    for title, (what, column, desired, scale) in shown.items():
        curves[title] = [
            (n, COLOURS[n], log, scale * log[what][:, 0, column]) for n, log in logs.items()
        ]
        if desired:
            target, ours = desired, logs[OURS]
            curves[title].insert(0, ("desired", 7, ours, scale * ours[target[0]][:, 0, target[1]]))
    return curves
