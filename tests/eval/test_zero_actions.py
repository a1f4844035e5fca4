"""Tables of zero actions: how walks are summarised, which rows there are, and where they go."""

import math
from pathlib import Path

import numpy as np
import pytest

from eval.page.docs import END, START
from eval.zero_actions import __main__ as command
from eval.zero_actions import measures
from eval.zero_actions.__main__ import Sum, main
from eval.zero_actions.measures import noise_torque, summarised, walk
from eval.zero_actions.tables import EXACT, SETTINGS, ZeroActionConfig, cases, environment
from fbid_gym import robots
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig
from train.runs.tables import read_rows

SHORT = ["walking", "--robots", "biped", "--layers", "torque", "base_acceleration"]
SHORT += ["--episodes", "2", "--seconds", "0.1"]


def told(up: np.ndarray) -> dict[str, np.ndarray]:
    steps, count = up.shape
    return {
        "up": up,
        "miss": np.ones((steps, count, 2)) * [0.3, 0.4],
        **{name: np.full(up.shape, value) for name, value in (("turn", -0.2), ("power", 6.0))},
        **{name: np.full(up.shape, 0.5) for name in ("speed", "reward", "velocity_error")},
    }


def test_moments_count_until_a_robot_falls() -> None:
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


def test_where_nobody_was_up_there_is_no_number() -> None:
    fallen = summarised(told(np.zeros((1, 2), bool)), hz=2, weight=1.0)
    assert all(math.isnan(v) for k, v in fallen.items() if k != "velocity_error_of_the_reward")


def test_differences_are_shares_of_the_exact_walk() -> None:
    assert Sum(9, 10, 0.11).apart(Sum(10, 10, 0.1)) == pytest.approx((-0.1, 0.1))
    assert Sum(10, 10, 0.1).apart(Sum(10, 10, 0.1)) == (0.0, 0.0)
    assert Sum(0, 10, 0.2).apart(Sum(0, 10, 0.1)) == pytest.approx((0.0, 1.0))
    assert Sum(5, 10, 0.1).apart(Sum(0, 10, 0.1))[0] == math.inf


def test_each_setting_is_cheaper_by_one_thing_than_the_one_before() -> None:
    for env in ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0"):
        its = [EnvConfig.of(ENVIRONMENTS[env] | each) for each in SETTINGS.values()]
        differ = [
            sum(getattr(one, name) != getattr(other, name) for name in EXACT)
            for one, other in zip(its, its[1:], strict=False)
        ]
        assert differ == [1, 1, 1, 1] and its[-1] == EnvConfig.of(ENVIRONMENTS[env])
        assert (its[0].rates().physics, its[0].rates().control) == (1000, 500)


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["base_acceleration", "joint_position"])
def test_walking_hardly_depends_on_the_rates(layer: str) -> None:
    arguments = environment(robots.load("go1"), {})
    arguments |= {"action_layer": layer, "episode_seconds": 5.0, "push_force": (0.0, 0.0)}
    cheap, exact = walk(arguments, 16, 0), walk(arguments | EXACT, 16, 0)
    # A tenth over the robots and seconds of docs/rates.md; these are fewer.
    assert cheap["up"] == exact["up"] == "16"
    assert float(cheap["velocity_error"]) == pytest.approx(float(exact["velocity_error"]), rel=0.15)


def test_the_rows_are_all_that_a_robot_can() -> None:
    """Four legs have four gaits, two have one; six legs stand, as there is no gait for them."""
    of = cases(ZeroActionConfig("walking", robots=("go1", "biped"), layers=("torque",)))
    assert [case.cells["gait"] for case in of] == ["trot", "walk", "pace", "bound", "walk"]
    of = cases(ZeroActionConfig("zoo", robots=("0", "1"), layers=("joint_position",)))
    known = [(case.cells["legs"], case.cells["task"]) for case in of]
    assert known == [("4", "stand"), ("4", "walk"), ("6", "stand")]
    only = ("terrain=slopes,gaps", "difficulty=1", "ground=sees", "robot=go1")
    assert len(cases(ZeroActionConfig("terrain", only=only))) == 3 * 2


@pytest.mark.parametrize(("layer", "up"), [("joint_position", "2"), ("torque", "0")])
def test_who_has_no_feedback_falls(layer: str, up: str) -> None:
    config = ZeroActionConfig("zoo", robots=("0",), layers=(layer,), episodes=2, seconds=4.0)
    row = cases(config)[0].measure()
    assert row["up"] == up and "velocity_error" not in row
    assert float(row["share_low"]) <= int(up) / 2 <= float(row["share_high"])


def test_torque_is_in_proportion_to_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "WARM_UP", (2,))
    env = "fbid_gym/QuadrupedBalance-v0"
    once, twice = (noise_torque(env, "torque", std, 64, 3) for std in (0.02, 0.04))
    assert once > 0.0 and twice == pytest.approx(2.0 * once, rel=0.05)
    assert noise_torque(env, "torque", 0.0, 2, 3) == 0.0


def test_a_file_is_continued(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_a_page_has_the_command_and_the_short_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "DOCS", tmp_path)
    page = tmp_path / "walking.md"
    page.write_text(f"before\n{START}\n{END}\nafter\n")
    assert main([*SHORT, "--write-docs"]) == 0
    _, _, written = page.read_text().partition(START)
    assert "\n```\npython -m eval.zero_actions walking --robots biped " in written
    assert "2 robots each, 0.1 s, pushes of 0 N" in written and "[walking.csv](data/" in written
    assert "| robot | gait | torque | base acceleration |" in written
    assert len(read_rows(tmp_path / "data" / "walking.csv")) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["flying"],
            "Unknown table 'flying'. Valid choices: walking, terrain, rates, zoo, layers",
        ),
        (["walking", "--seconds", "1e300"], "Invalid seconds: 1e+300"),
        (["walking", "--seconds", "-1"], "Invalid seconds: -1.0. Expected a number from"),
        (["terrain", "--seconds", "nan"], "Invalid seconds: nan. Expected a number from"),
        (["rates", "--episodes", "0"], "Invalid episodes: 0"),
        (["terrain", "--episodes", "-3"], "Invalid episodes: -3. Expected a whole number fr"),
        (["walking", "--push", "-50"], "Invalid push: -50.0. Expected a number from 0 to"),
        (["walking", "--robots", "horse"], "Unknown robot 'horse'. Valid choices: biped, quad"),
        (["walking", "--robots"], "Invalid robots: []. Expected one or more"),
        (["walking", "--feet", "toe"], "Invalid --feet: 'toe'"),
        (["walking", "--layers", "torque", "magic"], "action layer 'magic'. Valid choices: tor"),
        (["terrain", "--only", "terrain=lava"], "Unknown terrain 'lava'. Valid choices: slopes, "),
        (["terrain", "--only", "difficulty=-1"], "Unknown difficulty '-1'. Valid choices: 0, 0.25"),
        (["terrain", "--only", "slopes"], "Unknown column 'slopes' in --only. Valid choices: robo"),
        (["zoo", "--robots", "-1"], "Invalid seed of a robot: '-1'. Expected a whole number from"),
        (["zoo", "--feet", "toe"], "Invalid feet: ('toe',). Expected none for the table 'zoo'"),
        (["noise", "--push", "1"], "Invalid push: 1.0. Expected none for the table 'noise'"),
        (["noise", "--robots", "no module:Moon-v0"], "Invalid module of the environment: 'no mod"),
        (["walking", "--csv", "rows.txt"], "Invalid csv: 'rows.txt'. Expected a file name ending"),
        (["walking", "--csv", "/dev/null/there/a.csv"], "Invalid csv: '/dev/null/there/a.csv'"),
        (["walking", "--csv", "a.csv", "--write-docs"], "Invalid csv: 'a.csv'. Expected none with"),
    ],
)
def test_nonsense_is_one_line(
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert list(tmp_path.iterdir()) == []
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1
    assert message in captured.err
