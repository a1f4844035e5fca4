"""What figures 8-9 look like on the page."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eval.page.figures import lines
from eval.page.html import columns, figure, heading, text
from eval.papers.camera import Camera, logged
from eval.papers.experiment import Result, row
from eval.papers.log import Log
from eval.papers.mistry2010.joint_tracking import JOINTS, LABELS
from eval.papers.mistry2010.stepping_cases import (
    COLOURS,
    FORCE,
    OURS,
    SHOWN,
    UPRIGHT,
    first_fall,
)
from eval.wording import number, percent
from fbid_gym.robots import load

_FILMED = 12.0  # s
Pick = Callable[[Log], np.ndarray]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers = result.numbers
    chart = lines(
        numbers["forces"],
        [(run["name"], COLOURS[run["name"]], run["up"]) for run in numbers["short"]],
        "Survival of two pushes, crouched", "N for 150 ms",
        (0.0, 1.04), percent,
    )  # fmt: skip
    return [
        _film(result, "crouched", OURS),
        _strip(result, "crouched", OURS),
        text(
            f"{numbers['count']} robots, each pushed in directions and at phases of its own. "
            "Why the paper's controller falls: eq. (15) asks the ground for whatever force "
            "brings the base back, and the ground neither pulls nor holds beyond the soles' "
            "edge. Limited forces help, but do not suffice.",
            "What ours does instead: 200 N for 150 ms give this robot of 55 kg 0.54 m/s. If "
            "the centre of pressure goes to the far edge of the soles at once, a distance "
            "d away, the point where the robot falls, ξ = c + ċ/ω, is "
            "(exp(ωT) − 1)(F/mω² − d) farther out after the push: "
            f"{_cm(numbers['carried']['upright'])} in the upright motion and "
            f"{_cm(numbers['carried']['crouched'])} in the crouched one, of the "
            f"{_cm(numbers['half_sole'])} that half a sole has. So our motion is low (knees at "
            "1.6 rad), the feet stand 28 cm apart and each is up for 0.15 s only. The paper "
            "does not give its robot's mass or stance.",
            "Our controller (stepper.py) is the walk of this package on flat feet, "
            "eq. (19) with another task: the centre of mass follows a law for ξ, with the centre "
            "of pressure within the soles, the base the height of the squat, the trunk upright. "
            "Forces are limited to the friction cones, the trunk's moment gives way first, and a "
            "foot in the air is a task in space. A planned step waits until ξ is within 3 cm of "
            "the middle of the feet, and if ξ gets to the ends of the soles, the robot steps to "
            "where it can be caught. All these are our choices, not the paper's.",
            _counts(numbers),
        ),
        figure(
            [chart],
            "Survival of two pushes in random directions at random phases, three seconds "
            "apart, all controllers in the same crouched motion.",
            1,
        ),
        _table(numbers),
        heading("As the paper's figure 9"),
        figure(
            _detail(result, numbers["every"]),
            f"Base and left leg, crouched, pushed with {FORCE:.0f} N. The paper's controller "
            "follows the joints of the motion, ours puts the feet where they belong, so its "
            "legs are elsewhere while a foot is in the air or stands elsewhere. Nor does it sway "
            "with the motion: it leans over a foot only to step. Base: from the middle of the "
            "feet.",
            3,
        ),
        heading("Contact-force feedback on the upright motion"),
        _rivals_table(numbers),
    ]


def _cm(metres: float) -> str:
    return f"{100.0 * metres:.1f} cm"


def _counts(numbers: dict[str, Any]) -> str:
    ours = row(numbers["long"], motion="crouched", name=OURS)
    count, seconds = numbers["count"], numbers["seconds"]
    planned = 2.0 * seconds / UPRIGHT.period
    return (
        f"In {seconds:g} s a robot took {ours['steps'] / count:.1f} planned steps of about "
        f"{planned:.0f}, and {ours['captures'] / count:.1f} that were not planned, for "
        f"{numbers['pushes']} pushes. Of {numbers['unpushed']} robots that nobody pushed, "
        f"{percent(ours['unpushed'])} stayed up. Numbers of the controller were chosen on other "
        "pushes than these, of up to 250 N."
    )


def _film(result: Result, motion: str, name: str) -> str:
    log = Log.from_arrays(result.arrays, f"{motion}.{name}.")
    seconds, every = min(_FILMED, result.numbers["seconds"]), result.numbers["every"]
    caption = (
        f"{name.capitalize()}, {motion}: the first {seconds:g} s, "
        f"a push of {FORCE:.0f} N every {every:g} s."
    )
    with Camera(load("biped"), 640, 480, azimuth=155.0, nearer=1.3) as camera:
        return camera.film(log, 15.0, caption, _FILMED)


def _strip(result: Result, motion: str, name: str) -> str:
    log = Log.from_arrays(result.arrays, f"{motion}.{name}.")
    moments = result.numbers["every"] + np.array([-0.1, 0.1, 0.3, 0.5, 0.8, 1.2, 2.0])
    caption = "A push of 200 N, as the paper's figure 8."
    with Camera(load("biped"), 224, 300, azimuth=155.0, nearer=1.25) as camera:
        return camera.strip(log, moments, caption, "the robot under a push")


def _detail(result: Result, push: float) -> list[str]:
    names = load("biped").joint_names
    logs = {name: Log.from_arrays(result.arrays, f"{m}.{name}.") for m, name in SHOWN}

    def chart(title: str, pick: Pick, desired: Pick | None = None) -> str:
        curves = [] if desired is None else [("desired", 7, logs[OURS], desired(logs[OURS]))]
        curves += [(name, COLOURS[name], log, pick(log)) for name, log in logs.items()]
        return logged(curves, title, push - 2.0, push + 4.0)

    def base(title: str, axis: int) -> str:
        def cm(what: str) -> Pick:
            return lambda log: 100 * log[what][:, 0, axis]

        return chart(title, cm("base"), cm("base_target"))

    def joint(label: str, column: int) -> str:
        return chart(
            f"Left {label}, rad",
            lambda log: log["qpos"][:, 0, 7 + column],
            lambda log: log["target"][:, 0, column],
        )

    columns = [names.index(name) for name in JOINTS]
    knee = names.index("left_knee")
    return [
        base("Base sideways, cm", 1),
        base("Base forward, cm", 0),
        *(joint(label, column) for label, column in zip(LABELS, columns, strict=True)),
        chart("Left knee, torque in N·m", lambda log: log["torque"][:, 0, knee]),
    ]


_HOLDS = (
    ("base, cm", lambda r: number(100 * r["base"], 2)),
    ("joints, mrad", lambda r: number(1e3 * r["error"])),
    ("torque, N·m", lambda r: number(r["torque"])),
)


def _table(numbers: dict[str, Any]) -> str:
    head = f"{FORCE:.0f} N every {numbers['every']:g} s"
    cells = (
        (head, lambda r: f"{r['motion']}: {r['name']}"),
        ("stay up", lambda r: percent(r["up"])),
        ("first fall", first_fall),
        *_HOLDS,
    )
    return columns(numbers["long"], cells)


def _rivals_table(numbers: dict[str, Any]) -> str:
    cells = (
        ("", lambda r: r["name"]),
        ("pushes", lambda r: f"{r['force']:.0f} N"),
        ("stay up", lambda r: percent(r["up"])),
        *_HOLDS,
    )
    return columns(numbers["rivals"], cells)
