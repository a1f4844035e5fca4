"""Walking to commands: what is drawn, seen and rewarded."""

import numpy as np
import pytest

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks import Walk
from tests.batches import started

NUM_ENVS = 3
WALK = ENVIRONMENTS["fbid_gym/QuadrupedWalk-v0"]


@pytest.fixture(scope="module")
def batch():
    """Robots on their way, with a random action: nothing is zero."""
    arguments = {"action_layer": "torque", "command_interval": (0.1, 0.1)}
    return started(WALK | arguments, NUM_ENVS)


@pytest.fixture(scope="module")
def step(batch):
    rng = np.random.default_rng(0)
    for _ in range(12):
        done = batch.step(0.1 * rng.uniform(-1, 1, (NUM_ENVS, len(batch.action_names))))
    return done


def heading_axes(batch):
    ahead = batch.simulation.terms().world_from_base[:, :2, 0]
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.stack([ahead, np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)], axis=1)


def test_commands_are_redrawn_within_their_ranges_and_one_in_ten_is_to_stand(batch):
    task, rng = EnvConfig(batch.robot, task="walk").make_task(batch.robot), np.random.default_rng(0)
    plans = [task.draw(rng) for _ in range(300)]
    commands = np.concatenate([plan["command"] for plan in plans])
    assert ((commands >= task.most[:, 0]) & (commands <= task.most[:, 1])).all()
    zero = (commands == 0.0).all(axis=1)
    assert abs(zero.mean() - 0.1) < 4.0 * np.sqrt(0.09 / len(zero))
    spans = np.concatenate([np.diff(plan["command_start"]) for plan in plans]) / task.hz
    assert spans.min() >= 2.0 - 1e-9 and spans.max() <= 5.0 + 1e-9
    # The ranges scale with sqrt(g h) and sqrt(g / h), h the height of the centre of mass.
    height, gravity = task.body.stance.home_com[2], batch.robot.gravity
    np.testing.assert_allclose(task.most[0], np.sqrt(gravity * height) * np.array([-0.35, 0.58]))
    np.testing.assert_allclose(task.most[2], np.sqrt(gravity / height) * np.array([-0.13, 0.13]))


def test_the_command_is_that_which_began_last(batch):
    task, plan = batch.task, batch.task.draw(np.random.default_rng(3))
    for tick in (0, 24, 25, 26, 1000, 4999):
        last = np.flatnonzero(plan["command_start"] <= tick)[-1]
        rows = {name: value[None] for name, value in plan.items()}
        command = task.command(rows, np.array([tick]))[0]
        np.testing.assert_array_equal(command, plan["command"][last])


def test_half_of_the_commands_come_by_ramps(batch):
    config = EnvConfig(batch.robot, task="walk", task_options={"command_ramp": (0.5, 1.5)})
    task, rng = config.make_task(batch.robot), np.random.default_rng(4)
    plans = [task.draw(rng) for _ in range(200)]
    ramps = np.concatenate([plan["command_ramp"] for plan in plans]) / task.hz
    assert ((ramps == 0.0) | (ramps >= 0.5) & (ramps <= 1.5)).all()
    assert abs((ramps > 0.0).mean() - 0.5 * 5 / 6) < 0.1  # the first of an episode never does
    ticks = np.arange(0, 10 * task.hz, 7)
    for plan in plans[:5]:
        rows = {name: np.broadcast_to(v, (len(ticks), *v.shape)) for name, v in plan.items()}
        start, ramp = plan["command_start"], plan["command_ramp"]
        # Each in turn takes over from those before it.
        expected = np.tile(plan["command"][0], (len(ticks), 1))
        for k in range(1, len(start)):
            way = np.clip((ticks - start[k]) / max(ramp[k], 1e-9), 0.0, 1.0)[:, None]
            begun = (ticks >= start[k])[:, None]
            mixed = (1.0 - way) * plan["command"][k - 1] + way * plan["command"][k]
            expected = np.where(begun, mixed, expected)
        np.testing.assert_allclose(task.command(rows, ticks), expected, atol=1e-12)


def test_a_ramp_is_over_before_the_next_command(batch):
    config = EnvConfig(batch.robot, task="walk", task_options={"command_ramp": (0.5, 2.5)})
    with pytest.raises(FbidError, match=r"command_ramp: \(0.5, 2.5\). Expected at most 2 s"):
        config.make_task(batch.robot)


def test_the_observation_is_what_its_names_say(batch, step):
    task, robot, simulation = batch.task, batch.robot, batch.simulation
    seen = dict(zip(batch.observation_names, step.observation.T, strict=True))
    terms, qpos, qvel = simulation.terms(), simulation.qpos, simulation.qvel
    command = task.command(batch._plan, batch._tick)
    memory = batch.loop.planned
    phase = 2.0 * np.pi * memory["seen_cycle"]
    base, above = terms.world_from_base, terms.base_position[:, 2] - memory["seen_ground"]
    ahead, left = np.einsum("nij,nj->in", heading_axes(batch), qvel[:, :2])
    yaw_rate = np.einsum("ni,nij,nj->n", [[0.0, 0.0, 1.0]] * len(base), base, qvel[:, 3:6])
    said = {
        "sine of the gait's cycle (1)": np.sin(phase),
        "cosine of the gait's cycle (1)": np.cos(phase),
        "commanded velocity ahead (m/s)": command[:, 0],
        "commanded velocity to the left (m/s)": command[:, 1],
        "commanded yaw rate (rad/s)": command[:, 2],
        "velocity ahead short of the command (m/s)": command[:, 0] - ahead,
        "velocity to the left short of the command (m/s)": command[:, 1] - left,
        "yaw rate short of the command (rad/s)": command[:, 2] - yaw_rate,
        "base velocity ahead (m/s, heading)": ahead,
        "base velocity to the left (m/s, heading)": left,
        "base velocity up (m/s, heading)": qvel[:, 2],
        "height of the base above the ground, from home (m)": above - task.body.home_height,
    }
    for k, axis in enumerate("xyz"):
        said[f"up direction {axis} (base frame)"] = base[:, 2, k]
        said[f"base angular velocity {axis} (rad/s, base frame)"] = qvel[:, 3 + k]
    for k, foot in enumerate(robot.foot_names):
        said[f"{foot} planned to stand (1)"] = memory["seen_planted"][:, k]
    for k, joint in enumerate(robot.joint_names):
        said[f"{joint} position from home (rad)"] = qpos[:, 7 + k] - robot.home_qpos[7 + k]
        said[f"{joint} velocity (rad/s)"] = qvel[:, 6 + k]
        torque = step.info["torque"][:, k] / robot.torque_limit[k]
        said[f"{joint} last torque (share of its limit)"] = torque
    for point in range(robot.num_points):
        load = step.info["contact_force"][:, point, 2] / robot.weight
        said[f"normal force on point {point} (share of the weight)"] = load
    assert said.keys() == seen.keys()
    for name, value in said.items():
        np.testing.assert_allclose(seen[name], value, rtol=1e-6, atol=1e-6, err_msg=name)
    assert np.abs(command).max() > 0.0


def test_rewards_are_their_formulas(batch, step):
    task, robot, info = batch.task, batch.robot, step.info
    assert sum(term.weight for term in Walk.reward_terms.values()) == pytest.approx(1.0)
    qvel, base = batch.simulation.qvel, batch.simulation.terms().world_from_base
    command = task.command(batch._plan, batch._tick)
    velocity = np.einsum("nij,nj->ni", heading_axes(batch), qvel[:, :2])
    height, gravity = task.body.stance.home_com[2], robot.gravity
    speed, rate = np.sqrt(gravity * height), np.sqrt(gravity / height)
    miss = np.linalg.norm(velocity - command[:, :2], axis=1)
    turn = np.abs(np.einsum("nk,nk->n", base[:, 2], qvel[:, 3:6]) - command[:, 2])
    np.testing.assert_allclose(info["velocity_error"], miss)
    np.testing.assert_allclose(info["turning_error"], turn)
    np.testing.assert_allclose(info["speed"], np.linalg.norm(velocity, axis=1))
    touching = info["contact_force"][:, :, 2] > 0.01 * robot.weight
    planned = (touching == batch.loop.planned["seen_planted"]).mean(axis=1)  # a point is a foot
    tumble = np.linalg.norm(qvel[:, 3:5], axis=1) / rate + np.abs(qvel[:, 2]) / speed
    torque = info["torque_rms"] / robot.torque_limit.mean()

    def bell(x):
        return np.exp(-(x**2))

    said = {
        "velocity": bell(miss / (0.19 * speed)),
        "turning": bell(turn / (0.09 * rate)),
        "clock": planned * bell(info["slip"] / (0.2 * speed)),
        "upright": np.exp(-(1.0 - base[:, 2, 2]) / (1.0 - np.cos(0.2))),
        "steady": bell(tumble / 0.3),
        "torque": bell(torque / 0.5),
    }
    assert said.keys() == Walk.reward_terms.keys()
    for name, share in said.items():
        weight = Walk.reward_terms[name].weight
        np.testing.assert_allclose(info[f"reward_{name}"], weight * share, err_msg=name)
    np.testing.assert_allclose(step.reward, sum(info[f"reward_{name}"] for name in said))


def walking(**arguments):
    """Robots that walk by the zero action, and that action."""
    given = {"action_layer": "base_acceleration", "forward_range": (0.3, 0.3)}
    made = started(WALK | given | arguments, NUM_ENVS)
    return made, np.zeros((NUM_ENVS, len(made.action_names)))


def test_distance_and_cost_of_transport_are_those_of_the_episode():
    batch, action = walking()
    distance, energy = np.zeros((2, NUM_ENVS))
    weight, size = batch.robot.weight, batch.task.body.stance.home_com[2]
    shares = []
    for _ in range(60):
        info = batch.step(action).info
        distance += info["speed"] / batch.rates.policy
        energy += info["power"] / batch.rates.policy
        cost = energy / (weight * np.maximum(distance, size))
        np.testing.assert_allclose(info["distance"], distance)
        np.testing.assert_allclose(info["cost_of_transport"], cost)
        shares.append(distance / size)
    assert np.min(shares) < 1.0 < np.max(shares)  # both sides of the bound were there
    batch.reset(np.array([1]))
    info = batch.step(action).info
    assert info["distance"][1] < 0.1 * distance[1] and (info["distance"][::2] > distance[::2]).all()


def test_the_foothold_error_is_how_far_off_feet_land():
    """A policy step as long as a control tick shows every touchdown."""
    batch, action = walking(policy_hz=250, command_interval=(0.3, 0.3))
    missed, landed = np.zeros(NUM_ENVS), np.zeros(NUM_ENVS, int)
    for _ in range(250):
        foot = batch.simulation.terms().foot_position[:, :, :2].copy()
        told = {k.removeprefix("planned.seen_"): v for k, v in batch.state_dict().items()}
        info = batch.step(action).info
        now = batch.state_dict()["planned.seen_planted"]
        down = now & ~told["planted"]
        gap = np.linalg.norm(foot - told["foothold"][:, :, :2], axis=2)
        missed, landed = missed + (gap * down).sum(axis=1), landed + down.sum(axis=1)
        np.testing.assert_allclose(info["foothold_error"], missed / np.maximum(landed, 1))
    assert landed.min() > 2 and 0.0 < info["foothold_error"].min()
    assert info["foothold_error"].max() < 0.3 * batch.task.body.stance.home_com[2]
