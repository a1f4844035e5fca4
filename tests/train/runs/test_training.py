import stand_in

from train.ppo import main
from train.runs.config import EvaluationConfig
from train.runs.jobs import Progress
from train.runs.training import log_of, progress, standing, training_job


def test_progress_is_that_of_the_run_folder(tmp_path):
    config = stand_in.config(tmp_path / "run")
    assert training_job("a", config).progress() == Progress(0.0, "0 of 768 steps")
    main(stand_in.config(tmp_path / "run", total_steps=384), stand_in.make)
    share, note = progress(config)
    assert share == 0.5 and note.startswith("384 of 768 steps, return ") and note.endswith("%")


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
