import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fbid_gym import bundles
from fbid_gym.bundles import load_bundle, present_bundle, save_bundle, write_file
from fbid_gym.errors import InvalidValueError, RunError


class _Crash(BaseException):
    pass


def _numbered(number: int, size: int = 1000) -> tuple[dict, dict]:
    return {"number": number}, {"x": np.full(size, number, dtype=np.float64)}


def _read(folder: Path) -> int:
    """Return the number of the bundle, checking that both files agree on it."""
    bundle = load_bundle(folder, "b", RunError)
    bundle.check_digest(RunError)
    assert (bundle.tensors["x"] == bundle.data["number"]).all()
    return bundle.data["number"]


def test_every_kind_of_tensor_survives(tmp_path):
    tensors = {
        "scalar": np.array(2.5),
        "empty": np.zeros((0, 3)),
        "transposed": np.arange(6.0).reshape(2, 3).T,
        "bool": np.array([True, False]),
        "uint64": np.array([2**64 - 1], dtype=np.uint64),
        "float32": np.float32([1e-45, np.inf, np.nan]),
    }
    save_bundle(tmp_path / "b", "b", {"pi": 0.1 + 0.2}, tensors)
    bundle = load_bundle(tmp_path / "b", "b", RunError)
    assert bundle.data["pi"] == 0.1 + 0.2
    for name, tensor in tensors.items():
        loaded = bundle.tensors[name]
        assert loaded.dtype == tensor.dtype and loaded.shape == tensor.shape
        np.testing.assert_array_equal(loaded, tensor)


def test_a_crash_at_any_operation_leaves_the_old_or_the_new(tmp_path, monkeypatch):
    """Stop before every single file operation of a save, the way a kill would."""
    countdown = 0

    def crashing(function):
        def call(*args, **kwargs):
            nonlocal countdown
            countdown -= 1
            if countdown == 0:
                raise _Crash
            return function(*args, **kwargs)

        return call

    for module, names in (
        (os, ("rename", "fsync", "open")),
        (shutil, ("rmtree",)),
        (bundles, ("_write_through",)),
    ):
        for name in names:
            monkeypatch.setattr(module, name, crashing(getattr(module, name)))

    folder = tmp_path / "b"
    save_bundle(folder, "b", *_numbered(0))
    last, crashes, seen = 0, 0, set()
    for number in range(1, 60):
        countdown = number
        try:
            save_bundle(folder, "b", *_numbered(number))
        except _Crash:
            crashes += 1
            countdown = 0
            found = _read(folder)
            assert found in (last, number)
            seen.add(found == number)
            last = found
        else:
            countdown = 0
            assert _read(folder) == number
            assert sorted(p.name for p in tmp_path.iterdir()) == ["b"]
            break
    assert crashes > 8 and seen == {True, False}


@pytest.mark.parametrize("attempt", range(3))
def test_a_kill_at_any_moment_leaves_a_bundle(tmp_path, attempt):
    program = (
        "import sys, numpy as np\n"
        "from pathlib import Path\n"
        "from fbid_gym.bundles import save_bundle\n"
        "for n in range(10**6):\n"
        "    save_bundle(Path(sys.argv[1]), 'b', {'number': n}, {'x': np.full(20000, float(n))})\n"
    )
    folder = tmp_path / "b"
    child = subprocess.Popen([sys.executable, "-c", program, str(folder)])
    while not folder.exists():
        time.sleep(0.005)
        assert child.poll() is None
    time.sleep(0.05 + 0.013 * attempt)
    child.send_signal(signal.SIGKILL)
    child.wait()
    _read(folder)


@pytest.mark.parametrize("file", ["b.json", "b.safetensors"])
def test_a_flipped_bit_is_noticed_or_changes_nothing(tmp_path, rng, file):
    """Blanks between JSON's words may be others."""
    data = {"steps": 1500, "rng": {"pos": 17, "gauss": 0.125}, "env_id": "some/Env-v0", "on": True}
    tensors = {"x": rng.normal(size=7), "y": np.arange(5, dtype=np.uint32)}
    save_bundle(tmp_path / "b", "b", data, tensors)
    path = tmp_path / "b" / file
    whole, accepted = path.read_bytes(), 0
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(damaged))
        try:
            bundle = load_bundle(tmp_path / "b", "b", RunError)
            bundle.check_digest(RunError)
        except RunError:
            continue
        accepted += 1
        assert {name: bundle.data[name] for name in data} == data and len(bundle.data) == 5
        for name, tensor in tensors.items():
            np.testing.assert_array_equal(bundle.tensors[name], tensor)
    assert accepted < 0.1 * len(whole)


def test_folders_with_other_things_are_not_replaced(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InvalidValueError, match=r"found thesis\.tex"):
        save_bundle(tmp_path, "b", *_numbered(1))
    assert (tmp_path / "thesis.tex").read_text() == "years of work"
    with pytest.raises(InvalidValueError, match="found a file"):
        save_bundle(tmp_path / "thesis.tex", "b", *_numbered(1))


@pytest.mark.parametrize("name", ["b.old", "b.new", ".b.old", ".b.new"])
def test_what_lies_beside_a_bundle_is_not_replaced(tmp_path, name):
    (tmp_path / name).mkdir()
    (tmp_path / name / "thesis.tex").write_text("years of work")
    try:
        save_bundle(tmp_path / "b", "b", *_numbered(1))
        save_bundle(tmp_path / "b", "b", *_numbered(2))
    except InvalidValueError as error:
        assert "thesis.tex" in str(error) and name.startswith(".")
    assert (tmp_path / name / "thesis.tex").read_text() == "years of work"


def test_a_copy_kept_beside_a_bundle_stays(tmp_path):
    save_bundle(tmp_path / "b", "b", *_numbered(1))
    for name in ("b.old", "b.new"):
        shutil.copytree(tmp_path / "b", tmp_path / name)
    save_bundle(tmp_path / "b", "b", *_numbered(2))
    for name in ("b.old", "b.new"):
        assert load_bundle(tmp_path / name, "b", RunError).data["number"] == 1


def test_more_than_can_be_read_is_not_written(tmp_path, monkeypatch):
    save_bundle(tmp_path / "b", "b", *_numbered(1))
    for name in ("MOST_JSON", "MOST_DATA"):
        with monkeypatch.context() as patch:
            patch.setattr(bundles, name, 10)
            with pytest.raises(InvalidValueError, match="Expected at most 10 bytes"):
                save_bundle(tmp_path / "b", "b", *_numbered(2))
        assert load_bundle(tmp_path / "b", "b", RunError).data["number"] == 1


def test_what_the_files_cannot_hold_is_refused_before_writing(tmp_path):
    with pytest.raises(InvalidValueError, match=r"tensor 'x': 'object'\. Expected booleans"):
        save_bundle(tmp_path / "b", "b", {}, {"x": np.array([None])})
    for value in (float("nan"), {1, 2}):
        with pytest.raises(InvalidValueError, match=r"b\.json"):
            save_bundle(tmp_path / "b", "b", {"value": value}, {})
    assert not list(tmp_path.iterdir())


def test_written_file_replaces_the_old_one(tmp_path):
    for content in (b"long content", b"new"):
        write_file(tmp_path / "f", content)
        assert (tmp_path / "f").read_bytes() == content
    assert [p.name for p in tmp_path.iterdir()] == ["f"]


def test_present_bundle_is_the_old_one_only_without_a_new_one(tmp_path):
    folder, old = tmp_path / "b", tmp_path / ".b.old"
    assert present_bundle(folder) == folder
    old.mkdir()
    assert present_bundle(folder) == old
    folder.mkdir()
    assert present_bundle(folder) == folder
