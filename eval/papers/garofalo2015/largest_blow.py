"""Beyond [G15]: the largest blow that each balancer survives, by direction."""

from collections.abc import Callable

import numpy as np

from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.garofalo2015.balancer import COLOUR, GAROFALO, Balancer
from eval.papers.garofalo2015.bout import Blow, bout
from eval.papers.garofalo2015.pendulum import PendulumBlow
from eval.papers.trial import simulate
from fbid_gym.robots import load

START = 0.2
SECONDS = 4.0
"""s until which a robot must stay up."""

FIRST = np.geomspace(8.0, 180.0, 7)
"""J, first round; the second looks between the last survived and the first that is not."""

LABELS = {0.0: "forward", 90.0: "to the left", 180.0: "backward", 270.0: "to the right"}


def largest(
    test: Callable[[np.ndarray, np.ndarray], np.ndarray], angle: np.ndarray, refined: int
) -> tuple[np.ndarray, np.ndarray]:
    """Find the largest energy that is survived in each direction.

    Args:
        test: from angles (N,) and energies (N,) to who survives (N,); called once a round.
        angle: (K,) rad.
        refined: energies of the second round.

    Returns:
        (K,) J survived, and (K,) J not survived next above it. Infinity where all were survived,
        0 where none was.
    """
    low, high = np.zeros(len(angle)), np.full(len(angle), np.inf)
    grid = np.tile(FIRST, (len(angle), 1))
    for _ in range(2):
        who = np.repeat(angle, grid.shape[1])
        stood = test(who, grid.ravel()).reshape(grid.shape)
        for k, one in enumerate(stood):
            # Below the first fall: a lucky stand above it does not count.
            fallen = np.flatnonzero(~one)
            first = fallen[0] if fallen.size else len(one)
            low[k] = max(low[k], grid[k, first - 1] if first else 0.0)
            high[k] = min(high[k], grid[k, first] if fallen.size else np.inf)
        top = np.where(np.isfinite(high), high, low)
        share = np.arange(1, refined + 1) / (refined + 1)
        grid = low[:, None] + (top - low)[:, None] * share
    return low, high


@experiment(
    "Left open: the largest blow, by direction",
    f"""The same pendulum from all sides, at every energy that it takes: the largest after which the
    robot still stands {SECONDS - START:g} s later.""",
    minutes=2.2,
)
def largest_blow(setting: Setting) -> Measured:
    """Search each balancer's limit in half the directions; the other half are their mirror."""
    robot = load("humanoid")
    angle = np.radians(np.linspace(0.0, 180.0, setting.pick(9, 3)))
    rows: list[Numbers] = []
    for name in setting.each(COLOUR):
        controller = Balancer(robot, name)

        def survives(
            angle: np.ndarray, energy: np.ndarray, by: Balancer = controller
        ) -> np.ndarray:
            # 0 is forward, pi/2 to the robot's left.
            direction = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
            blow = Blow(START, direction, energy)
            return simulate(bout(robot, PendulumBlow(), blow, SECONDS, every=100), by).survived

        survived, lost = largest(survives, angle, setting.pick(5, 2))
        rows.append({"name": name, "survived": survived.tolist(), "lost": lost.tolist()})
    degrees = np.degrees(angle).round(6).tolist()
    side = int(np.argmin(np.abs(np.array(degrees) - 90.0)))
    around = degrees + [360.0 - d for d in reversed(degrees[1:-1])]
    return {"degrees": degrees, "rows": rows}, {
        **{"around": around, "LABELS": LABELS, "infinity": np.inf},
        "angles": [f"{d:g}°" for d in degrees],
        "sideways": {r["name"]: r["survived"][side] for r in rows},
        "least": {r["name"]: min(r["survived"]) for r in rows},
        "ours": row(rows, name=GAROFALO)["survived"][side],
        "rings": [
            (r["name"], COLOUR[r["name"]], r["survived"] + r["survived"][-2:0:-1]) for r in rows
        ],
    }
