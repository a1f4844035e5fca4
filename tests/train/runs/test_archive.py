"""Packed runs are read as folders are, and an archive of a stranger can at worst be refused."""

import os
import shutil
import zipfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import stand_in

from fbid_gym.errors import RunError
from train import pack
from train.pack import PackConfig
from train.ppo import main
from train.runs import archive
from train.runs.archive import KEPT, as_archive, found, read_archive
from train.runs.folder import RunFolder
from train.runs.opening import open_run
from train.runs.reading import load
from train.runs.training import is_finished, standing


@pytest.fixture
def folder(straight, tmp_path):
    """A copy of a finished training, in a folder of runs."""
    return Path(shutil.copytree(straight, tmp_path / "walk.v2" / "a"))


def test_a_packed_run_is_read_as_its_folder_is(folder, capsys):
    config = stand_in.config(folder)
    before, stands = load(folder), standing(config)
    pack.main(PackConfig(folder.parent, remove=True))
    assert not folder.exists() and "1 runs in" in capsys.readouterr().out
    after = load(folder)
    assert (after.path, after.seed, after.config) == (folder, 3, before.config)
    assert after.versions == before.versions and after.policy.trained_steps == 768
    for one, other in zip(after.policy.weights, before.policy.weights, strict=True):
        np.testing.assert_array_equal(one, other)
    for name, values in asdict(before.curve).items():
        np.testing.assert_array_equal(getattr(after.curve, name), values)
    assert is_finished(config) and standing(config) == stands
    assert load(folder / "policy.safetensors").policy.trained_steps == 768
    assert RunFolder.of(folder).path == folder
    assert load(folder.parent.with_suffix(".v2.zip") / "a").seed == 3
    assert found(folder.parent / "b") == folder.parent / "b"


def test_a_packed_run_is_trained_anew_only_where_that_is_asked_for(folder):
    pack.main(PackConfig(folder.parent, remove=True))
    config = stand_in.config(folder)
    with pytest.raises(RunError, match=r"is packed in .*walk\.v2\.zip. Choose another --out"):
        main(config, stand_in.make)
    assert not folder.exists()
    with open_run(replace(config, overwrite=True)) as run:
        run.begin()
    assert run.folder.config.parent == folder
    assert not is_finished(config)  # the folder goes before the archive
    with pytest.raises(RunError, match="holds no finished run"):
        pack.main(PackConfig(folder.parent))


def test_an_archive_depends_on_what_the_runs_hold_and_keeps_those_it_held(folder):
    packed = folder.parent.with_suffix(".v2.zip")
    pack.main(PackConfig(folder.parent))
    first = packed.read_bytes()
    for file in folder.rglob("*"):
        os.utime(file, (1e9, 1e9))
    pack.main(PackConfig(folder.parent))
    assert packed.read_bytes() == first
    folder.rename(folder.with_name("b"))
    unfinished = folder.with_name("c")
    unfinished.mkdir()
    shutil.copy(folder.with_name("b") / "config.json", unfinished)
    done = pack.pack(folder.parent)
    assert [run.name for run in done.runs] == ["b"] and str(unfinished) in done.left[0]
    held = read_archive(packed)
    assert held.keys() == {"a", "b"} and held["a"] == held["b"] and set(held["a"]) <= set(KEPT)
    assert first == as_archive({"a": held["a"]})


def test_what_an_archive_calls_its_files_decides_about_no_place(straight, tmp_path):
    inside = {name: (straight / name).read_bytes() for name in KEPT if (straight / name).is_file()}
    with zipfile.ZipFile(tmp_path / "runs.zip", "w") as file:
        for name in ("../evil.txt", "/evil.txt", "a/../../evil.txt", "a/policy/evil.pkl", "a/x/"):
            file.writestr(name, "evil")
        for name, data in inside.items():
            file.writestr(f"a/{name}", data)
            file.writestr(f"../{name}", data)
    place = found(tmp_path / "runs" / "a")
    files = {str(file.relative_to(place)) for file in place.rglob("*") if file.is_file()}
    assert files == inside.keys() and load(tmp_path / "runs" / "a").seed == 3
    assert not list(tmp_path.rglob("evil*")) and not list(place.parents[1].rglob("evil*"))


def test_too_large_and_strangely_packed_archives_are_refused(tmp_path, monkeypatch):
    path, run = tmp_path / "runs.zip", tmp_path / "runs" / "a"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as file:
        file.writestr("a/config.json", "{}")
    with pytest.raises(RunError, match=r"runs\.zip: a cannot be read \(packed in another way"):
        load(run)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("a/progress.csv", bytes(2**27 + 1))
    assert path.stat().st_size < 2**20
    with pytest.raises(RunError, match="a unpacks to more than 128 MB"):
        load(run)
    monkeypatch.setattr(archive, "MOST_BYTES", 2**20)
    with pytest.raises(RunError, match="more than 1 MB"):
        as_archive({"a": {"progress.csv": bytes(2**20 + 1)}})
    os.truncate(path, 2**20 + 1)
    with pytest.raises(RunError, match="has more than 1 MB"):
        load(run)
