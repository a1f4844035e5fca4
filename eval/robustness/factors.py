"""Factors in which conditions differ from the training, and their environment arguments.

A factor is a line of data: a name, its values, and the environment's arguments at one of them. All
other arguments stay as they were in training. A new factor needs an entry in `FACTORS`, no more.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from eval.wording import number, percent
from eval.zero_actions.tables import EXACT
from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots.data_sheets import motor_sheet
from fbid_gym.robots.drives import IDEAL, SHEET
from fbid_gym.robots.terrain import hardest
from fbid_gym.runtime.config import EnvConfig

PAPERS_PHYSICS: dict[str, Any] = EXACT | {"solver_warm_start": True}
"""Rates, cones and contact solver of the papers' experiments; see also `eval.zero_actions`."""

Changes = dict[str, Any]


@dataclass(frozen=True)
class Factor:
    """Something that varies while all else stays as in training."""

    name: str  # on the command line
    title: str  # what varies
    axis: str  # how much of it: what stands below its axis
    values: tuple[float, ...]  # from the least to the greatest
    changes: Callable[[float, EnvConfig], Changes]
    """(value, environment of training) -> its arguments that differ; a range of the randomisation
    replaces that range alone."""
    about: str  # one or two sentences for people
    nominal: float | None = 0.0
    """Value at which nothing differs, where training has no other; None: there is none."""
    form: Callable[[float], str] = number  # how a value is written
    most: Callable[[EnvConfig], float] = lambda config: np.inf
    """Greatest value that there is in an environment."""
    missing: Callable[[EnvConfig], str] = lambda config: ""
    """Why an environment does not have the factor; empty where it has it."""
    for_policies: bool = False  # whether a zero action cannot feel it
    for_one: bool = False  # whether its values are of one robot, and not of several
    stages: tuple[str, ...] = ()
    """Names of the values, where these are no quantity: there is no area, but a change from the
    first to the last."""

    def values_in(self, config: EnvConfig) -> tuple[float, ...]:
        """Return the values that there are in an environment."""
        most = self.most(config)
        return tuple(value for value in self.values if value <= most)

    def written(self, value: float) -> str:
        """Write a value."""
        if self.stages:
            return dict(zip(self.values, self.stages, strict=True)).get(value, "")
        return self.form(value)


def changed(env_args: Mapping[str, Any], changes: Changes) -> dict[str, Any]:
    """Return an environment's arguments with the changes made; both sides are left as they are."""
    ranges = dict(env_args.get("randomisation") or {}) | changes.get("randomisation", {})
    return {**env_args, **changes, **({"randomisation": ranges} if ranges else {})}


def _signed(share: float) -> str:
    return f"+{percent(share)}" if share > 0 else percent(share).replace("-", "−")


def _fixed(
    name: str, unit: float = 1.0, nominal: float = 0.0
) -> Callable[[float, EnvConfig], Changes]:
    """A quantity of the randomisation, the same for all robots: so many units from nominal."""
    return lambda value, config: {"randomisation": {name: (nominal + unit * value,) * 2}}


def _sped(share: float, config: EnvConfig) -> Changes:
    motors = SHEET if config.motors == IDEAL else config.motors
    return {"motors": motors, "randomisation": {"motor_speed": (share, share)}}


def _without_line(config: EnvConfig) -> str:
    own = config.load_robot()
    if config.motors == IDEAL:
        return "" if motor_sheet(own) else f"robot {own.name!r} has no data sheet of its motors"
    fades = own.drives is not None and own.drives.line.fading.any()
    return "" if fades else "its motors have no no_load_speed"


def _lagging(milliseconds: float, config: EnvConfig) -> Changes:
    """The environment's motors as a table, with a lag."""
    if milliseconds == 0.0:
        return {}
    own = config.motors
    if isinstance(own, str):
        own = {} if own == IDEAL else {"base": own}
    return {"motors": own | {"lag": 1e-3 * milliseconds}}


def _sensing(varied: str) -> Callable[[float, EnvConfig], Changes]:
    """An option of the sensors, which are those of training; "mems" where these are perfect."""

    def changes(value: float, config: EnvConfig) -> Changes:
        own = config.perceived()
        given = {"like": "mems"} if own is None else asdict(own)
        return {"sensors": given | {"scale": 1.0, "contact_errors": 0.0} | {varied: value}}

    return changes


def _ahead(heights: float, config: EnvConfig) -> Changes:
    metres = heights * float(Stance.of(config.load_robot()).home_com[2])
    return {"randomisation": {"model_com_ahead": (metres, metres)}}


def _hardest(kind: str, config: EnvConfig) -> float:
    """Difficulty 1 of a kind of ground; of slopes in degrees."""
    size = hardest(kind, config.load_robot())
    return (float(np.degrees(np.arctan(size))) if kind == "slopes" else size) + 1e-9


def _uneven(kind: str, value: float, config: EnvConfig) -> Changes:
    if value == 0.0:
        return {"terrain": "flat", "curriculum": False}
    size = float(np.tan(np.radians(value))) if kind == "slopes" else value
    difficulty = min(size / hardest(kind, config.load_robot()), 1.0)
    return {"terrain": kind, "difficulty": difficulty, "curriculum": False}


def _stays(config: EnvConfig) -> str:
    walks = config.make_task(config.load_robot()).kind.gait
    return "" if walks else f"task {config.task!r} does not leave level ground"


def _exact(config: EnvConfig) -> str:
    same = all(getattr(config, name) == value for name, value in PAPERS_PHYSICS.items())
    return "the environment has the papers' physics anyway" if same else ""


_THIRD = (-0.3, -0.15, 0.0, 0.15, 0.3)
_OVER = "over the height of the centre of mass"
_GROUNDS = (
    ("slopes", "slopes", "degrees", (0.0, 5.0, 10.0, 15.0, 20.0, 25.0),
     "Hills of four even sides; episodes begin on their level tops."),
    ("roughness", "rough ground", f"bumps {_OVER}", (0.0, 0.07, 0.14, 0.21, 0.28, 0.35),
     "Random heights, evenly joined; episodes begin on a level place among them."),
    ("stairs", "stairs", f"steps {_OVER}", (0.0, 0.09, 0.18, 0.27, 0.36, 0.45),
     "Stairs down to all four sides from a level top, where episodes begin."),
    ("planks", "planks", f"planks {_OVER}", (0.0, 0.08, 0.16, 0.24, 0.32, 0.4),
     "Planks lying about on level ground, from half as high."),
    ("gaps", "gaps", f"depth {_OVER}", (0.0, 0.2, 0.4, 0.6, 0.8, 1.0),
     "Gaps between rings of raised ground, at most 0.7 of that height wide."),
)  # fmt: skip
"""Kind of terrain, title, axis, values, and what it is."""

FACTORS = (
    Factor(
        "push",
        "pushes",
        "size, share of the weight",
        (0.0, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2),
        lambda weights, config: {"push_force": None, "push_weights": (weights, weights)},
        "Every push of an episode has this size; its direction and time are as in training.",
        nominal=None,
    ),
    Factor(
        "mass",
        "mass of the robot",
        "against its own",
        _THIRD,
        _fixed("total_mass", nominal=1.0),
        "All masses and inertias of the robot are larger or smaller by this share. No controller "
        "knows.",
        form=_signed,
    ),
    Factor(
        "friction",
        "friction of the contacts",
        "share of the robot's own",
        (0.375, 0.5, 0.75, 1.0, 1.25),
        _fixed("friction"),
        "Coefficient of friction over the robot's own, which is 0.8 for the built-in robots: "
        "0.3 to 1.0 for these. Laws with limited forces go on believing in theirs.",
        nominal=1.0,
    ),
    Factor(
        "delay",
        "delay of the actions",
        "ms",
        (0.0, 8.0, 16.0, 24.0, 32.0, 40.0),
        _fixed("action_delay", 1e-3),
        "Time from the choice of an action to its arrival at the action layer, which itself runs "
        "without delay. A policy step is 20 ms long in all our environments.",
        for_policies=True,
    ),
    Factor(
        "motor",
        "strength of the motors",
        "share of their own",
        (0.4, 0.55, 0.7, 0.85, 1.0, 1.15),
        _fixed("motor_strength"),
        "Every motor gives this share of the torque that it is asked for. No controller knows.",
        nominal=1.0,
    ),
    Factor(
        "latency",
        "delay of the inner loop",
        "ms",
        (0.0, 2.5, 5.0, 10.0, 15.0, 20.0),
        _fixed("loop_delay", 1e-3),
        "Time from the state that an action layer sees to the torque that answers it. No layer "
        "knows. Policies learn without it.",
    ),
    Factor(
        "motor_speed",
        "speed of the motors",
        "share of the data sheet's",
        (0.25, 0.4, 0.6, 0.8, 1.0, 1.3),
        _sped,
        "Motors as in the robot's data sheet, whose torque falls to nothing at a no-load speed; "
        "full and no-load speeds are this share of the data sheet's. Laws believe in the whole.",
        nominal=None,
        missing=_without_line,
    ),
    Factor(
        "motor_lag",
        "lag of the motors",
        "time constant, ms",
        (0.0, 2.5, 5.0, 10.0, 20.0),
        _lagging,
        "The torque follows what is asked for with this time constant.",
    ),
    Factor(
        "sensors",
        "errors of the sensors",
        "times those of training, or of cheap ones",
        (0.0, 0.5, 1.0, 2.0, 4.0),
        _sensing("scale"),
        "Robots know their state by an estimate from their sensors only, whose noise, biases and "
        'mounting are worse by this factor: those of training, or of "mems" where training had '
        "perfect ones.",
        nominal=None,
    ),
    Factor(
        "contact_errors",
        "wrong contacts",
        "share of the time for which a foot's sensor is wrong",
        (0.0, 0.05, 0.1, 0.2, 0.3),
        _sensing("contact_errors"),
        "The sensor of each foot tells the wrong thing for this share of the time, 20 ms at a "
        'time; the other sensors are those of training, or "mems".',
        nominal=None,
    ),
    *(
        Factor(
            *(kind, title, axis, values, partial(_uneven, kind), about),
            most=partial(_hardest, kind),
            missing=_stays,
        )
        for kind, title, axis, values, about in _GROUNDS
    ),
    Factor(
        "model-mass",
        "mass in the controller's model",
        "against the robot's",
        _THIRD,
        _fixed("model_total_mass", nominal=1.0),
        "All masses and inertias in the model that model-based layers compute with are wrong by "
        "this share.",
        form=_signed,
    ),
    Factor(
        "model-inertia",
        "inertia in the controller's model",
        "against the robot's",
        _THIRD,
        _fixed("model_inertia", nominal=1.0),
        "The rotational inertias of all bodies in that model are wrong by this share; their masses "
        "are right.",
        form=_signed,
    ),
    Factor(
        "model-com",
        "centre of mass in the controller's model",
        "ahead of the robot's, share of its height",
        (-0.1, -0.05, 0.0, 0.05, 0.1),
        _ahead,
        "In that model the base's centre of mass lies farther ahead than it does, or farther back, "
        "by this share of the height of the robot's.",
        for_one=True,
    ),
    Factor(
        "physics",
        "the papers' physics",
        "",
        (0.0, 1.0),
        lambda stage, config: dict(PAPERS_PHYSICS) if stage else {},
        "From the light physics that policies learn in to those of the papers' experiments: law at "
        "500 Hz, physics at 1 kHz, elliptic friction cones, a contact solver that is not stopped.",
        missing=_exact,
        stages=("as in training", "the papers'"),
    ),
)
"""In the order of the page."""
BY_NAME = {factor.name: factor for factor in FACTORS}
