"""What a folder becomes when a run opens it: begun, continued, or left as it is."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import stand_in

from fbid_gym.bundles import save_bundle
from fbid_gym.envs.registered import resolved_arguments
from fbid_gym.errors import RunError
from train.ppo import main
from train.runs.config import EvaluationConfig
from train.runs.opening import continued, open_run


def _begin(config, *, checkpoint=False):
    """What a training of this configuration leaves that is killed early, or after a checkpoint."""
    with open_run(config) as run:
        run.begin()
        if checkpoint:
            save_bundle(run.folder.checkpoint, {}, {"x": np.zeros(1)})


def _contents(path):
    files = (file for file in path.rglob("*") if file.is_file() and file.name != ".lock")
    return {file: file.read_bytes() for file in files}


def _refused(config, message):
    """Nothing in the folder is changed by it."""
    before = _contents(config.folder)
    with pytest.raises(RunError, match=message), open_run(config):
        pass
    assert _contents(config.folder) == before


def _changes(config):
    with open_run(config) as run:
        return run.changes


def test_a_run_goes_on_with_the_threads_of_torch_that_it_began_with(tmp_path):
    """Whatever machine it goes on on, unless it is told otherwise, which is another run."""
    began = stand_in.config(tmp_path, num_threads=3)
    assert continued(began) == began and began.learning_threads == 3
    _begin(began, checkpoint=True)
    again = continued(stand_in.config(tmp_path, num_threads=1))
    assert (again.threads, again.learning_threads) == (1, 3)
    with open_run(again) as run:
        assert run.resumes
    for changes in ({"torch_threads": 1}, {"overwrite": True}):
        other = stand_in.config(tmp_path, **changes)
        assert continued(other) == other
    _refused(stand_in.config(tmp_path, torch_threads=1), "asked for torch_threads 1 instead of 3")


def test_same_run_resumes_another_is_refused(tmp_path):
    _begin(stand_in.config(tmp_path), checkpoint=True)
    with open_run(stand_in.config(tmp_path, total_steps=9999)) as run:
        assert run.resumes
        run.begin()
    assert json.loads((tmp_path / "config.json").read_text())["total_steps"] == 9999
    words = f"{tmp_path}.* holds another run: asked for seed 4 instead of 3.*--overwrite"
    _refused(stand_in.config(tmp_path, seed=4), words)
    with open_run(stand_in.config(tmp_path, seed=4, overwrite=True)) as run:
        run.begin()
        assert not run.resumes and not run.folder.checkpoint.exists()
    assert json.loads((tmp_path / "config.json").read_text())["seed"] == 4


def test_without_a_checkpoint_everything_starts_anew_but_notes_stay(tmp_path):
    config, notes = stand_in.config(tmp_path), ("notes.txt", "config.json.old", "progress.csv.new")
    _begin(config)
    for name in (*notes, "progress.csv", ".policy.safetensors.new"):
        (tmp_path / name).write_text("mine" if name in notes else "steps\n1\n")
    with open_run(config) as run:
        run.begin()
        assert not run.resumes and not run.folder.progress.exists()
    assert not (tmp_path / ".policy.safetensors.new").exists()
    assert {(tmp_path / name).read_text() for name in notes} == {"mine"}


def _curve(folder, steps, evaluated):
    (folder / "progress.csv").write_text(f"steps,fps\n{steps},1\n")
    (folder / "evaluations.csv").write_text(f"steps,return_mean\n{evaluated},1\n")


@pytest.mark.parametrize(
    ("steps", "evaluated", "anew"),
    [(1024, 1024, False), (512, 0, False), (256, 0, True), (128, 128, True)],
)
def test_a_run_is_begun_anew_only_before_its_first_checkpoint(tmp_path, steps, evaluated, anew):
    """Not a finished one, as is kept without its checkpoint, nor one farther than its first."""
    config = stand_in.config(tmp_path, total_steps=1000, checkpoint_every=256)
    _begin(config)
    _curve(tmp_path, steps, evaluated)
    if not anew:
        for longer in (config, replace(config, total_steps=2000)):
            _refused(longer, f"holds a run of {steps} steps without the checkpoint")
        config = replace(config, overwrite=True)
    with open_run(config) as run:
        run.begin()
        assert not run.resumes and not run.folder.progress.exists()


def test_a_longer_run_is_not_called_a_shorter_one(tmp_path):
    config = stand_in.config(tmp_path, total_steps=1000)
    _begin(config, checkpoint=True)
    _curve(tmp_path, 1024, 1024)
    shorter = stand_in.config(tmp_path, total_steps=500)
    _refused(shorter, "trained for 1024 steps, which total_steps 500 would deny")
    with open_run(config) as run:
        assert run.resumes


def test_a_checkpoint_of_an_earlier_version_is_not_begun_anew(tmp_path):
    """It was a folder, as policies were; none stays where a run takes its place."""
    config = stand_in.config(tmp_path)
    _begin(config)
    for name in ("checkpoint", "policy", "policy_best"):
        (tmp_path / name).mkdir()
    _refused(config, "checkpoint: of an earlier version")
    _begin(replace(config, overwrite=True))
    assert {file.name for file in tmp_path.iterdir()} == {".lock", "config.json", "versions.json"}


def test_results_without_their_configuration_are_not_begun_anew(tmp_path):
    config = stand_in.config(tmp_path)
    _begin(config, checkpoint=True)
    (tmp_path / "config.json").unlink()
    _refused(config, r"holds checkpoint\.safetensors but no config\.json")
    _begin(replace(config, overwrite=True))


@pytest.mark.parametrize("overwrite", [False, True])
def test_folders_that_are_no_run_are_left_alone(tmp_path, overwrite):
    (tmp_path / "thesis.tex").write_text("years of work")
    words = r"holds thesis\.tex but no config\.json, so it is not a run"
    _refused(stand_in.config(tmp_path, overwrite=overwrite), words)
    _refused(stand_in.config(tmp_path / "thesis.tex"), "is a file")
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_one_process_per_run(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config):
        _refused(config, r"is being trained by process \d+")
    with open_run(config):
        pass


def test_other_versions_than_at_the_beginning_are_named(tmp_path):
    config = stand_in.config(tmp_path)
    _begin(config, checkpoint=True)
    assert _changes(config) == ()
    file = tmp_path / "versions.json"
    versions = json.loads(file.read_text())
    versions["packages"]["torch"], versions["commit"] = "1.0", "another"
    file.write_text(json.dumps(versions))
    commit, torch = _changes(config)
    assert commit.startswith("commit ") and commit.endswith(' instead of "another"')
    assert torch.startswith("torch ") and torch.endswith(' instead of "1.0"')
    file.write_text("{")
    (damaged,) = _changes(config)
    assert "versions.json: not JSON" in damaged


def test_what_the_arguments_of_the_environment_mean_is_kept(tmp_path):
    real = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "joint_position"}
    config = stand_in.config(tmp_path, **real)
    _begin(config, checkpoint=True)
    file = tmp_path / "environment.json"
    began = json.loads(file.read_text())
    assert began == resolved_arguments(config.env, config.make_args()) and _changes(config) == ()
    # As a default that was changed since: the file stays as the run began, and it is said.
    began["layer_options"]["scale"] = 0.5
    file.write_text(json.dumps(began))
    with open_run(config) as run:
        assert run.changes == ("layer_options.scale 0.3 instead of 0.5",)
        run.begin()
    assert json.loads(file.read_text()) == began
    file.unlink()
    assert _changes(config) == ()


def _overwritten(name, content):
    return lambda folder: (folder / name).write_bytes(content)


def _of_fewer_robots(folder):
    """A checkpoint that only the learner can tell to be another's."""
    other = folder.with_name("other")
    main(stand_in.config(other, num_envs=4, eval=EvaluationConfig(every=0)), stand_in.make)
    (other / "checkpoint.safetensors").replace(folder / "checkpoint.safetensors")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_overwritten("config.json", b"{"), r"config\.json: not JSON"),
        (_overwritten("checkpoint.safetensors", b"x" * 20), "not safetensors"),
        (lambda folder: (folder / "checkpoint.safetensors").unlink(), "without the checkpoint"),
        (_overwritten("progress.csv", b"steps\n"), r"progress\.csv: has 6 bytes"),
        (_overwritten("evaluations.csv", b""), r"evaluations\.csv: has 0 bytes"),
        (_of_fewer_robots, "does not fit this run.*Expected a checkpoint of the same"),
    ],
)
def test_a_refused_resume_changes_nothing(tmp_path, straight, damage, message):
    """Whatever is found wrong, the folder stays as it was, byte for byte."""
    folder = shutil.copytree(straight, tmp_path / "run")
    damage(folder)
    before = _contents(folder)
    with pytest.raises(RunError, match=message):
        main(stand_in.config(folder, total_steps=9999), stand_in.make)
    assert _contents(folder) == before
