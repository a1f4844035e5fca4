"""The comparison from run folders to the page: its numbers, its words, its independence."""

import json
import re
import shlex
from dataclasses import asdict, replace
from html import unescape

import numpy as np
import pytest

from eval.compare import main
from eval.comparison import compare, film
from eval.report import page
from eval.results import Settings
from eval.rollout import Player, play_player
from tests.eval.conftest import ENV_ID, write_run
from tests.eval.test_html import EVIL
from train.episodes import METRICS
from train.runs.command_line import parse
from train.runs.config import PPOConfig, TrainConfig
from train.runs.reading import load
from train.runs.tables import EVALUATIONS, read_rows, to_csv

QUICK = Settings(episodes=6, samples=300, sweep=(1.0,), sweep_episodes=4, sweep_seconds=2.0)
QUICK_ARGS = ["--episodes", "6", "--samples", "300", "--sweep", "1.0", "--sweep-episodes", "4"]


def words_of(html):
    """The text of a page."""
    words = re.sub(r"<(style|script).*?</\1>|<[^>]+>", " ", html, flags=re.DOTALL)
    return re.sub("[ \n]+", " ", words)


@pytest.fixture(scope="module")
def four_runs(tmp_path_factory):
    folder, layers = tmp_path_factory.mktemp("four"), ("joint_position", "base_acceleration")
    return [write_run(folder / f"{layer}-s{seed}", layer, seed)
            for layer in layers for seed in (0, 1)]  # fmt: skip


def test_the_page_stands_alone_and_holds_every_run(four_runs, tmp_path):
    out = tmp_path / "new" / "report.html"
    assert main([*map(str, four_runs), "--out", str(out), *QUICK_ARGS]) == 0
    html = out.read_text()
    assert html.count("<video") == 2 and html.count("<h1") == 1
    kinds = ("data:video/mp4;base64,", "data:image/jpeg;base64,")
    for reference in re.findall(r'<[^>]*\s(?:src|href|poster|srcset)="([^"]*)"', html):
        assert reference.startswith(kinds)
    assert not re.search(r"https?://|//[a-z]+\.|@import|url\((?!#)|<link", html)
    for folder in four_runs:
        assert folder.name in words_of(html)
    assert sorted(path.name for path in out.parent.iterdir()) == ["report.html", "report.json"]


def test_the_numbers_are_those_of_the_rollouts(four_runs):
    runs = [load(path) for path in four_runs]
    result = compare(runs, QUICK)
    assert [layer.name for layer in result.layers] == ["base acceleration", "joint position"]
    for layer in result.layers:
        members = [run for run in runs if run.layer == layer.name]
        played = [play_player(Player.of(run), QUICK.episodes, QUICK.seed) for run in members]
        for metric in METRICS:
            means = np.array([getattr(episodes, metric.name).mean() for episodes in played])
            np.testing.assert_allclose(layer.values(metric.name), means)
            estimate = layer.metrics[metric.name]
            if np.isnan(means).all():  # this environment does not measure it
                assert np.isnan(estimate.value)
                continue
            # Of two runs: their mean, and their range.
            assert estimate.value == pytest.approx(means.mean())
            assert (estimate.low, estimate.high) == (means.min(), means.max())


def test_the_order_of_the_runs_does_not_matter(four_runs):
    runs = [load(path) for path in four_runs]
    one, other = compare(runs, QUICK), compare([runs[2], runs[0], runs[3], runs[1]], QUICK)
    assert one.pairs[0].difference.value == other.pairs[0].difference.value
    means = [[x.metrics["returned"].value for x in each.layers] for each in (one, other)]
    assert means[0] == means[1]
    # As text: what an environment does not measure is no number, and equals nothing.
    assert repr(asdict(one)) == repr(asdict(compare(runs, QUICK)))


def test_a_threshold_that_one_layer_never_reaches_is_said_to_be_that(four_runs):
    result = compare([load(path) for path in four_runs], replace(QUICK, threshold=36.5))
    by_name = {layer.name: layer for layer in result.layers}
    quick, slow = by_name["base acceleration"].steps_to, by_name["joint position"].steps_to
    assert quick.reached == 2 and 0 < quick.median.value < 1e6
    assert slow.reached == 0 and slow.median.value == float("inf")
    words = words_of(page(result, None))
    assert "joint position not reached in 2 runs" in words and "0 of 2" in words
    assert "inf" not in words.replace("information", "")


def test_clips_show_the_same_pushes(four_runs):
    runs = [load(path) for path in four_runs]
    result = compare(runs, QUICK)
    clips = film(runs, result)
    by_layer = {one.name: one.clip for one in clips.shown}
    assert clips.same_pushes and list(by_layer) == ["base acceleration", "joint position"]
    lengths = {len(clip.frames) for clip in by_layer.values()}
    assert len(lengths) == 1
    assert clips.push == pytest.approx(QUICK.video_push * result.hardest_push)
    strengths = np.linalg.norm(by_layer["base acceleration"].pushes, axis=1)
    assert strengths.max() == pytest.approx(clips.push)


def test_what_files_say_is_printed_as_it_is_and_is_no_html(run_folder, tmp_path, capsys):
    folders = [run_folder(name="a<b>&c"), run_folder("joint_position", name="[bold]b[/x]")]
    known = json.loads((folders[0] / "versions.json").read_text())
    forged = {"commit": "[/x]", "cpu_count": EVIL, "platform": EVIL, "packages": {EVIL: EVIL}}
    (folders[0] / "versions.json").write_text(json.dumps(known | forged))
    out = tmp_path / "[b]" / "report.html"
    assert main([*map(str, folders), "--out", str(out), "--video-seconds", "0", *QUICK_ARGS]) == 0
    said = capsys.readouterr().out.replace("\n", "")
    assert "different commits of this project: " in said and "[/x]" in said
    assert "[b]/report.html" in said
    html = out.read_text()
    assert "&lt;script&gt;alert(1)" in html
    assert "<script" not in html and "<img" not in html and "a<b>" not in html


def test_an_environment_that_has_changed_since_training_is_noticed(run_folder):
    """Few evaluations that scatter are no sign of it."""
    folder = run_folder()
    assert compare([load(folder)], QUICK).warnings == []
    rows = read_rows(folder / "evaluations.csv")
    mean = float(rows[-1]["return_mean"])
    for changes, noticed in (({}, 1), ({"return_std": str(0.4 * mean), "episodes": "6"}, 0)):
        rows[-1] |= {"return_mean": str(0.7 * mean)} | changes
        (folder / "evaluations.csv").write_text(to_csv(EVALUATIONS, rows))
        warnings = compare([load(folder)], QUICK).warnings
        assert len(warnings) == noticed
        assert all("base_acceleration-s0 returns" in warning for warning in warnings)


def test_the_page_says_how_each_run_is_trained_again(run_folder):
    config = TrainConfig(env=ENV_ID, seed=3, ppo=PPOConfig(gamma=0.9, hidden=(8, 8)))
    folder = run_folder(seed=3, ppo=config.ppo)
    html = page(compare([load(folder)], QUICK), None)
    (command,) = re.findall("python -m train.ppo (.*?)</pre>", html)
    assert parse(shlex.split(unescape(command))) == config
