"""What tasks ask robots to do: asking changes nothing, and what is asked fits together."""

import mujoco
import numpy as np
import pytest

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.motions.gait.command import Steering
from fbid_gym.motions.kinematics import foot_radius
from fbid_gym.quantities import RobotState
from fbid_gym.robots import load
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks import Now
from tests.batches import assert_same

PLANNED = ("QuadrupedBalance-v0", "BipedSquat-v0", "BipedStep-v0", "QuadrupedCrawl-v0")
WALKS = ("QuadrupedWalk-v0", "BipedWalk-v0")
COUNT = 6


def begun(name):
    """A task, its plan for some robots, and what they are and remember as their episodes begin."""
    arguments = ENVIRONMENTS[f"fbid_gym/{name}"]
    robot = load(arguments["robot"])
    task = EnvConfig.of(arguments).make_task(robot)
    draws = [task.draw(np.random.default_rng(seed)) for seed in range(COUNT)]
    # Schedules are padded as those of environments are.
    most = {key: max(draw[key].shape for draw in draws) for key in draws[0]}
    plan = {key: np.stack([np.resize(draw[key], most[key]) for draw in draws]) for key in most}
    force = np.zeros((COUNT, robot.num_points, 3))
    force[..., 2] = robot.weight / robot.num_points
    state = RobotState(plan["qpos"].copy(), plan["qvel"].copy(), force, np.zeros(COUNT, np.int64))
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    steering = Steering(np.zeros((COUNT, robot.num_feet, 2)), np.ones(COUNT))
    known = lambda: terms  # noqa: E731
    return task, plan, Now(state, known, steering, task.memory(terms), known)


def kept(plan, memory):
    return {f"{kind}-{k}": v.copy() for kind, d in enumerate((plan, memory)) for k, v in d.items()}


@pytest.mark.parametrize("name", [*PLANNED, *WALKS])
def test_asking_for_the_target_changes_nothing(name):
    task, plan, now = begun(name)
    for tick in range(5):
        now = now._replace(state=now.state._replace(tick=now.state.tick + tick))
        task.advance(plan, now)
        before = kept(plan, now.memory)
        once = [value.copy() for value in task.target(plan, now)]
        for again, first in zip(task.target(plan, now), once, strict=True):
            np.testing.assert_array_equal(again, first)
        assert_same(kept(plan, now.memory), before)


def along(robot, target, row, time):
    """The dynamics of a robot a while after it moves as its target has it; it goes on moving."""
    qpos, qvel, qacc = target.qpos[row].copy(), target.qvel[row], target.qacc[row]
    mujoco.mj_integratePos(robot.model, qpos, time * qvel + 0.5 * time**2 * qacc, 1.0)
    return MuJoCoDynamics(robot).terms(qpos[None], (qvel + time * qacc)[None])


def test_a_crawl_need_not_know_how_to_stand_still():
    """Its speeds may leave out zero."""
    usual = ENVIRONMENTS["fbid_gym/QuadrupedCrawl-v0"]
    both = usual, usual | {"speed_range": (0.03, 0.04)}
    at_rest, always = (EnvConfig.of(own).make_task(load("quadruped")).kind for own in both)
    assert at_rest == always and always.steps


@pytest.mark.parametrize("name", PLANNED)
def test_planned_rates_are_those_of_what_is_planned(name):
    """Of feet and centre of mass, against differences along the motion of base and joints."""
    task, plan, now = begun(name)
    robot, step = task.body.robot, 1e-5
    if name == "QuadrupedCrawl-v0":
        plan["speed"][:] = task.motion.speeds[-1]  # between planned ones it is interpolated
    # The target of who is on the motion is where it is.
    target = task.target(plan, now)
    now = now._replace(terms=lambda: MuJoCoDynamics(robot).terms(target.qpos, target.qvel))
    target = task.target(plan, now)
    size = max(1.0, np.abs(target.foot_acceleration).max())
    for row in range(len(target.qpos)):
        behind, here, ahead = (along(robot, target, row, time) for time in (-step, 0.0, step))
        np.testing.assert_allclose(target.foot_position[row], here.foot_position[0], atol=1e-6)
        np.testing.assert_allclose(target.com[row], here.com[0], atol=1e-6)
        rate = (ahead.com - behind.com)[0] / (2 * step)
        np.testing.assert_allclose(target.com_velocity[row], rate, atol=1e-6 * size)
        # A foot's reference is below its sphere's centre, which it goes with but for rolling.
        arm = here.world_from_foot[0].mT @ np.array([0.0, 0.0, 1.0])[:, None]
        turned = (ahead.world_from_foot - behind.world_from_foot)[0] @ arm
        rolled = foot_radius(robot)[:, None] * turned[..., 0]
        rate = (ahead.foot_position - behind.foot_position)[0] - rolled
        found = target.foot_velocity[row, :, :3]
        np.testing.assert_allclose(found, rate / (2 * step), atol=1e-6 * size)
        for value, rate in (
            (ahead.foot_velocity - behind.foot_velocity, target.foot_acceleration),
            (ahead.com_velocity - behind.com_velocity, target.com_acceleration),
        ):
            np.testing.assert_allclose(rate[row], value[0] / (2 * step), atol=1e-4 * size)
    assert np.abs(target.foot_velocity[target.planted][:, :3]).max() < 1e-6
    np.testing.assert_array_equal(target.load, target.planted)


@pytest.mark.parametrize("name", WALKS)
def test_a_gait_begins_where_the_robot_stands(name):
    task, plan, now = begun(name)
    plan["command"][:] = 0.0
    task.advance(plan, now)
    target, terms = task.target(plan, now), now.terms()
    assert target.planted.all() and (target.load == 1.0).all() and not target.clipped.any()
    np.testing.assert_array_equal(target.foot_position, terms.foot_position)
    np.testing.assert_array_equal(target.world_from_foot, terms.world_from_foot)
    for rate in ("foot_velocity", "foot_acceleration", "com_velocity", "qvel", "qacc"):
        assert not getattr(target, rate).any(), rate
    # Upright, and facing ahead.
    half = np.arctan2(target.qpos[:, 6], target.qpos[:, 3])
    ahead = np.arctan2(terms.world_from_trunk[:, 1, 0], terms.world_from_trunk[:, 0, 0])
    np.testing.assert_allclose(np.sin(2.0 * half - ahead), 0.0, atol=1e-9)
