import io
import os
from pathlib import Path

import pytest
import stand_in
from rich.console import Console

from fbid_gym.errors import RunError
from train.ppo import main
from train.runs.command_line import parse
from train.runs.config import EvaluationConfig, PPOConfig, TrainConfig
from train.runs.jobs import Progress, run_jobs
from train.runs.training import log_of, progress, standing, training_job


def test_the_command_is_the_training(tmp_path):
    config = stand_in.config(tmp_path / "here" / "a-s0")
    job = training_job("a", config)
    assert parse(list(job.command[3:])) == config
    assert job.log == tmp_path / "here" / "logs" / "a-s0.log"


def test_progress_is_that_of_the_run_folder(tmp_path):
    config = stand_in.config(tmp_path / "run")
    assert training_job("a", config).progress() == Progress(0.0, "0 of 768 steps")
    main(stand_in.config(tmp_path / "run", total_steps=384), stand_in.make)
    share, note = progress(config)
    assert share == 0.5 and note.startswith("384 of 768 steps, return ") and note.endswith("%")


def test_tables_of_something_else_are_one_clear_error(tmp_path):
    config = stand_in.config(tmp_path / "run")
    config.folder.mkdir()
    for text in ("colour\nred\n", "steps\nmany\n"):
        (config.folder / "progress.csv").write_text(text)
        with pytest.raises(RunError, match="run: its tables are not those of a training"):
            progress(config)


def test_where_a_training_is_is_said(tmp_path):
    config = stand_in.config(tmp_path / "run")
    assert standing(config).state == "not begun"
    log_of(config).parent.mkdir()
    log_of(config).write_text("run: step 0\nerror: the disk is full.\n")
    assert standing(config) == ("failed", "error: the disk is full.")
    log_of(config).write_text("run: 384/768 steps, errors fell\n")
    main(stand_in.config(tmp_path / "run", total_steps=384), stand_in.make)
    assert standing(config).state == "50%"
    main(config, stand_in.make)
    assert standing(config).state == "done"


def test_what_nobody_evaluates_is_done_when_its_policy_is_there(tmp_path):
    quiet = EvaluationConfig(every=0)
    config = stand_in.config(tmp_path / "run", eval=quiet, checkpoint_every=0)
    main(config, stand_in.make)
    assert standing(config).state == "done"
    # Killed between the last row and the last checkpoint, which the policy goes before.
    for name in ("policy", "checkpoint"):
        (config.folder / f"{name}.safetensors").unlink()
    assert standing(config).state == "99%"
    main(config, stand_in.make)
    assert standing(config).state == "done"


def test_a_training_that_is_refused_is_reported(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    console = Console(file=io.StringIO(), width=200)
    job = training_job("a", TrainConfig(action_layer="flying", out=tmp_path / "run"))
    assert run_jobs([job], 2, console) == [job]
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "a failed with status 2" in text
    assert "Unknown action layer 'flying'. Valid choices:" in text
    assert os.listdir(tmp_path) == ["logs"]


@pytest.mark.slow
def test_trainings_finish_side_by_side(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    jobs = [
        training_job(
            f"seed {seed}",
            TrainConfig(
                action_layer="joint_position",
                env_args={"episode_seconds": 1.0},
                seed=seed,
                total_steps=1024,
                num_envs=16,
                num_threads=1,
                ppo=PPOConfig(n_steps=16, batch_size=64),
                eval=EvaluationConfig(every=1024, episodes=2),
                out=tmp_path / f"s{seed}",
            ),
        )
        for seed in (0, 1)
    ]
    assert run_jobs(jobs, 2, Console(file=io.StringIO())) == []
    for job in jobs:
        share, note = job.progress()
        assert share == 1.0 and note.startswith("1024 of 1024 steps, return ")
