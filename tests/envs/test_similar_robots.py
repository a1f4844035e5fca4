"""No robot's size is known to anything: similar robots do the same, each in its own time.

Nor is where in its body a robot's base has its origin, nor how its axes lie.
"""

from typing import Any

import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot, load
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.outcome import Outcome
from tests.batches import started
from tests.pairs import pairs
from tests.robots.similar import moved, similar, turned

CASES = [
    ("go1", "QuadrupedBalance", "height_interval"),
    ("go1", "QuadrupedWalk", "command_interval"),
    ("biped", "BipedBalance", "height_interval"),
    ("biped", "BipedWalk", "command_interval"),
]
STEPS = 4


def rollout(
    name: str, size: float, env: str, commands: str, layer: str, density: float = 1.0, **args: Any
) -> list[np.ndarray]:
    """Postures, torques, rewards and the body's view of two robots, in units of those of size 1."""
    base, time = ENVIRONMENTS[f"fbid_gym/{env}-v0"], np.sqrt(size)
    robot = similar(name, size, density)
    rates = {"physics_hz": 1000, "control_hz": 500, "policy_hz": 50}
    own = {
        "robot": robot,
        "action_layer": layer,
        "observation": "body",
        **{rate: round(base.get(rate, default) / time) for rate, default in rates.items()},
        "velocity_noise": 0.0,
        "episode_seconds": 4.0 * time,
        # Harder ones meet torque limits, where the law's torques may jump by some hundredths.
        "push_force": (0.2 * robot.weight, 0.2 * robot.weight),
        "push_interval": (0.04 * time, 0.06 * time),
        "push_duration": 0.02 * time,
        commands: (2.0 * time, 4.0 * time),
        **args,
    }
    batch = started(base | own, 2)
    rng, seen = np.random.default_rng(7), []
    for _ in range(STEPS):
        step = batch.step(rng.uniform(-0.2, 0.2, (2, len(batch.action_names))))
        qpos = batch.simulation.qpos.copy()
        qpos[:, :3] /= size
        torque = step.info["torque_rms"] / robot.torque_limit.mean()
        seen.append((qpos, torque[:, None], step.reward[:, None], step.observation))
    return [np.array(values) for values in zip(*seen, strict=True)]


@pytest.mark.parametrize(
    ("layer", "name", "env", "commands", "size"), pairs(pairs(LAYERS, CASES), [0.25, 4.0], 1)
)
def test_size_is_unknown(name, env, commands, layer, size):
    own, other = (rollout(name, own, env, commands, layer) for own in (1.0, size))
    for expected, value in zip(own, other, strict=True):
        np.testing.assert_allclose(value, expected, rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize(
    ("name", "env", "layer", "size", "density", "units"),
    [
        ("go1", "QuadrupedWalk", "base_acceleration", 4.0, 2.0, "contacts"),
        ("go1", "QuadrupedWalk", "com_wrench", 0.25, 0.5, "robot"),
        ("biped", "BipedWalk", "base_acceleration", 4.0, 2.0, "robot"),
    ],
)
def test_mass_length_and_time_are_unknown_to_the_last_digits(
    name, env, layer, size, density, units
):
    """Four times as long is twice as slow, in numbers without rounding."""
    options = {"action_units": units}
    own, other = (
        rollout(name, own, env, "command_interval", layer, made_of, layer_options=options)
        for own, made_of in ((1.0, 1.0), (size, density))
    )
    for expected, value in zip(own, other, strict=True):
        np.testing.assert_allclose(value, expected, rtol=1e-6, atol=1e-6)


def outcome_of(robot: Robot, qpos: np.ndarray) -> Outcome:
    """Robots (N, nq) at rest."""
    count, joints = len(qpos), np.zeros((len(qpos), robot.num_joints))
    qvel, force = np.zeros((count, robot.nv)), np.zeros((count, robot.num_points, 3))
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    state = RobotState(qpos, qvel, force, np.zeros(count, np.int64))
    posture = Body.of(robot).posture(state, terms)
    return Outcome(state, terms, posture, joints, *np.zeros((4, count)), terms)


@pytest.mark.parametrize("up", [-0.9, 0.3])
@pytest.mark.parametrize("name", ["biped", "quadruped"])
def test_the_base_may_have_its_origin_anywhere(name: str, up: float) -> None:
    up *= load(name).home_qpos[2]
    one, other = load(name), moved(name, 0.0, 0.0, up)
    own, body = Body.of(one), Body.of(other)
    near = 1e-5 * own.size  # home is found by letting the robot down
    assert body.units.speed == pytest.approx(own.units.speed, rel=1e-5)
    shares = np.array([0.7, 1.0, 1.2])
    np.testing.assert_allclose(body.height(shares), own.height(shares) + up, atol=near)

    numbers, found = (gait_of(robot, 500).constants._asdict() for robot in (one, other))
    assert found["height"] == pytest.approx(numbers.pop("height") + up, abs=near)
    if "hip" in numbers:
        np.testing.assert_allclose(found["hip"], numbers.pop("hip") - [0.0, 0.0, up], atol=near)
    raised = numbers.pop("home") + up * np.eye(one.nq)[2]
    np.testing.assert_allclose(found["home"], raised, rtol=1e-4, atol=near)
    for number, value in numbers.items():
        parts = (item if isinstance(item, tuple) else (item,) for item in (value, found[number]))
        for a, b in zip(*parts, strict=True):
            np.testing.assert_allclose(b, a, rtol=1e-4, atol=near, err_msg=number)

    # Bent, tilted and lowered: where the one lies the other does.
    rng, count = np.random.default_rng(3), 400
    qpos = np.tile(one.home_qpos, (count, 1))
    qpos[:, 7:] += rng.uniform(-1.5, 1.5, (count, 1)) * np.sign(one.home_qpos[7:])
    qpos[:, 3:7] += 0.3 * rng.normal(size=(count, 4))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    lies = outcome_of(one, qpos).posture.fallen
    upright = MuJoCoDynamics(one).terms(qpos, np.zeros((count, one.nv))).world_from_base
    qpos[:, :3] += up * upright[:, :, 2]
    np.testing.assert_array_equal(outcome_of(other, qpos).posture.fallen, lies)
    tilted = np.arccos(upright[:, 2, 2]) > np.radians(60.0)
    assert 0.05 < lies[~tilted].mean() < 0.95


FOLLOWING = ("joint_position", "base_acceleration", "com_wrench")
# Y up and x ahead, as computer graphics has it; x up, as some makers have it; pitched.
AXES = [((1.0, 0.0, 0.0), -np.pi / 2), ((0.0, 1.0, 0.0), -np.pi / 2 - 0.01), ((0.0, 1.0, 0.0), 0.6)]


def moves(robot: Robot, env: str, layer: str, **args: str) -> list[tuple[np.ndarray, ...]]:
    """Joints, torques and rewards of two robots that follow commands by a zero action."""
    # What is drawn at the begin is about the base's axes.
    own = {"robot": robot, "action_layer": layer, "velocity_noise": 0.0, **args}
    batch = started(ENVIRONMENTS[f"fbid_gym/{env}-v0"] | own, 2)
    # Feet that just touch would do so or not by the last bit.
    batch.simulation.qpos[:, 2] += 1e-4 * robot.home_qpos[2]
    zero, said = np.zeros((2, len(batch.action_names))), []
    for _ in range(5 * STEPS):
        step = batch.step(zero)
        torque = step.info["torque"] / robot.torque_limit
        said.append((batch.simulation.qpos[:, 7:].copy(), torque, step.reward))
    return said


@pytest.mark.parametrize(
    ("name", "env", "layer", "axis", "angle", "args"),
    [
        *((*case, {}) for case in pairs([x[:2] for x in CASES], pairs(FOLLOWING, AXES, 3), 3)),
        # Moments that turn the trunk weigh more: along its axes the base's may be in any order.
        ("biped", "BipedWalk", "base_acceleration", *AXES[0], {"gait": "brisk_walk"}),
    ],
)
def test_the_axes_of_the_base_may_lie_as_they_like(name, env, layer, axis, angle, args):
    robots = load(name), turned(name, axis, angle)
    own, other = (moves(robot, env, layer, **args) for robot in robots)
    for step, expected in zip(other, own, strict=True):
        for value, said in zip(step, expected, strict=True):
            np.testing.assert_allclose(value, said, atol=1e-5)
