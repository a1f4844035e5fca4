import json

import pytest
import stand_in

from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import RunError
from train.run_folder import open_run


def _checkpoint(run):
    run.checkpoint.mkdir()


def test_new_folder_records_what_was_asked_and_with_what(tmp_path):
    config = stand_in.config(tmp_path / "a" / "run")
    with open_run(config) as run:
        assert not run.resumes
        assert json.loads((run.path / "config.json").read_text()) == config.to_json()
        versions = json.loads((run.path / "versions.json").read_text())
    assert {"python", "packages", "commit", "platform"} <= set(versions)
    assert {"torch", "numpy", "mujoco", "stable-baselines3"} <= set(versions["packages"])


def test_same_run_resumes_another_is_refused(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config) as run:
        _checkpoint(run)
    with open_run(stand_in.config(tmp_path, total_steps=9999)) as run:
        assert run.resumes
    assert json.loads((tmp_path / "config.json").read_text())["total_steps"] == 9999
    with pytest.raises(RunError) as caught, open_run(stand_in.config(tmp_path, seed=4)):
        pass
    assert "seed: 3 in the folder, 4 asked" in str(caught.value)
    assert "--overwrite" in str(caught.value) and str(tmp_path) in str(caught.value)
    with open_run(stand_in.config(tmp_path, seed=4, overwrite=True)) as run:
        assert not run.resumes and not run.checkpoint.exists()
    assert json.loads((tmp_path / "config.json").read_text())["seed"] == 4


def test_without_a_checkpoint_everything_starts_anew_but_notes_stay(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config) as run:
        run.progress.write_text("steps\n1\n")
        (run.path / "policy.new").mkdir()
        (run.path / "notes.txt").write_text("mine")
    with open_run(config) as run:
        assert not run.resumes and not run.progress.exists()
        assert not (run.path / "policy.new").exists()
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_interrupted_replacement_of_a_checkpoint_resumes(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config) as run:
        (run.path / "checkpoint.old").mkdir()
    with open_run(config) as run:
        assert run.resumes


@pytest.mark.parametrize("overwrite", [False, True])
def test_folders_that_are_no_run_are_left_alone(tmp_path, overwrite):
    (tmp_path / "thesis.tex").write_text("years of work")
    with (
        pytest.raises(RunError, match=r"holds thesis\.tex but no config\.json, so it is not a run"),
        open_run(stand_in.config(tmp_path, overwrite=overwrite)),
    ):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]
    with (
        pytest.raises(RunError, match="is a file"),
        open_run(stand_in.config(tmp_path / "thesis.tex")),
    ):
        pass


@pytest.mark.parametrize("content", ["", '{"seed": ', "[]"])
def test_damaged_config(tmp_path, content):
    (tmp_path / "config.json").write_text(content)
    with (
        pytest.raises(RunError, match=r"config\.json: (not JSON|holds list)"),
        open_run(stand_in.config(tmp_path)),
    ):
        pass


def test_one_process_per_run(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config):
        with pytest.raises(RunError, match=r"is being trained by process \d+"), open_run(config):
            pass
    with open_run(config):
        pass


def test_other_versions_than_at_the_beginning_are_named(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config) as run:
        _checkpoint(run)
    with open_run(config) as run:
        assert run.changes == ()
    file = tmp_path / "versions.json"
    versions = json.loads(file.read_text())
    versions["packages"]["torch"] = "1.0"
    file.write_text(json.dumps(versions))
    with open_run(config) as run:
        assert len(run.changes) == 1 and run.changes[0].startswith("torch 1.0 when it began")
    file.write_text("{")
    with open_run(config) as run:
        assert run.changes == ("versions.json cannot be read",)


def test_what_the_arguments_of_the_environment_mean_is_kept(tmp_path):
    real = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "joint_position"}
    config = stand_in.config(tmp_path, **real)
    with open_run(config) as run:
        _checkpoint(run)
    file = tmp_path / "environment.json"
    began = json.loads(file.read_text())
    assert began == resolved_arguments(config.env, config.make_args())
    with open_run(config) as run:
        assert run.changes == ()
    # As a default that was changed since: the file stays as the run began, and it is said.
    began["layer_options"]["scale"] = 0.5
    file.write_text(json.dumps(began))
    with open_run(config) as run:
        assert run.changes == ("layer_options.scale 0.5 when it began, 0.3 now",)
    assert json.loads(file.read_text()) == began
    file.unlink()
    with open_run(config) as run:
        assert run.changes == ()


def test_of_foreign_environments_the_meaning_is_not_known(tmp_path):
    (tmp_path / "environment.json").write_text("left by a run that was killed at its beginning")
    with open_run(stand_in.config(tmp_path)):
        assert not (tmp_path / "environment.json").exists()
