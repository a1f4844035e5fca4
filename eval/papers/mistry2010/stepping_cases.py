"""Motions and controllers of figures 8-9, and the pushes."""

from typing import Any

import numpy as np

from eval.papers.mistry2010.controllers import JointController, PdGains, base_returning
from eval.papers.mistry2010.laws import Law, Limited, orthogonal
from eval.papers.mistry2010.laws import rivals as rival_laws
from eval.papers.mistry2010.stepper import Stepper
from eval.papers.trial import Controller, Push
from eval.wording import percent
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.motions import Steps, stepping
from fbid_gym.quantities import Target
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


def controller(robot: Robot, motion: str, name: str) -> Controller[Target]:
    """Return the paper's controller, the same with limited forces, or ours."""
    if name == OURS:
        return Stepper(robot, MOTIONS[motion])
    return _papers(robot, orthogonal() if name == PAPER else Limited.of(robot, base_priority=1e3))


def rivals(robot: Robot) -> dict[str, Controller[Target]]:
    """Return contact-force feedback with the paper's balance task, and the paper's law."""
    laws = {PAPER: orthogonal(), **rival_laws(robot)}
    return {name: _papers(robot, law) for name, law in laws.items()}


def _papers(robot: Robot, law: Law) -> JointController:
    desire = base_returning(robot, 1.0)
    return JointController(robot, PdGains.of(robot, 2.0, 0.5), law, desire=desire)


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
