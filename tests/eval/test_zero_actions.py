"""Tables of zero actions: how walks are summarised, which rows there are, and where they go."""

import numpy as np
import pytest

from eval.zero_actions import measures
from eval.zero_actions.__main__ import main
from eval.zero_actions.measures import noise_torque, summarised, walk
from eval.zero_actions.tables import EXACT, ZeroActionConfig, cases, environment
from fbid_gym import robots
from fbid_gym.robots.terrain import LEVELLED
from train.runs.tables import read_rows

SHORT = ["walking", "--robots", "biped", "--layers", "torque", "base_acceleration"]
SHORT += ["--episodes", "2", "--seconds", "0.1", "--only", "gait=walk"]


def told(up: np.ndarray) -> dict[str, np.ndarray]:
    steps, count = up.shape
    return {
        "up": up,
        "miss": np.ones((steps, count, 2)) * [0.3, 0.4],
        **{name: np.full(up.shape, value) for name, value in (("turn", -0.2), ("power", 6.0))},
        **{name: np.full(up.shape, 0.5) for name in ("speed", "reward", "velocity_error", "slip")},
    }


def test_moments_count_until_a_robot_falls():
    up = np.ones((4, 2), bool)
    up[2:, 0] = False
    numbers = told(up)
    for name, values in numbers.items():
        values[~up] = values[~up] if name in ("up", "velocity_error") else 1e9
    walked = summarised(numbers, hz=2, weight=3.0)
    expected = {"velocity_error": 0.5, "yaw_rate_error": 0.2, "cost_of_transport": 4.0}
    assert expected.items() <= {name: round(value, 9) for name, value in walked.items()}.items()
    # The reward counts the step of a fall as well.
    numbers["velocity_error"][2, 0] = 7.5
    assert summarised(numbers, 2, 3.0)["velocity_error_of_the_reward"] == pytest.approx(1.5)


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["base_acceleration", "joint_position"])
def test_walking_hardly_depends_on_the_rates(layer):
    arguments = environment(robots.load("go1"), {})
    arguments |= {"action_layer": layer, "episode_seconds": 5.0, "push_force": (0.0, 0.0)}
    cheap, exact = walk(arguments, 16, 0), walk(arguments | EXACT, 16, 0)
    # A tenth over the robots and seconds of docs/rates.md; these are fewer.
    assert cheap["up"] == exact["up"] == "16"
    assert float(cheap["velocity_error"]) == pytest.approx(float(exact["velocity_error"]), rel=0.15)


def test_the_rows_are_all_that_a_robot_can():
    """Four legs have five gaits, two have three; six legs stand, as there is no gait for them."""
    gaits = "trot short_trot walk pace bound walk brisk_walk rolling_walk"
    of = cases(ZeroActionConfig("walking", robots=("go1", "biped"), layers=("torque",)))
    assert " ".join(case.cells["gait"] for case in of) == gaits
    of = cases(ZeroActionConfig("zoo", robots=("0", "1"), layers=("joint_position",)))
    known = [(case.cells["legs"], case.cells["task"]) for case in of]
    assert known == [("4", "stand"), ("4", "walk"), ("6", "stand")]
    only = ("terrain=slopes,gaps", "difficulty=1", "ground=sees", "robot=go1")
    assert len(cases(ZeroActionConfig("terrain", only=only))) == 3 * 2
    of = cases(ZeroActionConfig("measured", layers=("com_wrench",), only=("sensors=mems",)))
    acting = [(case.cells["robot"], case.cells["acts"]) for case in of]
    zero = [(name, "zero action") for name in ("go1", "biped", "humanoid")]
    assert acting == [*zero, ("go1", "policy"), ("biped", "policy")]


def test_version_1_keeps_its_own_pushes_and_loads_beside_what_a_condition_varies():
    of = cases(ZeroActionConfig("v1", robots=("go1", "g1"), layers=("base_acceleration",)))
    kinds = [f"{kind}, {seen}" for kind in LEVELLED[:-1] for seen in ("blind", "seen")]
    walks = ["walk", "walk, measured"]
    known = [(case.cells["robot"], case.cells["task"]) for case in of]
    assert known == [*(("go1", name) for name in [*walks, *kinds]), *(("g1", w) for w in walks)]
    for case in of:
        arguments = case.measure.args[0]
        assert "push_force" not in arguments and arguments["push_weights"][1] > 0.0
        drawn = arguments["randomisation"]
        assert drawn["payload"] == (0.0, 0.25)
        assert ("loop_delay" in drawn) is (case.cells["task"] == "walk, measured")


@pytest.mark.parametrize(("layer", "up"), [("joint_position", "2"), ("torque", "0")])
def test_who_has_no_feedback_falls(layer, up):
    config = ZeroActionConfig("zoo", robots=("0",), layers=(layer,), episodes=2, seconds=4.0)
    row = cases(config)[0].measure()
    assert row["up"] == up and "velocity_error" not in row
    assert float(row["share_low"]) <= int(up) / 2 <= float(row["share_high"])


def test_torque_is_in_proportion_to_the_noise(monkeypatch):
    monkeypatch.setattr(measures, "WARM_UP", (2,))
    env = "fbid_gym/QuadrupedBalance-v0"
    once, twice = (noise_torque(env, "torque", std, 64, 3) for std in (0.02, 0.04))
    assert once > 0.0 and twice == pytest.approx(2.0 * once, rel=0.05)
    assert noise_torque(env, "torque", 0.0, 2, 3) == 0.0


def test_a_file_is_continued(tmp_path, capsys):
    file = tmp_path / "rows.csv"
    assert main([*SHORT, "--csv", str(file)]) == 0
    whole = file.read_text()
    head, first, second = whole.splitlines()
    assert len(read_rows(file)) == 2 and "| biped | walk | 2/2, 0." in capsys.readouterr().out
    kept = first.replace("0,0,2,", "0,0,1,")
    file.write_text(f"{head}\n{kept}\n")
    assert main([*SHORT, "--csv", str(file)]) == 0
    assert main([*SHORT, "--csv", str(file), "--seed", "5"]) == 0
    assert file.read_text().startswith(f"{head}\n{kept}\n{second}\n")
    assert len(read_rows(file)) == 4
    assert main([*SHORT, "--csv", str(file), "--overwrite"]) == 0
    assert file.read_text() == whole
    assert main(["zoo", "--csv", str(file)]) == 2 and file.read_text() == whole
    for broken in (whole.replace("0,0,2,", "0,0,two,"), whole.replace("0,0,2,", "0,0,"), "notes"):
        file.write_text(broken)
        assert main([*SHORT, "--csv", str(file)]) == 2 and file.read_text() == broken
        assert "rows.csv: has " in capsys.readouterr().err
