"""Run folders that are missing or incomplete, each made from one that a training wrote."""

import json
import shutil
from pathlib import Path

import pytest
import stand_in

from fbid_gym.errors import FbidError, PolicyFileError
from train.ppo import main
from train.runs.folder import RunFolder
from train.runs.reading import load
from train.runs.tables import read_rows


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A finished training."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    config = stand_in.config(folder, seed=5, layer_options={"stiffness": 2})
    return main(config, stand_in.make)


@pytest.fixture
def folder(trained, tmp_path):
    """A copy of it to break."""
    return Path(shutil.copytree(trained, tmp_path / "run"))


def test_a_run_is_read_as_it_was_written(trained):
    run = load(trained)
    assert run.layer == "force (stiffness: 2)" and run.env_args == {}
    assert run.seed == 5 and run.policy.trained_steps == 768
    assert run.config == json.loads(RunFolder.of(trained).config.read_text())
    assert run.versions["packages"] == run.policy.versions
    assert run.curve.steps.tolist() == [0, 384, 640, 768]
    rows = read_rows(RunFolder.of(trained).evaluations)
    assert run.curve.returns.tolist() == [float(row["return_mean"]) for row in rows]
    assert run.curve.spread.tolist() == [float(row["return_std"]) for row in rows]
    assert run.curve.episodes.tolist() == [4] * 4 and (run.curve.wall_seconds[1:] > 0).all()


def test_an_exported_policy_is_read(trained):
    run = load(trained / "policy.safetensors")
    assert run.layer == "force (stiffness: 2)"
    assert run.seed is None and run.curve is None and run.config is None


COLUMNS = "steps,wall_seconds,return_mean,return_std,episodes\n"
BROKEN = [  # file, what it holds instead, and what is said
    ("evaluations.csv", None, "evaluations.csv is missing"),
    ("versions.json", None, "versions.json is missing"),
    ("policy.safetensors", None, "no policy here. Expected a policy's file"),
    ("policy.safetensors", "{", "policy.safetensors: not safetensors"),
    ("config.json", "{", "config.json: not JSON, truncated or corrupt"),
    ("config.json", "[]", "config.json: holds list. Expected a JSON object"),
    ("evaluations.csv", "steps,wall_seconds\n", "evaluations.csv: holds no evaluation"),
    ("evaluations.csv", "steps\n1\n", "csv: column 'wall_seconds' is missing"),
    ("evaluations.csv", f"{COLUMNS}1,2,x,1,8\n", "'return_mean' holds more than numbe"),
    ("evaluations.csv", f"{COLUMNS}2,2,2,1,8\n1,3,3,1,8\n", "steps do not increase"),
]


def test_a_broken_run_is_named(folder):
    def named(file: Path, content: str | None, message: str) -> None:
        before = file.read_bytes()
        file.unlink() if content is None else file.write_text(content)
        with pytest.raises(FbidError) as caught:
            load(folder)
        assert message in str(caught.value) and str(folder) in str(caught.value)
        file.write_bytes(before)

    for name, content, message in BROKEN:
        named(folder / name, content, message)
    run = RunFolder.of(folder)
    config, lines = json.loads(run.config.read_text()), run.evaluations.read_text().splitlines()
    nobody = json.dumps(config | {"seed": None})
    other = json.dumps(config | {"env_id": "other/Env-v0"})
    named(run.config, nobody, "config.json: seed is None. Expected int.")
    named(run.config, other, "config.json says other/Env-v0, the policy in it was trained in")
    few = "\n".join([*lines[:3], ""])
    named(run.evaluations, few, "trained for 384 of 768 steps. Resume it, or leave it out.")
    for path in (folder / "nowhere", folder.parent):
        with pytest.raises(PolicyFileError, match=f"{path}: no policy here. Expected a policy's"):
            load(path)
