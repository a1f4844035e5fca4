"""A study names trainings, each once, and what is wrong with a file is said in one line."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym  # noqa: F401
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError, RunError
from train import sweep
from train.recipes import config_for
from train.runs.command_line import command, parse
from train.runs.opening import open_run
from train.runs.study import check_cells, read_study
from train.runs.training import training_job
from train.sweep import SweepConfig, main, standing, unfinished

STUDIES = sorted((Path(__file__).parents[3] / "studies").glob("*.toml"))
WALK = "fbid_gym/QuadrupedWalk-v0"
ARM = f'[[arms]]\nname = "a"\nenv = "{WALK}"\naction_layer = "torque"\n'


def write(folder, text, name="mine"):
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_the_studies_of_the_repository_name_what_there_is(path, tmp_path):
    study = read_study(path, tmp_path)
    assert study.cells
    for cell in study.cells:
        assert cell.config.env in ENVIRONMENTS and cell.config.action_layer in LAYERS
        # A job is started by its command line, which has to say all of it.
        command = training_job(cell.name, cell.config).command
        assert parse(list(command[3:]), cell.config.algorithm) == cell.config


@pytest.mark.slow
@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_arm_can_take_a_step(path, tmp_path):
    for config in {cell.arm: cell.config for cell in read_study(path, tmp_path).cells}.values():
        envs = gym.make_vec(config.env, num_envs=1, num_threads=1, **config.make_args())
        envs.reset(seed=0)
        reward = envs.step(np.zeros(envs.action_space.shape))[1]
        envs.close()
        assert np.isfinite(reward).all()


def test_a_study_says_whom_its_arms_are_set_against_and_where_it_is_told(tmp_path):
    second = ARM.replace('"a"', '"b"')
    study = read_study(write(tmp_path, ARM + second))
    assert (study.reference, study.page) == ("a", "mine")
    said = read_study(write(tmp_path, f'reference = "b"\npage = "study"\n{ARM}{second}'))
    assert (said.reference, said.page) == ("b", "study")


def test_runs_lie_where_they_are_wanted_else_where_the_study_says(tmp_path):
    (usual,) = read_study(write(tmp_path, ARM)).cells
    assert usual.config.folder.parent == Path("runs") / "mine"
    path = write(tmp_path, f'runs = "kept"\n{ARM}')
    (said,), (wanted,) = read_study(path).cells, read_study(path, tmp_path / "out").cells
    assert said.config.folder.parent == tmp_path / "kept"
    assert wanted.config.folder.parent == tmp_path / "out"


def test_studies_that_share_a_folder_mean_the_same_by_a_training():
    cells = [cell for path in STUDIES for cell in read_study(path).cells]
    by_folder = {cell.config.folder: cell for cell in cells}
    assert len(by_folder) < len(cells)  # some are shared
    for cell in cells:
        assert cell == by_folder[cell.config.folder]


def test_cells_are_arms_times_seeds_seed_by_seed(tmp_path):
    text = (
        f'title = "T"\nseeds = [0, 3]\n{ARM}total_steps = 1000\nppo = {{ hidden = [8] }}\n'
        f'[[arms]]\nname = "b c"\nenv = "{WALK}"\naction_layer = "joint_position"\n'
        'layer_options = { reference = "home" }\nseeds = [3, 5]\n'
    )
    study = read_study(write(tmp_path, text), tmp_path / "out")
    assert (study.name, study.title) == ("mine", "T")
    assert [(cell.arm, cell.config.seed) for cell in study.cells] == [
        *(("a", 0), ("a", 3), ("b c", 3), ("b c", 5)),
    ]
    first, _, third, _ = (cell.config for cell in study.cells)
    usual = config_for(WALK, "torque")
    assert first == replace(
        usual,
        total_steps=1000,
        ppo=replace(usual.ppo, hidden=(8,)),
        num_threads=1,
        out=tmp_path / "out" / "QuadrupedWalk-v0-a-s0",
    )
    assert third.out == tmp_path / "out" / "QuadrupedWalk-v0-b_c-s3"
    assert third.ppo == config_for(WALK, "joint_position", {"reference": "home"}).ppo


def test_settings_of_an_arm_go_before_those_of_the_study(tmp_path):
    text = (
        f"total_steps = 5000\neval = {{ every = 100, episodes = 7 }}\n{ARM}eval = {{ every = 9 }}"
    )
    (cell,) = read_study(write(tmp_path, text)).cells
    assert cell.config.total_steps == 5000
    assert (cell.config.eval.every, cell.config.eval.episodes) == (9, 7)


def test_settings_of_study_and_arm_are_checked_together(tmp_path):
    text = f"num_envs = 200\n{ARM}ppo = {{ n_steps = 12, batch_size = 1200 }}"
    (cell,) = read_study(write(tmp_path, text)).cells
    assert (cell.config.num_envs, cell.config.batch_size) == (200, 1200)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seeds = [", "is no TOML"),
        ("seeds = [0]", "has no arms. Expected one [[arms]] table for each."),
        ("arms = 3", "has no arms"),
        (f"reference = 'c'\n{ARM}", "Unknown reference 'c' of the study. Valid choices: a."),
        (f"page = '../x'\n{ARM}", "page is '../x'. Expected the name of one of docs/."),
        (f"runs = 'a/b'\n{ARM}", "runs is 'a/b'. Expected the name of a folder beside it."),
        (f"colour = 1\n{ARM}", "Unknown setting 'colour' of study 'mine'. Valid choices: total"),
        (f"{ARM}speed = 1", "Unknown setting 'speed' of arm 'a'. Valid choices: name, env"),
        (f"{ARM}ppo = {{ lr = 1 }}", "Unknown setting 'lr' of arm 'a'. Valid choices: lear"),
        (f"{ARM}ppo = 3", "arm 'a': ppo is 3. Expected a table."),
        (f"{ARM}{ARM}", "QuadrupedWalk-v0, a, seed 0 is there twice. Expected each cell once."),
        (f"seeds = [1, 1]\n{ARM}", "a, seed 1 is there twice"),
        (f"{ARM}seeds = []", "seeds of arm 'a' are []. Expected a list."),
        (f"seeds = [-1]\n{ARM}", "Invalid seed of arm 'a': -1. Expected a whole number from 0"),
        (f"seeds = [1, 1.0]\n{ARM}", "a, seed 1 is there twice"),
        (f"{ARM}env_args = 3", "env_args of arm 'a' is 3. Expected a table."),
        (f"{ARM}layer_options = 'x'", "layer_options of arm 'a' is 'x'. Expected a table."),
        (f"{ARM}total_steps = 0", "Invalid total_steps: 0."),
        (f"{ARM}feet = [1]", "feet of arm 'a' are [1]"),
        (f"{ARM}algorithm = 'dqn'", "Unknown algorithm 'dqn'. Valid choices: ppo, sac"),
        (f"{ARM}sac = {{ tau = 0.1 }}", "setting of arm 'a': 'sac'. Expected those of 'ppo'"),
        ("a = " + "[" * 100_000, "mine.toml: is nested too deeply"),
        (f"{ARM}recipe = 'fast'", "Unknown recipe 'fast'. Valid choices: balance, walk, none."),
        ('[[arms]]\nname = "a"', "an arm without env. Expected one in each"),
        (ARM.replace('"a"', '"../a"'), "arm '../a' cannot name a folder."),
    ],
)
def test_what_is_wrong_with_a_study_is_said(text, message, tmp_path):
    with pytest.raises(FbidError, match=re.escape(message)):
        read_study(write(tmp_path, text))


def test_a_study_that_is_not_there_is_said(tmp_path):
    with pytest.raises(FbidError, match="cannot be read as a study"):
        read_study(tmp_path / "none.toml")


def test_a_dry_run_shows_where_the_study_stands_and_trains_nothing(tmp_path, capsys):
    path = write(tmp_path, f"seeds = [0, 1]\n{ARM}total_steps = 1000")
    done, begun = tmp_path / "out" / "QuadrupedWalk-v0-a-s0", tmp_path / "out" / "x"
    done.mkdir(parents=True)
    (done / "progress.csv").write_text("steps,return_mean\n1200,3\n")
    evaluations = done / "evaluations.csv"
    evaluations.write_text("steps,return_mean,survival\n0,3,1\n")
    study = read_study(path, tmp_path / "out")
    assert [cell.config.seed for cell in unfinished(study)] == [0, 1]  # not evaluated at its end
    evaluations.write_text("steps,return_mean,survival\n0,3,1\n1200,3,1\n")
    assert [cell.config.seed for cell in unfinished(study)] == [1]
    assert main(SweepConfig(path, tmp_path / "out", dry_run=True)) == 0
    text = capsys.readouterr().out
    assert "done" in text and "not begun" in text and not begun.exists()
    assert [path.name for path in (tmp_path / "out").iterdir()] == [done.name]


@pytest.mark.slow
def test_a_sweep_goes_on_where_it_was_and_says_what_failed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    small = "num_envs = 2\ntotal_steps = 64\nppo = { n_steps = 16, batch_size = 32 }\n"
    small += "eval = { every = 32, episodes = 2 }\n"
    short = ARM + "env_args = { episode_seconds = 1 }\n"
    broken = short.replace('"a"', '"broken"') + "layer_options = { wings = 2 }\n"
    path, out = write(tmp_path, f"{small}{short}{broken}"), tmp_path / "out"
    assert main(SweepConfig(path, out, workers=1)) == 1
    study = read_study(path, out)
    assert [cell.arm for cell in unfinished(study)] == ["broken"]
    text = capsys.readouterr().out
    assert "failed" in text and "wings" in text
    kept = (out / "QuadrupedWalk-v0-a-s0" / "progress.csv").read_bytes()
    longer = write(tmp_path, path.read_text().replace("= 64", "= 128").replace(broken, ""))
    assert main(SweepConfig(longer, out, workers=1)) == 0
    after = (out / "QuadrupedWalk-v0-a-s0" / "progress.csv").read_bytes()
    assert after.startswith(kept) and len(after) > len(kept)
    assert main(SweepConfig(longer, out, workers=1)) == 0
    assert (out / "QuadrupedWalk-v0-a-s0" / "progress.csv").read_bytes() == after
    assert standing(read_study(longer, out)).row_count == 1


def test_a_sweep_with_a_job_that_failed_has_not_succeeded(tmp_path, monkeypatch):
    """Not even where its tables are at their end, as when the disk was full after the last row."""
    path = write(tmp_path, f"{ARM}total_steps = 1000")
    folder = read_study(path, tmp_path / "out").cells[0].config.folder

    def run_jobs(jobs, *args, **options):
        folder.mkdir(parents=True)
        (folder / "progress.csv").write_text("steps,return_mean\n1000,3\n")
        rows = "steps,return_mean,survival\n0,3,1\n1000,3,1\n"
        (folder / "evaluations.csv").write_text(rows)
        return jobs

    monkeypatch.setattr(sweep, "run_jobs", run_jobs)
    assert main(SweepConfig(path, tmp_path / "out")) == 1
    assert unfinished(read_study(path, tmp_path / "out")) == []


def test_arms_may_name_a_robot_of_their_own(tmp_path):
    text = f'{ARM}robot = "dog/robot.toml"\nfeet = ["a", "b"]\n'
    cell = read_study(write(tmp_path, text), tmp_path).cells[0]
    assert (cell.config.robot, cell.config.feet) == ("dog/robot.toml", ("a", "b"))
    assert parse(list(training_job(cell.name, cell.config).command[3:])) == cell.config


def test_arms_may_say_what_learns(tmp_path):
    """What the study says of an algorithm for every arm is for those that learn by it."""
    second = ARM.replace('"a"', '"b"')
    text = (
        "total_steps = 2048\nsac = { tau = 0.1 }\nppo = { gamma = 0.9 }\n"
        f'{ARM}{second}algorithm = "sac"\n'
        "sac = { hidden = [8] }\n"
    )
    one, other = (cell.config for cell in read_study(write(tmp_path, text), tmp_path).cells)
    assert (one.algorithm, one.ppo.gamma, one.sac) == ("ppo", 0.9, None)
    assert (other.algorithm, other.sac.tau, other.sac.hidden, other.ppo) == ("sac", 0.1, (8,), None)
    assert other.num_envs == config_for(WALK, "torque", algorithm="sac").num_envs
    command = training_job("b", other).command
    assert command[1:3] == ("-m", "train.sac")
    assert parse(list(command[3:]), "sac") == other


def test_a_folder_of_another_training_is_not_taken_for_done(tmp_path, capsys):
    """It may well have taken as many steps."""
    path = write(tmp_path, f"{ARM}total_steps = 1000")
    config = read_study(path, tmp_path / "out").cells[0].config
    with open_run(config) as run:
        run.begin()
    (config.folder / "progress.csv").write_text("steps,return_mean\n1000,3\n")
    rows = "steps,return_mean,survival\n0,3,1\n1000,3,1\n"
    (config.folder / "evaluations.csv").write_text(rows)
    assert main(SweepConfig(path, tmp_path / "out", dry_run=True)) == 0
    other = write(tmp_path, f"{ARM}total_steps = 1000\nppo = {{ gamma = 0.5 }}")
    for dry_run in (True, False):
        with pytest.raises(RunError, match="the study says: it says ppo.gamma 0.5 instead of"):
            main(SweepConfig(other, tmp_path / "out", dry_run=dry_run))


def test_who_stops_a_sweep_sees_where_it_stands(tmp_path, monkeypatch, capsys):
    def run_jobs(jobs, *args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep, "run_jobs", run_jobs)
    with pytest.raises(KeyboardInterrupt):
        main(SweepConfig(write(tmp_path, ARM), tmp_path / "out"))
    said = capsys.readouterr().out
    assert "not begun" in said and "failed" not in said


def test_the_command_of_a_cell_is_the_cell(tmp_path):
    text = f'{ARM}robot = "my dog/robot.toml"\nfeet = ["a", "b"]\nppo = {{ gamma = 0.5 }}\n'
    cell = read_study(write(tmp_path, text), tmp_path).cells[0]
    words = shlex.split(command(cell.config))
    assert words[:3] == ["python", "-m", "train.ppo"]
    assert parse(words[3:]) == replace(cell.config, num_threads=0)


def test_a_run_of_a_study_may_have_begun_on_other_threads_of_torch(tmp_path):
    """By the command that the study's page gives, say, on a machine of many cores."""
    study = read_study(write(tmp_path, ARM), tmp_path / "runs")
    (first, *_) = study.cells
    with open_run(replace(first.config, num_threads=0, torch_threads=5)) as run:
        run.begin()
    check_cells(study)
    with open_run(replace(first.config, seed=77, overwrite=True)) as run:
        run.begin()
    with pytest.raises(RunError, match="is not what the study says: it says seed"):
        check_cells(study)
