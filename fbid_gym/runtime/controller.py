"""One robot's controller: a policy on its task and layer, from sensors to torques.

It computes what the environment of its policy computes, to the last bits: `ControlLoop` is all that
both run. It imports no Gymnasium and steps no physics; MuJoCo computes the model's terms.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fbid_gym.checks import check_choices
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import InvalidValueError, NonFiniteError, UnknownOptionError
from fbid_gym.policy import Policy
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.robots import ROBOTS, Robot
from fbid_gym.robots.undrawn import undrawn
from fbid_gym.runtime import answers
from fbid_gym.runtime.config import AROUND, EnvConfig
from fbid_gym.runtime.control_loop import ControlLoop
from fbid_gym.runtime.effort import Effort, add_power, limit
from fbid_gym.runtime.given import checked_action, checked_command, clip, finite_numbers
from fbid_gym.runtime.observer import Observer
from fbid_gym.runtime.readings import READINGS, Reader
from fbid_gym.runtime.sensors import Sensing

_COMMANDED = ("command", "command_start", "command_ramp")

Heights = Callable[[np.ndarray], Any]
"""Tells how high the ground is, (K,) m, at places (K, 2) m of the world that has "position"."""

_BLIND = "None: the policy does not see the ground"


class Controller:
    """From the sensors of one robot to its joints' torques, tick by tick.

    Attributes:
        config: the environment whose task and action layer it runs.
        robot: the robot; its `joint_names` are the order of positions, velocities and torques.
        policy: takes observations (1, O), returns actions (1, A).
        sees_ground: whether it wants to be told the height of the ground.
        rates: `rates.control` is how often it wants to be asked, Hz.
        loop: its task and layer at work.
        estimator: of its state, from readings; None where the environment's sensors are perfect.
        measured: what the task measured when the policy was last asked, see `Task.measure`; None
            before the first time.
    """

    def __init__(
        self, config: EnvConfig, policy: Callable[[np.ndarray], np.ndarray] | None = None
    ) -> None:
        """Build the controller.

        Args:
            config: what an environment would be made of; its terrain, pushes and randomisation
                count for nothing here.
            policy: from observations (1, O), not normalised, to actions (1, A); None follows the
                task as well as the layer alone can.

        Raises:
            FbidError: arguments that no environment has.
        """
        self.config, self.robot, self.rates = config, config.load_robot(), config.rates()
        task = config.make_task(self.robot).on(self._ground)
        drawn = task.draw(np.random.default_rng(0))
        answers.check_plan(task, drawn)
        self._tick, sensors = np.zeros(1, np.int64), config.perceived()
        self._reader = None
        if sensors is not None and config.estimates:
            self._reader = Reader(self.robot, sensors, self.rates.control, self._tick)
        self.estimator = self._reader.estimator if self._reader else None
        observer = Observer(task, config.observation, config.history, 1, self.estimator)
        self._heights: Heights | None = None
        self.sees_ground = "scan" in observer.groups
        self._sensing, self._dynamics = Sensing(self.robot), MuJoCoDynamics(undrawn(self.robot))
        home = self._dynamics.terms(self.robot.home_qpos[None], np.zeros((1, self.robot.nv)))
        self.loop = ControlLoop(config, task, drawn, home, observer)
        zero = np.zeros((1, self.loop.num_actions))
        self.policy = policy or (lambda observation: zero)
        self._effort = Effort.none(1, self.robot.num_joints)
        self._state: RobotState
        self._found: DynamicsTerms | None = None
        self._sums = {"distance": np.zeros(1), "energy": np.zeros(1)}
        self.measured: Any = None
        self.reset()

    @classmethod
    def load(
        cls, policy: str | Path | Policy, robot: str | Path | Robot | None = None, **arguments: Any
    ) -> "Controller":
        """Build the controller of a trained policy.

        Args:
            policy: its file, run folder, or `shipped:NAME`.
            robot: the name of a built-in robot, the path of a file, or a Robot. Default: that of
                the policy's environment.
            **arguments: of the environment, which go before those that the policy was trained
                with; all of them, with `task`, where its id is not of this package.

        Raises:
            PolicyFileError: no policy, or one that observes or commands something else than this
                robot and these arguments give.
            FbidError: another argument, or a robot that cannot be used.
        """
        known = policy if isinstance(policy, Policy) else Policy.load(policy)
        given = {**known.env_args, **arguments}
        if robot is not None:
            path = isinstance(robot, Path) or (isinstance(robot, str) and robot not in ROBOTS)
            given["robot"] = Robot.load(robot) if path else robot
        return cls.of_environment(known.env_id, given, known)

    @classmethod
    def of_environment(
        cls, env_id: str, arguments: Mapping[str, Any], policy: Policy | None = None
    ) -> "Controller":
        """Build the controller of an environment, as `gym.make(env_id, **arguments)` has it.

        Args:
            env_id: an id of this package; of another one, the arguments hold the task.
            arguments: of the environment; how it is drawn and stepped counts for nothing.
            policy: None for the zero action.

        Raises:
            FbidError: as `load`.
        """
        if env_id not in ENVIRONMENTS and "task" not in arguments:
            choices = (*ENVIRONMENTS, "the arguments of your own, such as task='walk'")
            raise UnknownOptionError("environment", env_id, choices)
        given = {**ENVIRONMENTS.get(env_id, {}), **arguments}
        if isinstance(given.get("robot"), Mapping):
            expected = "robot=..., such as the robot.zip of its run folder"
            raise InvalidValueError("robot of the policy", dict(given["robot"]), expected)
        config = EnvConfig.of({name: v for name, v in given.items() if name not in AROUND})
        made = cls(config, policy)
        if policy is not None:
            size = len(made.loop.observer.bound)
            policy.check(observation_size=size, action_size=made.loop.num_actions)
        return made

    @property
    def observation_names(self) -> tuple[str, ...]:
        """What each entry of the policy's observation is, with its unit."""
        return self.loop.observer.names

    @property
    def action_names(self) -> tuple[str, ...]:
        """What each entry of its action commands, with its scale and unit."""
        return self.loop.action_names

    def reset(self, **planned: Any) -> None:
        """Begin anew: the next tick's sensors tell where. There is no command, until `set_command`.

        Args:
            **planned: entries of the task's plan other than its command, such as the `phase` and
                the `speed` of a planned motion; the others are 0, the beginning of a motion.

        Raises:
            FbidError: the plan has no such entry, or it is of another shape or not finite.
        """
        plan, command = self.loop.plan, self.loop.plan.get("command")
        names = [n for n in plan if n not in (*answers.DRAWN, *_COMMANDED)]
        check_choices("entry of the plan", planned, names)
        given = {n: finite_numbers(n, v, plan[n].shape[1:]) for n, v in planned.items()}
        for name, value in plan.items():
            value[:] = given.get(name, 0)
        if command is not None:
            # None where that is a command, else the greatest: to stand as high as at home.
            ranges = np.array(list(self.loop.task.commands.values())).reshape(-1, 2)
            stays = ((ranges[:, 0] <= 0.0) & (ranges[:, 1] >= 0.0)).all()
            command[:] = 0.0 if stays else ranges[:, 1].reshape(command.shape[2:])
        self._tick[:], self.measured = 0, None
        # What it knows of its place, and whether its estimate goes on from there.
        self._where, self._estimating = self.robot.home_qpos[None], False
        self._effort.begin()
        self._effort.torque[:] = 0.0
        for total in self._sums.values():
            total[:] = 0.0

    def set_command(self, *command: float) -> None:
        """Have the robot follow a command from the next tick on.

        Args:
            *command: of a robot that walks m/s ahead, m/s and rad/s to the left; of one that
                balances the height of its base above its feet, m.

        Raises:
            FbidError: a task without commands, or another number of them.
        """
        plan, group = self.loop.plan, self.loop.observer.groups.get("command")
        if group is None or "command" not in plan:
            raise InvalidValueError("command", command, f"none in task {self.config.task!r}")
        shape = plan["command"].shape[2:]
        given = command if shape else (command[0] if len(command) == 1 else command)
        plan["command"][:] = checked_command(given, shape, group.bound, 1)[:, None]

    def tick(self, sensors: Any, heights: Heights | None = None) -> np.ndarray:
        """Return the joints' torques of a control tick, within their limits.

        Args:
            sensors: `fbid_gym.runtime.SENSORS` by name, now; or a `RobotState` of one robot, as an
                estimator gives it. Where the environment has sensors that err, also `READINGS` by
                name, of which it makes an estimate as the environment does; the first ones are of
                a robot that rests.
            heights: of the ground, for policies that see it (`height_scan`) and for these alone:
                asked for those at the footholds, and around the robot when the policy is asked.

        Returns:
            (n,) N·m, in the order of `robot.joint_names`.

        Raises:
            FbidError: a sensor that is missing, of another shape or not finite; names it. The
                controller has not gone on.
            NonFiniteError: torques or heights that are no numbers; it has to be reset then, as
                after heights of another shape.
        """
        if not (callable(heights) if self.sees_ground else heights is None):
            sees = "a function (K, 2) -> (K,): the policy sees the ground"
            raise InvalidValueError("heights", heights, sees if self.sees_ground else _BLIND)
        self._heights = heights
        state = self._state = self._told(sensors)
        self._found, terms = None, self._terms
        loop, effort = self.loop, self._effort
        ticks = int(self._tick[0])
        tick = ticks % self.rates.ticks
        if ticks == 0:
            loop.begin(np.zeros(1, int), terms())
        add_power(effort, state.qvel)
        if tick == 0:
            if ticks:
                self._sums["distance"] += np.hypot(*state.qvel[0, :2]) / self.rates.policy
                self._sums["energy"] += effort.power / self.rates.control
            self.measured = loop.measure(loop.outcome(state, terms(), effort, self._sums))
            just_begun = np.zeros(1, int) if ticks == 0 else None
            seen = loop.observer.observe(self.measured, self.measured, just_begun)
            action = checked_action(self.policy(seen), (1, loop.num_actions), refuse=False)
            action = np.array(action, order="C")
            clip(action)
            loop.send(action)
            effort.begin()
        torque = loop.torque(tick, state, terms, terms)
        if self.estimator is not None:
            self.estimator.prepare(terms)
        limit(effort, torque, self.robot.torque_limit)
        if effort.lost[0]:
            raise NonFiniteError("torque", (int(np.isnan(torque[0]).argmax()),))
        self._tick[0] = ticks + 1
        return effort.torque[0].copy()

    def _terms(self) -> DynamicsTerms:
        """The dynamics at the state of this tick, once somebody asks."""
        if self._found is None:
            self._found = self._dynamics.live(self._state.qpos, self._state.qvel)
        return self._found

    def _told(self, sensors: Any) -> RobotState:
        """Return the robot's state, as it is told or by its own estimate."""
        reader = self._reader
        if reader is None or not reader.reads(sensors):
            if self.config.observation.startswith("measured"):
                expected = f"{', '.join(READINGS)}: its policy observes them"
                raise InvalidValueError("sensors", "a state", expected)
            state = self._sensing.state(sensors, int(self._tick[0]))
            self._where, self._estimating = state.qpos, False
            return state
        reader.take(sensors, begins=not self._estimating)
        if self._estimating:
            reader.estimator.update(self._effort.torque)
        else:
            reader.estimator.begin(np.zeros(1, int), self._where)
        self._estimating = True
        return reader.estimator.state

    def _ground(self, points: np.ndarray) -> np.ndarray:
        """Ask for the height of the ground, (1, K) m, below points (1, K, 2 or 3) m."""
        assert self._heights is not None
        told = self._heights(points[0, :, :2].copy())
        return finite_numbers("heights", told, points.shape[1:2])[None]
