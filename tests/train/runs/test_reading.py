"""Run folders that are missing or incomplete, each made from one that a training wrote."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import stand_in

from fbid_gym.errors import FbidError, PolicyFileError
from train.ppo import main
from train.runs.folder import RunFolder
from train.runs.reading import load
from train.runs.tables import read_rows


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished training."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    config = stand_in.config(folder, seed=5, layer_options={"stiffness": 2})
    return main(config, stand_in.make)


@pytest.fixture
def folder(trained: Path, tmp_path: Path) -> Path:
    """A copy of it to break."""
    return Path(shutil.copytree(trained, tmp_path / "run"))


def test_a_run_is_read_as_it_was_written(trained: Path) -> None:
    run = load(trained)
    assert run.layer == "force (stiffness: 2)" and run.env_args == {}
    assert run.seed == 5 and run.policy.trained_steps == 768
    assert run.config == json.loads(RunFolder.of(trained).config.read_text())
    assert run.versions["packages"] == run.policy.versions
    assert run.curve is not None
    assert run.curve.steps.tolist() == [0, 384, 640, 768]
    rows = read_rows(RunFolder.of(trained).evaluations)
    assert run.curve.returns.tolist() == [float(row["return_mean"]) for row in rows]
    assert run.curve.spread.tolist() == [float(row["return_std"]) for row in rows]
    assert run.curve.episodes.tolist() == [4] * 4 and (run.curve.wall_seconds[1:] > 0).all()


def test_an_exported_policy_is_read(trained: Path) -> None:
    run = load(trained / "policy.safetensors")
    assert run.layer == "force (stiffness: 2)"
    assert run.seed is None and run.curve is None and run.config is None


COLUMNS = "steps,wall_seconds,return_mean,return_std,episodes\n"


def damage(name: str, content: str | None) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        if content is None:
            (folder / name).unlink()
        else:
            (folder / name).write_text(content)

    return apply


def without(key: str) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        config = json.loads((folder / "config.json").read_text())
        del config[key]
        (folder / "config.json").write_text(json.dumps(config))

    return apply


def unfinished(folder: Path) -> None:
    lines = (folder / "evaluations.csv").read_text().splitlines(keepends=True)
    (folder / "evaluations.csv").write_text("".join(lines[:3]))


def renamed(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"env_id": "other/Env-v0"}))


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (damage("evaluations.csv", None), "evaluations.csv is missing"),
        (damage("versions.json", None), "versions.json is missing"),
        (damage("policy.safetensors", None), "no policy here. Expected a policy's file"),
        (damage("policy.safetensors", "{"), "policy.safetensors: not safetensors"),
        (damage("config.json", "{"), "config.json: not JSON, truncated or corrupt"),
        (damage("config.json", "[]"), "config.json: holds list. Expected a JSON object"),
        (damage("evaluations.csv", "steps,wall_seconds\n"), "evaluations.csv: holds no evaluation"),
        (damage("evaluations.csv", "steps\n1\n"), "csv: column 'wall_seconds' is missing"),
        (damage("evaluations.csv", f"{COLUMNS}1,2,x,1,8\n"), "'return_mean' holds more than numbe"),
        (damage("evaluations.csv", f"{COLUMNS}2,2,2,1,8\n1,3,3,1,8\n"), "steps do not increase"),
        (without("seed"), "config.json: seed is None. Expected int."),
        (unfinished, "trained for 384 of 768 steps. Resume it, or leave it out."),
        (renamed, "config.json says other/Env-v0, the policy in it was trained in stand-in/"),
    ],
)
def test_a_broken_run_is_named(
    folder: Path, break_it: Callable[[Path], None], message: str
) -> None:
    break_it(folder)
    with pytest.raises(FbidError) as caught:
        load(folder)
    assert message in str(caught.value) and str(folder) in str(caught.value)


def test_a_folder_that_is_no_run_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(PolicyFileError, match=f"{path}: no policy here. Expected a policy's"):
            load(path)
