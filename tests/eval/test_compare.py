"""The comparison from run folders to the page: its numbers, its words, its independence."""

import json
import re
import shlex
from dataclasses import asdict
from html import unescape

import numpy as np
import pytest

from eval.compare import CompareConfig, compared, main, named, players_of
from eval.rollout import Player, play_player
from eval.study.films import film
from eval.study.page import page
from eval.study.results import Settings
from eval.study.wording import headline
from tests.eval.conftest import ENV_ID, write_run, zero_policy
from tests.eval.test_html import EVIL
from train.episodes import METRICS
from train.runs.command_line import parse
from train.runs.config import PPOConfig, TrainConfig
from train.runs.reading import load
from train.runs.tables import EVALUATIONS, read_rows, to_csv

QUICK = CompareConfig(runs=(), episodes=6, settings=Settings(samples=300))
QUICK_ARGS = ["--episodes", "6", "--samples", "300", "--push-episodes", "4"]
LAYERS = ["base acceleration", "joint position"]


def found_of(folders):
    return compared([load(folder) for folder in folders], QUICK)


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
    assert "Survival under pushes is not known" in words_of(html)  # not our environment
    assert sorted(path.name for path in out.parent.iterdir()) == ["report.html", "report.json"]


def test_the_numbers_are_those_of_the_rollouts(four_runs):
    """And of the zero action of each layer, behind them; all are set against the last layer."""
    runs, found = [load(path) for path in four_runs], found_of(four_runs)
    arms = {arm.name: arm.fresh for arm in found.arms}
    assert list(arms) == [*LAYERS[::-1], *(f"{layer}, zero action" for layer in LAYERS[::-1])]
    assert found.reference == "base acceleration"
    assert arms["joint position"].versus["return_mean"].probability.value == 0.0
    for layer in LAYERS:
        members = [run for run in runs if run.layer == layer]
        players = [*map(Player.of, members), Player.of(members[0], trained=False)]
        played = [play_player(its, QUICK.episodes, QUICK.settings.seed) for its in players]
        for metric in METRICS:
            name = {"returned": "return_mean"}.get(metric.name, metric.name)
            *means, zero = (getattr(episodes, metric.name).mean() for episodes in played)
            if name in arms[layer].final:  # others this environment does not measure
                estimate = arms[layer].final[name]
                # Of two runs: their mean, and their range.
                expected = [np.mean(means), min(means), max(means)]
                assert [estimate.value, estimate.low, estimate.high] == pytest.approx(expected)
                assert arms[f"{layer}, zero action"].final[name].value == pytest.approx(zero)
        assert arms[layer].final.keys() >= {"return_mean", "falls", "height_error", "torque"}


def test_episodes_are_fresh_and_the_order_of_the_runs_does_not_matter(four_runs, capsys):
    assert main([str(four_runs[0]), "--seed", "10031"]) == 2
    assert "was evaluated from seeds 10000 to 10031. Expected none" in capsys.readouterr().err
    one, other = found_of(four_runs), found_of([four_runs[k] for k in (2, 0, 3, 1)])
    means = [{a.name: a.fresh.final["return_mean"].value for a in x.arms} for x in (one, other)]
    assert means[0] == means[1] and headline(one) == headline(other)
    # As text: what an environment does not measure is no number, and equals nothing.
    assert repr(asdict(one)) == repr(asdict(found_of(four_runs)))


def test_clips_show_the_same_pushes(four_runs):
    who = players_of(named([load(path) for path in four_runs])).__getitem__
    clips, missing = film(found_of(four_runs), who, 6.0, lambda *told: None)
    by_arm = {arm: shown.clip for (_, arm), shown in clips.items()}
    assert by_arm.keys() == {*LAYERS, *(f"{layer}, zero action" for layer in LAYERS)}
    assert not missing and len({len(clip.frames) for clip in by_arm.values()}) == 1
    first, *others = (clip.pushes for clip in by_arm.values())
    assert np.linalg.norm(first, axis=1).max() > 20.0
    assert all(all(map(np.array_equal, its, first)) for its in others)  # until one falls


def test_exported_policies_are_compared_and_pushed(tmp_path, capsys):
    """Sizes of push are shares of the weight; the zero action of the layer stands beside."""
    env_id, files = "fbid_gym/QuadrupedWalk-v0", [tmp_path / x / "policy.safetensors" for x in "ab"]
    for file in files:
        zero_policy(env_id, (62, 12), episode_seconds=0.6).save(file)
    out = tmp_path / "new" / "page.html"
    few = ["--episodes", "2", "--push-episodes", "2", "--push-seconds", "0.4", "--samples", "50"]
    sizes = ["--pushes", "0.2", "0.1", "--video-push", "0.5", "--video-seconds", "0.2"]
    assert main([*map(str, files), "--out", str(out), *few, *sizes]) == 0
    words, told = words_of(out.read_text()), json.loads(out.with_suffix(".json").read_text())
    assert "No learning curves: exported policies do not" in words and "Torque, N m" in words
    assert all(str(file) in words for file in files) and out.read_text().count("<video") == 1
    learnt, zero = told["arms"]
    assert learnt["fresh"]["each"]["return_mean"] == 2 * zero["fresh"]["each"]["return_mean"]
    assert told["robustness"][env_id]["along"][0]["values"] == [0.1, 0.2]
    assert "stay up under pushes of" in " ".join(capsys.readouterr().out.split())


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
    assert found_of([folder]).warnings == []
    rows = read_rows(folder / "evaluations.csv")
    mean = float(rows[-1]["return_mean"])
    for changes, noticed in (({}, 1), ({"return_std": str(0.4 * mean), "episodes": "6"}, 0)):
        rows[-1] |= {"return_mean": str(0.7 * mean)} | changes
        (folder / "evaluations.csv").write_text(to_csv(EVALUATIONS, rows))
        warnings = found_of([folder]).warnings
        assert len(warnings) == noticed
        assert all("base_acceleration-s0 returns" in warning for warning in warnings)


def test_the_page_says_how_each_run_is_trained_again(run_folder):
    config = TrainConfig(env=ENV_ID, seed=3, ppo=PPOConfig(gamma=0.9, hidden=(8, 8)))
    folder = run_folder(seed=3, ppo=config.ppo)
    html = page(found_of([folder]))
    (command,) = re.findall("python -m train.ppo (.*?)</pre>", html)
    assert parse(shlex.split(unescape(command))) == config
