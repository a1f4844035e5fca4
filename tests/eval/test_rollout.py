"""The command line of rollouts: what it prints, what it writes, what it refuses."""

import csv
import json
import sys
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

from eval.clips import legend
from eval.rollout import main
from fbid_gym.bundles import load_bundle, save_bundle
from fbid_gym.envs.overlays import EVERYTHING, LABELS, RenderOptions
from fbid_gym.errors import FbidError
from tests.eval.conftest import ENV_ID, make_policy
from train.environments import make_env, make_envs


@pytest.fixture
def exported(tmp_path):
    make_policy(0.5).save(tmp_path / "policy")
    return str(tmp_path / "policy")


def test_json_csv_and_table_agree(exported, tmp_path, capsys):
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


def test_the_result_does_not_depend_on_how_many_play_at_once(exported, tmp_path):
    """With one episode per environment each is its environment's first, so the batch is free."""
    first = {}
    for count in (1, 3, 6):
        out = tmp_path / f"{count}.json"
        arguments = ["--num-envs", str(count), "--episodes", str(count), "--out", str(out)]
        assert main([exported, *arguments]) == 0
        first[count] = json.loads(out.read_text())["episodes"]
    assert first[6][:3] == first[3] and first[3][:1] == first[1]


def test_zero_action(tmp_path, exported):
    arguments = ["--zero-action", "--episodes", "8", "--out"]
    named = ["--env", ENV_ID, "--action-layer", "base_acceleration"]
    assert main([*named, *arguments, str(tmp_path / "a.json")]) == 0
    assert main([exported, *arguments, str(tmp_path / "b.json")]) == 0
    one, other = (json.loads((tmp_path / name).read_text()) for name in ("a.json", "b.json"))
    assert one["episodes"] == other["episodes"] and one["zero_action"]
    seconds = one["summary"]["seconds"]["mean"]  # ten steps each, worth 0.5 with no strength
    assert one["summary"]["returned"]["mean"] == pytest.approx(10 * 0.5 * seconds)


def test_video_is_h264_of_the_size_pages_expect(exported, tmp_path):
    video = tmp_path / "out.mp4"
    assert main([exported, "--episodes", "2", "--video", str(video)]) == 0
    reader = imageio_ffmpeg.read_frames(str(video))
    metadata = next(reader)
    assert metadata["codec"] == "h264" and metadata["size"] == (640, 480)
    assert metadata["duration"] == pytest.approx(4.0, abs=0.2)
    reader.close()


def test_videos_show_what_layers_see_unless_told_otherwise():
    ours, com = "fbid_gym/BipedBalance-v0", {"com": True}
    for given, shown in (({}, EVERYTHING), ({"render_options": com}, RenderOptions(**com))):
        env = make_env(ours, given)
        assert env.unwrapped.drawn_over == shown
        env.close()
    make_env(ENV_ID, {}).close()  # others know nothing of it
    words = " ".join(LABELS.values())
    assert legend(ENV_ID) == "" and all(word in legend(ours) for word in words.split())


def test_a_module_is_imported_only_where_the_user_names_it(exported, tmp_path, monkeypatch, capsys):
    (tmp_path / "own_robots.py").write_text(
        "import gymnasium as gym\n"
        "from tests.eval.conftest import StandIn\n"
        "gym.register('own_robots/Mine-v0', entry_point=StandIn)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    data, tensors = load_bundle(Path(exported), FbidError)
    for env_id, message in (
        ("own_robots:own_robots/Mine-v0", "Expected the id alone of a registered environment"),
        ("own_robots/Mine-v0", "Unknown environment 'own_robots/Mine-v0'"),
    ):
        save_bundle(Path(exported), data | {"env_id": env_id}, tensors)
        assert main([exported, "--episodes", "1"]) == 2
        assert message in capsys.readouterr().err
        assert "own_robots" not in sys.modules
    assert main([exported, "--episodes", "1", "--register", "own_robots"]) == 0
    assert "own_robots" in sys.modules
    assert main([exported, "--register", "no_such_robots"]) == 2
    assert "Invalid register: 'no_such_robots'" in capsys.readouterr().err


def test_nothing_is_left_behind_by_a_failed_write(exported, tmp_path):
    folder = tmp_path / "out.json"
    folder.mkdir()
    assert main([exported, "--episodes", "1", "--out", str(folder)]) == 2
    assert list(folder.iterdir()) == []
    with pytest.raises(KeyError):  # of an environment, which is no mistake of the user's
        make_envs(ENV_ID, {"action_layer": "unheard of"}, 2)
