"""Beyond [G15]: balancers whose model of the robot is wrong."""

import numpy as np

from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.garofalo2015.balancer import COLOUR, GAROFALO, Balancer
from eval.papers.garofalo2015.bout import SIDEWAYS, Blow, bout
from eval.papers.garofalo2015.pendulum import PendulumBlow
from eval.papers.log import Log
from eval.papers.trial import simulate
from eval.papers.wrong_models import believing, wrong_model
from fbid_gym.robots import load

SIZES = (0.0, 0.1, 0.2, 0.3)
START, SECONDS = 2.5, 6.0
_SEED = 20150703


def outcome(log: Log) -> Numbers:
    """Find where the robots rest, and how far the blow moves them from there.

    Returns:
        stood: share up to the end; offset (m), lean (rad): median distance from the goal at rest,
        before the blow; swing (m): median largest horizontal distance from there after it; medians
        are over the robots that stood.
    """
    stood = log.survived
    if not stood.any():
        return {"stood": 0.0, "offset": None, "lean": None, "swing": None}
    rest = np.flatnonzero(log.time < START)[-1]
    com, rotation = log["com"][:, stood], log["rotation"][rest, stood]
    moved = np.linalg.norm((com - com[rest])[rest:, :, :2], axis=2).max(axis=0)
    return {
        "stood": float(stood.mean()),
        "offset": float(np.median(np.linalg.norm(com[rest], axis=1))),
        "lean": float(np.median(np.linalg.norm(rotation, axis=1))),
        "swing": float(np.median(moved)),
    }


@experiment(
    "Left open: a wrong model",
    """Every link's mass is off by a random factor and its centre of mass displaced, by up to 10, 20
    and 30 %, in the balancer's model only; then the paper's blow.""",
    minutes=1.6,
)
def model_errors(setting: Setting) -> Measured:
    """Let each balancer believe in many wrong robots, and hit them."""
    robot, pendulum = load("humanoid"), PendulumBlow()
    count, sizes = setting.pick(24, 4), setting.pick(SIZES, (0.0, 0.3))
    rows: list[Numbers] = []
    for size in setting.each(sizes):
        rng = np.random.default_rng(_SEED)
        models = [wrong_model(robot, size, rng) for _ in range(count if size else 1)]
        direction = np.tile(SIDEWAYS, (len(models), 1))
        blow = Blow(START, direction, np.full(len(models), pendulum.energy))
        trial = bout(robot, pendulum, blow, SECONDS, believe=believing(models), every=10)
        for name in COLOUR:
            log = simulate(trial, Balancer(robot, name))
            rows.append({"name": name, "size": size} | outcome(log))
    stood = {r["name"]: r["stood"] for r in rows if r["size"] == max(sizes)}
    return {"rows": rows, "robots": count}, {
        **{"COLOUR": COLOUR, "ours": stood.pop(GAROFALO), "others": stood, "largest": max(sizes)},
        "percents": [100 * size for size in sizes],
    }
