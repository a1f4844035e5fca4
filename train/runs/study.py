"""A study: which trainings answer a question, as a readable TOML file.

    title = "What the gait is worth"
    seeds = [0, 1, 2]                        # of every arm that names none
    reference = "home"                       # arm the others are compared with; else the first
    page = "study"                           # of docs/; else the study's own name
    runs = "mine"                            # folder of the runs, beside the file; else runs/NAME
    eval = { every = 250_000 }               # any setting of a recipe, for every arm
    env = "fbid_gym/QuadrupedWalk-v0"        # likewise action_layer, layer_options and env_args,
                                             # for every arm that does not name its own

    [transfer]                               # robots that no arm learns with, for eval.scaling
    unseen = ["zoo:quadruped:1000-1029"]
    gain = 4.0                               # of the proportional law beside them; else none
    episodes = 8                             # on each

    [[endpoints]]                            # at most three; none can change once runs have begun
    measure = "return_mean"                  # or velocity_error, turning_error, slip, falls, ...
    arm = "home"
    against = "gait"

    [[arms]]
    name = "home"                            # once in each environment
    action_layer = "joint_position"
    layer_options = { reference = "home" }
    env_args = {}                            # further arguments of the environment
    robot = "dog/robot.toml"                 # instead of the environment's, as --robot; and feet
    robots = ["go1", "zoo:quadruped:0-15"]   # or several at once, as --robots
    algorithm = "sac"                        # that learns; "ppo" where it is not said
    start = "shipped:any-quadruped"          # policy to begin with, instead of the zero action
    total_steps = 5_000_000                  # any setting of a recipe, for this arm

    [[arms]]
    name = "gain"
    action_layer = "base_acceleration"
    policy = "proportional:24"               # or "zero": nothing is learnt, so there are no seeds

What a study does not say is as the recipe of the environment has it; what it says of an algorithm
for every arm is for those that learn by it. Each arm with each of its seeds is a *cell*: a training
with a run folder of its own, in a folder named after the study.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from fbid_gym.errors import InvalidValueError, RunError, UnknownOptionError
from fbid_gym.options import Whole
from fbid_gym.robots.several import each_name
from train.recipes import SETTINGS, check, config_for, merged, valid_settings
from train.runs.config import ALGORITHMS, SEED, TrainConfig
from train.runs.differences import in_words, run_differences
from train.runs.endpoints import Endpoint, check_registered, endpoints
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.opening import continued
from train.runs.proportional import GAIN, check_unlearnt
from train.runs.robots import check_trainable, chosen, with_robot, with_robots
from train.runs.training import is_finished

_OF_LEARNING = ("robots", "seeds", "recipe", "algorithm", "start")
_OF_ARM = (
    *("name", "env", "action_layer", "layer_options", "env_args"),
    *("robot", "feet", "policy", *_OF_LEARNING),
)
_REQUIRED = ("name", "env", "action_layer")
_FOR_EVERY_ARM = ("env", "action_layer", "layer_options", "env_args")


class Cell(NamedTuple):
    """One training of a study, or a policy that learns nothing."""

    arm: str  # name of the arm
    config: TrainConfig  # of what learns nothing: where it acts, and how it is evaluated
    policy: str = ""  # "zero" or `proportional:GAIN` where nothing is learnt

    @property
    def name(self) -> str:
        """For people."""
        seed = "" if self.policy else f", seed {self.config.seed}"
        return f"{environment_name(self.config.env)}, {self.arm}{seed}"


class Transfer(NamedTuple):
    """Robots that no arm learns with, on which all are played."""

    unseen: tuple[str, ...]  # as `fbid_gym.robots.several` takes them
    # Of the proportional law that plays as well, see `train.runs.proportional`.
    gain: float | None = None
    episodes: int = 8  # on each robot


class Arm(NamedTuple):
    """The cells of a study that differ in their seed alone."""

    env: str
    name: str
    cells: tuple[Cell, ...]

    @property
    def policy(self) -> str:
        """The policy of its only cell where nothing is learnt, else empty."""
        return self.cells[0].policy

    def finished(self) -> list[Cell]:
        """Return the cells that are at their end; what learns nothing always is."""
        return [cell for cell in self.cells if cell.policy or is_finished(cell.config)]


@dataclass(frozen=True)
class Study:
    """The content of a study's file."""

    name: str  # of the file
    title: str  # for people
    reference: str  # name of the arm that the others are compared with
    page: str  # of docs/, without its ending, that its tables go to
    # The trainings, seed by seed: what has been interrupted has some of every arm.
    cells: tuple[Cell, ...]
    endpoints: tuple[Endpoint, ...] = ()  # what it is asked
    # On which robots the policies are played besides; None: on none.
    transfer: Transfer | None = None
    unlearnt: tuple[Cell, ...] = ()  # the cells of arms that learn nothing

    @property
    def runs(self) -> Path:
        """Folder of the runs."""
        return self.cells[0].config.folder.parent


def read_study(path: Path, out: Path | None = None) -> Study:
    """Read a study.

    Args:
        path: the file.
        out: folder of the run folders; by default the study's, see above.

    Raises:
        RunError: there is no such file, it is no TOML, or arms lack something or are there twice.
        UnknownOptionError: a setting that there is not.
        InvalidValueError: a value that is not valid.
    """
    try:
        data = tomllib.loads(path.read_text())
    except (OSError, UnicodeDecodeError) as error:
        raise RunError(f"{path}: cannot be read as a study: {error}.") from error
    except tomllib.TOMLDecodeError as error:
        raise RunError(f"{path}: is no TOML: {error}.") from error
    except RecursionError as error:
        raise RunError(f"{path}: is nested too deeply.") from error
    title, seeds, arms = data.pop("title", path.stem), data.pop("seeds", [0]), data.pop("arms", [])
    reference, page = data.pop("reference", None), data.pop("page", path.stem)
    runs, asked = data.pop("runs", None), data.pop("endpoints", [])
    transfer = _transfer(path, data.pop("transfer", None))
    if not isinstance(arms, list) or not arms or not all(isinstance(arm, dict) for arm in arms):
        raise RunError(f"{path}: has no arms. Expected one [[arms]] table for each.")
    usual = {name: data.pop(name) for name in _FOR_EVERY_ARM if name in data}
    arms = [usual | arm for arm in arms]
    check(f"study {path.stem!r}", data, valid_settings())
    if runs is not None and not _is_name(runs):
        raise RunError(f"{path}: runs is {runs!r}. Expected the name of a folder beside it.")
    out = out or (Path("runs") / path.stem if runs is None else path.parent / runs)
    every = [cell for arm in arms for cell in _cells(path, arm, data, seeds, out)]
    cells, unlearnt = ([x for x in every if bool(x.policy) is no] for no in (False, True))
    if not cells:
        raise RunError(f"{path}: has no arm that learns. Expected one at least.")
    folders = [cell.config.folder for cell in every]
    learning = {(cell.config.env, cell.arm) for cell in cells}
    for cell in every:
        both = bool(cell.policy) and (cell.config.env, cell.arm) in learning
        if both or folders.count(cell.config.folder) > 1:
            raise RunError(f"{path}: {cell.name} is there twice. Expected each cell once.")
    names = [cell.arm for cell in every]
    reference = names[0] if reference is None else reference
    if reference not in names:
        raise UnknownOptionError("reference of the study", reference, dict.fromkeys(names))
    if not _is_name(page):
        raise RunError(f"{path}: page is {page!r}. Expected the name of one of docs/.")
    asked = endpoints(path, asked, [(cell.config.env, cell.arm) for cell in every])
    cells.sort(key=lambda cell: cell.config.seed)
    own = tuple(cells), asked, transfer, tuple(unlearnt)
    return Study(path.stem, str(title), reference, page, *own)


def arms(study: Study) -> list[Arm]:
    """Return the arms of a study in the order of its file, those that learn nothing at the end."""
    found: dict[tuple[str, str], list[Cell]] = {}
    for cell in (*study.cells, *study.unlearnt):
        found.setdefault((cell.config.env, cell.arm), []).append(cell)
    return [Arm(env, name, tuple(cells)) for (env, name), cells in found.items()]


def check_cells(study: Study) -> None:
    """Check that the run folders are those of the study, and that it asks what it asked.

    Raises:
        RunError: one is of another training than the study says, or of a longer one; or they began
            with other endpoints.
    """
    begun = any(RunFolder.of(cell.config.folder).config.is_file() for cell in study.cells)
    check_registered(study.name, study.runs, study.endpoints, begun=begun)
    for cell in study.cells:
        folder = RunFolder.of(cell.config.folder)
        if not folder.config.is_file():
            continue
        stored, run = read_json(folder.config), continued(cell.config)
        robot = chosen(run.robot, run.feet)
        asked = with_robots(run if robot is None else with_robot(run, robot)).to_json()
        different = in_words(run_differences(stored, asked))
        trains, wants = stored.get("total_steps"), asked["total_steps"]
        if not different and isinstance(trains, int) and trains > wants:
            different = f"total_steps {wants} instead of {trains}"
        if different:
            raise RunError(
                f"{folder.path}: is not what the study says: it says {different}. Expected the "
                "folder of its own runs, see --out of train.sweep and --runs of eval.study."
            )


def environment_name(env_id: str) -> str:
    """Return an environment's id without its namespace."""
    return env_id.rpartition("/")[2]


def _cells(
    path: Path, arm: Mapping[str, Any], shared: Mapping[str, Any], seeds: Any, out: Path
) -> list[Cell]:
    missing = [name for name in _REQUIRED if not isinstance(arm.get(name), str)]
    if missing:
        raise RunError(f"{path}: an arm without {missing[0]}. Expected one in each: {dict(arm)}.")
    own = {name: value for name, value in arm.items() if name not in _OF_ARM}
    for name in own:
        if name not in SETTINGS:
            raise UnknownOptionError(f"setting of arm {arm['name']!r}", name, _OF_ARM + SETTINGS)
    check(f"arm {arm['name']!r}", own, valid_settings())
    policy = _policy(path, arm, own)
    seeds = [0] if policy else arm.get("seeds", seeds)
    if not isinstance(seeds, list) or not seeds:
        raise RunError(f"{path}: seeds of arm {arm['name']!r} are {seeds!r}. Expected a list.")
    seeds = [SEED.check(f"seed of arm {arm['name']!r}", seed) for seed in seeds]
    for name in ("layer_options", "env_args"):
        if not isinstance(arm.get(name, {}), dict):
            raise RunError(
                f"{path}: {name} of arm {arm['name']!r} is {arm[name]!r}. Expected a table."
            )
    robot = arm.get("robot")
    feet = _names(path, arm.get("feet", []), f"feet of arm {arm['name']!r}")
    if not isinstance(robot, str | None):
        raise RunError(f"{path}: robot of arm {arm['name']!r} is {robot!r}. Expected a name.")
    robots = _names(path, arm.get("robots", []), f"robots of arm {arm['name']!r}")
    if "robots" in arm and not robots:
        raise InvalidValueError(f"robots of arm {arm['name']!r}", [], "at least one")
    if not policy:
        check_trainable(each_name((*robots, *([] if robot is None else [robot]))))
    usual = config_for(
        *(arm["env"], arm["action_layer"], arm.get("layer_options"), arm.get("recipe")),
        algorithm=arm.get("algorithm", "ppo"),
    )
    others = ALGORITHMS.keys() - {usual.algorithm}
    for name in sorted(others & own.keys()):
        raise InvalidValueError(
            f"setting of arm {arm['name']!r}", name, f"those of {usual.algorithm!r}, which learns"
        )
    usual = _with(usual, merged({k: v for k, v in shared.items() if k not in others}, own))
    place = f"{environment_name(arm['env'])}-{arm['name'].replace(' ', '_')}"
    if Path(place).name != place:
        raise RunError(f"{path}: arm {arm['name']!r} cannot name a folder.")
    return [
        Cell(
            arm["name"],
            replace(
                usual,
                env_args=dict(arm.get("env_args", {})),
                robot=robot,
                feet=feet,
                robots=robots,
                start=arm.get("start"),
                seed=seed,
                num_threads=1,
                out=out / (place if policy else f"{place}-s{seed}"),
            ),
            policy,
        )
        for seed in seeds
    ]


def _transfer(path: Path, given: Any) -> Transfer | None:
    if given is None:
        return None
    if not isinstance(given, dict) or not isinstance(given.get("unseen"), list):
        raise RunError(f"{path}: transfer is {given!r}. Expected a table with robots, `unseen`.")
    if odd := sorted(given.keys() - set(Transfer._fields)):
        raise UnknownOptionError("setting of transfer", odd[0], Transfer._fields)
    unseen = _names(path, given["unseen"], "unseen of transfer")
    gain, episodes = given.get("gain"), given.get("episodes", 8)
    if gain is not None:
        GAIN.check("gain of transfer", gain)
    return Transfer(unseen, gain, Whole(1, 100_000).check("episodes of transfer", episodes))


def _names(path: Path, given: Any, what: str) -> tuple[str, ...]:
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        raise RunError(f"{path}: {what} are {given!r}. Expected a list of names.")
    return tuple(given)


def _policy(path: Path, arm: Mapping[str, Any], own: Mapping[str, Any]) -> str:
    """Return what acts in an arm that learns nothing; empty for another."""
    policy = arm.get("policy", "")
    if not isinstance(policy, str):
        raise RunError(f"{path}: policy of arm {arm['name']!r} is {policy!r}. Expected a name.")
    if "policy" not in arm:
        return ""
    for name in (*own, *(name for name in _OF_LEARNING if name in arm)):
        expected = f"none beside policy {policy!r}, which learns nothing"
        raise InvalidValueError(f"setting of arm {arm['name']!r}", name, expected)
    check_unlearnt(policy, arm["action_layer"])
    return policy


def _with(config: TrainConfig, settings: Mapping[str, Any]) -> TrainConfig:
    parts = {
        name: replace(getattr(config, name), **settings[name])
        for name in (*ALGORITHMS, "eval")
        if name in settings
    }
    return replace(config, **{**settings, **parts})


def _is_name(value: Any) -> bool:
    """Whether it can be the name of something in a folder."""
    return isinstance(value, str) and Path(value).name == value and value not in ("", "..")
