"""[G15] figures 1 and 2: a pendulum hits the hip from the side."""

from typing import Any

import numpy as np

from eval.papers.camera import Camera
from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.garofalo2015.balancer import COLOUR, GAROFALO, ON_MOMENTUM, ON_VELOCITY, Balancer
from eval.papers.garofalo2015.bout import SIDEWAYS, Blow, blow_numbers, bout
from eval.papers.garofalo2015.pendulum import PendulumBlow, world_with_pendulum
from eval.papers.log import Log
from eval.papers.trial import simulate
from fbid_gym.robots import load

START = 1.0
"""s, when the pendulum is let go."""

AXES = {"x": 7, "y": 0, "z": 3}
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


def hit(controller: Balancer, seconds: float, pendulum: PendulumBlow) -> Log:
    """Let the pendulum hit a robot once."""
    blow = Blow(START, SIDEWAYS, np.array([pendulum.energy]))
    return simulate(bout(controller.robot, pendulum, blow, seconds, every=5), controller)


@experiment(
    "Figures 1 and 2: a pendulum hits the hip",
    """A point mass of 5 kg hits the hip of a standing humanoid from the side with 17.4 J. The
    pendulum is a body of the simulation; gains are the paper's table 1.""",
    minutes=0.8,
)
def fig2_push(setting: Setting) -> Measured:
    """Hit a robot under each balancer, then vary what the paper leaves open."""
    robot, seconds = load("humanoid"), setting.pick(9.0, 4.0)
    variants = dict(list(VARIANTS.items())[: setting.pick(None, 2)])
    logs: dict[str, Log] = {}
    rows: dict[str, list[Numbers]] = {"balancers": [], "pairs": [], "varied": []}
    for name in setting.each(COLOUR, 0.4):
        log = logs[name] = hit(Balancer(robot, name), seconds, PendulumBlow())
        rows["balancers"].append({"name": name} | blow_numbers(log, START))
    pairs = [(wrench, each) for wrench in (ON_VELOCITY, ON_MOMENTUM) for each in COLOUR]
    for wrench, torque_map in setting.each(pairs, 0.6):
        log = hit(Balancer(robot, torque_map, wrench), START + 2.0, PendulumBlow())
        pair = {"wrench": wrench, "map": torque_map}
        rows["pairs"].append(pair | blow_numbers(log, START))
    for name in setting.each(variants):
        pendulum, options = variants[name]
        log = hit(Balancer(robot, GAROFALO, **options), seconds, PendulumBlow(**pendulum))
        rows["varied"].append({"name": name} | blow_numbers(log, START))
    ours, log = row(rows["balancers"], name=GAROFALO), logs[GAROFALO]
    moments = (START - 0.002, START + 0.02, START + 0.2, START + 0.35, START + 0.7, START + 2.0)
    world = world_with_pendulum(robot, PendulumBlow())
    camera = Camera(robot, 224, 320, 180.0, -6.0, model=world, nearer=0.92)
    return rows | {"seconds": seconds}, {
        **{"ours": ours, "time": log.time, "START": START, "COLOUR": COLOUR},
        "strip": camera.strip(log, moments, 2),
        "fallen": [r["name"] for r in rows["balancers"] if r["fell"] is not None],
        "axes": {
            title: [(axis, c, values[:, k]) for k, (axis, c) in enumerate(AXES.items())]
            for title, values in (
                ("Centre of mass, error in mm", 1e3 * log["com"][:, 0]),
                ("Hip, orientation error in rad", log["rotation"][:, 0]),
                ("Linear momentum, kg m/s", log["momentum"][:, 0, :3]),
                ("Angular momentum, kg m²/s", log["momentum"][:, 0, 3:]),
            )
        },
        "by_law": {
            title: [(n, COLOUR[n], log, scale * log[what][:, 0, k]) for n, log in logs.items()]
            for title, what, k, scale in (
                ("Centre of mass, y, error in mm", "com", 1, 1e3),
                ("Hip, about x, error in rad", "rotation", 0, 1.0),
                ("Linear momentum, y, kg m/s", "momentum", 1, 1.0),
                ("Angular momentum, x, kg m²/s", "momentum", 3, 1.0),
            )
        },
        "by_wrench": {w: [r for r in rows["pairs"] if r["wrench"] == w] for w, _ in pairs},
    }
