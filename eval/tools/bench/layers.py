"""Measure the cost beside physics: layers, walking, sensors and motors, a single robot."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np

from eval.tools.bench.environments import BALANCE, zero_action
from eval.tools.bench.figures import Figure, FigureTable, Limit
from eval.tools.bench.timing import Measure, Timed, added, in_turns, timed_physics
from eval.zero_actions.measures import begin
from fbid_gym.actions.base_acceleration import BaseAcceleration
from fbid_gym.actions.law import BodyLaw
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.runtime import Controller
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.runtime.rates import Rates

Cases = Mapping[tuple[str, str], Limit | None]
"""Environment and layer -> what the ratio shall keep to."""

ON_TASKS: Cases = {
    ("BipedStep-v0", "joint_position_feedforward"): Limit(1.0),
    ("BipedStep-v0", "base_acceleration"): None,
    ("QuadrupedCrawl-v0", "joint_position_feedforward"): None,
    ("QuadrupedCrawl-v0", "base_acceleration"): None,
    ("HumanoidBalance-v0", "com_wrench"): Limit(1.0),
    ("HumanoidBalance-v0", "base_acceleration"): None,
}
WALKING: Cases = {
    ("QuadrupedWalk-v0", "torque"): None,
    ("QuadrupedWalk-v0", "joint_position"): Limit(0.4),
    ("QuadrupedWalk-v0", "base_acceleration"): Limit(0.8),
    ("QuadrupedWalk-v0", "com_wrench"): Limit(1.0),
    ("BipedWalk-v0", "base_acceleration"): Limit(0.5),
    ("HumanoidWalk-v0", "base_acceleration"): Limit(0.4),
}
ESTIMATOR, MOTORS, BOUNDS = "sensors and estimator", "motors", "bounded torques"
CONDITIONS: Mapping[str, tuple[dict[str, Any], Limit | None]] = {
    ESTIMATOR: ({"sensors": "mems"}, Limit(0.15)),
    MOTORS: ({"motors": "data_sheet"}, None),
    BOUNDS: ({"motors": {"strength": 0.4}}, Limit(0.05)),
}
"""Part that is timed -> arguments of the environment, and what the ratio shall keep to."""
CONTROLLED = [
    f"{env}/{layer}"
    for env in ("QuadrupedWalk-v0", "BipedWalk-v0")
    for layer in ("base_acceleration", "com_wrench", "joint_position_gait")
]
"""Shipped policies."""
SINGLE_LIMIT, CONTROLLER_LIMIT = Limit(150.0), Limit(200.0)
TASK_STEPS, WALKING_STEPS, SINGLE_STEPS = 25, 60, 20
"""Policy steps of a round: from a reset but for robots that walk on from round to round."""
CONTROLLER_TICKS = 100
SINGLE_ROUNDS = 10
"""How much oftener a single robot is timed: its rounds are short, and noise does not average out
over a batch."""


def on_their_tasks(num_envs: int, rounds: int) -> FigureTable:
    """Time layers, terms and reference included, in closed loop beside the physics."""
    return FigureTable(
        f"Controllers on their tasks (N = {num_envs}, one thread)",
        "CPU time of the layer with the terms it asks for, on zero action and the task's default "
        "pushes, in half a second from a reset. Figure: relative to the physics steps it drives.",
        "x physics",
        _beside_physics(ON_TASKS, _task, TASK_STEPS, num_envs, rounds),
    )


def walking(num_envs: int, rounds: int) -> FigureTable:
    """Time steps of vector environments on one thread, and the physics in them."""
    return FigureTable(
        f"Walking (N = {num_envs}, one thread)",
        "CPU time of `gym.make_vec(...).step` on zero action: gait, layer, observation, reward, "
        "`info`, resets. Figure: all but the physics, relative to it; cost per robot and control "
        "tick.",
        "x physics",
        _beside_physics(WALKING, _walk, WALKING_STEPS, num_envs, rounds),
    )


def conditions(num_envs: int, rounds: int) -> FigureTable:
    """Time what sensors and motors of robots take, and what laws do about these."""
    walks = "QuadrupedWalk-v0", "BipedWalk-v0"
    return FigureTable(
        f"Robots as they are (N = {num_envs}, one thread)",
        f"CPU time of walking through `base_acceleration` on zero action, {WALKING_STEPS} steps "
        'from a reset: of sensors and estimator at `sensors="mems"`; of the motors of '
        '`motors="data_sheet"`; and at 0.4 of every torque of the law, less that of the same law '
        "with motors that have no limits, at the same states. Figure: relative to the physics.",
        "x physics",
        _beside_physics(
            {(env, part): limit for part, (_, limit) in CONDITIONS.items() for env in walks},
            *(_condition, WALKING_STEPS, num_envs, rounds),
        ),
    )


def single(robots: Sequence[str], layers: list[str], rounds: int) -> FigureTable:
    """Microseconds beyond physics per control tick of a single robot, by layer."""
    cases = [(robot, layer) for robot in robots for layer in layers]
    found = in_turns({case: _one(*case) for case in cases}, SINGLE_ROUNDS * rounds)
    micros = {case: values / (SINGLE_STEPS * Rates().ticks) * 1e6 for case, values in found.items()}
    return FigureTable(
        "One robot",
        f"`gym.make(...).unwrapped`, {SINGLE_STEPS} policy steps from a reset. Figure: time of "
        "everything beyond the physics (layer, observation, reward, `info`), per control tick, "
        f"median over {SINGLE_ROUNDS} times as many rounds as elsewhere. By the clock on the wall: "
        "to ask for CPU time twice a tick would be measured, too.",
        "µs",
        tuple(
            Figure.of(
                f"{robot}, `{layer}`",
                f"beside {np.median(micros[robot, layer][:, 1]):.0f} µs of physics",
                micros[robot, layer][:, 0],
                SINGLE_LIMIT,
            )
            for robot, layer in cases
        ),
    )


def controller(names: list[str], rounds: int) -> FigureTable:
    """Microseconds of a tick of `fbid_gym.runtime.Controller`, by the policy that it runs."""
    cases = {f"{name}, {told}": (name, told) for name in names for told in ("state", "readings")}
    found = in_turns(
        {words: _ticks(*case) for words, case in cases.items()}, SINGLE_ROUNDS * rounds
    )
    return FigureTable(
        "A robot's controller",
        f"`fbid_gym.runtime.Controller.tick` of a robot at home, {CONTROLLER_TICKS} ticks, told "
        'its state, or what its sensors of the kind "mems" read, of which it makes an estimate. '
        "Figure: CPU time of a tick, mean over the policy's period. Beside it the longest: when "
        "the policy acts.",
        "µs",
        tuple(
            Figure.of(
                words,
                f"{1e6 * np.median(values[:, 1]):.0f} µs when the policy acts",
                1e6 * values[:, 0],
                CONTROLLER_LIMIT,
            )
            for words, values in found.items()
        ),
    )


def _ticks(name: str, told: str) -> Measure:
    """Seconds of a controller's tick: mean, and of those at which the policy acts; no physics."""
    made = Controller.load(f"shipped:{name}", sensors="mems" if told == "readings" else "perfect")
    robot, still = made.robot, np.zeros(3)
    sensors = {"joint_position": robot.home_qpos[7:], "joint_velocity": np.zeros(robot.num_joints)}
    if told == "readings":
        sensors |= {"gyroscope": still, "accelerometer": np.array([0.0, 0.0, robot.gravity])}
        sensors["contact_load"] = np.full(robot.num_feet, robot.weight / robot.num_feet)
    else:
        sensors |= {"position": robot.home_qpos[:3], "orientation": robot.home_qpos[3:7]}
        sensors |= {"velocity": still, "angular_velocity": still}
        sensors["contact"] = np.ones(robot.num_points)

    def run() -> tuple[float, float]:
        made.reset()
        spent = np.empty(CONTROLLER_TICKS)
        for tick in range(CONTROLLER_TICKS):
            start = time.thread_time()
            made.tick(sensors)
            spent[tick] = time.thread_time() - start
        return float(spent.mean()), float(spent[:: made.rates.ticks].mean())

    return run


def _beside_physics(
    cases: Cases, begin: Callable[[str, str, int], Measure], steps: int, num_envs: int, rounds: int
) -> tuple[Figure, ...]:
    """Cost relative to the physics; beside it what that takes per robot and control tick.

    What `begin` returns tells the seconds of what is measured, and of the physics.
    """
    running = {case: begin(f"fbid_gym/{case[0]}", case[1], num_envs) for case in cases}
    found = in_turns(running, rounds)
    figures = []
    for (env, layer), limit in cases.items():
        cost, physics = found[env, layer].T
        ticks = steps * num_envs * EnvConfig.of(ENVIRONMENTS[f"fbid_gym/{env}"]).rates().ticks
        beside = f"beside {np.median(physics) / ticks * 1e6:.1f} µs of physics"
        figures.append(Figure.of(f"{env}, `{layer}`", beside, cost / physics, limit))
    return tuple(figures)


def _one(robot: str, layer: str) -> Measure:
    """All but the physics, and the physics, of one robot from a reset."""
    env = gym.make(BALANCE, robot=robot, action_layer=layer).unwrapped
    assert isinstance(env, RobotEnv)
    clock, action = time.perf_counter, zero_action(env.action_space)
    physics = timed_physics(env.batch.simulation, clock)
    return added(
        *(lambda: env.reset(seed=0), lambda: env.step(action), SINGLE_STEPS),
        lambda: (clock() - physics.seconds, physics.seconds),
    )


def _task(env: str, layer: str, num_envs: int) -> Measure:
    """A layer and the physics, timed apart, from a reset."""
    batch = EnvBatch(EnvConfig.of({**ENVIRONMENTS[env], "action_layer": layer}), num_envs)
    physics = timed_physics(batch.simulation)
    batch.loop.layer = timed = Timed(batch.layer, "torque")
    return _from_a_reset(batch, TASK_STEPS, lambda: (timed.seconds, physics.seconds))


def _condition(env: str, part: str, num_envs: int) -> Measure:
    """One of `CONDITIONS` and the physics, timed apart, from a reset."""
    own = {**ENVIRONMENTS[env], "action_layer": "base_acceleration", **CONDITIONS[part][0]}
    batch = EnvBatch(EnvConfig.of(own), num_envs)
    physics, within = timed_physics(batch.simulation), 0.0
    timed: Timed | _Bounds
    if part == ESTIMATOR:
        batch.perception = timed = Timed(batch.perception, "update")  # type: ignore[assignment]
    elif part == MOTORS:
        batch.simulation = timed = Timed(batch.simulation, "tick")  # type: ignore[assignment]
        within = 1.0  # of the physics are within what is timed
    else:
        assert isinstance(batch.layer, BaseAcceleration)
        timed = _Bounds(batch.layer.law)
        batch.loop.layer = replace(batch.layer, law=timed)  # type: ignore[arg-type]
    return _from_a_reset(
        batch, WALKING_STEPS, lambda: (timed.seconds - within * physics.seconds, physics.seconds)
    )


class _Bounds:
    """A law that is timed beside one with motors without limits, at the same states."""

    def __init__(self, law: BodyLaw) -> None:
        motors, limit = law.constants.motors, np.full(law.robot.num_joints, 1e9)
        boundless = motors._replace(line=motors.line._replace(torque=limit))
        free = replace(law, constants=law.constants._replace(motors=boundless))
        self._law, self._free, self._turn = Timed(law, "torque"), Timed(free, "torque"), 1

    def __getattr__(self, name: str) -> Any:
        return getattr(self._law, name)

    @property
    def seconds(self) -> float:
        """By which it took longer."""
        return self._law.seconds - self._free.seconds

    def torque(self, *given: Any) -> np.ndarray:
        """Return the law's torque, see `BodyLaw.torque`."""
        *seen, memory = given
        copied = {name: value.copy() for name, value in memory.items()}
        found, self._turn = {}, -self._turn
        for law, own in ((self._law, memory), (self._free, copied))[:: self._turn]:
            found[law] = law.torque(*seen, own)
        return found[self._law]


def _from_a_reset(batch: EnvBatch, steps: int, spent: Measure) -> Measure:
    """Add the time of steps of a batch from a reset to the seconds that are spent."""
    action = np.zeros((batch.num_envs, len(batch.action_names)))
    return added(lambda: begin(batch, 0), lambda: batch.step(action), steps, spent)


def _walk(env: str, layer: str, num_envs: int) -> Measure:
    """All but the physics, and the physics, of robots that walk on."""
    envs = gym.make_vec(env, num_envs=num_envs, action_layer=layer, num_threads=1).unwrapped
    assert isinstance(envs, RobotVectorEnv)
    parts = [timed_physics(its.simulation, time.thread_time) for its in envs.chunks.batches]
    action = zero_action(envs.action_space)
    envs.reset(seed=0)

    def spent() -> tuple[float, float]:
        physics = sum(part.seconds for part in parts)
        return time.thread_time() - physics, physics

    return added(lambda: None, lambda: envs.step(action), WALKING_STEPS, spent)
