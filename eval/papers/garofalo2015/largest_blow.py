"""What [G15] leaves open: the largest blow that each balancer survives, by direction."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eval.page.figures import polar
from eval.page.html import figure, table, text
from eval.papers.experiment import Finding, Result, Setting, experiment, judged
from eval.papers.garofalo2015.balancer import COLOUR, GAROFALO, Balancer
from eval.papers.garofalo2015.bout import Blow, bout
from eval.papers.garofalo2015.pendulum import Pendulum
from eval.papers.trial import simulate
from eval.wording import number
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
        for k, row in enumerate(stood):
            # Below the first fall: a lucky stand above it does not count.
            fallen = np.flatnonzero(~row)
            first = fallen[0] if fallen.size else len(row)
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
def largest_blow(setting: Setting) -> Result:
    """Search each balancer's limit in half the directions; the other half are their mirror."""
    robot = load("humanoid")
    angle = np.radians(np.linspace(0.0, 180.0, setting.pick(9, 3)))
    rows = []
    for name, part in setting.progress.each(COLOUR):
        rounds, controller = part.each(("coarse", "fine")), Balancer(robot, name)

        def survives(
            angle: np.ndarray, energy: np.ndarray, rounds: Any = rounds, by: Balancer = controller
        ) -> np.ndarray:
            # 0 is forward, pi/2 to the robot's left.
            direction = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
            blow = Blow(START, direction, energy)
            trial = bout(robot, Pendulum(), blow, SECONDS, every=100)
            return simulate(trial, by, next(rounds)[1]).survived

        survived, lost = largest(survives, angle, setting.pick(5, 2))
        rows.append({"name": name, "survived": survived.tolist(), "lost": lost.tolist()})
    degrees = np.degrees(angle).round(6).tolist()
    side = int(np.argmin(np.abs(np.array(degrees) - 90.0)))
    ours = {row["name"]: row["survived"][side] for row in rows}
    least = (f"{row['name']}: {number(min(row['survived']))}" for row in rows)
    findings = [
        judged(
            "Largest blow from the side that is survived, J",
            "17.4 is survived",
            ", ".join(f"{name}: {number(value)}" for name, value in ours.items()),
            "more than 17.4",
            ours[GAROFALO] > 17.4,
        ),
        Finding("Smallest of all directions, J", "not given", ", ".join(least)),
    ]
    return Result(findings, {"degrees": degrees, "rows": rows}, _body(rows, degrees))


def _body(rows: list[dict[str, Any]], half: list[float]) -> list[str]:
    def whole(values: list[float]) -> list[float]:
        return [*values, *reversed(values[1:-1])]

    degrees = [*half, *(360.0 - d for d in reversed(half[1:-1]))]
    rings = [(row["name"], COLOUR[row["name"]], whole(row["survived"])) for row in rows]
    title, at = "Largest energy survived, by direction of the blow", (90.0, 17.4, "[G15]")
    cells = [
        [
            row["name"],
            *(
                f"{number(low)} – {number(high)}" if np.isfinite(high) else f"> {number(low)}"
                for low, high in zip(row["survived"], row["lost"], strict=True)
            ),
        ]
        for row in rows
    ]
    return [
        figure(
            [polar(degrees, rings, title, "J", LABELS, mark=at)],
            "In the direction of the push. The robot is its own mirror image, so the right half is "
            "the left one's; [G15]'s blow is marked.",
            1,
        ),
        table(["J, last survived – first not", *(f"{d:g}°" for d in half)], cells),
        text(
            "The robot may not step, so what can be survived is bounded by the soles: the momentum "
            "of the blow moves the capture point, and beyond the edge of the feet no balancer that "
            "keeps them in place brings it back. Sideways the two feet reach farther than forward. "
            "Within that, what counts is how much of the wanted wrench the torques produce."
        ),
    ]
