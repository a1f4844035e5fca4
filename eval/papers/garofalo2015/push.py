"""[G15] figures 1 and 2: a pendulum hits the hip from the side."""

from typing import Any

import numpy as np

from eval.page.figures import traces
from eval.page.html import columns, figure, folded, heading, table, text
from eval.papers.camera import Camera, logged
from eval.papers.experiment import Finding, Result, Setting, experiment, fate, judged, prose, row
from eval.papers.garofalo2015.balancer import COLOUR, GAROFALO, ON_MOMENTUM, ON_VELOCITY, Balancer
from eval.papers.garofalo2015.bout import SIDEWAYS, Blow, blow_numbers, bout
from eval.papers.garofalo2015.pendulum import Pendulum, world_with_pendulum
from eval.papers.log import Log
from eval.papers.trial import simulate
from eval.wording import number
from fbid_gym.robots import load

START = 1.0
"""s, when the pendulum is let go."""

AXES = (("x", 7), ("y", 0), ("z", 3))
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
    return simulate(bout(controller.robot, pendulum, blow, seconds, every=5), controller)


@experiment(
    "Figures 1 and 2: a pendulum hits the hip",
    """A point mass of 5 kg hits the hip of a standing humanoid from the side with 17.4 J. The
    pendulum is a body of the simulation; gains are the paper's table 1.""",
    minutes=0.8,
)
def fig2_push(setting: Setting) -> Result:
    """Hit a robot under each balancer, then vary what the paper leaves open."""
    robot, seconds = load("humanoid"), setting.pick(9.0, 4.0)
    variants = dict(list(VARIANTS.items())[: setting.pick(None, 2)])
    pairs = [(wrench, each) for wrench in (ON_VELOCITY, ON_MOMENTUM) for each in COLOUR]
    logs: dict[str, Log] = {}
    rows: dict[str, list[dict[str, Any]]] = {"balancers": [], "pairs": [], "varied": []}
    for name, _ in setting.progress.part(0.0, 0.4).each(COLOUR):
        log = logs[name] = hit(Balancer(robot, name), seconds, Pendulum())
        rows["balancers"].append({"name": name} | blow_numbers(log, START))
    for (wrench, torque_map), _ in setting.progress.part(0.4, 0.6).each(pairs, " ".join):
        log = hit(Balancer(robot, torque_map, wrench), START + 2.0, Pendulum())
        pair = {"wrench": wrench, "map": torque_map}
        rows["pairs"].append(pair | blow_numbers(log, START))
    for name, _ in setting.progress.part(0.6, 1.0).each(variants):
        pendulum, options = variants[name]
        log = hit(Balancer(robot, GAROFALO, **options), seconds, Pendulum(**pendulum))
        rows["varied"].append({"name": name} | blow_numbers(log, START))
    ours = row(rows["balancers"], name=GAROFALO)
    fallen = [r["name"] for r in rows["balancers"] if r["fell"] is not None]
    stood = f"falls: {', '.join(fallen)}" if fallen else "all three balancers stay up"
    findings = [
        judged("After the blow", "stays up", stood, "stays up", ours["fell"] is None),
        *(
            Finding(*told)
            for told in (
                ("Centre of mass, largest error, m", "0.045 in y",
                 f"{number(ours['com'][1], 2)} in y"),
                ("Its settling time, s", "4.7", f"{ours['com_settled']:.1f}"),
                ("Orientation of the hip, largest error, rad", "0.11 about x",
                 f"{number(ours['rotation'][0], 2)} about x"),
                ("Its settling time, s", "4.7", f"{ours['rotation_settled']:.1f}"),
                ("Largest linear momentum, kg m/s (the bounce is chosen for it)", "14.5",
                 number(ours["linear"])),
                ("Largest angular momentum, kg m²/s", "1.2, noisy", number(ours["angular"], 2)),
            )
        ),
    ]  # fmt: skip
    return Result(findings, rows | {"seconds": seconds}, _body(rows, logs))


def _body(rows: dict[str, list[dict[str, Any]]], logs: dict[str, Log]) -> list[str]:
    ours = logs[GAROFALO]
    axes = [
        traces(ours.time, [(axis, c, values[:, k]) for k, (axis, c) in enumerate(AXES)], title)
        for title, values in (
            ("Centre of mass, error in mm", 1e3 * ours["com"][:, 0]),
            ("Hip, orientation error in rad", ours["rotation"][:, 0]),
            ("Linear momentum, kg m/s", ours["momentum"][:, 0, :3]),
            ("Angular momentum, kg m²/s", ours["momentum"][:, 0, 3:]),
        )
    ]
    by_law = [
        logged([(n, COLOUR[n], log, scale * log[what][:, 0, k]) for n, log in logs.items()], title)
        for title, what, k, scale in (
            ("Centre of mass, y, error in mm", "com", 1, 1e3),
            ("Hip, about x, error in rad", "rotation", 0, 1.0),
            ("Linear momentum, y, kg m/s", "momentum", 1, 1.0),
            ("Angular momentum, x, kg m²/s", "momentum", 3, 1.0),
        )
    ]
    moments = (START - 0.002, START + 0.02, START + 0.2, START + 0.35, START + 0.7, START + 2.0)
    robot = load("humanoid")
    world = world_with_pendulum(robot, Pendulum())
    with Camera(robot, 224, 320, 180.0, -6.0, model=world, nearer=0.92) as camera:
        strip = camera.strip(
            ours,
            moments,
            "The pendulum and the robot, from the front; [G15]'s balancer. The pendulum is caught "
            "when it has hit.",
            "a humanoid robot is hit at its hip by a pendulum and sways to the side",
            2,
        )
    return [
        strip,
        figure(
            axes,
            "[G15]'s balancer with the gains of its table 1, as the paper's figure 2: errors of "
            "centre of mass and orientation, linear and angular momentum. The pendulum is let go "
            f"at {START:g} s.",
        ),
        heading("Three balancers"),
        figure(
            by_law,
            "The components that the blow excites. The gains of Ott 2011 are those that damp a "
            "rigid body as table 1 does.",
        ),
        _peaks(rows["balancers"], "balancer"),
        text("The hip leans most under the paper's balancer. Exchanging laws and maps shows why:"),
        _pairs(rows["pairs"]),
        prose("""
Half of it is the law. A robot that sways upright on its legs has angular momentum, because its top
moves fastest. (38) damps that momentum, so the hip leans against the sway; (36) damps the spin of
the hip, which does not see it. Full inverse dynamics, which realises the wrench of (38), leans as
well.

The other half is the map. In [G15]'s coordinates, neglecting the joints' accelerations means that
the robot turns like one rigid body about its centre of mass, planted legs included. In those of Ott
2011 it means that a moment turns the hip alone, which is nearer to what a standing robot does. The
last rows have the wrench that is lost so. The paper's point, that (38) leaves nothing out of the
momentum's equation, holds for the wrench that is wanted; the quasi-static torques do not produce
all of it."""),
        folded(
            "What the paper does not say, one thing changed at a time",
            _peaks(rows["varied"], "[G15]'s balancer"),
        ),
        prose("""
What differs from the paper, and why. The robot is simulated, from published link data, with ideal
torque control and no play, delay or elasticity in its joints. The momentum is that of the
simulation; the paper's comes from noisy joint velocities. The sideways gains of table 1 damp little
(a tenth of critical damping), so the settling time follows from them and the joints' friction.
“Settled” means below a tenth of the peak here; the paper does not say."""),
    ]


def _peaks(rows: list[dict[str, Any]], what: str) -> str:
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


def _pairs(rows: list[dict[str, Any]]) -> str:
    """Hip angle, angular momentum and lost wrench by law and map."""
    told = {
        "hip about x, rad": lambda row: f"{row['rotation'][0]:.3f}",
        "angular momentum, kg m²/s": lambda row: number(row["angular"], 2),
        "force lost, rms, N": lambda row: number(row["unrealised"][0]),
        "moment lost, rms, N m": lambda row: number(row["unrealised"][1]),
    }
    cells = [
        [f"{label}, wrench {w}", *(form(row(rows, wrench=w, map=m)) for m in COLOUR)]
        for label, form in told.items()
        for w in (ON_VELOCITY, ON_MOMENTUM)
    ]
    return table(["", *(f"map of {m}" for m in COLOUR)], cells)
