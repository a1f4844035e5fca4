"""The command line of rollouts: what it prints, what it writes, what it refuses."""

import csv
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

from eval.clips import legend
from eval.rollout import main
from fbid_gym.envs.overlays import EVERYTHING, LABELS, RenderOptions
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy
from train.environments import make_env, make_envs

ENV_ID = "eval_tests/StandIn-v0"


@pytest.fixture
def exported(tmp_path: Path, policy: Callable[..., Policy]) -> str:
    policy(0.5).save(tmp_path / "policy")
    return str(tmp_path / "policy")


def test_json_csv_and_table_agree(
    exported: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("metrics.json", "new/metrics.csv"):
        command = [exported, "--episodes", "12", "--out", str(tmp_path / name)]
        assert main(command) == 0
    printed = capsys.readouterr().out
    written = json.loads((tmp_path / "metrics.json").read_text())
    with (tmp_path / "new" / "metrics.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(written["episodes"]) == 12
    for name in ("returned", "survived", "power"):
        column = [float(row[name]) for row in rows]
        np.testing.assert_allclose(column, [e[name] for e in written["episodes"]])
        mean = written["summary"][name]["mean"]
        assert mean == pytest.approx(np.mean(column))
        assert f"{mean:.4g}" in printed
    assert written["env_args"] == {"action_layer": "base_acceleration"}
    assert "12 episodes" in printed and "ended by fall" in printed


def test_the_result_does_not_depend_on_how_many_play_at_once(exported: str, tmp_path: Path) -> None:
    """With one episode per environment each is its environment's first, so the batch is free."""
    first = {}
    for count in (1, 3, 6):
        out = tmp_path / f"{count}.json"
        arguments = ["--num-envs", str(count), "--episodes", str(count), "--out", str(out)]
        assert main([exported, *arguments]) == 0
        first[count] = json.loads(out.read_text())["episodes"]
    assert first[6][:3] == first[3] and first[3][:1] == first[1]


def test_zero_action(tmp_path: Path, exported: str) -> None:
    arguments = ["--zero-action", "--episodes", "8", "--out"]
    named = ["--env", ENV_ID, "--action-layer", "base_acceleration"]
    assert main([*named, *arguments, str(tmp_path / "a.json")]) == 0
    assert main([exported, *arguments, str(tmp_path / "b.json")]) == 0
    one, other = (json.loads((tmp_path / name).read_text()) for name in ("a.json", "b.json"))
    assert one["episodes"] == other["episodes"] and one["zero_action"]
    seconds = one["summary"]["seconds"]["mean"]  # ten steps each, worth 0.5 with no strength
    assert one["summary"]["returned"]["mean"] == pytest.approx(10 * 0.5 * seconds)


def test_environment_arguments_replace_those_of_the_policy(exported: str, tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    arguments = ["--env-args", '{"push_force": [10, 10]}', "--episodes", "5", "--out", str(out)]
    assert main([exported, *arguments]) == 0
    written = json.loads(out.read_text())
    assert written["summary"]["strongest_push"]["mean"] == pytest.approx(10)
    assert written["summary"]["survived"]["mean"] == 1


def test_video_is_h264_of_the_size_pages_expect(exported: str, tmp_path: Path) -> None:
    video = tmp_path / "out.mp4"
    assert main([exported, "--episodes", "2", "--video", str(video)]) == 0
    reader = imageio_ffmpeg.read_frames(str(video))
    metadata = next(reader)
    assert metadata["codec"] == "h264" and metadata["size"] == (640, 480)
    assert metadata["duration"] == pytest.approx(4.0, abs=0.2)
    reader.close()


def test_videos_show_what_layers_see_unless_told_otherwise() -> None:
    ours = "fbid_gym/BipedBalance-v0"
    for given, shown in (
        ({}, EVERYTHING),
        ({"render_options": {"com": True}}, RenderOptions(com=True)),
    ):
        env = make_env(ours, given)
        assert env.unwrapped.drawn_over == shown
        env.close()
    make_env(ENV_ID, {}).close()  # others know nothing of it
    words = " ".join(LABELS.values())
    assert legend(ENV_ID) == "" and all(word in legend(ours) for word in words.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Invalid source: None. Expected a run folder or policy, or --zero-action."),
        (["nowhere"], "nowhere: no policy here"),
        (["--zero-action"], "Invalid --env: None. Expected an environment id"),
        (
            ["--zero-action", "--env", "fbid_gym/Nothing-v0"],
            "Unknown environment 'fbid_gym/Nothing-v0'. Valid choices: fbid_gym/BipedBalance-v0, ",
        ),
        (["POLICY", "--env", ENV_ID], "Expected neither beside a policy"),
        (["POLICY", "--zero-action", "--action-layer", "torque"], "Expected neither beside a pol"),
        (["POLICY", "--env-args", "[1]"], "Invalid env_args: '[1]'. Expected a JSON object"),
        (["POLICY", "--env-args", "{"], "Invalid env_args: '{'. Expected a JSON object"),
        (["POLICY", "--env-args", '{"nonsense": 1}'], "Expected what eval_tests/StandIn-v0 takes"),
        (
            ["POLICY", "--episodes", "0"],
            "Invalid episodes: 0. Expected a whole number from 1 to 1,000,000.",
        ),
        (
            ["POLICY", "--num-envs", "0"],
            "Invalid num_envs: 0. Expected a whole number from 1 to 65,536.",
        ),
        (
            ["POLICY", "--out", "x.txt"],
            "Invalid out: 'x.txt'. Expected a file name ending in .json",
        ),
        (["POLICY", "--video", "x.gif"], "Invalid video: 'x.gif'. Expected a file name ending in"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str], message: str, exported: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([exported if a == "POLICY" else a for a in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1
    assert message in captured.err and "Traceback" not in captured.out + captured.err


def test_a_module_is_imported_only_where_the_user_names_it(
    exported: str,
    policy: Callable[..., Policy],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "own_robots.py").write_text(
        "import gymnasium as gym\n"
        "from tests.eval.conftest import StandIn\n"
        "gym.register('own_robots/Mine-v0', entry_point=StandIn)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for env_id, message in (
        ("own_robots:own_robots/Mine-v0", "which names a module to import"),
        ("own_robots/Mine-v0", "Unknown environment 'own_robots/Mine-v0'"),
    ):
        replace(policy(0.5), env_id=env_id).save(exported)
        assert main([exported, "--episodes", "1"]) == 2
        assert message in capsys.readouterr().err
        assert "own_robots" not in sys.modules
    assert main([exported, "--episodes", "1", "--register", "own_robots"]) == 0
    assert "own_robots" in sys.modules
    assert main([exported, "--register", "no_such_robots"]) == 2
    assert "Invalid register: 'no_such_robots'" in capsys.readouterr().err


def test_a_policy_for_another_size_is_refused(
    tmp_path: Path, policy: Callable[..., Policy], capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = Policy(
        ENV_ID, {}, np.zeros(4), np.ones(4), (np.zeros((2, 4)),), (np.zeros(2),), source="x"
    )
    wrong.save(tmp_path / "policy")
    assert main([str(tmp_path / "policy"), "--episodes", "1"]) == 2
    assert "has observation_size 4. Expected 3" in capsys.readouterr().err


def test_nothing_is_left_behind_by_a_failed_write(exported: str, tmp_path: Path) -> None:
    folder = tmp_path / "out.json"
    folder.mkdir()
    assert main([exported, "--episodes", "1", "--out", str(folder)]) == 2
    assert list(folder.iterdir()) == []


def test_an_error_inside_an_environment_is_not_taken_for_a_mistake() -> None:
    with pytest.raises(InvalidValueError, match="nonsense"):
        make_envs(ENV_ID, {"nonsense": 1}, 2)
    with pytest.raises(KeyError):
        make_envs(ENV_ID, {"action_layer": "unheard of"}, 2)
