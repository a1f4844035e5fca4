"""Motions and controllers of figures 8-9, and the pushes."""

from typing import Any

import numpy as np

from eval.papers.mistry2010.balance import BaseTask
from eval.papers.mistry2010.controllers import (
    Feedforward,
    Gains,
    Limited,
    Orthogonal,
    Tracking,
)
from eval.papers.mistry2010.rivals import EstimatedForce, MeasuredForce
from eval.papers.mistry2010.stepper import Stepper
from eval.papers.trial import Controller, Push
from eval.wording import percent
from fbid_gym.control import ContactLimits
from fbid_gym.dynamics.contacts import ContactGeometry
from fbid_gym.dynamics.support import Support
from fbid_gym.motions.stepping import Steps, stepping
from fbid_gym.robots import Robot

FORCE, PUSH_SECONDS, EVERY_SECONDS, SECONDS = 200.0, 0.15, 5.0, 60.0
ROBOTS, UNPUSHED = 24, 4
SOON_SECONDS = 20.0
"""How long controllers run that do not hold anyway."""

UPRIGHT = Steps()
"""The centre of mass sways over one foot before the other is lifted."""

CROUCHED = Steps(
    knee=1.6, amplitude=0.1, sway=0.06, single=0.05, lift=(-0.1, 0.2, -0.1), ramp=0.07, spread=0.05
)
"""Deep in the knees, feet 28 cm apart, and each foot is up for 0.15 s only: the robot hops from
foot to foot."""

MOTIONS = {"upright": UPRIGHT, "crouched": CROUCHED}
PAPER, LIMITED, OURS = "eqs. (15), (19)", "the same, limited forces", "ours, with steps"
COLOURS = {PAPER: 0, LIMITED: 2, OURS: 4}
CELLS = (("crouched", OURS), ("crouched", LIMITED), ("crouched", PAPER), ("upright", PAPER))
SHOWN = CELLS[0], CELLS[2]
FORCES = (0.0, 100.0, 150.0, 200.0, 250.0)
EVERY = 10


def controller(robot: Robot, motion: str, name: str) -> Controller:
    """Return the paper's controller, the same with limited forces, or ours."""
    if name == OURS:
        return Stepper.of(robot, MOTIONS[motion])
    gains, task = Gains.of(robot, 2.0, 0.5), BaseTask.of(robot, 1.0)
    limited = Limited(ContactLimits(0.7), Support.of(robot).radius, 1e3)
    return Tracking(robot, gains, Orthogonal() if name == PAPER else limited, motive=task)


def rivals(robot: Robot) -> dict[str, Tracking]:
    """Return contact-force feedback with the paper's balance task, and the paper's law."""
    gains, task = Gains.of(robot, 2.0, 0.5), BaseTask.of(robot, 1.0)
    laws: dict[str, Feedforward] = {
        PAPER: Orthogonal(),
        "measured force, ideal sensor": MeasuredForce.of(robot),
        "measured force, 10 ms late": MeasuredForce.of(robot, delay=5),
        "force from the previous torque": EstimatedForce(),
    }
    return {name: Tracking(robot, gains, law, motive=task) for name, law in laws.items()}


def random_pushes(
    force: float, times: tuple[float, ...], count: int, seed: int
) -> tuple[Push, ...]:
    """Push every robot at these times, each time in a random horizontal direction."""
    rng = np.random.default_rng(seed)
    found = []
    for moment in times:
        angle = rng.uniform(-np.pi, np.pi, count)
        vector = force * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        found.append(Push(np.full(count, moment), PUSH_SECONDS, vector))
    return tuple(found)


def cell(numbers: dict[str, Any], motion: str, name: str) -> dict[str, Any]:
    """Return one long run."""
    return next(r for r in numbers["long"] if (r["motion"], r["name"]) == (motion, name))


def half_sole(robot: Robot) -> float:
    """Return how far a sole reaches forward and backward of its middle, m."""
    return float(np.ptp(ContactGeometry.of(robot).offset[:, 0])) / 2.0


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


def fate(row: dict[str, Any]) -> str:
    """Say how many stay up, and how long all do."""
    fallen = "" if row["first"] is None else "the first falls at "
    return f"{percent(row['up'])}; {fallen}{first_fall(row)}"
