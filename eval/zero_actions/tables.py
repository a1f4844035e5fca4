"""The tables as data: of whom, through which layers, with which factors, and which numbers."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import tyro

from eval.zero_actions.measures import Row, noise, walk
from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.estimation import PRESETS
from fbid_gym.motions.gait import biped
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.options import Choice, Each, Number, Whole
from fbid_gym.policy import place_of
from fbid_gym.policy.policy_file import PREFIX
from fbid_gym.robots import Robot, zoo
from fbid_gym.robots.terrain import LEVELLED
from train.runs.environment import load_policy
from train.runs.robots import chosen, is_built_in

EXACT: dict[str, Any] = {
    "physics_hz": 1000,
    "control_hz": 500,
    "friction_cone": "elliptic",
    "solver_iterations": None,
}
"""How the papers' experiments run."""

SETTINGS: dict[str, dict[str, Any]] = {
    "as in the papers": EXACT,
    "law at 250 Hz": EXACT | {"control_hz": 250},
    "law and physics at 250 Hz": EXACT | {"control_hz": 250, "physics_hz": 250},
    "and pyramids": {"solver_iterations": None},
    "and 20 iterations: the environment's own": {},
}
"""Name -> arguments that differ from the environment's, from the dearest to the cheapest."""


_LATE = {"randomisation": {"loop_delay": (0.005, 0.005)}}

SENSORS: dict[str, dict[str, Any]] = {
    "perfect": {},
    **{name: {"sensors": name} for name in PRESETS},
    "mems, 5 ms": {"sensors": "mems", **_LATE},
    "mems, 5 ms, told": {"sensors": "mems", **_LATE, "told": {"loop_delay": 0.005}},
}
"""Sensors, and with the delay of the loop from the state that a layer sees to its torque; told, to
the layers that can be."""

MOTORS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "ideal, 5 ms": _LATE,
    "data sheet": {"motors": "data_sheet"},
    "data sheet, 5 ms": {"motors": "data_sheet", **_LATE},
}
"""Motors, and the delay of the loop from the state that a layer sees to its torque."""


GAINS = {f"{gain:g}": {"gain": gain} for gain in (0.0, 6.0, 12.0, 24.0, 48.0)}
"""Of the proportional law, 1/s; 0 is the zero action."""

MEASURED: dict[str, Any] = {"sensors": "mems", "motors": "data_sheet", **_LATE}
"""A robot as it is built: cheap sensors, its motors' curves, 5 ms from state to torque."""

V1: dict[str, dict[str, Any]] = {
    "walk": {"env": "Walk", "version": 1},
    "walk, measured": {"env": "Walk", "version": 1, **MEASURED},
    **{
        f"{kind}, {seen}": {"env": "Terrain", "version": 1, "terrain": kind, "curriculum": False}
        | {"height_scan": seen == "seen"}
        for kind in LEVELLED[:-1]
        for seen in ("blind", "seen")
    },
}
"""Tasks of version 1: walking, as robots are built, and each kind of ground at difficulty 0.5."""


class Table(NamedTuple):
    """A table: the product of robots, layers and factors, which the command line can change."""

    about: str
    robots: tuple[str, ...]
    layers: tuple[str, ...]
    factors: Mapping[str, Mapping[str, Mapping[str, Any]]]
    """Name of a factor -> its values, in words -> what they are for the environment; "push" in
    weights of the robot, "gain" of the proportional law; "told" options of the
    layers that have them, without the rows of others."""
    names: tuple[str, ...]  # columns that say what is measured; those of SHARED follow
    numbers: tuple[str, ...]
    rows: tuple[str, ...]
    """Of the short table: columns that make a line; it sums up all rows that agree in them."""
    across: str  # of the short table: the column whose cells are its columns
    error: str = ""  # column shown beside how many stayed up
    more: tuple[str, ...] = ()  # columns shown after that
    compared: bool = False
    """Whether the short table says by how much a cell differs from the first of its line."""
    episodes: int = 32
    seconds: float = 20.0
    without: tuple[str, ...] = ()  # options that it does not have
    of_each: tuple[str, ...] = ()  # columns with a number for each robot, separated by spaces
    policies: tuple[str, ...] = ()
    """Names of shipped policies that act beside the zero action, in the column "acts"."""

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns of a row."""
        return (*self.names, *SHARED, *self.numbers, *self.of_each)


SHARED = ("episodes", "seconds", "push", "first_seed")
"""Columns of options that all rows of a run share."""
_UP = ("up", "share_low", "share_high")
_BODY = ("base_acceleration", "com_wrench")
_ERRORS = tuple(f"{what}_error{of}" for what in ("velocity", "yaw_rate")
                for of in ("", "_of_1_s_means"))  # fmt: skip
_GAITS = [gait for gait in {**PATTERNS, **biped.PATTERNS} if gait != "stand"]

TABLES = {
    "walking": Table(
        "every layer on every gait of every robot, on level ground",
        ("go1", "quadruped", "biped", "humanoid", "g1"),
        tuple(LAYERS),
        {"gait": {gait: {"gait": gait} for gait in _GAITS}},
        ("robot", "layer", "gait"),
        (*_UP, *_ERRORS, "cost_of_transport"),
        rows=("robot", "gait"),
        across="layer",
        error="velocity_error",
    ),
    "terrain": Table(
        "every kind of ground, blind and with a scan of the ground",
        ("go1", "biped"),
        (*_BODY, "joint_position"),
        {
            "ground": {"blind": {"height_scan": False}, "sees": {"height_scan": True}},
            "terrain": {name: {"env": "Terrain", "terrain": name} for name in LEVELLED},
            "difficulty": {f"{n / 4:g}": {"difficulty": n / 4} for n in range(5)},
        },
        ("robot", "layer", "ground", "terrain", "difficulty"),
        (*_UP, "velocity_error_of_the_reward"),
        rows=("robot", "layer", "ground"),
        across="terrain",
    ),
    "rates": Table(
        "the environments' rates of law and physics, which are cheap, beside the papers'",
        ("go1", "biped", "humanoid"),
        ("base_acceleration", "joint_position"),
        {"setting": SETTINGS},
        ("robot", "layer", "setting"),
        (*_UP, "velocity_error"),
        rows=("robot", "layer"),
        across="setting",
        error="velocity_error",
        compared=True,
    ),
    "motors": Table(
        "every layer with ideal motors and those of data sheets, without and with a delay of 5 ms",
        ("go1", "biped", "humanoid"),
        tuple(LAYERS),
        {"motors": MOTORS},
        ("robot", "layer", "motors"),
        (*_UP, "reward", "velocity_error"),
        rows=("robot", "layer"),
        across="motors",
        error="reward",
        compared=True,
        episodes=16,
        seconds=5.0,
    ),
    "measured": Table(
        "what layers lose where robots know their state by sensors and an estimate only",
        ("go1", "biped", "humanoid"),
        tuple(LAYERS),
        {"sensors": SENSORS},
        ("robot", "layer", "acts", "sensors"),
        (*_UP, "return", "velocity_error"),
        rows=("robot", "layer", "acts"),
        across="sensors",
        error="return",
        compared=True,
        episodes=64,
        seconds=6.0,
        policies=(
            *(f"QuadrupedWalk-v0/{name}" for name in (*_BODY, "joint_position_gait")),
            *(f"BipedWalk-v0/{name}" for name in (*_BODY, "joint_position_gait")),
            "HumanoidWalk-v0/base_acceleration",
        ),
    ),
    "proportional": Table(
        "one gain and no learning: the body is asked for gain (1/s) x velocity that it is short of",
        ("go1", "biped"),
        (*_BODY, "task_space_position"),
        {"pushes": {"none": {}, "0.4 weights": {"push": 0.4}}, "gain": GAINS},
        ("robot", "layer", "pushes", "gain"),
        (*_UP, "return", "velocity_error", "yaw_rate_error"),
        rows=("robot", "layer", "pushes"),
        across="gain",
        error="velocity_error",
        compared=True,
        episodes=16,
        seconds=8.0,
        without=("push",),
    ),
    "v1": Table(
        "every layer on the tasks of version 1, with their pushes, loads and grounds",
        ("go1", "biped", "g1"),
        tuple(LAYERS),
        {"task": {name: {**task, "push": None} for name, task in V1.items()}},
        ("robot", "layer", "task"),
        (*_UP, "return", "velocity_error", "yaw_rate_error", "slip", "cost_of_transport"),
        rows=("robot", "task"),
        across="layer",
        error="return",
        more=("velocity_error", "yaw_rate_error", "slip"),
        without=("push",),
    ),
    "zoo": Table(
        "robots that nobody has seen, drawn from seeds, standing and walking",
        tuple(map(str, range(24))),
        tuple(LAYERS),
        {"task": {"stand": {"env": None, "task": "balance"}, "walk": {}}},
        ("robot_seed", "kg", "legs", "leg_m", "joints", "feet", "layer", "task"),
        (*_UP, "reward", "velocity_error"),
        rows=("legs", "task"),
        across="layer",
        episodes=8,
        seconds=5.0,
        without=("feet",),
    ),
    "layers": Table(
        "a fixed set of tasks for any layer, also those of others (`eval.layers`)",
        ("go1", "biped"),
        tuple(LAYERS),
        {
            "task": {
                "stand pushed by 0.3 weights": {"env": None, "task": "balance", "push": 0.3},
                "walk": {},
                "walk pushed by 0.5 weights": {"push": 0.5},
                "walk with masses 30 % off": {"randomisation": {"mass": 0.3}},
                "walk on slopes": {"env": "Terrain", "terrain": "slopes", "difficulty": 0.5},
            }
        },
        ("robot", "task", "layer", "code"),
        (*_UP, "reward", "velocity_error", "yaw_rate_error", "cost_of_transport"),
        rows=("robot", "task"),
        across="layer",
        error="velocity_error",
        seconds=10.0,
        without=("push",),
        of_each=("score_of_each",),
    ),
    "noise": Table(
        "the torque of exploration noise through a layer, and the noise that is that of the first",
        ("fbid_gym/QuadrupedWalk-v0",),
        ("base_acceleration", "joint_position"),
        {},
        ("env", "layer"),
        ("log_std_init", "torque_nm"),
        rows=("env",),
        across="layer",
        episodes=128,
        without=("feet", "seconds", "push", "write_docs"),
    ),
}
"""Name of a table, and of its page and file -> the table."""


@dataclass(frozen=True)
class ZeroActionConfig:
    """Options of the measurement."""

    table: Annotated[
        str, Choice(TABLES), tyro.conf.Positional, tyro.conf.arg(metavar="|".join(TABLES))
    ]
    """Which table, see above."""
    robots: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="ROBOT [ROBOT ...]")] = None
    """Built-in robots or your own, as `--robot` of other commands takes them; of `zoo`, seeds to
    draw robots from; of `noise`, environment ids. Default: those of the table."""
    feet: tuple[str, ...] = ()
    """Of your own robot, as `eval.rollout` takes them, where the file does not say."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] | None = None
    """Action layers. Default: those of the table."""
    only: tuple[str, ...] = ()
    """Only some rows, such as terrain=slopes,stairs difficulty=0.5. Default: all."""
    episodes: Annotated[int, NUM_ENVS] | None = None
    """Robots side by side, one episode each. Default: that of the table."""
    seconds: Annotated[float, Number(0.02, 10_000.0, "s")] | None = None
    """Length of an episode. Default: that of the table."""
    push: Annotated[float, Number(0.0, 1e6, "N")] = 0.0
    """N, of pushes of 0.15 s every 1.5 to 3 s in a random direction."""
    seed: Annotated[int, Whole(0, 2**31)] = 0
    """Robot i starts from seed + i."""
    csv: Path | None = None
    """Write the rows to this file, each when it is there. Rows that it has are not measured again:
    the same command goes on after an interruption."""
    overwrite: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Measure anew what the file has already."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write the rows to docs/data/ and the short table into its page of docs/."""


class Case(NamedTuple):
    """A row to be: the cells that say what is measured, and what measures the others."""

    cells: Row
    measure: Callable[[], Row]


def cases(config: ZeroActionConfig) -> list[Case]:
    """Return the rows to be, in the order of the table; FbidError where there are none."""
    table = TABLES[config.table]
    for name in table.without:
        if (value := getattr(config, name)) != getattr(ZeroActionConfig, name):
            raise InvalidValueError(name, value, f"none for the table {config.table!r}")
    if config.robots == ():
        raise InvalidValueError("robots", [], "one or more")
    table = table._replace(
        robots=config.robots or table.robots,
        layers=config.layers or table.layers,
        episodes=config.episodes or table.episodes,
        seconds=config.seconds or table.seconds,
    )
    found = [case for name in table.robots for case in _of(name, config, table)]
    found += [case for name in table.policies for case in _acting(name, config, table)]
    for word in config.only:
        name, _, text = word.partition("=")
        Choice(table.names).check("column in --only", name)
        known = dict.fromkeys(case.cells[name] for case in found)
        values = [text] if text in known else text.split(",")  # some have commas of their own
        for value in values:
            Choice(known).check(name, value)
        found = [case for case in found if case.cells[name] in values]
    return found


def _of(name: str, config: ZeroActionConfig, table: Table) -> Iterator[Case]:
    """Yield the rows of a robot."""
    count = table.episodes
    cells = _shared(config, table) | ({"acts": "zero action"} if table.policies else {})
    if config.table == "noise":
        for layer in table.layers:
            names = {"env": name, "layer": layer, **cells, "seconds": "", "push": ""}
            yield Case(names, partial(noise, name, layer, count, config.seed))
        return
    its, robot = (_drawn if config.table == "zoo" else _named)(name, config.feet)
    run = {"episode_seconds": table.seconds, "robot": robot}
    walks, refused = [], None
    for levels in product(*(values.items() for values in table.factors.values())):
        own = {key: value for _, level in levels for key, value in level.items()}
        names = dict(zip(table.factors, (value for value, _ in levels), strict=True))
        gain, told, share = own.pop("gain", 0.0), own.pop("told", {}), own.pop("push", 0.0)
        pushes = {}
        if share is not None:  # else they are the environment's
            pushes["push_force"] = (share * robot.weight or config.push,) * 2
        try:
            walks.append((names, environment(robot, own) | run | pushes, gain, told))
        except FbidError as error:  # its feet have not this gait, or none
            refused = error
    if refused and not walks:
        raise refused
    for layer, (names, arguments, gain, told) in product(table.layers, walks):
        if not told.keys() <= layer_options(layer).keys():
            continue
        its_own = arguments | {"action_layer": layer} | ({"layer_options": told} if told else {})
        measure = partial(walk, its_own, count, config.seed, gain=gain)
        yield Case({**its, "layer": layer, **names, **cells}, measure)


def _acting(name: str, config: ZeroActionConfig, table: Table) -> Iterator[Case]:
    """Yield the rows of a shipped policy, where its robot and its layer are asked for."""
    policy = load_policy(place_of(PREFIX + name))
    own = ENVIRONMENTS[policy.env_id] | dict(policy.env_args)
    robot, layer = own["robot"], own["action_layer"]
    if robot in table.robots and layer in table.layers:
        own |= {"push_force": (config.push, config.push), "episode_seconds": table.seconds}
        ((factor, levels),) = table.factors.items()
        for value, level in levels.items():
            if "told" in level:  # a policy's layer has the options with which it was trained
                continue
            cells = {"robot": robot, "layer": layer, "acts": "policy", factor: value}
            measure = partial(walk, {**own, **level}, table.episodes, config.seed, policy)
            yield Case(cells | _shared(config, table), measure)


def _shared(config: ZeroActionConfig, table: Table) -> Row:
    """The cells of options that all rows of a run share."""
    values = (str(table.episodes), f"{table.seconds:g}", f"{config.push:g}", str(config.seed))
    return dict(zip(SHARED, values, strict=True))


def environment(robot: Robot, own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of the environment of a robot: that of two feet, or of more.

    `own` are the arguments that differ from it. There "env" names a walking environment, or is
    None, and "version" is its version; "randomisation" is added to that of the environment.

    Raises:
        FbidError: it has no such gait, or there is no such environment.
    """
    own = {"env": "Walk", "version": 0, **own}
    ground, version = own.pop("env"), own.pop("version")
    if ground is None:
        return own
    feet = "Biped" if robot.num_feet == 2 else "Quadruped"
    env_id = Choice(ENVIRONMENTS).check("environment", f"fbid_gym/{feet}{ground}-v{version}")
    usual = ENVIRONMENTS[env_id]
    varied = usual.get("randomisation", {}) | own.get("randomisation", {})
    arguments = usual | own | ({"randomisation": varied} if varied else {})
    gait_of(robot, arguments["control_hz"], arguments.get("gait"))
    return arguments


def _named(name: str, feet: Sequence[str]) -> tuple[Row, Robot]:
    robot = chosen(name, feet)
    assert robot is not None
    # Two files may call their robots the same.
    own = "" if is_built_in(robot) else f" {robot.digest[:8]}"
    return {"robot": robot.name + own}, robot


def _drawn(text: str, feet: Sequence[str]) -> tuple[Row, Robot]:
    seed = int(text) if text.isascii() and text.isdecimal() else text
    drawn = zoo.draw(Whole(0, 2**32 - 1).check("seed of a robot", seed))
    robot = zoo.built(drawn)
    words = (text, f"{robot.mass:.3g}", drawn.legs, f"{drawn.leg:.2g}", drawn.joints, drawn.foot)
    return dict(zip(TABLES["zoo"].names, map(str, words), strict=False)), robot
