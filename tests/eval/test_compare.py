"""The comparison from run folders to the page: its numbers, its words, its independence."""

import json
import re
import shlex
from collections.abc import Callable
from dataclasses import asdict, replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from eval.compare import main
from eval.comparison import compare, film
from eval.report import lede, page
from eval.results import Settings
from eval.rollout import Player, play_player
from eval.wording import number
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from train.episodes import METRICS
from train.runs.command_line import parse
from train.runs.config import PPOConfig, TrainConfig
from train.runs.reading import load
from train.runs.tables import EVALUATIONS, read_rows, to_csv

Build = Callable[..., Path]
ENV_ID = "eval_tests/StandIn-v0"
QUICK = Settings(episodes=6, samples=300, sweep=(1.0,), sweep_episodes=4, sweep_seconds=2.0)
QUICK_ARGS = ["--episodes", "6", "--samples", "300", "--sweep", "1.0", "--sweep-episodes", "4"]


class Page(HTMLParser):
    """Collects what a page refers to, and the text of it."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.words = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.references += [v or "" for k, v in attrs if k in ("src", "href", "poster", "srcset")]
        if tag not in ("meta", "br", "img", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self.open):
            self.words += data + " "


@pytest.fixture
def four_runs(run_folder: Build) -> list[Path]:
    return [run_folder(layer, seed) for layer in ("joint_position", "base_acceleration")
            for seed in (0, 1)]  # fmt: skip


def test_the_page_stands_alone_and_holds_every_run(four_runs: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "new" / "report.html"
    assert main([*map(str, four_runs), "--out", str(out), *QUICK_ARGS]) == 0
    html = out.read_text()
    parsed = Page(html)
    assert parsed.open == []
    assert parsed.tags.count("video") == 2 and parsed.tags.count("h1") == 1
    kinds = ("data:video/mp4;base64,", "data:image/jpeg;base64,")
    assert all(reference.startswith(kinds) for reference in parsed.references)
    assert not re.search(r"https?://|//[a-z]+\.|@import|url\((?!#)|<link", html)
    for folder in four_runs:
        assert folder.name in parsed.words
    assert sorted(path.name for path in out.parent.iterdir()) == ["report.html", "report.json"]


def test_the_numbers_are_those_of_the_rollouts(four_runs: list[Path]) -> None:
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


def test_page_and_json_agree(four_runs: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    main([*map(str, four_runs), "--out", str(out), "--video-seconds", "0", *QUICK_ARGS])
    written = json.loads((tmp_path / "report.json").read_text())
    words = re.sub(r"\s+", " ", Page(out.read_text()).words)
    for layer in written["layers"]:
        for run in layer["runs"]:
            value = run["metrics"]["returned"]
            row = words[words.rindex(run["name"] + " " + layer["name"]) :][:200]
            assert f" {number(value)} " in row and run["path"].endswith(run["name"])
        low, high = (layer["metrics"]["returned"][key] for key in ("low", "high"))
        assert f"({number(low)} to {number(high)})" in words
    assert f"return of {number(written['threshold'])}" in words


def test_the_order_of_the_runs_does_not_matter(four_runs: list[Path]) -> None:
    runs = [load(path) for path in four_runs]
    one, other = compare(runs, QUICK), compare([runs[2], runs[0], runs[3], runs[1]], QUICK)
    assert one.pairs[0].difference.value == other.pairs[0].difference.value
    assert [x.metrics["returned"].value for x in one.layers] == [
        x.metrics["returned"].value for x in other.layers
    ]
    # As text: what an environment does not measure is no number, and equals nothing.
    assert repr(asdict(one)) == repr(asdict(compare(runs, QUICK)))


def test_a_threshold_that_one_layer_never_reaches_is_said_to_be_that(
    four_runs: list[Path],
) -> None:
    result = compare(
        [load(path) for path in four_runs], Settings(**{**asdict(QUICK), "threshold": 36.5})
    )
    by_name = {layer.name: layer for layer in result.layers}
    quick, slow = by_name["base acceleration"].steps_to, by_name["joint position"].steps_to
    assert quick is not None and slow is not None
    assert quick.reached == 2 and 0 < quick.median.value < 1e6
    assert slow.reached == 0 and slow.median.value == float("inf")
    words = Page(page(result, None)).words
    assert "joint position not reached in 2 runs" in words and "0 of 2" in words
    assert "inf" not in words.replace("information", "")


def test_two_seeds_come_with_a_warning_and_five_without(run_folder: Build) -> None:
    few = [load(run_folder(layer, s)) for layer in ("joint_position", "base_acceleration")
           for s in range(5)]  # fmt: skip
    five = compare(few, QUICK)
    assert "How far to trust this" not in page(five, None)
    assert five.pairs[0].p_value == pytest.approx(2 / 252)
    two = compare([run for run in few if run.seed in (0, 1)], QUICK)
    words = Page(page(two, None)).words.replace("\N{NO-BREAK SPACE}", " ")
    assert "holds the true median at most 50 % of the time" in words
    assert "in 33 % of such comparisons" in words
    assert "cannot rule out chance" in words


def test_one_seed_has_no_interval(run_folder: Build) -> None:
    result = compare([load(run_folder("joint_position")), load(run_folder())], QUICK)
    for layer in result.layers:
        assert all(value.low is None and value.high is None for value in layer.metrics.values())
        assert layer.by_steps is not None and layer.by_steps.low is None
    assert result.pairs[0].difference.low is None
    words = Page(page(result, None)).words
    assert "One seed is one draw" in words and "one run cannot say" in words


def test_exported_policies_have_no_curves(
    run_folder: Build, tmp_path: Path, policy: Callable[..., Policy]
) -> None:
    policy(0.4).save(tmp_path / "one")
    policy(0.9, "joint_position").save(tmp_path / "other")
    result = compare([load(tmp_path / "one"), load(tmp_path / "other")], QUICK)
    assert result.threshold is None
    assert all(layer.by_steps is layer.steps_to is None for layer in result.layers)
    html = page(result, None)
    assert "exported policies do not carry them" in html
    mixed = compare([load(tmp_path / "one"), load(run_folder("joint_position"))], QUICK)
    assert "No learning curves" not in page(mixed, None)


def test_one_layer_alone_is_described(run_folder: Build) -> None:
    result = compare([load(run_folder(seed=s)) for s in (0, 1, 2)], QUICK)
    words = Page(page(result, None)).words
    assert "over three seeds" in words and "How sure is the order" not in words


def test_clips_show_the_same_pushes(four_runs: list[Path]) -> None:
    runs = [load(path) for path in four_runs]
    result = compare(runs, QUICK)
    clips = film(runs, result)
    assert clips.same_pushes and list(clips.by_layer) == ["base acceleration", "joint position"]
    lengths = {len(clip.frames) for clip in clips.by_layer.values()}
    assert len(lengths) == 1
    assert clips.push == pytest.approx(QUICK.video_push * result.hardest_push)
    strengths = np.linalg.norm(clips.by_layer["base acceleration"].pushes, axis=1)
    assert strengths.max() == pytest.approx(clips.push)


def test_an_environment_without_pushes_is_filmed_and_promised_none(
    four_runs: list[Path], stand_in: Callable[..., Any]
) -> None:
    """Of somebody else, who rewards beyond 1."""

    def unpushed(
        action_layer: str = "base_acceleration",
        layer_options: dict[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> gym.Env[np.ndarray, np.ndarray]:
        env = stand_in(action_layer, layer_options, (0.0, 0.0), render_mode=render_mode)
        return gym.wrappers.TransformReward(env, lambda reward: 10.0 * reward)

    gym.register("eval_tests/Unpushed-v0", entry_point=unpushed)
    runs = [load(path) for path in four_runs]
    runs = [
        replace(run, policy=replace(run.policy, env_id="eval_tests/Unpushed-v0")) for run in runs
    ]
    result = compare(runs, replace(QUICK, video_seconds=1.0))
    html = page(result, film(runs, result))
    assert "<h2>The same start</h2>" in html and "same push" not in html
    assert result.layers[0].metrics["returned"].value > 100.0 and "of at most" not in html


def test_the_most_that_can_be_earned_is_said_where_it_is_known(four_runs: list[Path]) -> None:
    """However early all of them fall."""
    result = compare([load(path) for path in four_runs], QUICK)
    env_args = {"episode_seconds": 4.0, "policy_hz": 25}
    ours = replace(result, env_id="fbid_gym/QuadrupedWalk-v0", env_args=env_args)
    assert "of at most" not in lede(result)[0] and "of at most 100," in lede(ours)[0]


def test_what_files_say_is_printed_as_it_is(
    run_folder: Build, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [run_folder(), run_folder("joint_position", name="[bold]b[/x]")]
    known = json.loads((folders[0] / "versions.json").read_text())
    (folders[0] / "versions.json").write_text(json.dumps(known | {"commit": "[/x]"}))
    out = tmp_path / "[b]" / "report.html"
    assert main([*map(str, folders), "--out", str(out), "--video-seconds", "0", *QUICK_ARGS]) == 0
    said = capsys.readouterr().out.replace("\n", "")
    assert "different commits of this project: " in said and "[/x]" in said
    assert "[b]/report.html" in said


def test_the_sweep_and_the_zero_action_are_played(four_runs: list[Path]) -> None:
    result = compare([load(path) for path in four_runs], QUICK)
    # The fixture falls beyond 60 + 60 x strength: base acceleration at about 114 N, zero at 60 N.
    strong = result.layers[0]
    assert strong.sweep[0].value == 1.0 and strong.zero_sweep == [0.0]
    assert strong.zero_action["survived"] < strong.metrics["survived"].value == 1.0


def test_an_environment_that_has_changed_since_training_is_noticed(run_folder: Build) -> None:
    folder = run_folder()
    assert compare([load(folder)], QUICK).warnings == []
    rows = read_rows(folder / "evaluations.csv")
    rows[-1]["return_mean"] = str(0.7 * float(rows[-1]["return_mean"]))
    (folder / "evaluations.csv").write_text(to_csv(EVALUATIONS, rows))
    (warning,) = compare([load(folder)], QUICK).warnings
    assert "base_acceleration-s0 returns" in warning and "is not what it was" in warning


def test_few_scattered_evaluations_are_no_sign_of_a_change(run_folder: Build) -> None:
    """The last evaluation's own scatter counts: fresh episodes that all survive have little."""
    folder = run_folder()
    rows = read_rows(folder / "evaluations.csv")
    mean = float(rows[-1]["return_mean"])
    rows[-1] |= {"return_mean": str(0.7 * mean), "return_std": str(0.4 * mean), "episodes": "6"}
    (folder / "evaluations.csv").write_text(to_csv(EVALUATIONS, rows))
    assert compare([load(folder)], QUICK).warnings == []


def test_the_page_says_how_each_run_is_trained_again(run_folder: Build) -> None:
    config = TrainConfig(env=ENV_ID, seed=3, ppo=PPOConfig(gamma=0.9, hidden=(8, 8)))
    folder = run_folder(seed=3, ppo=config.ppo)
    html = page(compare([load(folder)], QUICK), None)
    (command,) = re.findall("python -m train.ppo (.*?)</pre>", html)
    assert parse(shlex.split(unescape(command))) == config


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: no policy here"),
        (["RUN", "RUN"], "given twice"),
        (["RUN", "--out", "x.pdf"], "Invalid out: 'x.pdf'. Expected a file name ending in .html"),
        (["RUN", "--episodes", "0"], "Invalid episodes: 0"),
        (["RUN", "--confidence", "95"], "Invalid confidence: 95.0. Expected a number from 0.01"),
        (["RUN", "--sweep", "0"], "Invalid sweep: 0.0. Expected a number from 0.001"),
    ],
)
def test_mistakes_are_one_line_and_leave_no_file(
    arguments: list[str],
    message: str,
    run_folder: Build,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = str(run_folder())
    before = sorted(tmp_path.iterdir())
    assert main([folder if a == "RUN" else a for a in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1
    assert message in captured.err
    assert sorted(tmp_path.iterdir()) == before


def test_warnings_are_on_the_page(run_folder: Build) -> None:
    folders = [run_folder(), run_folder("joint_position", num_envs=8)]
    result = compare([load(folder) for folder in folders], QUICK)
    assert "num_envs 8 instead of 64" in Page(page(result, None)).words
    with pytest.raises(RunError, match="different environment arguments"):
        compare(
            [load(folders[0]), load(run_folder(seed=4, env_args={"push_force": [1, 2]}))], QUICK
        )
