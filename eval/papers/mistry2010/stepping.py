"""[M10] figures 8 and 9: squatting at 2 Hz, stepping every 3 s, pushed with 200 N."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eval.page.figures import lines
from eval.page.html import columns, figure, heading
from eval.papers.camera import Camera, logged
from eval.papers.experiment import (
    Finding,
    Progress,
    Result,
    Setting,
    experiment,
    judged,
    prose,
    row,
)
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, base_returning, following
from eval.papers.mistry2010.laws import Law, limited, orthogonal
from eval.papers.mistry2010.laws import rivals as rival_laws
from eval.papers.mistry2010.squats import JOINTS, joint_columns
from eval.papers.mistry2010.stepper import Stepper
from eval.papers.trial import Controller, Push, Trial, pushed, simulate
from eval.wording import number, percent
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
Pick = Callable[[Log], np.ndarray]


def controller(robot: Robot, motion: str, name: str) -> Controller:
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
    force: float, times: tuple[float, ...], count: int, seed: int, spare: int = 0
) -> tuple[Push, ...]:
    """Push `count` robots at these times, each time in a random direction, and `spare` never."""
    rng = np.random.default_rng(seed)
    found = []
    for moment in times:
        angle = rng.uniform(-np.pi, np.pi, count)
        vector = force * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        none = np.zeros((spare, 3))
        found.append(
            Push(np.full(count + spare, moment), PUSH_SECONDS, np.concatenate([vector, none]))
        )
    return tuple(found)


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


def first_fall(row: dict[str, Any]) -> str:
    """Say when the first robot of a run fell."""
    return "none falls" if row["first"] is None else f"{row['first']:.1f} s"


def outcome(row: dict[str, Any]) -> str:
    """Say how many stay up, and how long all do."""
    fallen = "" if row["first"] is None else "the first falls at "
    return f"{percent(row['up'])}; {fallen}{first_fall(row)}"


def summary(log: Log) -> dict[str, Any]:
    """Who stayed up, and how well."""
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
def fig8_9_stepping(setting: Setting) -> Result:
    """The long run of each controller and motion, then how much each takes, then the rivals."""
    robot = load("biped")
    motions = {name: stepping(robot, steps) for name, steps in MOTIONS.items()}
    count, every = setting.pick(24, 4), setting.pick(5.0, 1.0)
    seconds = setting.pick(60.0, 2.0)
    times = tuple(np.arange(every, seconds - 1e-9, every).tolist())
    start = np.random.default_rng(2).uniform(0.0, 3.0, count + UNPUSHED)
    long: list[dict[str, Any]] = []
    logs: dict[str, Log] = {}
    for (motion, name), progress in setting.progress.part(0.0, 0.7, "200 N").each(CELLS, ", ".join):
        # Others than ours fall soon enough.
        spare, span = (UNPUSHED, seconds) if name == OURS else (0, setting.pick(20.0, seconds))
        counted = ("steps", "captures") if name == OURS else ()
        pushes = random_pushes(FORCE, times, count, 1, spare)
        trial = Trial(
            robot, following(motions[motion]), span, count + spare, start=start[: count + spare],
            disturb=pushed(*pushes), every=EVERY, watch=("base", "base_target", *counted),
        )  # fmt: skip
        log = simulate(trial, controller(robot, motion, name), progress)
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
    part = setting.progress.part
    numbers["short"] = _forces(robot, setting, numbers["forces"], part(0.7, 0.9, "sizes of push"))
    numbers["rivals"] = _rivals(robot, setting, part(0.9, 1.0, "rivals"))
    return Result(findings(numbers), numbers, _body(numbers, logs))


def _forces(
    robot: Robot, setting: Setting, forces: list[float], progress: Progress
) -> list[dict[str, Any]]:
    """Share of robots that survive pushes of each size, all sizes in one batch."""
    each, times = setting.pick(5, 2), setting.pick((1.0, 4.0), (0.2,))
    count = each * len(forces)
    start = np.resize(np.random.default_rng(3).uniform(0.0, 3.0, each), count)
    size = np.repeat(forces, each)[:, None]
    pushes = (
        Push(np.resize(begin, count), span, size * np.tile(force, (len(forces), 1)))
        for begin, span, force in random_pushes(1.0, times, each, 4)
    )
    trial = Trial(
        robot, following(stepping(robot, MOTIONS["crouched"])), times[-1] + setting.pick(2.0, 1.0),
        count, start=start, disturb=pushed(*pushes), every=EVERY,
    )  # fmt: skip
    rows = []
    for name, part in progress.each((PAPER, LIMITED, OURS)):
        log = simulate(trial, controller(robot, "crouched", name), part)
        up = log.survived.reshape(len(forces), each).mean(axis=1)
        rows.append({"name": name, "up": up.tolist()})
    return rows


def _rivals(robot: Robot, setting: Setting, progress: Progress) -> list[dict[str, Any]]:
    """Contact-force feedback while stepping, without pushes and with small ones, side by side."""
    each, times = setting.pick(4, 2), setting.pick((1.0, 4.0), (0.2,))
    trial = Trial(
        robot, following(stepping(robot, MOTIONS["upright"])), setting.pick(5.5, 1.0), 2 * each,
        start=np.tile(np.arange(each) * 3.0 / each, 2), every=EVERY,
        disturb=pushed(*random_pushes(50.0, times, each, 5, each)), watch=("base", "base_target"),
    )  # fmt: skip
    rows = []
    for (name, law), part in progress.each(
        ({PAPER: orthogonal()} | rival_laws(robot)).items(), lambda item: item[0]
    ):
        log = simulate(trial, papers(robot, law), part)
        for force, part_of in ((0.0, slice(each, None)), (50.0, slice(each))):
            rows.append({"name": name, "force": force, **summary(log.of(part_of))})
    return rows


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's claim, for its controller and for ours."""
    count = numbers["count"]
    ours, paper, bound = (
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
            outcome(paper),
            "all stay up",
            paper["up"] == 1.0,
        ),
        Finding(
            f"{soon}: the paper's controller with limited forces, crouched", "", outcome(bound)
        ),
        Finding(
            f"{soon}: the paper's controller, upright and swaying over each foot",
            "",
            outcome(upright),
        ),
    ]


def _body(numbers: dict[str, Any], logs: dict[str, Log]) -> list[str]:
    def cm(metres: float) -> str:
        return f"{100.0 * metres:.1f} cm"

    ours = row(numbers["long"], motion="crouched", name=OURS)
    count, seconds, every = numbers["count"], numbers["seconds"], numbers["every"]
    filmed = min(12.0, seconds)
    with Camera(load("biped"), 640, 480, azimuth=155.0, nearer=1.3) as camera:
        film = camera.film(
            logs[OURS], 15.0, f"{OURS.capitalize()}, crouched: the first {filmed:g} s, a push of "
            f"{FORCE:.0f} N every {every:g} s.", filmed,
        )  # fmt: skip
    moments = every + np.array([-0.1, 0.1, 0.3, 0.5, 0.8, 1.2, 2.0])
    with Camera(load("biped"), 224, 300, azimuth=155.0, nearer=1.25) as camera:
        caption, words = "A push of 200 N, as the paper's figure 8.", "the robot under a push"
        strip = camera.strip(logs[OURS], moments, caption, words)
    chart = lines(
        numbers["forces"],
        [(run["name"], COLOURS[run["name"]], run["up"]) for run in numbers["short"]],
        "Survival of two pushes, crouched", "N for 150 ms", (0.0, 1.04), percent,
    )  # fmt: skip
    holds = (
        ("base, cm", lambda r: number(100 * r["base"], 2)),
        ("joints, mrad", lambda r: number(1e3 * r["error"])),
        ("torque, N·m", lambda r: number(r["torque"])),
    )
    up = ("stay up", lambda r: percent(r["up"]))
    case = (f"{FORCE:.0f} N every {every:g} s", lambda r: f"{r['motion']}: {r['name']}")
    name, size = ("", lambda r: r["name"]), ("pushes", lambda r: f"{r['force']:.0f} N")
    return [
        film,
        strip,
        prose(f"""
{count} robots, each pushed in directions and at phases of its own. Why the paper's controller
falls: eq. (15) asks the ground for whatever force brings the base back, and the ground neither
pulls nor holds beyond the soles' edge. Limited forces help, but do not suffice.

What ours does instead: 200 N for 150 ms give this robot of 55 kg 0.54 m/s. If the centre of
pressure goes to the far edge of the soles at once, a distance d away, the point where the robot
falls, ξ = c + ċ/ω, is (exp(ωT) − 1)(F/mω² − d) farther out after the push:
{cm(numbers["carried"]["upright"])} in the upright motion and {cm(numbers["carried"]["crouched"])}
in the crouched one, of the {cm(numbers["half_sole"])} that half a sole has. So our motion is low
(knees at 1.6 rad), the feet stand 28 cm apart and each is up for 0.15 s only. The paper does not
give its robot's mass or stance.

Our controller (stepper.py) is the walk of this package on flat feet, eq. (19) with another task:
the centre of mass follows a law for ξ, with the centre of pressure within the soles, the base the
height of the squat, the trunk upright. Forces are limited to the friction cones, the trunk's moment
gives way first, and a foot in the air is a task in space. A planned step waits until ξ is within
3 cm of the middle of the feet, and if ξ gets to the ends of the soles, the robot steps to where it
can be caught. All these are our choices, not the paper's.

In {seconds:g} s a robot took {ours["steps"] / count:.1f} planned steps of about
{2.0 * seconds / MOTIONS["upright"].period:.0f}, and {ours["captures"] / count:.1f} that were not
planned, for {numbers["pushes"]} pushes. Of {numbers["unpushed"]} robots that nobody pushed,
{percent(ours["unpushed"])} stayed up. Numbers of the controller were chosen on other pushes than
these, of up to 250 N."""),
        figure(
            [chart],
            "Survival of two pushes in random directions at random phases, three seconds apart, "
            "all controllers in the same crouched motion.",
            1,
        ),
        columns(numbers["long"], (case, up, ("first fall", first_fall), *holds)),
        heading("As the paper's figure 9"),
        figure(
            _detail({name: logs[name] for name in (OURS, PAPER)}, every),
            f"Base and left leg, crouched, pushed with {FORCE:.0f} N. The paper's controller "
            "follows the joints of the motion, ours puts the feet where they belong, so its legs "
            "are elsewhere while a foot is in the air or stands elsewhere. Nor does it sway with "
            "the motion: it leans over a foot only to step. Base: from the middle of the feet.",
            3,
        ),
        heading("Contact-force feedback on the upright motion"),
        columns(numbers["rivals"], (name, size, up, *holds)),
    ]


def _detail(logs: dict[str, Log], push: float) -> list[str]:
    robot = load("biped")
    legs = joint_columns(robot)

    def chart(title: str, pick: Pick, desired: Pick | None = None) -> str:
        curves = [] if desired is None else [("desired", 7, logs[OURS], desired(logs[OURS]))]
        curves += [(name, COLOURS[name], log, pick(log)) for name, log in logs.items()]
        return logged(curves, title, push - 2.0, push + 4.0)

    def cm(what: str, axis: int) -> Pick:
        return lambda log: 100 * log[what][:, 0, axis]

    def of(what: str, column: int) -> Pick:
        return lambda log: log[what][:, 0, column]

    return [
        chart("Base sideways, cm", cm("base", 1), cm("base_target", 1)),
        chart("Base forward, cm", cm("base", 0), cm("base_target", 0)),
        *(
            chart(f"Left {label}, rad", of("qpos", 7 + column), of("target", column))
            for label, column in zip(JOINTS, legs, strict=True)
        ),
        chart("Left knee, torque in N·m", of("torque", legs[1])),
    ]
