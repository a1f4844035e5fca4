"""[G15] figures 1 and 2: a pendulum hits the hip from the side."""

from typing import Any

import numpy as np

from eval.page.figures import traces
from eval.page.html import columns, figure, folded, heading, table, text
from eval.papers.camera import Camera, logged
from eval.papers.experiment import Experiment, Result, Setting, main
from eval.papers.garofalo2015.balancer import (
    BALANCERS,
    GAROFALO,
    INVERSE,
    ON_MOMENTUM,
    ON_VELOCITY,
    OTT,
    Balancer,
    balancer,
)
from eval.papers.garofalo2015.bout import Blow, bout
from eval.papers.garofalo2015.measures import blow_numbers
from eval.papers.garofalo2015.pendulum import Pendulum, world_with_pendulum
from eval.papers.log import Log
from eval.papers.page import Finding, fate, judged
from eval.papers.trial import simulate
from eval.wording import number
from fbid_gym.robots import load

START = 1.0
"""s, when the pendulum is let go."""

EVERY = 5
COLOUR = {OTT: 1, GAROFALO: 0, INVERSE: 2}
AXES = (("x", 7), ("y", 0), ("z", 3))
SIDEWAYS = np.array([[0.0, 1.0, 0.0]])

PAPER = {
    "com": 0.045,
    "com_settled": 4.7,
    "rotation": 0.11,
    "rotation_settled": 4.7,
    "linear": 14.5,
    "angular": 1.2,
}
"""[G15], section 5: m, s, rad, s, kg m/s, kg m^2/s."""

VARIANTS: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "as above": ({}, {}),
    "bounce 0.3": ({"bounce": 0.3}, {}),
    "bounce 0.5": ({"bounce": 0.5}, {}),
    "they touch for 10 ms": ({"contact_seconds": 0.01}, {}),
    "they touch for 50 ms": ({"contact_seconds": 0.05}, {}),
    "upper body held at 3 Hz": ({}, {"posture_hertz": 3.0}),
    "upper body held at 0.7 Hz": ({}, {"posture_hertz": 0.7}),
    "joint friction compensated": ({}, {"compensate_damping": True}),
}
"""What the paper does not say, one thing changed at a time: of the pendulum, of the balancer."""


def hit(controller: Balancer, seconds: float, pendulum: Pendulum) -> Log:
    """Let the pendulum hit a robot once."""
    blow = Blow(START, SIDEWAYS, np.array([pendulum.energy]))
    return simulate(bout(controller.robot, pendulum, blow, seconds, every=EVERY), controller)


def run(setting: Setting) -> Result:
    """Hit a robot under each balancer, then vary what the paper leaves open."""
    robot, seconds = load("humanoid"), setting.pick(9.0, 4.0)
    variants = dict(list(VARIANTS.items())[: setting.pick(None, 2)])
    pairs = [(wrench, each) for wrench in (ON_VELOCITY, ON_MOMENTUM) for each in BALANCERS]
    arrays: dict[str, np.ndarray] = {}
    rows: dict[str, list[dict[str, Any]]] = {"balancers": [], "pairs": [], "varied": []}
    for name, _ in setting.progress.part(0.0, 0.4).each(BALANCERS):
        log = hit(balancer(robot, name), seconds, Pendulum())
        rows["balancers"].append({"name": name} | blow_numbers(log, START))
        arrays |= log.arrays(f"{name}.")
    for (wrench, torque_map), _ in setting.progress.part(0.4, 0.6).each(pairs, " ".join):
        log = hit(Balancer(robot, wrench, torque_map), START + 2.0, Pendulum())
        pair = {"wrench": wrench, "map": torque_map}
        rows["pairs"].append(pair | blow_numbers(log, START))
    for name, _ in setting.progress.part(0.6, 1.0).each(variants):
        pendulum, options = variants[name]
        log = hit(balancer(robot, GAROFALO, **options), seconds, Pendulum(**pendulum))
        rows["varied"].append({"name": name} | blow_numbers(log, START))
    return Result(findings(rows["balancers"]), rows | {"seconds": seconds}, arrays)


def findings(balancers: list[dict[str, Any]]) -> list[Finding]:
    """The paper's numbers beside those of its balancer here."""
    ours = next(row for row in balancers if row["name"] == GAROFALO)
    fallen = [row["name"] for row in balancers if row["fell"] is not None]
    return [
        judged(
            "After the blow",
            "stays up",
            "all three balancers stay up" if not fallen else f"falls: {', '.join(fallen)}",
            "stays up",
            ours["fell"] is None,
        ),
        Finding(
            "Centre of mass, largest error, m",
            f"{PAPER['com']:g} in y",
            f"{number(ours['com'][1], 2)} in y",
        ),
        Finding("Its settling time, s", f"{PAPER['com_settled']:g}", f"{ours['com_settled']:.1f}"),
        Finding(
            "Orientation of the hip, largest error, rad",
            f"{PAPER['rotation']:g} about x",
            f"{number(ours['rotation'][0], 2)} about x",
        ),
        Finding(
            "Its settling time, s",
            f"{PAPER['rotation_settled']:g}",
            f"{ours['rotation_settled']:.1f}",
        ),
        Finding(
            "Largest linear momentum, kg m/s (the bounce is chosen for it)",
            f"{PAPER['linear']:g}",
            number(ours["linear"]),
        ),
        Finding(
            "Largest angular momentum, kg m²/s",
            f"{PAPER['angular']:g}, noisy",
            number(ours["angular"], 2),
        ),
    ]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers = result.numbers
    logs = {law: Log.from_arrays(result.arrays, f"{law}.") for law in BALANCERS}
    return [
        pictures(logs[GAROFALO]),
        figure(
            axes_charts(logs[GAROFALO]),
            "[G15]'s balancer with the gains of its table 1, as the paper's figure 2: errors "
            "of centre of mass and orientation, linear and angular momentum. The pendulum is "
            f"let go at {START:g} s.",
        ),
        heading("Three balancers"),
        figure(
            law_charts(logs),
            "The components that the blow excites. The gains of Ott 2011 are those that damp a "
            "rigid body as table 1 does.",
        ),
        numbers_table(numbers["balancers"], "balancer"),
        text("The hip leans most under the paper's balancer. Exchanging laws and maps shows why:"),
        pairs_table(numbers["pairs"]),
        text(
            "Half of it is the law. A robot that sways upright on its legs has angular "
            "momentum, because its top moves fastest. (38) damps that momentum, so the hip "
            "leans against the sway; (36) damps the spin of the hip, which does not see it. "
            "Full inverse dynamics, which realises the wrench of (38), leans as well.",
            "The other half is the map. In [G15]'s coordinates, neglecting the joints' "
            "accelerations means that the robot turns like one rigid body about its centre of "
            "mass, planted legs included. In those of Ott 2011 it means that a moment turns "
            "the hip alone, which is nearer to what a standing robot does. The last rows have "
            "the wrench that is lost so. The paper's point, that (38) leaves nothing out of "
            "the momentum's equation, holds for the wrench that is wanted; the quasi-static "
            "torques do not produce all of it.",
        ),
        folded(
            "What the paper does not say, one thing changed at a time",
            numbers_table(numbers["varied"], "[G15]'s balancer"),
        ),
        text(
            "What differs from the paper, and why. The robot is simulated, from published "
            "link data, with ideal torque control and no play, delay or elasticity in its "
            "joints. The momentum is that of the simulation; the paper's comes from noisy "
            "joint velocities. The sideways gains of table 1 damp little (a tenth of critical "
            "damping), so the settling time follows from them and the joints' friction. "
            "“Settled” means below a tenth of the peak here; the paper does not say."
        ),
    ]


def axes_charts(log: Log) -> list[str]:
    """The four panels of the paper's figure 2."""
    panels = (
        ("Centre of mass, error in mm", 1e3 * log["com"][:, 0]),
        ("Hip, orientation error in rad", log["rotation"][:, 0]),
        ("Linear momentum, kg m/s", log["momentum"][:, 0, :3]),
        ("Angular momentum, kg m²/s", log["momentum"][:, 0, 3:]),
    )
    return [
        traces(
            log.time,
            [(axis, colour, values[:, k]) for k, (axis, colour) in enumerate(AXES)],
            title,
        )
        for title, values in panels
    ]


def law_charts(logs: dict[str, Log]) -> list[str]:
    """One component of each quantity, for the three balancers."""
    panels = (
        ("Centre of mass, y, error in mm", lambda r: 1e3 * r["com"][:, 0, 1]),
        ("Hip, about x, error in rad", lambda r: r["rotation"][:, 0, 0]),
        ("Linear momentum, y, kg m/s", lambda r: r["momentum"][:, 0, 1]),
        ("Angular momentum, x, kg m²/s", lambda r: r["momentum"][:, 0, 3]),
    )
    return [
        logged([(law, COLOUR[law], log, pick(log)) for law, log in logs.items()], title)
        for title, pick in panels
    ]


def numbers_table(rows: list[dict[str, Any]], what: str) -> str:
    """Peaks and settling times."""
    cells = (
        (what, lambda row: row["name"]),
        ("centre of mass, y, mm", lambda row: f"{1e3 * row['com'][1]:.0f}"),
        ("settled, s", lambda row: f"{row['com_settled']:.1f}"),
        ("hip about x, rad", lambda row: f"{row['rotation'][0]:.3f}"),
        ("settled, s", lambda row: f"{row['rotation_settled']:.1f}"),
        ("linear momentum, kg m/s", lambda row: number(row["linear"])),
        ("angular, kg m²/s", lambda row: number(row["angular"], 2)),
        ("", lambda row: fate(row["fell"])),
    )
    return columns(rows, cells)


def pairs_table(rows: list[dict[str, Any]]) -> str:
    """Hip angle, angular momentum and lost wrench by law and map."""
    heads = ["", *(f"map of {m}" for m in BALANCERS)]
    cells = []
    for label, form in (
        ("hip about x, rad", lambda row: f"{row['rotation'][0]:.3f}"),
        ("angular momentum, kg m²/s", lambda row: number(row["angular"], 2)),
        ("force lost, rms, N", lambda row: number(row["unrealised"][0])),
        ("moment lost, rms, N m", lambda row: number(row["unrealised"][1])),
    ):
        for wrench in (ON_VELOCITY, ON_MOMENTUM):
            own = {row["map"]: row for row in rows if row["wrench"] == wrench}
            cells.append([f"{label}, wrench {wrench}", *(form(own[m]) for m in BALANCERS)])
    return table(heads, cells)


def pictures(log: Log) -> str:
    """A strip of frames around the blow, seen from the front."""
    moments = (START - 0.002, START + 0.02, START + 0.2, START + 0.35, START + 0.7, START + 2.0)
    robot = load("humanoid")
    world = world_with_pendulum(robot, Pendulum())
    with Camera(robot, 224, 320, 180.0, -6.0, model=world, nearer=0.92) as camera:
        return camera.strip(
            log,
            moments,
            "The pendulum and the robot, from the front; [G15]'s balancer. The pendulum is caught "
            "when it has hit.",
            "a humanoid robot is hit at its hip by a pendulum and sways to the side",
            2,
        )


EXPERIMENT = Experiment(
    module="eval.papers.garofalo2015.fig2_push",
    title="Figures 1 and 2: a pendulum hits the hip",
    about=(
        "A point mass of 5 kg hits the hip of a standing humanoid from the side with 17.4 J. The "
        "pendulum is a body of the simulation; gains are the paper's table 1."
    ),
    run=run,
    show=show,
    minutes=0.8,
)

if __name__ == "__main__":
    main(EXPERIMENT)
