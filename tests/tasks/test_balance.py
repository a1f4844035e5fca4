"""What the task says of a state, against the same said of it by MuJoCo and plain formulas."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.quantities import RobotState
from fbid_gym.tasks import Balance, Body, Episode, Pushes, Start
from fbid_gym.tasks.outcome import Outcome
from tests.postures import point_jacobians, points, posed

HZ = 500


def make_task(robot, joint_noise=0.02, velocity_noise=0.05, **changes):
    pushes = Pushes((0.0, 0.1 * robot.weight), 0.15, (1.5, 3.0))
    start = Start(joint_noise, velocity_noise)
    episode = Episode(body=Body.of(robot), seconds=10.0, hz=HZ, pushes=pushes, start=start)
    return Balance.of(episode, **changes)


@pytest.fixture(scope="module")
def task(robot):
    return make_task(robot)


def plans(task, count, seed=0):
    rng = np.random.default_rng(seed)
    drawn = [task.draw(rng) for _ in range(count)]
    return {name: np.array([one[name] for one in drawn]) for name in drawn[0]}


def outcome_at(task, qpos, qvel, *, contact=None, tick=None, torque=None):
    """The outcome of a step that ended in these states (N, nq), (N, nv)."""
    robot, count = task.body.robot, len(qpos)
    if contact is None:
        contact = np.zeros((count, robot.num_points, 3))
        contact[..., 2] = robot.weight / robot.num_points
    tick = np.zeros(count, int) if tick is None else tick
    torque = np.zeros((count, robot.num_joints)) if torque is None else torque
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    state = RobotState(qpos, qvel, contact, tick)
    rms, power = np.sqrt(np.square(torque).mean(axis=1)), np.abs(torque * qvel[:, 6:]).sum(axis=1)
    posture, none = task.body.posture(state, terms), np.zeros(count)
    return Outcome(state, terms, posture, torque, rms, power, none, none, terms)


def observed(task, outcome, plan):
    measured = task.measure(outcome, plan, {})
    groups = task.observation_groups.values()
    return np.concatenate([group.function(measured) for group in groups], axis=1)


def judged(task, outcome, plan):
    """The terms of the reward, each from 0 to its weight, and the metrics."""
    measured = task.measure(outcome, plan, {})
    terms = {name: term.weight * term.share(measured) for name, term in task.reward_terms.items()}
    return terms, task.metrics(measured)


def at_home(task, count=1):
    qpos = np.tile(task.body.robot.home_qpos, (count, 1))
    return qpos, np.zeros((count, task.body.robot.nv))


def at_random(task, rng, count):
    """Any heading, bent joints, a tilted base, everything moving, random forces and torques."""
    robot = task.body.robot
    qpos = np.tile(robot.home_qpos, (count, 1))
    qpos[:, :2] += rng.normal(size=(count, 2))
    for row in qpos:
        tilt = np.append(1.0, 0.2 * rng.normal(size=3))
        turn = rng.normal(size=4) * [1, 0, 0, 1]
        mujoco.mju_mulQuat(row[3:7], turn / np.linalg.norm(turn), tilt / np.linalg.norm(tilt))
    qpos[:, 7:] += 0.1 * rng.normal(size=(count, robot.num_joints))
    qvel = rng.normal(size=(count, robot.nv))
    rest = {"contact": np.abs(rng.normal(size=(count, robot.num_points, 3))) * robot.weight}
    rest["tick"] = rng.integers(0, 5000, count)
    rest["torque"] = rng.uniform(-1, 1, (count, robot.num_joints)) * robot.torque_limit
    return qpos, qvel, rest


def feet_of(robot, qpos, qvel):
    """MjData, contact points (P, 3) and their velocities."""
    data = posed(robot, qpos, qvel)
    return data, points(robot, data), point_jacobians(robot, data) @ qvel


def home_layout(robot):
    """At home: the contact points about their centre from above (P, 2), and the base from it."""
    home, places, _ = feet_of(robot, robot.home_qpos, np.zeros(robot.nv))
    return (places - places.mean(axis=0))[:, :2], home.xpos[robot.base_body] - places.mean(axis=0)


def heading_of(places, layout):
    """Angle that turns the home layout (P, 2) nearest to the places, by complex numbers."""
    now = places[:, :2] - places[:, :2].mean(axis=0)
    return np.angle(np.vdot(layout @ [1, 1j], now @ [1, 1j]))


def commanded(plan, row, tick):
    """The last command given, found by walking through the plan."""
    height = None
    for start, value in zip(plan["command_start"][row], plan["command"][row], strict=True):
        if start <= tick:
            height = value
    return height


def test_the_observation_is_what_its_names_say(task, rng):
    robot, plan = task.body.robot, plans(task, 6)
    qpos, qvel, rest = at_random(task, rng, 6)
    seen = observed(task, outcome_at(task, qpos, qvel, **rest), plan)
    layout, home_base = home_layout(robot)
    for row in range(6):
        data, places, _ = feet_of(robot, qpos[row], qvel[row])
        angle = heading_of(places, layout)
        cosine, sine = np.cos(angle), np.sin(angle)
        level = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])  # support from world
        rotation = data.xmat[robot.base_body].reshape(3, 3)
        base = level @ (data.xpos[robot.base_body] - places.mean(axis=0))
        expected = [
            [commanded(plan, row, rest["tick"][row]) - home_base[2]],
            base - home_base,
            rotation.T @ [0, 0, 1],
            level @ qvel[row, :3],
            qvel[row, 3:6],
            qpos[row, 7:] - robot.home_qpos[7:],
            qvel[row, 6:],
            rest["torque"][row] / robot.torque_limit,
            rest["contact"][row, :, 2] / robot.weight,
        ]
        np.testing.assert_allclose(seen[row], np.concatenate(expected), atol=1e-12)


def test_standing_perfectly_earns_everything(task):
    plan = plans(task, 1)
    plan["command"][:] = task.body.home_height
    rewards, metrics = judged(task, outcome_at(task, *at_home(task)), plan)
    assert sum(term.weight for term in task.reward_terms.values()) == pytest.approx(1.0)
    for name, value in rewards.items():
        assert value == pytest.approx(task.reward_terms[name].weight), name
    assert metrics["height"] == pytest.approx(task.body.home_height)
    assert metrics["height_error"] == pytest.approx(0.0, abs=1e-12)
    assert metrics["slip"] == metrics["power"] == metrics["torque_rms"] == 0.0


def test_rewards_are_their_formulas(task, rng):
    """The table of the environment's docstring, computed from MjData."""
    robot, plan, size = task.body.robot, plans(task, 20), task.body.size
    speed = np.sqrt(9.81 * size)
    qpos, qvel, rest = at_random(task, rng, 20)
    qvel *= 0.2
    rest["torque"] *= 0.5
    rest["contact"][::3, 0] *= 1e-3  # some places carry less than 1 % of the weight
    rewards, metrics = judged(task, outcome_at(task, qpos, qvel, **rest), plan)
    layout, home_base = home_layout(robot)
    for row in range(20):
        data, places, velocities = feet_of(robot, qpos[row], qvel[row])
        angle = heading_of(places, layout)
        base = data.xpos[robot.base_body] - places.mean(axis=0)
        ahead = (base[0] + 1j * base[1]) * np.exp(-1j * angle) - (home_base[:2] @ [1, 1j])
        command = commanded(plan, row, rest["tick"][row])
        tilt = np.arccos(data.xmat[robot.base_body].reshape(3, 3)[2, 2])
        down = rest["contact"][row, :, 2] > 0.01 * robot.weight
        slip = np.linalg.norm(velocities[down], axis=1).mean() if down.any() else 0.0
        effort = np.sqrt(np.mean(rest["torque"][row] ** 2)) / robot.torque_limit.mean()
        moving = np.concatenate([qvel[row, :3] / speed, qvel[row, 3:6] / (speed / size)])
        expected = {
            "height": np.exp(-(((base[2] - command) / (0.03 * size)) ** 2)),
            "upright": np.exp(-(1 - np.cos(tilt)) / (1 - np.cos(0.2))),
            "position": np.exp(-((abs(ahead) / (0.06 * size)) ** 2)),
            "stillness": np.exp(-((np.linalg.norm(moving) / 0.16) ** 2)),
            "contact": down.mean() * np.exp(-((slip / (0.033 * speed)) ** 2)),
            "torque": np.exp(-((effort / 0.3) ** 2)),
        }
        for name, share in expected.items():
            value, weight = rewards[name][row], task.reward_terms[name].weight
            assert value == pytest.approx(weight * share, rel=1e-9), name
            assert 0.0 <= value <= weight
        assert metrics["height"][row] == pytest.approx(base[2])
        assert metrics["height_command"][row] == command
        assert metrics["height_error"][row] == pytest.approx(base[2] - command)
        assert metrics["slip"][row] == pytest.approx(slip)
        torque = rest["torque"][row]
        assert metrics["torque_rms"][row] == pytest.approx(np.sqrt(np.mean(torque**2)))
        assert metrics["power"][row] == pytest.approx(np.abs(torque * qvel[row, 6:]).sum())


def test_a_tilted_base_has_fallen(task):
    """Tilt alone: feet and height stay as they are at home."""
    outcome = outcome_at(task, *at_home(task, 8))
    heading = np.linspace(0, 2 * np.pi, 8)
    axes = np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1)
    for degrees, fallen in ((0, False), (59.5, False), (60.5, True), (180, True)):
        tilted = Rotation.from_rotvec(np.radians(degrees) * axes).as_matrix()
        terms = outcome.terms._replace(world_from_trunk=tilted)
        assert (task.body.posture(outcome.state, terms).fallen == fallen).all(), degrees


def test_a_low_base_has_fallen(task, robot):
    """Squatting down: the height of the base above the feet decides."""
    qpos, qvel = at_home(task, 200)
    knees = [index for index, name in enumerate(robot.joint_names) if "knee" in name]
    hips = [index for index, name in enumerate(robot.joint_names) if "hip_pitch" in name]
    bend = np.linspace(0.0, 1.6, 200)
    for joint in knees:
        qpos[:, 7 + joint] += bend * np.sign(robot.home_qpos[7 + joint])
    for joint in hips:
        qpos[:, 7 + joint] += bend / 2 * np.sign(robot.home_qpos[7 + joint])
    outcome = outcome_at(task, qpos, qvel)
    height = [
        data.xpos[robot.base_body][2] - places[:, 2].mean()
        for data, places, _ in (feet_of(robot, row, np.zeros(robot.nv)) for row in qpos)
    ]
    low = np.array(height) + task.body.size - task.body.home_height < 0.6 * task.body.size
    assert low.any() and not low.all()
    np.testing.assert_array_equal(outcome.posture.fallen, low)


def test_commands_are_constant_for_a_while_and_within_range(robot):
    task = make_task(robot, height_range=(0.85, 1.05), height_interval=(0.5, 1.0))
    plan = plans(task, 50)
    ticks = np.arange(int(task.seconds * HZ))
    heights = np.array([task.command(plan, np.full(50, tick)) for tick in ticks])
    assert heights.min() >= task.body.height(0.85)
    assert heights.max() <= task.body.height(1.05)
    assert heights.mean() == pytest.approx(task.body.height(0.95), rel=0.01)
    for row in range(50):
        changes = np.flatnonzero(np.diff(heights[:, row])) + 1
        gaps = np.diff(np.append(0, changes))
        assert gaps.min() >= 0.5 * HZ - 1 and gaps.max() <= 1.0 * HZ + 1
        assert len(changes) >= 9
        expected = [commanded(plan, row, tick) for tick in ticks[::97]]
        np.testing.assert_array_equal(heights[::97, row], expected)


def test_starts_are_upright_near_home_with_any_heading(robot):
    task = make_task(robot, joint_noise=0.03, velocity_noise=0.2)
    plan = plans(task, 400)
    qpos, qvel = plan["qpos"], plan["qvel"]
    offset = qpos[:, 7:] - robot.home_qpos[7:]
    low, high = robot.joint_range.T
    assert np.abs(offset).max() <= 0.03 and np.abs(offset).max() > 0.029
    assert (qpos[:, 7:] >= low).all() and (qpos[:, 7:] <= high).all()
    assert 0.19 < np.abs(qvel).max() <= 0.2
    np.testing.assert_array_equal(qpos[:, :3], np.tile(robot.home_qpos[:3], (400, 1)))
    matrices = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_matrix()
    np.testing.assert_allclose(matrices[:, 2, 2], 1.0)
    heading = matrices[:, 0, 0] + 1j * matrices[:, 1, 0]
    for harmonic in (1, 2, 3):
        assert np.abs((heading**harmonic).mean()) < 5 / np.sqrt(400)
