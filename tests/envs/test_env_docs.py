"""The environment's docstring says what the code does: every table, number and key."""

import re
from dataclasses import fields

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import LAYERS, layer_options
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.balance_env import BalanceEnv
from fbid_gym.envs.config import BalanceConfig
from fbid_gym.envs.randomisation import Randomisation
from fbid_gym.envs.simulation import MAX_SPEED
from fbid_gym.tasks.balance import FALLEN_HEIGHT, FALLEN_TILT, REWARD_WEIGHTS, TOUCH

DOC = BalanceEnv.__doc__
SECTIONS = dict(
    re.findall(r"^    ## (.+?)\n(.*?)(?=^    ## |\Z)", DOC, flags=re.MULTILINE | re.DOTALL)
)


def table(section, header):
    """Rows of the table that begins with the column `header`; continued lines are joined."""
    rows, inside = [], False
    for line in SECTIONS[section].splitlines():
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


@pytest.fixture(params=ENVIRONMENTS)
def env(request):
    made = gym.make(request.param).unwrapped
    made.reset(seed=0)
    return made


def test_the_sections_are_those_of_gymnasium():
    assert list(SECTIONS) == [
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


def test_robots(env):
    robot = env.batch.robot
    (row,) = (
        row
        for row in table("Description", "Id")
        if ENVIRONMENTS[names_in(row[0])[0]]["robot"] == robot.name
    )
    assert (int(row[2]), int(row[3])) == (robot.num_joints, robot.num_points)
    assert float(re.search(r"([\d.]+) kg", row[1])[1]) == pytest.approx(robot.mass, rel=0.02)
    assert len(table("Description", "Id")) == len(ENVIRONMENTS)


def test_action_tables(env):
    rows = {names_in(row[0])[0]: row for row in table("Action Space", "`action_layer`")}
    assert rows.keys() == LAYERS.keys()
    options = {names_in(row[0])[0]: row[1] for row in table("Action Space", "Layer")}
    assert options.keys() == LAYERS.keys()
    options["joint_acceleration"] = options["joint_acceleration"].replace(
        "the same;", options["joint_position"] + ";"
    )
    for name in LAYERS:
        size = len(BalanceConfig(env.config.robot, name).layer(env.batch.robot).action_names)
        assert size == (
            env.batch.robot.num_joints if rows[name][1] == "joints" else int(rows[name][1])
        )
        assert set(names_in(options[name])) == set(layer_options(name))


def test_observation_table(env):
    column = {"biped": 0, "quadruped": 1}[env.batch.robot.name]
    names, bound = env.batch.task.observation_names, env.observation_space.high
    covered = []
    for row in table("Observation Space", "Biped"):
        entries = span(row[column])
        covered += entries
        np.testing.assert_array_equal(bound[list(entries)], float(row[3]))
        text, unit = re.fullmatch(r"(.*?) \((.*)\)", row[2]).groups()
        for entry in entries:
            unit_words = re.search(r"\((.*)\)$", names[entry])[1]
            assert unit_words == unit
            said = text.removeprefix("joints: ").removeprefix("contact points: ")
            for word in said.split():
                assert word in names[entry].split(), (names[entry], said)
    assert covered == list(range(len(names)))
    np.testing.assert_array_equal(env.observation_space.low, -bound)


def test_reward_table():
    """The formulas themselves are held against the code by the task's tests."""
    rows = table("Rewards", "Term")
    assert {names_in(row[0])[0]: float(row[1]) for row in rows} == REWARD_WEIGHTS
    assert f"{100 * TOUCH:g} %" in SECTIONS["Rewards"]


def test_episode_end():
    text = SECTIONS["Episode End"]
    assert f"{FALLEN_HEIGHT:g} H" in text and f"{FALLEN_TILT:g}" in text
    assert f"{MAX_SPEED:g} m/s" in text


def test_arguments_table():
    rows = {names_in(row[0])[0]: row for row in table("Arguments", "Parameter")}
    assert list(rows) == [field.name for field in fields(BalanceConfig)] + ["render_mode"]
    for field in fields(BalanceConfig):
        default = names_in(rows[field.name][2])[0]
        assert default == repr(field.default).replace("'", '"'), field.name
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
        assert documented - info.keys() == (set() if layer.endswith("acceleration") else optional)
