"""The environment's docstring says what the code does: every table, number and key."""

import re
from dataclasses import fields

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.balance_env import BalanceEnv
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.randomisation import Randomisation
from fbid_gym.envs.simulation import MAX_SPEED
from fbid_gym.envs.tracking_env import TrackingEnv
from fbid_gym.envs.walking_env import WalkingEnv
from fbid_gym.tasks import TASKS, Balance, Tracking, Walk, task_options
from fbid_gym.tasks.body import FALLEN_HEIGHT, FALLEN_TILT, TOUCHING_LOAD
from fbid_gym.tasks.observation import entry_bounds, entry_names

BALANCE = [name for name, arguments in ENVIRONMENTS.items() if arguments["task"] == "balance"]
MODEL_FREE = ("torque", "joint_position")
ON_FOOT = [name for name, arguments in ENVIRONMENTS.items() if arguments["task"] == "walk"]
WALKS = [name for name in ON_FOOT if "terrain" not in ENVIRONMENTS[name]]
FOLLOWING = [name for name in ENVIRONMENTS if name not in (*BALANCE, *ON_FOOT)]


def sections(described):
    parts = re.findall(
        r"^    ## (.+?)\n(.*?)(?=^    ## |\Z)", described.__doc__, flags=re.MULTILINE | re.DOTALL
    )
    return dict(parts)


SECTIONS, TRACKING = sections(BalanceEnv), sections(TrackingEnv)
WALKING = sections(WalkingEnv)


def table(section, header, doc=SECTIONS):
    """Rows of the table that begins with the column `header`; continued lines are joined."""
    rows, inside = [], False
    for line in doc[section].splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.strip().startswith("|"):
            inside = False
        elif cells[0] == header:
            inside = True
        elif inside and not set(cells[0]) <= {"-"}:
            rows.append(cells)
        elif inside and cells[0] == "":
            rows[-1] = [f"{old} {new}".strip() for old, new in zip(rows[-1], cells, strict=True)]
    assert rows, header
    return rows


def names_in(text):
    return re.findall(r"`([^`]+)`", text)


def span(text):
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


@pytest.fixture(params=BALANCE)
def env(request):
    made = gym.make(request.param).unwrapped
    made.reset(seed=0)
    return made


@pytest.fixture(params=WALKS)
def walker(request):
    made = gym.make(request.param).unwrapped
    made.reset(seed=0)
    return made


@pytest.fixture(params=FOLLOWING)
def follower(request):
    made = gym.make(request.param).unwrapped
    made.reset(seed=0)
    return made


def test_the_sections_are_those_of_gymnasium():
    assert (
        list(SECTIONS)
        == list(TRACKING)
        == list(WALKING)
        == [
            "Description",
            "Action Space",
            "Observation Space",
            "Rewards",
            "Starting State",
            "Episode End",
            "Arguments",
            "Info",
            "Version History",
        ]
    )


def test_robots(env):
    robot = env.batch.robot
    (row,) = (
        row
        for row in table("Description", "Id")
        if ENVIRONMENTS[names_in(row[0])[0]]["robot"] == robot.name
    )
    assert (int(row[2]), int(row[3])) == (robot.num_joints, robot.num_points)
    assert float(re.search(r"([\d.]+) kg", row[1])[1]) == pytest.approx(robot.mass, rel=0.02)
    assert len(table("Description", "Id")) == len(BALANCE)


def test_action_tables(env):
    rows = {names_in(row[0])[0]: row for row in table("Action Space", "`action_layer`")}
    assert rows.keys() == LAYERS.keys()
    options = {names_in(row[0])[0]: row[1] for row in table("Action Space", "Layer")}
    assert options.keys() == LAYERS.keys()
    shared = table("Action Space", "Option")
    about_contacts = " ".join(name for name, *_ in shared)
    assert {names_in(name)[0]: names_in(default)[0] for name, default, _ in shared} == {
        name: repr(default).replace("'", '"') for name, default in vars(CONTACT_DEFAULTS).items()
    }
    for name, text in options.items():
        text = re.sub("the same as `(.*?)`", lambda other: options[other[1]], text)
        options[name] = text.replace("those about contacts", about_contacts)
    for name in LAYERS:
        config = EnvConfig(env.config.robot, action_layer=name)
        size = len(config.layer(env.batch.robot, env.batch.task)[0].action_names)
        assert size == (
            env.batch.robot.num_joints if rows[name][1] == "joints" else int(rows[name][1])
        )
        steering = {"footholds", "step_rate"}
        assert set(names_in(options[name])) | steering == set(layer_options(name))


def test_observation_table(env):
    column = ["biped", "quadruped", "humanoid"].index(env.batch.robot.name)
    names, bound = env.observation_names, env.observation_space.high
    covered = []
    for row in table("Observation Space", "Biped"):
        entries = span(row[column])
        covered += entries
        np.testing.assert_array_equal(bound[list(entries)], float(row[4]))
        text, unit = re.fullmatch(r"(.*?) \((.*)\)", row[3]).groups()
        for entry in entries:
            unit_words = re.search(r"\((.*)\)$", names[entry])[1]
            assert unit_words == unit
            said = text.removeprefix("joints: ").removeprefix("points: ")
            for word in said.split():
                assert word in names[entry].split(), (names[entry], said)
    assert covered == list(range(len(names)))
    np.testing.assert_array_equal(env.observation_space.low, -bound)


@pytest.mark.parametrize(
    ("task", "doc"), [(Balance, SECTIONS), (Tracking, TRACKING), (Walk, WALKING)]
)
def test_reward_tables(task, doc):
    """The formulas themselves are held against the code by the task's tests."""
    rows = {names_in(name)[0]: rest for name, *rest in table("Rewards", "Term", doc)}
    assert rows.keys() == task.reward_terms.keys()
    for name, (weight, scale, *_) in rows.items():
        term = task.reward_terms[name]
        assert float(weight) == term.weight
        assert scale == f"{term.scale:g} {term.unit}".strip()
    if task is Balance:
        assert f"{100 * TOUCHING_LOAD:g} %" in doc["Rewards"]


def test_episode_end():
    text = SECTIONS["Episode End"]
    assert f"{FALLEN_HEIGHT:g} H" in text and f"{FALLEN_TILT:g}" in text
    assert f"{MAX_SPEED:g} m/s" in text


def test_arguments_table():
    rows = {names_in(row[0])[0]: row for row in table("Arguments", "Parameter")}
    defaults = {field.name: field.default for field in fields(EnvConfig)} | task_options("balance")
    del defaults["task_options"]
    assert rows.keys() == defaults.keys() | {"render_mode", "render_options"}
    for name, default in defaults.items():
        assert names_in(rows[name][2])[0] == repr(default).replace("'", '"'), name
    randomised = set(names_in(rows["randomisation"][3]))
    assert {field.name for field in fields(Randomisation)} <= randomised


def test_the_default_push(env):
    """By default 0.04 to 0.36 of the weight."""
    text = next(row for row in table("Arguments", "Parameter") if "push_force" in row[0])[3]
    least, most = (
        float(x) for x in re.search(r"([\d.]+) to ([\d.]+) of the weight", text).groups()
    )
    weight = env.batch.robot.weight
    assert env.batch.task.pushes.force == pytest.approx((least * weight, most * weight))


def test_info_table(env):
    rows = table("Info", "Key")
    for layer in LAYERS:
        made = gym.make(env.spec.id, action_layer=layer).unwrapped
        made.reset(seed=0)
        *_, info = made.step(np.zeros(made.action_space.shape))
        documented = set()
        for row in rows:
            for key in names_in(row[0]):
                documented.add(key)
                if key in info:
                    robot = made.batch.robot
                    shape = {"": (), "(3,)": (3,), "(n,)": (robot.num_joints,)}
                    shape["(P, 3)"] = (robot.num_points, 3)
                    assert np.shape(info[key]) == shape[row[1]], key
        assert info.keys() <= documented
        optional = {"layer_residual", "layer_underactuation"}
        assert documented - info.keys() == (optional if layer in MODEL_FREE else set())


def test_following_robots_and_tasks(follower):
    rows = {names_in(row[0])[0]: row for row in table("Description", "Id", TRACKING)}
    assert rows.keys() == set(FOLLOWING)
    row = rows[follower.spec.id]
    assert row[1] == follower.batch.robot.name
    assert names_in(row[2])[0] == follower.config.task


def test_following_observation_table(follower):
    task, robot = follower.batch.task, follower.batch.robot
    names, bound = list(follower.observation_names), follower.observation_space.high
    count = {"n": robot.num_joints, "F": robot.num_feet}
    at = 0
    for row in table("Observation Space", "Entries", TRACKING):
        size = count.get(row[0]) or int(row[0])
        np.testing.assert_array_equal(bound[at : at + size], float(row[2]))
        for name in names[at : at + size]:
            assert [word for word in row[1].split() if word not in name.split()] == []
        at += size
    own = task.body.groups
    assert tuple(names[at:]) == entry_names(own)
    np.testing.assert_array_equal(bound[at:], entry_bounds(own))


def test_following_arguments():
    """Every option of every task that follows a motion, with its default."""
    said = {
        (names_in(row[1])[0], names_in(row[0])[0]): names_in(row[2])[0]
        for row in table("Arguments", "Parameter", TRACKING)
    }
    tasks = {ENVIRONMENTS[name]["task"] for name in FOLLOWING}
    assert tasks == TASKS.keys() - {"balance", "walk"}
    assert said == {
        (task, option): repr(default).replace("'", '"')
        for task in tasks
        for option, default in task_options(task).items()
    }


def test_following_info_table(follower):
    *_, info = follower.step(np.zeros(follower.action_space.shape))
    documented = set(names_in(TRACKING["Info"])) - {"BalanceEnv"}
    shared = {key for key in info if key.startswith("layer_")}
    assert info.keys() - shared == documented


def test_walking_robots(walker):
    rows = {names_in(row[0])[0]: row for row in table("Description", "Id", WALKING)}
    assert rows.keys() == set(WALKS)
    robot = walker.batch.robot
    said = rows[walker.spec.id]
    assert said[1] == robot.name
    sizes = [robot.num_joints, robot.num_feet, robot.num_points]
    assert [int(cell) for cell in said[2:5]] == sizes


def test_walking_action_tables(walker):
    rows = {names_in(row[0])[0]: row for row in table("Action Space", "`action_layer`", WALKING)}
    assert rows.keys() == LAYERS.keys()
    robot = walker.batch.robot
    for name in LAYERS:
        given = {"footholds": True, "step_rate": True}
        config = EnvConfig(robot, task="walk", action_layer=name, layer_options=given)
        layer, steering = config.layer(robot, walker.batch.task)
        size = robot.num_joints if rows[name][1] == "joints" else int(rows[name][1])
        assert len(layer.action_names) == size
        assert len(steering.action_names) == 2 * robot.num_feet + 1


def test_walking_observation_table(walker):
    robot = walker.batch.robot
    names, bound = walker.observation_names, walker.observation_space.high
    count = {"n": robot.num_joints, "F": robot.num_feet, "P": robot.num_points}
    at = 0
    for row in table("Observation Space", "Entries", WALKING):
        size = count.get(row[0]) or int(row[0])
        np.testing.assert_array_equal(bound[at : at + size], float(row[2]))
        for name in names[at : at + size]:
            assert [word for word in row[1].split() if word not in name.split()] == []
        at += size
    assert at == len(names) == len(bound)


def test_walking_arguments():
    own, ids = WALKING["Arguments"].split("these ids differ")
    rows = table("own", "Parameter", {"own": own})
    assert {names_in(row[0])[0]: names_in(row[1])[0] for row in rows} == {
        option: repr(default).replace("'", '"') for option, default in task_options("walk").items()
    }
    rows = table("ids", "Parameter", {"ids": ids})
    for name in WALKS:
        column = 1 if "Quadruped" in name else 2
        said = {
            names_in(row[0])[0]: names_in(row[column])[0] for row in rows if names_in(row[column])
        }
        given = {k: v for k, v in ENVIRONMENTS[name].items() if k not in ("robot", "task")}
        assert said == {k: repr(v).replace("'", '"') for k, v in given.items()}
    most = float(re.search(r"are 0 to ([\d.]+) of the weight", ids)[1])
    assert TASKS["walk"].push == (0.0, most)


def test_walking_info_table(walker):
    *_, info = walker.step(np.zeros(walker.action_space.shape))
    documented = set(names_in(WALKING["Info"])) - {"BalanceEnv"}
    shared = {key for key in info if key.startswith("layer_")}
    assert info.keys() - shared == documented
