"""The arguments of the environments, checked before anything is built."""

import copy
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Annotated, Any

import mujoco
import numpy as np

from fbid_gym.actions import LAYERS, ActionLayer, layer_options, make_layer
from fbid_gym.actions.additions import Additions
from fbid_gym.actions.ranges import Falling, in_hertz
from fbid_gym.checks import by_name, check_choices
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError, UnknownArgumentError
from fbid_gym.estimation import Sensors, sensors_of
from fbid_gym.options import Choice, Named, Number, Pair, Whole, check_fields, options_of
from fbid_gym.robots import MENAGERIE, ROBOTS, ZOO, Robot, load
from fbid_gym.robots.by_place import by_place
from fbid_gym.robots.contact_pairs import compile_paired
from fbid_gym.robots.data_sheets import motor_sheet
from fbid_gym.robots.drives import IDEAL, complete_table, motor_table, with_motors
from fbid_gym.robots.home_check import check_upright
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.terrain import (
    LEVELLED,
    TERRAINS,
    Terrain,
    check_height,
    make_terrain,
    world_of,
)
from fbid_gym.runtime.observer import BODY, FULL, OBSERVATIONS
from fbid_gym.runtime.randomisation import Randomisation
from fbid_gym.runtime.rates import Rate, Rates
from fbid_gym.tasks import (
    TASKS,
    Pushes,
    Start,
    Task,
    Term,
    make_task,
    reward_table,
    task_kind,
    task_options,
)
from fbid_gym.tasks.plan import Duration, Force, Interval, Jump, Noise
from fbid_gym.tasks.reward import SCALE, WEIGHT

_MOST_OF_PYRAMIDS = 10.0  # impratio
_CONES = {"elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC, "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL}


@dataclass(frozen=True)
class Drawing:
    """Rendering: arguments of Gymnasium's MuJoCo environments, and overlays."""

    render_mode: Annotated[str, Choice(("human", "rgb_array"))] | None = None
    """"rgb_array", "human" for a window on the first robot, or None."""
    render_options: dict[str, Any] | None = None
    """What is drawn over the robots."""
    width: Annotated[int, Whole(1, 10_000, "pixels")] = 640
    """Of pictures."""
    height: Annotated[int, Whole(1, 10_000, "pixels")] = 480
    """Of pictures."""
    camera_id: Annotated[int, Whole(0, 10_000)] | None = None
    """Which camera of the robot's MJCF; or its name. Default: one that follows the base."""
    camera_name: str | None = None
    """Its name."""
    default_camera_config: Annotated[dict[str, float], Named(Number(-1e6, 1e6))] | None = None
    """"distance" (m), "azimuth" and "elevation" (degrees) of the camera that follows."""

    def __post_init__(self) -> None:
        """Check each value."""
        check_fields(self)
        by_name("render_options", self.render_options)
        camera = self.default_camera_config or {}
        check_choices("default_camera_config", camera, ("distance", "azimuth", "elevation"))

    @classmethod
    def of(cls, arguments: Mapping[str, Any]) -> tuple["Drawing", dict[str, Any]]:
        """Build it of its own among the arguments of an environment; return the others, too."""
        rest = dict(arguments)
        own = {name: rest.pop(name) for name in options_of(cls) if name in rest}
        return cls(**own), rest


@dataclass(frozen=True)
class EnvConfig:
    """Everything that defines an environment; the same for one robot and for many."""

    robot: str | Robot = "biped"
    """Name of a built-in robot, "menagerie:NAME" for one of `mujoco_menagerie`, "zoo:7" for one
    drawn from a seed, see `fbid_gym.robots.zoo`, or a `Robot`."""
    task: Annotated[str, Choice(TASKS)] = "balance"
    """What the robot shall do: see `fbid_gym.tasks.TASKS`."""
    task_options: dict[str, Any] = field(default_factory=dict)
    """Arguments of the task, by name; `of` takes them among the others."""
    action_layer: Annotated[str, Choice(LAYERS, "action layer")] = "joint_position"
    """How the policy acts: see `fbid_gym.actions.LAYERS`."""
    layer_options: dict[str, Any] | None = None
    """Arguments of the action layer, by name."""
    physics_hz: Rate = 1000
    """Simulation steps per second."""
    control_hz: Rate = 500
    """Action-layer ticks per second; divides `physics_hz`."""
    policy_hz: Rate = 50
    """Environment steps per second; divides `control_hz`."""
    episode_seconds: Annotated[float, Number(1e-4, 1e6, "s")] = 10.0
    """An episode is truncated after this time."""
    push_force: Force | None = None
    """(least, most) N of a push. Default: `push_weights`."""
    push_weights: Annotated[tuple[float, float], Pair(0.0, 100.0)] | None = None
    """(least, most) weights of the robot of a push, where `push_force` is not given. Default: the
    task's."""
    push_velocity: Jump = (0.0, 0.0)
    """(least, most) m/s by which the base's velocity jumps as a push begins."""
    push_duration: Duration = 0.15
    """s."""
    push_interval: Interval = (1.5, 3.0)
    """(least, most) s from the start of one push to the next."""
    terrain: Annotated[str, Choice(TERRAINS)] = "flat"
    """The ground: see `fbid_gym.robots.terrain.TERRAINS`."""
    terrain_height: Annotated[float, Number(0.0, 10.0, "m")] | None = None
    """m, height of the highest point of obstacles or rocks; 0 is flat. Default: a fifth of the
    height of the robot's centre of mass. Terrains that have a difficulty take none."""
    terrain_seed: Annotated[int, Whole(0, 2**63 - 1)] = 0
    """Decides where everything on the ground lies; every episode starts in another place of it."""
    difficulty: Annotated[float, Number(0.0, 1.0)] = 0.5
    """From 0 to 1: heights, angles and gaps of the terrains that have one, `LEVELLED`."""
    curriculum: bool = False
    """Whether a robot that walks moves on to harder ground, and back; begins at `difficulty`."""
    command_curriculum: bool = False
    """Whether commands of robots that walk begin at `difficulty`'s share of what is drawn, and
    grow, and shrink back."""
    actions: Annotated[str, Choice(("clip", "refuse"))] = "clip"
    """What becomes of actions outside [-1, 1]: "clip", or "refuse" for an error."""
    joint_noise: Noise = 0.02
    """rad, largest offset of a joint from its posture at the start."""
    velocity_noise: Noise = 0.05
    """m/s and rad/s, largest offset of a coordinate's velocity at the start."""
    friction_cone: Annotated[str, Choice(_CONES)] = "elliptic"
    """"elliptic", or "pyramidal": cheaper, and a little different from heading to heading. Robots
    with an `impratio` above 10 keep the elliptic one: on pyramids, their soft feet slip away."""
    solver_iterations: Annotated[int, Whole(1, 100_000)] | None = None
    """Most iterations of the physics' contact solver. Default: MuJoCo's."""
    solver_warm_start: bool = True
    """Whether that solver begins at the last step's accelerations. Over long steps these are worse
    to begin with than those without contact."""
    reward_weights: Annotated[dict[str, float], Named(WEIGHT)] | None = None
    """Weights of terms of the reward by name, instead of the task's own; 0 is for without."""
    reward_scales: Annotated[dict[str, float], Named(SCALE)] | None = None
    """Widths of the bells of terms of the reward by name, likewise, each in the term's unit."""
    motors: str | dict[str, Any] = IDEAL
    """"ideal"; "data_sheet", those of a built-in robot; or a table, see
    `fbid_gym.robots.drives.MotorTable`."""
    randomisation: dict[str, Any] | None = None
    """Arguments of `fbid_gym.runtime.randomisation.Randomisation`; none by default."""
    sensors: Any = "perfect"
    """What robots measure of themselves with: "perfect", "good", "mems", "raw", or a table of
    options of `fbid_gym.estimation.Sensors`, such as {"like": "mems", "scale": 2}."""
    state: Annotated[str, Choice(("estimated", "true"))] | None = None
    """What layer, gait and policy know: "true", or "estimated" from the sensors. Default:
    "estimated" unless these are perfect. Reward, metrics and ends of episodes are those of the
    truth."""
    observation: Annotated[str, Choice(OBSERVATIONS)] = FULL
    """"full"; "body", of body and feet alone, in the robot's own units, with the feet in the order
    of their places; or for robots, with sensors that are not perfect, "measured": what they tell
    and what the robot is told, and apart from it what a critic may know; or "measured+estimate"."""
    history: Annotated[int, Whole(1, 1000)] = 1
    """Policy steps that are observed together, newest first; at most an episode's."""

    def __post_init__(self) -> None:
        """Check each value that can be checked without a robot."""
        check_fields(self)
        by_name("layer_options", self.layer_options)
        check_height(self.terrain, self.terrain_height)
        motor_table(self.motors)
        self.rates()
        drawn = self.randomisations()
        for name in ("motor_speed", "motor_lag"):
            value = getattr(drawn, name)
            if self.motors == IDEAL and value != (1.0, 1.0):  # these have no such thing
                expected = f'(1, 1) with motors "{IDEAL}"'
                raise InvalidValueError(f"randomisation {name}", value, expected)
        if self.perceived() is None and self.state == "estimated":
            expected = '"true" with perfect sensors, of which nothing has to be estimated'
            raise InvalidValueError("state", self.state, expected)
        if self.observation not in (FULL, BODY) and not self.estimates:
            expected = '"full", "body", or sensors that are not perfect and state="estimated"'
            raise InvalidValueError("observation", self.observation, expected)
        if 1 < self.history > self.episode_seconds * self.policy_hz:
            expected = f"at most the {self.episode_seconds * self.policy_hz:g} steps of an episode"
            raise InvalidValueError("history", self.history, expected)
        for name in ("layer_options", "task_options", "motors", "randomisation", "sensors"):
            # Copies: whoever gave them may go on to change what is his.
            object.__setattr__(self, name, copy.deepcopy(getattr(self, name)))

    @classmethod
    def of(cls, arguments: Mapping[str, Any]) -> "EnvConfig":
        """Build a configuration from keyword arguments, naming any that does not exist.

        Those of the task stand among the others.
        """
        own = [field.name for field in fields(cls) if field.name != "task_options"]
        task = arguments.get("task", cls.task)
        options = task_options(Choice(TASKS).check("task", task))
        names = [*own, *options]
        for name in arguments:
            if name not in names:
                choices = [*names, *options_of(Drawing)]
                raise UnknownArgumentError("The environment", name, choices)
        given = {name: value for name, value in arguments.items() if name in own}
        return cls(
            **given, task_options={name: arguments[name] for name in options if name in arguments}
        )

    def load_robot(self) -> Robot:
        """Return the robot, with its motors; with its feet in order for who sees the body alone."""
        robot = self._plain_robot()
        equipped = with_motors(robot, self.motors, motor_sheet(robot))
        return by_place(equipped) if self.observation == BODY else equipped

    def _plain_robot(self) -> Robot:
        robot = self.robot
        if isinstance(robot, str):
            if not robot.startswith((MENAGERIE, ZOO)):  # many give the path of their file here
                made = "a Robot such as Robot.load(path) makes"
                check_choices("robot", [robot], (*ROBOTS, made))
            robot = load(robot)
        if not isinstance(robot, Robot):
            raise InvalidValueError("robot", robot, f"a Robot or one of {', '.join(ROBOTS)}")
        check_upright(robot)
        return robot

    def rates(self) -> Rates:
        """Return the checked rates."""
        return Rates(self.physics_hz, self.control_hz, self.policy_hz)

    def layer(self, robot: Robot, task: Task) -> tuple[ActionLayer, Additions]:
        """Return the action layer, and what of an action is added to the layer's."""
        options = by_name("layer_options", self.layer_options)
        return make_layer(self.action_layer, robot, self.rates().control, task.kind, options)

    def make_task(self, robot: Robot) -> Task:
        """Return the task."""
        rates = self.rates()
        task = make_task(
            self.task,
            robot,
            _at_least(1.0 / rates.policy, "episode_seconds", self.episode_seconds),
            rates.control,
            Pushes(
                self._push_force(robot),
                _at_least(1.0 / rates.control, "push_duration", self.push_duration),
                self.push_interval,
                self.push_velocity,
            ),
            Start(self.joint_noise, self.velocity_noise),
            self.task_options,
        )
        if self.command_curriculum and not np.isfinite(task.tolerance):
            expected = "one with commands, such as 'walk'"
            raise InvalidValueError("task of a command_curriculum", self.task, expected)
        return task

    def reward_terms(self, task: Task) -> dict[str, Term]:
        """Return the terms of the reward, with the weights and scales that were asked for."""
        return reward_table(self.task, task, self.reward_weights or {}, self.reward_scales or {})

    def ground(self, robot: Robot) -> tuple[Terrain, mujoco.MjModel]:
        """Return the terrain, and the robot's world with it."""
        height = self._terrain_height(robot)
        if self.curriculum and (self.task != "walk" or self.terrain not in LEVELLED):
            expected = f"task 'walk' on one of the terrains {', '.join(LEVELLED)}"
            given = self.task, self.terrain
            raise InvalidValueError("task and terrain of a curriculum", given, expected)
        difficulty = None if self.curriculum else self.difficulty
        terrain, shared = _ground(robot, self.terrain, height, difficulty, self.terrain_seed)
        world = copy.copy(shared)
        # There is one robot: no groups of bodies that do not touch have to be looked for.
        world.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        if robot.drives is not None:
            world.dof_damping[6 : robot.nv] = robot.drives.viscous
            world.dof_frictionloss[6 : robot.nv] = robot.drives.dry
        pyramids = world.opt.impratio <= _MOST_OF_PYRAMIDS
        world.opt.cone = _CONES[self.friction_cone if pyramids else "elliptic"]
        if self.solver_iterations is not None:
            world.opt.iterations = self.solver_iterations
        if not self.solver_warm_start:
            world.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
        return terrain, world

    def randomisations(self) -> Randomisation:
        """Return what varies from robot to robot."""
        known = options_of(Randomisation)
        return Randomisation(**by_name("randomisation", self.randomisation, known))

    def perceived(self) -> Sensors | None:
        """Return the sensors of the robots; None where they are perfect."""
        sensors = sensors_of(self.sensors)
        for name in ("imu", "encoder", "contact"):
            if sensors is not None:
                sensors.every(name, self.rates().control)
        return sensors

    @property
    def estimates(self) -> bool:
        """Whether layer, gait and policy know the state by an estimate only."""
        return self.perceived() is not None and self.state != "true"

    @property
    def arguments(self) -> dict[str, Any]:
        """The keyword arguments that make it again, see `of`."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        given = own.pop("task_options")
        return own | given

    def as_dict(self) -> dict[str, Any]:
        """Return the arguments as plain data; a robot of the user's by its name."""
        name = self.robot if isinstance(self.robot, str) else self.robot.name
        return self.arguments | task_options(self.task) | self.task_options | {"robot": name}

    def resolved(self) -> dict[str, Any]:
        """Return every argument with the value it means today, as JSON can hold it.

        Defaults may change; what is saved beside a policy must not change with them. The push is in
        newtons, the options of the layer and of the randomisation are complete; infinity is "inf".
        None is left where a terrain takes no height.
        """
        plain_robot, robot = self._plain_robot(), self.load_robot()
        task = self.make_task(robot)
        layer, additions = self.layer(robot, task)
        terms, sensors = self.reward_terms(task), self.perceived()
        options = layer_options(self.action_layer) | by_name("layer_options", self.layer_options)
        options["footholds"] = bool(additions.feet.any())
        for name, value in options.items():
            if value is None:
                # A layer of the user's need not tell what it makes of None.
                assumed = getattr(getattr(layer, "contact", None), name, None)
                told = getattr(layer, "meant", {}).get(name, assumed)
                options[name] = _derived(getattr(layer, name, told))
            elif isinstance(value, Falling):
                options[name] = _derived(in_hertz(robot, value))
        filled = {
            "layer_options": options,
            "motors": complete_table(plain_robot, self.motors, motor_sheet(plain_robot)),
            "push_force": _derived(self._push_force(robot)),
            "push_weights": [round(force / robot.weight, 6) for force in self._push_force(robot)],
            "randomisation": asdict(self.randomisations()),
            "reward_weights": {name: term.weight for name, term in terms.items()},
            "reward_scales": {n: term.scale for n, term in terms.items() if term.scale is not None},
            "sensors": "perfect" if sensors is None else asdict(sensors),
            "state": "estimated" if self.estimates else "true",
            "solver_iterations": self.solver_iterations or int(robot.model.opt.iterations),
            "terrain_height": _derived(self._terrain_height(robot)),
        }
        filled |= {name: _derived(value) for name, value in task.derived.items()}
        return plain(self.as_dict() | filled)

    def _terrain_height(self, robot: Robot) -> float | None:
        if self.terrain_height is None and self.terrain not in LEVELLED:
            return _TERRAIN_HEIGHT * float(Stance.of(robot).home_com[2])
        return self.terrain_height

    def _push_force(self, robot: Robot) -> tuple[float, float]:
        if self.push_force is None:
            least, most = self.push_weights or task_kind(self.task).push
            return least * robot.weight, most * robot.weight
        return self.push_force


# Every chunk of a batch asks for the same.
@once_for_robot
def _ground(
    robot: Robot, name: str, height: float | None, difficulty: float | None, seed: int
) -> tuple[Terrain, mujoco.MjModel]:
    terrain = make_terrain(name, robot, height=height, difficulty=difficulty, seed=seed)
    return terrain, compile_paired(world_of(robot, terrain))


_TERRAIN_HEIGHT = 0.191  # 3 cm for the 16 cm of `quadruped`, as in [M10] IV.E

AROUND = (
    *options_of(Drawing),
    *("num_envs", "robots", "num_threads", "max_episode_steps", "stagger", "autoreset_mode"),
    "vectorization_mode",
)
"""Arguments about how environments are drawn and stepped."""


def _derived(value: Any) -> Any:
    """To nine digits: platforms may sum up a robot's mass in another order. Words stay."""
    if isinstance(value, tuple):
        return [_derived(item) for item in value]
    return value if isinstance(value, str | bool | None) else float(f"{value:.9g}")


def plain(value: Any) -> Any:
    """Return a value as nested dictionaries and lists of what JSON can hold."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value


def _at_least(least: float, name: str, seconds: float) -> float:
    if seconds < least:
        raise InvalidValueError(name, seconds, f"a time of at least {least:g} s, one step")
    return seconds
