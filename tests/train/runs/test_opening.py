import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import stand_in

from fbid_gym.bundles import save_bundle
from fbid_gym.envs.config import resolved_arguments
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


def _contents(path: Path) -> dict[Path, bytes]:
    return {
        file: file.read_bytes()
        for file in path.rglob("*")
        if file.is_file() and file.name != ".lock"
    }


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
    with pytest.raises(RunError, match="asked for torch_threads 1 instead of 3"):
        _begin(stand_in.config(tmp_path, torch_threads=1))


def test_same_run_resumes_another_is_refused(tmp_path):
    _begin(stand_in.config(tmp_path), checkpoint=True)
    with open_run(stand_in.config(tmp_path, total_steps=9999)) as run:
        assert run.resumes
        run.begin()
    assert json.loads((tmp_path / "config.json").read_text())["total_steps"] == 9999
    before = _contents(tmp_path)
    with pytest.raises(RunError) as caught, open_run(stand_in.config(tmp_path, seed=4)):
        pass
    assert "holds another run: asked for seed 4 instead of 3." in str(caught.value)
    assert "--overwrite" in str(caught.value) and str(tmp_path) in str(caught.value)
    assert _contents(tmp_path) == before
    with open_run(stand_in.config(tmp_path, seed=4, overwrite=True)) as run:
        run.begin()
        assert not run.resumes and not run.folder.checkpoint.exists()
    assert json.loads((tmp_path / "config.json").read_text())["seed"] == 4


def test_without_a_checkpoint_everything_starts_anew_but_notes_stay(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config) as run:
        run.begin()
        run.folder.progress.write_text("steps\n1\n")
        (tmp_path / ".policy.safetensors.new").write_text("half")
        for name in ("notes.txt", "config.json.old", "progress.csv.new"):
            (tmp_path / name).write_text("mine")
    with open_run(config) as run:
        run.begin()
        assert not run.resumes and not run.folder.progress.exists()
        assert not (tmp_path / ".policy.safetensors.new").exists()
    for name in ("notes.txt", "config.json.old", "progress.csv.new"):
        assert (tmp_path / name).read_text() == "mine"


def _curve(folder: Path, steps: int, evaluated: int) -> None:
    (folder / "progress.csv").write_text(f"steps,fps\n{steps},1\n")
    (folder / "evaluations.csv").write_text(f"steps,return_mean\n{evaluated},1\n")


@pytest.mark.parametrize(("steps", "evaluated"), [(1024, 1024), (512, 0)])
def test_a_run_whose_checkpoint_is_gone_is_not_begun_anew(tmp_path, steps, evaluated):
    """Neither a finished one, as is kept without its checkpoint, nor one farther than its first."""
    config = stand_in.config(tmp_path, total_steps=1000, checkpoint_every=256)
    _begin(config)
    _curve(tmp_path, steps, evaluated)
    before = _contents(tmp_path)
    for changes in ({}, {"total_steps": 2000}):
        longer = stand_in.config(
            tmp_path, **({"total_steps": 1000, "checkpoint_every": 256} | changes)
        )
        expected = f"holds a run of {steps} steps without the checkpoint"
        with pytest.raises(RunError, match=expected), open_run(longer):
            pass
    assert _contents(tmp_path) == before
    with open_run(replace(config, overwrite=True)) as run:
        run.begin()
    assert not (tmp_path / "progress.csv").exists()


@pytest.mark.parametrize(("steps", "evaluated"), [(256, 0), (128, 128)])
def test_a_run_killed_before_its_first_checkpoint_is_begun_anew(tmp_path, steps, evaluated):
    config = stand_in.config(tmp_path, total_steps=1000, checkpoint_every=256)
    _begin(config)
    _curve(tmp_path, steps, evaluated)
    with open_run(config) as run:
        run.begin()
        assert not run.resumes and not run.folder.progress.exists()


def test_a_longer_run_is_not_called_a_shorter_one(tmp_path):
    config = stand_in.config(tmp_path, total_steps=1000)
    _begin(config, checkpoint=True)
    _curve(tmp_path, 1024, 1024)
    before = _contents(tmp_path)
    shorter = stand_in.config(tmp_path, total_steps=500)
    with (
        pytest.raises(RunError, match="trained for 1024 steps, which total_steps 500 would deny"),
        open_run(shorter),
    ):
        pass
    assert _contents(tmp_path) == before
    with open_run(config) as run:
        assert run.resumes


def test_a_checkpoint_of_an_earlier_version_is_not_begun_anew(tmp_path):
    """It was a folder, as policies were; none stays where a run takes its place."""
    config = stand_in.config(tmp_path)
    _begin(config)
    for name in ("checkpoint", "policy", "policy_best"):
        (tmp_path / name).mkdir()
    with pytest.raises(RunError, match="checkpoint: of an earlier version"), open_run(config):
        pass
    with open_run(replace(config, overwrite=True)) as run:
        run.begin()
    assert {file.name for file in tmp_path.iterdir()} == {".lock", "config.json", "versions.json"}


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


def test_one_process_per_run(tmp_path):
    config = stand_in.config(tmp_path)
    with open_run(config):
        with pytest.raises(RunError, match=r"is being trained by process \d+"), open_run(config):
            pass
    with open_run(config):
        pass


def test_other_versions_than_at_the_beginning_are_named(tmp_path):
    config = stand_in.config(tmp_path)
    _begin(config, checkpoint=True)
    with open_run(config) as run:
        assert run.changes == ()
    file = tmp_path / "versions.json"
    versions = json.loads(file.read_text())
    versions["packages"]["torch"] = "1.0"
    versions["commit"] = "another"
    file.write_text(json.dumps(versions))
    with open_run(config) as run:
        commit, torch = run.changes
    assert commit.startswith("commit ") and commit.endswith(' instead of "another"')
    assert torch.startswith("torch ") and torch.endswith(' instead of "1.0"')
    file.write_text("{")
    with open_run(config) as run:
        assert len(run.changes) == 1 and "versions.json: not JSON" in run.changes[0]


def test_what_the_arguments_of_the_environment_mean_is_kept(tmp_path):
    real = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "joint_position"}
    config = stand_in.config(tmp_path, **real)
    _begin(config, checkpoint=True)
    file = tmp_path / "environment.json"
    began = json.loads(file.read_text())
    assert began == resolved_arguments(config.env, config.make_args())
    with open_run(config) as run:
        assert run.changes == ()
    # As a default that was changed since: the file stays as the run began, and it is said.
    began["layer_options"]["scale"] = 0.5
    file.write_text(json.dumps(began))
    with open_run(config) as run:
        assert run.changes == ("layer_options.scale 0.3 instead of 0.5",)
        run.begin()
    assert json.loads(file.read_text()) == began
    file.unlink()
    with open_run(config) as run:
        assert run.changes == ()


def _overwritten(name: str, content: bytes):
    return lambda folder: (folder / name).write_bytes(content)


def _of_fewer_robots(folder: Path) -> None:
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
    folder = tmp_path / "run"
    shutil.copytree(straight, folder)
    damage(folder)
    before = _contents(folder)
    with pytest.raises(RunError, match=message):
        main(stand_in.config(folder, total_steps=9999), stand_in.make)
    assert _contents(folder) == before
