"""The controller of one robot: what its environment computes, and what it needs and refuses."""

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    PolicyFileError,
    ShapeError,
    UnknownOptionError,
)
from fbid_gym.policy import Policy
from fbid_gym.quantities import RobotState
from fbid_gym.runtime import SENSORS, Controller
from fbid_gym.runtime.config import EnvConfig
from tests.batches import started
from tests.postures import sensed

ROOT = Path(__file__).resolve().parents[2]
COMMAND = (0.4, 0.1, 0.3)
LAYERS = "base_acceleration", "com_wrench", "joint_position_gait"
SHIPPED = [f"{robot}Walk-v0/{layer}" for robot in ("Quadruped", "Biped") for layer in LAYERS]
SHIPPED += ["BipedBalance-v0/base_acceleration", "BipedSquat-v0/joint_position"]


def apart(monkeypatch, batch, controller, policy, command=None, heights=None) -> list[float]:
    """Play two episodes: by how much the torques of both differ at each tick."""
    checked = None if command is None else batch.check_command(np.squeeze(command), 1)
    taken, advance = [], batch.simulation.tick

    def tick(torque, push, effort, state):
        single = sensed(state.qpos[0], state.qvel[0], state.contact_force[0])
        torques = controller.tick(state if len(taken) % 2 else single, heights)
        advance(torque, push, effort, state)
        taken.append(np.abs(torques - effort.torque[0]).max())

    monkeypatch.setattr(batch.simulation, "tick", tick)
    for _ in range(2):
        batch.reset(np.arange(1), checked)
        planned = {k: v[0] for k, v in batch.loop.plan.items() if k in ("phase", "speed")}
        controller.reset(**planned)
        if command:
            controller.set_command(*command)
        for _ in range(batch.num_steps):
            step = batch.step(policy(batch.observation()))
            if step.terminated[0]:
                break
    return taken


@pytest.mark.parametrize("name", SHIPPED)
def test_its_torques_are_those_of_the_environment(name, monkeypatch):
    """Pushes and all, tick by tick, through a whole episode; and again after a reset."""
    policy, seconds = Policy.load(f"shipped:{name}"), 2.5
    arguments = {**ENVIRONMENTS[policy.env_id], **policy.env_args, "episode_seconds": seconds}
    batch, controller = started(arguments, 1), Controller.load(policy, episode_seconds=seconds)
    command = None
    if "command" in batch.loop.plan:
        command = COMMAND if "Walk" in name else (0.97 * batch.task.body.size,)
    taken = apart(monkeypatch, batch, controller, policy, command)
    assert len(taken) > seconds * batch.rates.control
    assert max(taken) < 1e-9


def test_a_policy_that_sees_the_ground_is_told_its_heights(monkeypatch):
    """By a function; its torques on stairs are those of the environment then."""
    own = {"terrain": "stairs", "difficulty": 0.4, "height_scan": True, "episode_seconds": 3.0}
    arguments = {**ENVIRONMENTS["fbid_gym/QuadrupedTerrain-v0"], **own}
    arguments["action_layer"] = "base_acceleration"
    batch = started(arguments, 1)
    weights = np.random.default_rng(0).normal(0.0, 0.1, (len(batch.observation_names), 14))

    def policy(seen):
        return np.tanh(np.clip(seen, -1.0, 1.0) @ weights)

    asked = []

    def heights(places):
        asked.append(places)
        return batch.terrain.grid.heights(places[None])[0]

    controller = Controller(EnvConfig.of(arguments), policy)
    taken = apart(monkeypatch, batch, controller, policy, COMMAND, heights)
    assert len(taken) > batch.rates.control and max(taken) < 1e-9
    assert np.ptp(np.concatenate([heights(places) for places in [*asked]])) > 0.01  # m, no plane
    sensors = at_home(controller)
    for wrong, error, words in (
        (None, InvalidValueError, "heights: None. Expected a function.*sees the ground"),
        (np.zeros(35), InvalidValueError, "heights"),
        (lambda places: places, ShapeError, r"heights has shape \(35, 2\). Expected \(35,\)"),
        (lambda places: places[:, 0] * np.nan, NonFiniteError, "heights"),
    ):
        controller.reset()
        with pytest.raises(error, match=words):
            controller.tick(sensors, wrong)
    with pytest.raises(InvalidValueError, match="heights.*None: the policy does not see"):
        blind = Controller.load(f"shipped:{SHIPPED[0]}")
        blind.tick(sensors, heights)


def at_home(controller: Controller) -> dict[str, np.ndarray]:
    """What the sensors of a robot read that stands at home."""
    robot = controller.robot
    force = np.tile([0.0, 0.0, robot.weight / robot.num_points], (robot.num_points, 1))
    return sensed(robot.home_qpos, np.zeros(robot.nv), force)


@pytest.fixture(scope="module")
def walker() -> Controller:
    return Controller.load(f"shipped:{SHIPPED[0]}")


def test_whether_feet_touch_is_enough(walker):
    """Feet that share the weight are as good as forces that say so; a state is, too."""
    sensors, ticks = at_home(walker), range(2 * walker.rates.ticks)
    walker.reset()
    forces = [walker.tick(sensors) for _ in ticks]
    touching = {name: value for name, value in sensors.items() if name != "contact_force"}
    touching["contact"] = [True] * walker.robot.num_points
    walker.reset()
    np.testing.assert_allclose([walker.tick(touching) for _ in ticks], forces, rtol=0, atol=1e-12)


def without(name: str, sensors: dict) -> dict:
    return {other: value for other, value in sensors.items() if other != name}


def refuse_failures_of(name, controller, sensors, needed=True):
    """Each wrong reading of a sensor is named, at every tick, and leaves the controller alone."""
    ticks, whole = range(controller.rates.ticks), np.array(sensors[name])
    rest = whole.ravel()[:-1]
    controller.reset()
    expected = [controller.tick(sensors) for _ in ticks]
    bad = [np.append(rest, end).reshape(whole.shape) for end in (np.nan, np.inf)]
    cases = [({**sensors, name: value}, NonFiniteError) for value in bad]
    cases += [({**sensors, name: rest}, ShapeError), ({**sensors, name: "x"}, InvalidValueError)]
    cases += [(without(name, sensors), InvalidValueError)] if needed else []
    controller.reset()
    for tick in ticks:
        for given, error in cases:
            with pytest.raises(error, match=name):
                controller.tick(given)
        np.testing.assert_array_equal(controller.tick(sensors), expected[tick])


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_that_fails_is_named_and_nothing_goes_on(walker, name):
    refuse_failures_of(name, walker, at_home(walker))


def test_what_else_is_no_state(walker):
    sensors = at_home(walker)
    for given, words in (
        (None, "sensors: None. Expected a dictionary"),
        ({**sensors, "gyro": np.zeros(3)}, "Unknown sensor 'gyro'.*angular_velocity"),
        ({**sensors, "orientation": [2.0, 0, 0, 0]}, "orientation.*a unit quaternion"),
        (RobotState(*np.zeros((4, 1, 19))), r"qvel has shape \(1, 19\). Expected \(1, 18\)"),
    ):
        with pytest.raises(FbidError, match=words):
            walker.tick(given)


def test_a_policy_that_does_not_fit_is_refused():
    shipped = f"shipped:{SHIPPED[0]}"
    with pytest.raises(PolicyFileError, match="observation_size 62.*Expected 76"):
        Controller.load(shipped, robot="biped")
    with pytest.raises(PolicyFileError, match="action_size 14.*Expected 6"):
        Controller.load(shipped, action_layer="com_wrench", layer_options={"footholds": False})
    with pytest.raises(UnknownOptionError, match=r"environment 'mine/Walk-v0'.*task='walk'"):
        own = Policy.load(shipped)
        Controller.load(replace(own, env_id="mine/Walk-v0"))
    with pytest.raises(PolicyFileError, match="observation_size 62.*Expected 97"):
        Controller.load(shipped, height_scan=True)
    walker = Controller.load(shipped)
    with pytest.raises(ShapeError, match="command"):
        walker.set_command(1.0)
    with pytest.raises(UnknownOptionError, match="entry 'phase' of the plan.*lowered"):
        walker.reset(phase=1)


WITHOUT = """
import sys
own = set(sys.modules)  # of the interpreter, as Debian's sitecustomize
sys.modules |= dict.fromkeys({absent!r})
import numpy as np
from fbid_gym.runtime import Controller
controller = Controller.load("shipped:{policy}")
robot = controller.robot
torque = controller.tick({{
    "position": robot.home_qpos[:3],
    "orientation": robot.home_qpos[3:7],
    "joint_position": robot.home_qpos[7:],
    "joint_velocity": np.zeros(robot.num_joints),
    "velocity": np.zeros(3),
    "angular_velocity": np.zeros(3),
    "contact": np.ones(robot.num_points),
}})
print(np.abs(torque).max() > 0.0)
loaded = {{name.partition(".")[0] for name, module in sys.modules.items() if module is not None}}
print(sorted(loaded - own - sys.stdlib_module_names - set({known!r})))
"""


def test_it_needs_numpy_numba_and_mujoco_alone():
    """In a process that has neither Gymnasium nor what else learning and drawing want."""
    absent = ["gymnasium", "torch", "stable_baselines3", "pinocchio", "matplotlib", "onnx", "PIL"]
    known = ["fbid_gym", "numpy", "numba", "llvmlite", "mujoco", "filelock", "msgspec", "cffi"]
    known += ["safetensors", "scipy", "typing_extensions", "OpenGL", "pycparser"]
    code = WITHOUT.format(absent=absent, known=known, policy=SHIPPED[0])
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    first, loaded = done.stdout.splitlines() or ["", done.stderr]
    assert first == "True", done.stderr
    found = {name for name in ast.literal_eval(loaded) if not name.startswith("_")}
    assert found - {"cython_runtime"} == set()
