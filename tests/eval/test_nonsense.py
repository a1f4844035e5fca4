"""Nonsense on the command line of what measures without a policy: one line, exit status 2."""

import subprocess
import sys
from pathlib import Path

import pytest
import tyro

from eval import compare, demo, rollout
from eval.papers.__main__ import main as papers
from eval.tools import soak
from eval.tools.bench import __main__ as bench
from fbid_gym.exit_status import exit_status
from train import ppo, sweep
from train.runs.command_line import parse

WALK = ["--zero-action", "--env", "fbid_gym/QuadrupedWalk-v0"]


COMPARE = ["runs/none"]
DEEP = '{"a":' * 3000 + "1" + "}" * 3000
NOWHERE = "/dev/null/there"


def command(config, work):
    """The command line of a module that reads it where it is started."""
    return lambda arguments: exit_status(lambda: work(tyro.cli(config, args=arguments)))


def train(arguments):
    return exit_status(lambda: print(ppo.main(parse(arguments))))


measure = command(bench.BenchConfig, bench.main)
show = command(demo.DemoConfig, demo.main)
sweeps = command(sweep.SweepConfig, sweep.main)
soaks = command(soak.SoakConfig, soak.main)


@pytest.mark.parametrize(
    ("main", "arguments", "message"),
    [
        (rollout.main, [*WALK, "--episodes", "0"], "Invalid episodes: 0. Expected a whole"),
        (rollout.main, [*WALK, "--episodes", "1" + "0" * 30], "Invalid episodes: 1000"),
        (rollout.main, [*WALK, "--seed", "1" + "0" * 400], "Invalid seed: 1000"),
        (rollout.main, [*WALK, "--video-seconds", "1e300"], "Invalid video_seconds: 1e+300"),
        (rollout.main, [*WALK, "--env-args", DEEP], "nested too deeply"),
        (rollout.main, [*WALK, "--env-args", '{"physics_hz": 1e999}'], "Invalid physics_hz: inf"),
        (rollout.main, [*WALK, "--env-args", '{"env_id": "a"}'], "keyword argument 'env_id'"),
        (rollout.main, [*WALK, "--env-args", '{"id": "a"}'], "environment arguments: {'id': 'a'}"),
        (rollout.main, ["--zero-action", "--env", "CartPole-v1"], "Invalid env: 'CartPole-v1'"),
        (rollout.main, [*WALK, "--out", f"{NOWHERE}/a.json"], "Invalid out: '/dev/null/there/a.js"),
        (rollout.main, [*WALK, "--video", "/dev/full/a.mp4"], "Expected a place where files can"),
        (compare.main, [*COMPARE, "--sweep", "nan"], "Invalid sweep: nan. Expected a number"),
        (compare.main, [*COMPARE, "--threshold", "nan"], "Invalid threshold: nan"),
        (compare.main, [*COMPARE, "--samples", "1000000000000"], "Invalid samples: 1000000000000"),
        (compare.main, [*COMPARE, "--confidence", "1.5"], "Invalid confidence: 1.5"),
        (compare.main, [*COMPARE, "--out", f"{NOWHERE}.html"], "Invalid out: '/dev/null/there.htm"),
        (measure, ["--num-envs", "0"], "Invalid num_envs: 0. Expected a whole number from 1"),
        (measure, ["--rounds", "0"], "Invalid rounds: 0. Expected a whole number from 1"),
        (measure, ["--robots", "horse"], "Unknown robot 'horse'"),
        (measure, ["--out", NOWHERE], "Invalid out: '/dev/null/there'"),
        (show, ["--jobs", "0"], "Invalid jobs: 0. Expected a whole number from 1"),
        (show, ["--video-seconds", "nan"], "Invalid video_seconds: nan"),
        (show, ["--layers", "magic"], "Unknown action layer 'magic'"),
        (show, ["--out", NOWHERE], "Invalid out: '/dev/null/there'"),
        (sweeps, ["none.toml", "--workers", "0"], "Invalid workers: 0"),
        (sweeps, ["none.toml"], "none.toml: cannot be read as a study"),
        (papers, ["--jobs", "0"], "Invalid jobs: 0"),
        (papers, ["--only", "nothing"], "'nothing'"),
        (papers, ["--out", NOWHERE], "Invalid out: '/dev/null/there'"),
        (train, ["--num-envs", "1" + "0" * 12], "Invalid num_envs: 1000000000000"),
        (train, ["--env-args", '{"env_id": "a"}'], "no 'env_id', which has an option"),
        (train, ["--ppo.n-steps", "1" + "0" * 12], "ppo.n_steps"),
        (train, ["--ppo.hidden", "1" + "0" * 9], "ppo.hidden"),
        (train, ["--eval.episodes", "1" + "0" * 12], "Invalid eval.episodes: 1000000000000"),
        (train, ["--out", f"{NOWHERE}/run"], "Invalid out: '/dev/null/there/run'"),
        (soaks, ["--env", "fbid_gym/Moon-v0"], "Unknown environment 'fbid_gym/Moon-v0'. Valid ch"),
        (soaks, ["--env", "CartPole-v1"], "Expected what CartPole-v1 takes"),
        (
            soaks,
            ["--env", "no module:Moon-v0"],
            "Invalid module of the environment: 'no module'. Ex",
        ),
        (rollout.main, [*WALK, "--register", ".here"], "Invalid register: '.here'. Expected a mo"),
        (rollout.main, [*WALK, "--action-layer", "magic"], "Unknown action layer 'magic'. Valid c"),
        (rollout.main, [*WALK, "--env-args", '{"robot": "horse"}'], "Unknown robot 'horse'. Valid"),
        (rollout.main, [*WALK, "--env-args", '{"gait": "hop"}'], "Unknown gait 'hop'. Valid choic"),
        (
            rollout.main,
            [*WALK, "--episodes", "-3"],
            "Invalid episodes: -3. Expected a whole number",
        ),
        (rollout.main, [*WALK, "--seed", "-1"], "Invalid seed: -1. Expected a whole number from 0"),
        (rollout.main, [*WALK, "--video-seconds", "-1"], "Invalid video_seconds: -1.0. Expected a"),
    ],
)
def test_nonsense_is_one_line(main, arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert list(tmp_path.iterdir()) == []
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1
    assert message in captured.err and "Traceback" not in captured.out + captured.err


@pytest.mark.parametrize("module", ["fbid_gym.envs", "fbid_gym.compile_all", "train.recipes.zoo"])
def test_what_takes_no_arguments_does_nothing_with_any(module):
    done = subprocess.run(
        [sys.executable, "-m", module, "--nonsense"],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith("error: unrecognized arguments: --nonsense\n")
