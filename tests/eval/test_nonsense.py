"""Nonsense on command lines: one line on standard error, exit status 2, and nothing is written."""

import runpy
import shlex
import sys
from pathlib import Path

import pytest

from eval import compare, demo, layers, rollout
from eval.papers.__main__ import main as papers
from eval.robustness.__main__ import main as robustness
from eval.tools import soak
from eval.tools.bench import __main__ as bench
from eval.zero_actions.__main__ import main as zero_actions
from fbid_gym.exit_status import exit_status
from tests.eval.conftest import ENV_ID, make_policy, zero_policy
from train import ppo, sweep
from train.command import run_command
from train.runs.command_line import parse

WALK, BALANCE = "fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedBalance-v0"
ZERO = f"--zero-action --env {WALK}"
DEEP = '{"a":' * 3000 + "1" + "}" * 3000
NOWHERE = "/dev/null/there"
HUGE = "1" + "0" * 12
STUDY = f'[[arms]]\nname = "one"\nenv = "{WALK}"\naction_layer = "torque"\n'


def command(config, work):
    """The command line of a module that reads it where it is started."""
    return lambda arguments: run_command("here", config, work, arguments)


def train(arguments):
    return exit_status(lambda: print(ppo.main(parse(arguments))))


COMMANDS = {
    rollout.main: [
        ("", "Invalid source: None. Expected a run folder or policy, or --zero-action."),
        ("nowhere", "nowhere: no policy here"),
        ("--zero-action", "Invalid --env: None. Expected an environment id"),
        ("--zero-action --env fbid_gym/No-v0", "Unknown environment 'fbid_gym/No-v0'. Valid choic"),
        ("--zero-action --env CartPole-v1", "Invalid env: 'CartPole-v1'"),
        (f"own --env {ENV_ID}", "Expected neither beside a policy"),
        ("own --env-args [1]", "Invalid env_args: '[1]'. Expected a JSON object"),
        ("""own --env-args '{"nonsense": 1}'""", f"Expected what {ENV_ID} takes"),
        (f"{ZERO} --env-args '{DEEP}'", "nested too deeply"),
        (f"""{ZERO} --env-args '{{"physics_hz": 1e999}}'""", "Invalid physics_hz: inf"),
        (f"""{ZERO} --env-args '{{"env_id": "a"}}'""", "keyword argument 'env_id'"),
        (f"""{ZERO} --env-args '{{"gait": "hop"}}'""", "Unknown gait 'hop'. Valid choic"),
        (f"{ZERO} --action-layer magic", "Unknown action layer 'magic'. Valid c"),
        (f"{ZERO} --episodes 0", "Invalid episodes: 0. Expected a whole number from 1 to 1,000,0"),
        (f"{ZERO} --seed -1", "Invalid seed: -1. Expected a whole number from 0"),
        (f"{ZERO} --video-seconds 1e300", "Invalid video_seconds: 1e+300"),
        (f"{ZERO} --register .here", "Invalid register: '.here'. Expected a mo"),
        (f"{ZERO} --out x.txt", "Invalid out: 'x.txt'. Expected a file name ending in .json"),
        (f"{ZERO} --out {NOWHERE}/a.json", "Invalid out: '/dev/null/there/a.js"),
        (f"{ZERO} --video /dev/full/a.mp4", "Expected a place where files can"),
        (f"{ZERO} --robot nodog", "Unknown robot 'nodog'. Valid choices: biped"),
        (f"{ZERO} --robots g1 goat", "Unknown robot 'goat'. Valid choices: biped"),
        (f"{ZERO} --feet a", "Invalid --feet: 'a'. Expected none without --robot"),
        (f"{ZERO} --robot go1 --feet a", "Expected none for 'go1', which has its"),
        (f"""{ZERO} --env-args '{{"robot": "g1"}}' --robot go1""", "Invalid robot in --env-args"),
    ],
    compare.main: [
        ("own own", "given twice"),
        ("own --out x.pdf", "Invalid out: 'x.pdf'. Expected a file name ending in .html"),
        ("own --confidence 95", "Invalid confidence: 95.0. Expected a number from 0.01"),
        ("own --reference cat", "Unknown reference 'cat'. Valid choices: base acceleration"),
        ("own --pushes nan", "Invalid pushes: nan. Expected a number"),
        ("own --samples 1000000000000", "Invalid samples: 1000000000000"),
    ],
    robustness: [
        (f"{ZERO[:13]} torque --env {WALK} --factors wind", "Unknown factor 'wind'. Valid choices"),
        (f"{ZERO[:13]} torque --env {WALK} --seconds nan", "Invalid seconds: nan. Expected a posi"),
        ("", "Invalid runs: []. Expected run folders, exported policies or studies"),
        ("--zero-action magic", "Unknown action layer 'magic'"),
        ("mine.toml", "no run of the study has finished"),
        ("walk balance", "Compare runs of one environment at a time"),
        ("walk walk", "given twice"),
        (f"walk --env {BALANCE}", f"Invalid --env: '{BALANCE}'. Expected that of the runs"),
        ("small", "observation"),
    ],
    zero_actions: [
        ("flying", "Unknown table 'flying'. Valid choices: walking, terrain, rates, motors, "),
        ("walking --seconds 1e300", "Invalid seconds: 1e+300"),
        ("walking --push -50", "Invalid push: -50.0. Expected a number from 0 to"),
        ("walking --robots", "Invalid robots: []. Expected one or more"),
        ("walking --robots horse", "Unknown robot 'horse'. Valid choices: biped, quad"),
        ("walking --layers torque magic", "action layer 'magic'. Valid choices: tor"),
        ("terrain --only terrain=lava", "Unknown terrain 'lava'. Valid choices: slopes, "),
        ("terrain --only slopes", "Unknown column 'slopes' in --only. Valid choices: robo"),
        ("zoo --robots -1", "Invalid seed of a robot: '-1'. Expected a whole number from"),
        ("noise --push 1", "Invalid push: 1.0. Expected none for the table 'noise'"),
        ("noise --robots 'no module:Moon-v0'", "Invalid module of the environment: 'no mod"),
        ("walking --csv a.csv --write-docs", "Invalid csv: 'a.csv'. Expected none with"),
    ],
    command(bench.BenchConfig, bench.main): [
        ("--num-envs 0", "Invalid num_envs: 0. Expected a whole number from 1"),
        (f"--out {NOWHERE}", "Invalid out: '/dev/null/there'"),
    ],
    command(demo.DemoConfig, demo.main): [
        ("--jobs 0", "Invalid jobs: 0. Expected a whole number from 1"),
        ("--layers magic", "Unknown action layer 'magic'"),
    ],
    command(sweep.SweepConfig, sweep.main): [
        ("none.toml --workers 0", "Invalid workers: 0"),
        ("none.toml", "none.toml: cannot be read as a study"),
    ],
    layers.main: [
        ("no.py", "Invalid file: 'no.py'. Expected the path of a Python file"),
        ("--against magic", "Unknown action layer 'magic'"),
        ("--against", "Invalid against: (). Expected one or more"),
        ("--out page.txt", "Invalid out: 'page.txt'"),
        ("--only task=fly", "Unknown task 'fly'. Valid choices: stand pushed by"),
        ("--episodes 0", "Invalid episodes: 0"),
    ],
    papers: [("--jobs 0", "Invalid jobs: 0"), ("--only nothing", "'nothing'")],
    train: [
        (f"--num-envs {HUGE}", "Invalid num_envs: 1000000000000"),
        ("""--env-args '{"env_id": "a"}'""", "no 'env_id', which has an option"),
        (f"--ppo.n-steps {HUGE}", "ppo.n_steps"),
        (f"--eval.episodes {HUGE}", "Invalid eval.episodes: 1000000000000"),
        (f"--out {NOWHERE}/run", "Invalid out: '/dev/null/there/run'"),
    ],
    command(soak.SoakConfig, soak.main): [
        ("--env fbid_gym/Moon-v0", "Unknown environment 'fbid_gym/Moon-v0'. Valid ch"),
        ("--env CartPole-v1", "Expected what CartPole-v1 takes"),
    ],
}


@pytest.mark.parametrize("main", COMMANDS)
def test_nonsense_is_one_line(main, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(STUDY)
    make_policy(0.5).save(Path("own"))
    for name, env_id, sizes in (
        ("walk", WALK, (62, 12)), ("small", WALK, (3, 2)), ("balance", BALANCE, (69, 16)),
    ):  # fmt: skip
        zero_policy(env_id, sizes).save(Path(name))
    before = sorted(tmp_path.rglob("*"))
    for words, message in COMMANDS[main]:
        assert main(shlex.split(words)) == 2, words
        captured = capsys.readouterr()
        assert captured.err.startswith("error: ") and captured.err.count("\n") == 1, words
        assert message in captured.err and "Traceback" not in captured.out + captured.err
        assert sorted(tmp_path.rglob("*")) == before, words


@pytest.mark.parametrize(
    "module", ["fbid_gym.envs.__main__", "fbid_gym.compile_all", "train.recipes.zoo"]
)
def test_what_takes_no_arguments_does_nothing_with_any(module, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [module, "--nonsense"])
    monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    told = capsys.readouterr()
    assert (ended.value.code, told.out) == (2, "")
    assert told.err.endswith("error: unrecognized arguments: --nonsense\n")
