"""A study names trainings, each once, and what is wrong with a file is said in one line."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError, RunError
from tests.batches import begun
from train import sweep
from train.recipes import config_for
from train.runs.command_line import command, parse
from train.runs.endpoints import register
from train.runs.opening import open_run
from train.runs.robots import with_robots
from train.runs.study import arms, check_cells, read_study
from train.runs.training import training_job
from train.sweep import SweepConfig, main, standing, unfinished

STUDIES = sorted((Path(__file__).parents[3] / "studies").glob("*.toml"))
WALK = "fbid_gym/QuadrupedWalk-v0"
ARM = f'[[arms]]\nname = "a"\nenv = "{WALK}"\naction_layer = "torque"\n'
SECOND = ARM.replace('"a"', '"b"')
ZERO = ARM.replace('"a"', '"z"') + 'policy = "zero"\n'


def write(folder, text):
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def fill(folder, steps, evaluated):
    """Write the curves of a run."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "progress.csv").write_text(f"steps,return_mean\n{steps},3\n")
    rows = "".join(f"{at},3,1\n" for at in evaluated)
    (folder / "evaluations.csv").write_text(f"steps,return_mean,survival\n{rows}")


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_the_studies_of_the_repository_name_what_there_is(path, tmp_path):
    for cell in (arm.cells[-1] for arm in arms(read_study(path, tmp_path)) if not arm.policy):
        assert cell.config.env in ENVIRONMENTS and cell.config.action_layer in LAYERS
        # A job is started by its command line, which has to say all of it.
        command = training_job(cell.name, cell.config).command
        assert parse(list(command[3:]), cell.config.algorithm) == cell.config


@pytest.mark.slow
@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_arm_can_take_a_step(path, tmp_path):
    configs = [cell.config for cell in read_study(path, tmp_path).cells]
    for config in {repr((each.env, each.make_args())): each for each in configs}.values():
        envs = begun(config.env, 1, num_threads=1, **config.make_args())
        reward = envs.step(np.zeros(envs.action_space.shape))[1]
        envs.close()
        assert np.isfinite(reward).all()


def test_studies_that_share_a_folder_mean_the_same_by_a_training():
    cells = [cell for path in STUDIES for cell in read_study(path).cells]
    by_folder = {cell.config.folder: cell for cell in cells}
    assert len(by_folder) < len(cells)  # some are shared
    assert all(cell == by_folder[cell.config.folder] for cell in cells)


def test_cells_are_arms_times_seeds_seed_by_seed(tmp_path):
    """Settings of an arm go before those of the study, and are checked together with them."""
    text = (
        f'title = "T"\nreference = "b c"\nseeds = [0, 3]\nnum_envs = 200\nenv = "{WALK}"\n'
        f'action_layer = "joint_position"\n{ARM}total_steps = 1000\n'
        "ppo = { hidden = [8], n_steps = 12, batch_size = 1200 }\neval = { every = 9 }\n"
        '[[arms]]\nname = "b c"\n'  # takes the layer of every arm, which the first does not
        'layer_options = { reference = "home" }\nseeds = [3, 5]\nnum_envs = 512\n'
    )
    study = read_study(write(tmp_path, f"eval = {{ every = 100, episodes = 7 }}\n{text}"), tmp_path)
    assert (study.name, study.title, study.reference, study.page) == ("mine", "T", "b c", "mine")
    cells = [(cell.arm, cell.config.seed) for cell in study.cells]
    assert cells == [("a", 0), ("a", 3), ("b c", 3), ("b c", 5)]
    first, _, third, _ = (cell.config for cell in study.cells)
    usual = config_for(WALK, "torque")
    ppo = replace(usual.ppo, hidden=(8,), n_steps=12, batch_size=1200)
    own = {"ppo": ppo, "eval": replace(usual.eval, every=9, episodes=7), "num_threads": 1}
    own |= {"total_steps": 1000, "num_envs": 200, "out": tmp_path / "QuadrupedWalk-v0-a-s0"}
    assert first == replace(usual, **own)
    assert (first.action_layer, third.action_layer) == ("torque", "joint_position")
    assert third.out == tmp_path / "QuadrupedWalk-v0-b_c-s3"
    assert third.ppo == config_for(WALK, "joint_position", {"reference": "home"}).ppo
    assert read_study(write(tmp_path, f'runs = "kept"\n{ARM}')).runs == tmp_path / "kept"


def test_arms_may_say_what_learns_and_on_which_robot(tmp_path):
    """What the study says of an algorithm for every arm is for those that learn by it."""
    text = "total_steps = 2048\nsac = { tau = 0.1 }\nppo = { gamma = 0.9 }\n"
    text += f'{ARM}robot = "my dog/robot.toml"\nfeet = ["a", "b"]\n'
    text += f'{SECOND}algorithm = "sac"\nsac = {{ hidden = [8] }}\n'
    one, other = (cell.config for cell in read_study(write(tmp_path, text), tmp_path).cells)
    assert (one.algorithm, one.ppo.gamma, one.sac) == ("ppo", 0.9, None)
    assert (one.robot, one.feet) == ("my dog/robot.toml", ("a", "b"))
    assert (other.algorithm, other.sac.tau, other.sac.hidden, other.ppo) == ("sac", 0.1, (8,), None)
    assert other.num_envs == config_for(WALK, "torque", algorithm="sac").num_envs
    for config in (one, other):
        words = training_job("b", config).command
        assert words[1:3] == ("-m", f"train.{config.algorithm}")
        assert parse(list(words[3:]), config.algorithm) == config
        words = shlex.split(command(config))
        assert words[:3] == ["python", "-m", f"train.{config.algorithm}"]
        assert parse(words[3:], config.algorithm) == replace(config, num_threads=0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seeds = [", "is no TOML"),
        ("arms = 3", "has no arms"),
        (f"reference = 'c'\n{ARM}", "Unknown reference 'c' of the study. Valid choices: a."),
        (f"runs = 'a/b'\n{ARM}", "runs is 'a/b'. Expected the name of a folder beside it."),
        (f"colour = 1\n{ARM}", "Unknown setting 'colour' of study 'mine'. Valid choices: total"),
        (f"{ARM}speed = 1", "Unknown setting 'speed' of arm 'a'. Nearest of 21 choices: seeds"),
        (f"{ARM}ppo = {{ lr = 1 }}", "Unknown setting 'lr' of arm 'a'. Valid choices: lear"),
        (f"{ARM}{ARM}", "QuadrupedWalk-v0, a, seed 0 is there twice. Expected each cell once."),
        (f"{ARM}seeds = []", "seeds of arm 'a' are []. Expected a list."),
        (f"seeds = [-1]\n{ARM}", "Invalid seed of arm 'a': -1. Expected a whole number from 0"),
        (f"{ARM}env_args = 3", "env_args of arm 'a' is 3. Expected a table."),
        (f"{ARM}robots = []", "Invalid robots of arm 'a': []. Expected at least one."),
        (f"{ARM}robots = ['zoo:7', 'zoo:biped:990-1000']", "'zoo:biped:1000'. Expected seeds bel"),
        (f"{ARM}sac = {{ tau = 0.1 }}", "setting of arm 'a': 'sac'. Expected those of 'ppo'"),
        (f"{ARM}recipe = 'fast'", "Unknown recipe 'fast'. Valid choices: balance, walk, none."),
        (ARM.replace('"a"', '"../a"'), "arm '../a' cannot name a folder."),
        (f"{ZERO}ppo = {{ gamma = 0.9 }}", "'ppo'. Expected none beside policy 'zero', which"),
        (f"{ZERO}seeds = [0]", "'seeds'. Expected none beside policy 'zero', which learns nothing"),
        (ZERO.replace("zero", "best"), "Invalid policy: 'best'. Expected zero, or proportional:"),
        (ZERO.replace("zero", ""), "Invalid policy: ''. Expected zero, or proportional:GAIN"),
        (ZERO.replace('"zero"', "3"), "policy of arm 'z' is 3. Expected a name."),
        (ZERO.replace("zero", "proportional:x"), "gain of a proportional law: 'x'. Expected a num"),
        (ZERO.replace("zero", "proportional:6"), "Invalid layer of a proportional law: 'torque'"),
        (ZERO, "has no arm that learns. Expected one at least."),
        (f"{ARM}{ZERO}{ZERO}", "QuadrupedWalk-v0, z is there twice. Expected each cell once."),
        (ARM + ZERO.replace('"z"', '"a"'), "QuadrupedWalk-v0, a is there twice."),
    ],
)
def test_what_is_wrong_with_a_study_is_said(text, message, tmp_path):
    with pytest.raises(FbidError, match=re.escape(message)):
        read_study(write(tmp_path, text))


def test_an_arm_may_learn_nothing(tmp_path):
    """It is an arm as the others, that may be the reference and asked about, and is not trained."""
    law = ZERO.replace('"z"', '"k"').replace("torque", "com_wrench")
    text = f'reference = "z"\nseeds = [0, 1]\neval = {{ episodes = 7 }}\n{ZERO}{ARM}'
    text += law.replace("zero", "proportional:24") + ENDPOINT.replace('"b"', '"k"')
    study = read_study(write(tmp_path, text), tmp_path)
    assert [cell.arm for cell in study.cells] == ["a", "a"] and study.reference == "z"
    laws = [("z", "zero"), ("k", "proportional:24")]
    assert [(cell.arm, cell.policy) for cell in study.unlearnt] == laws
    assert [(arm.name, arm.policy) for arm in arms(study)] == [("a", ""), *laws]
    assert [len(arm.cells) for arm in arms(study)] == [2, 1, 1]
    assert study.unlearnt[0].config.eval.episodes == 7
    assert (standing(study).row_count, study.endpoints[0].against) == (2, "k")


def test_a_dry_run_shows_where_the_study_stands_and_trains_nothing(tmp_path, capsys):
    path = write(tmp_path, f"seeds = [0, 1]\n{ARM}total_steps = 1000")
    study, done = read_study(path, tmp_path / "out"), tmp_path / "out" / "QuadrupedWalk-v0-a-s0"
    fill(done, 1200, [0])
    assert [cell.config.seed for cell in unfinished(study)] == [0, 1]  # not evaluated at its end
    fill(done, 1200, [0, 1200])
    assert [cell.config.seed for cell in unfinished(study)] == [1]
    assert main(SweepConfig(path, tmp_path / "out", dry_run=True)) == 0
    text = capsys.readouterr().out
    assert "done" in text and "not begun" in text
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
    assert [cell.arm for cell in unfinished(read_study(path, out))] == ["broken"]
    text = capsys.readouterr().out
    assert "failed" in text and "wings" in text
    curve = out / "QuadrupedWalk-v0-a-s0" / "progress.csv"
    kept = curve.read_bytes()
    longer = write(tmp_path, path.read_text().replace("= 64", "= 128").replace(broken, ""))
    assert main(SweepConfig(longer, out, workers=1)) == 0
    after = curve.read_bytes()
    assert after.startswith(kept) and len(after) > len(kept)
    assert main(SweepConfig(longer, out, workers=1)) == 0
    assert curve.read_bytes() == after and standing(read_study(longer, out)).row_count == 1


def test_a_sweep_with_a_job_that_failed_has_not_succeeded(tmp_path, monkeypatch):
    """Not even where its tables are at their end, as when the disk was full after the last row."""
    path = write(tmp_path, f"{ARM}total_steps = 1000")
    study = read_study(path, tmp_path / "out")

    def run_jobs(jobs, *args, **options):
        fill(study.cells[0].config.folder, 1000, [0, 1000])
        return jobs

    monkeypatch.setattr(sweep, "run_jobs", run_jobs)
    assert main(SweepConfig(path, tmp_path / "out")) == 1 and unfinished(study) == []


def test_a_folder_of_another_training_is_not_taken_for_done(tmp_path):
    """It may well have taken as many steps; but threads of torch may be others."""
    path, out = write(tmp_path, f"{ARM}total_steps = 1000"), tmp_path / "out"
    study = read_study(path, out)
    config = study.cells[0].config
    with open_run(replace(config, num_threads=0, torch_threads=5)) as run:
        run.begin()
    fill(config.folder, 1000, [0, 1000])
    check_cells(study)
    assert main(SweepConfig(path, out, dry_run=True)) == 0
    other = write(tmp_path, f"{ARM}total_steps = 1000\nppo = {{ gamma = 0.5 }}")
    for dry_run in (True, False):
        with pytest.raises(RunError, match="the study says: it says ppo.gamma 0.5 instead of"):
            main(SweepConfig(other, out, dry_run=dry_run))
    with open_run(replace(config, seed=77, overwrite=True)) as run:
        run.begin()
    with pytest.raises(RunError, match="is not what the study says: it says seed"):
        check_cells(study)


ENDPOINT = '[[endpoints]]\nmeasure = "falls"\narm = "a"\nagainst = "b"\n'


def test_what_a_study_is_asked_cannot_change_once_it_has_begun(tmp_path):
    """Nor can it be asked something then; before, and about fewer steps of the same, it can."""
    asked = read_study(write(tmp_path, ENDPOINT + ARM + SECOND), tmp_path / "out")
    assert [each.env for each in asked.endpoints] == [WALK]
    register(asked.name, asked.runs, asked.endpoints)
    check_cells(asked)
    for other in (ENDPOINT.replace("falls", "slip"), ENDPOINT * 2, ""):
        with pytest.raises(RunError, match="began with other endpoints"):
            check_cells(read_study(write(tmp_path, other + ARM + SECOND), tmp_path / "out"))
    late = read_study(write(tmp_path, ENDPOINT + ARM + SECOND), tmp_path / "late")
    check_cells(late)
    folder = late.cells[0].config.folder
    folder.mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    with pytest.raises(RunError, match="began without endpoints"):
        check_cells(late)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ENDPOINT * 4, "has 4 endpoints. Expected 3 at most"),
        (ENDPOINT.replace("falls", "luck"), "'luck'.*return_mean"),
        (ENDPOINT.replace('"b"', '"c"'), "'c'.*a, b"),
        (ENDPOINT.replace('arm = "a"', ""), "endpoint without arm"),
        ("endpoints = 3\n", "no list of tables"),
    ],
)
def test_what_is_wrong_with_an_endpoint_is_said(text, message, tmp_path):
    with pytest.raises(FbidError, match=message):
        read_study(write(tmp_path, text + ARM + SECOND))


def test_an_arm_learns_with_several_robots_and_all_meet_others(tmp_path):
    others = '[transfer]\nunseen = ["zoo:quadruped:1000-1001"]\ngain = 4\n'
    robots = ARM + 'robots = ["go1", "zoo:quadruped:0-3"]\n'
    study = read_study(write(tmp_path, others + robots), tmp_path)
    assert study.transfer == (("zoo:quadruped:1000-1001",), 4, 8)
    (cell,) = study.cells
    assert cell.config.robots == ("go1", "zoo:quadruped:0-3")
    with open_run(with_robots(cell.config)) as run:
        run.begin()
    check_cells(study)  # the folder is of these robots
    with pytest.raises(RunError, match="not what the study says"):
        check_cells(read_study(write(tmp_path, ARM + 'robots = ["go1"]\n'), tmp_path))
    for text, message in (
        ("[transfer]\ngain = 4\n" + ARM, "with robots, `unseen`"),
        (others.replace("gain", "gains") + ARM, "'gains'.*unseen, gain, episodes"),
        (others.replace("4", '"4"') + ARM, "gain of transfer"),
        (ARM + "robots = 3\n", "robots of arm 'a' are 3"),
        (ARM + 'robot = "go1"\nrobots = ["go1"]\n', "none beside --robot"),
    ):
        with pytest.raises(FbidError, match=message):
            read_study(write(tmp_path, text))
