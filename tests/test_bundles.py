import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy

from fbid_gym import bundles
from fbid_gym.bundles import load_bundle, save_bundle
from fbid_gym.errors import InvalidValueError, RunError


class _Crash(BaseException):
    pass


def _numbered(number: int, size: int = 1000) -> tuple[dict, dict]:
    return {"number": number}, {"x": np.full(size, number, dtype=np.float64)}


def _read(file: Path) -> int:
    """Return the number of the bundle, checking that its two parts agree on it."""
    data, tensors = load_bundle(file, RunError)
    assert (tensors["x"] == data["number"]).all()
    return data["number"]


@pytest.fixture
def file(tmp_path):
    return tmp_path / "b.safetensors"


def test_every_kind_of_tensor_and_of_value_survives(file):
    tensors = {
        "scalar": np.array(2.5),
        "empty": np.zeros((0, 3)),
        "transposed": np.arange(6.0).reshape(2, 3).T,
        "bool": np.array([True, False]),
        "uint64": np.array([2**64 - 1], dtype=np.uint64),
        "float32": np.float32([1e-45, np.inf, np.nan]),
    }
    data = {"pi": 0.1 + 0.2, "word": 'é\ud800"\n', "b": [None, True, 2**70], "a": {"sha256": "x"}}
    save_bundle(file, data, tensors)
    bundle = load_bundle(file, RunError)
    assert bundle.data == data and list(bundle.data) == list(data)
    assert bundle.tensors.keys() == tensors.keys()
    for name, tensor in tensors.items():
        loaded = bundle.tensors[name]
        assert loaded.dtype == tensor.dtype and loaded.shape == tensor.shape
        np.testing.assert_array_equal(loaded, tensor)


def test_the_same_gives_the_same_file(tmp_path):
    """Also in another process, whose hashes are others."""
    program = (
        "import sys, numpy as np\n"
        "from pathlib import Path\n"
        "from fbid_gym.bundles import save_bundle\n"
        "arrays = {name: np.arange(3.0) for name in 'abcdefgh'}\n"
        "save_bundle(Path(sys.argv[1]), {'b': 1, 'a': 2}, arrays)\n"
    )
    for name in ("one", "other"):
        subprocess.run([sys.executable, "-c", program, str(tmp_path / name)], check=True)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


def test_a_crash_at_any_operation_leaves_the_old_or_the_new(file, monkeypatch):
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

    for module, name in ((os, "replace"), (os, "fsync"), (os, "open"), (Path, "open")):
        monkeypatch.setattr(module, name, crashing(getattr(module, name)))
    save_bundle(file, *_numbered(0))
    last, crashes, seen = 0, 0, set()
    for number in range(1, 60):
        countdown = number
        try:
            save_bundle(file, *_numbered(number))
        except _Crash:
            crashes += 1
            countdown = 0
            last, before = _read(file), last
            assert last in (before, number)
            seen.add(last == number)
        else:
            countdown = 0
            assert _read(file) == number
            assert list(file.parent.iterdir()) == [file]
            break
    assert crashes == 5 and seen == {True, False}


def test_a_flipped_bit_is_noticed_or_changes_nothing(file, rng):
    """Blanks between JSON's words may be others."""
    data = {"steps": 1500, "rng": {"pos": 17, "gauss": 0.125}, "env_id": "some/Env-v0", "on": True}
    tensors = {"x": rng.normal(size=7), "y": np.arange(5, dtype=np.uint32)}
    save_bundle(file, data, tensors)
    whole, accepted = file.read_bytes(), 0
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(bytes(damaged))
        try:
            bundle = load_bundle(file, RunError)
        except RunError as error:
            assert str(file) in str(error)
            continue
        accepted += 1
        assert bundle.data == data and bundle.tensors.keys() == tensors.keys()
        for name, tensor in tensors.items():
            np.testing.assert_array_equal(bundle.tensors[name], tensor)
    assert accepted < 0.02 * len(whole)


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        (None, "not of this package. Expected JSON as 'fbid_gym' in its metadata"),
        ({"format": "pt"}, "not of this package"),
        ({"fbid_gym": "{"}, "not JSON"),
        ({"fbid_gym": '{"a": NaN}'}, "NaN is no number"),
        ({"fbid_gym": "[1]"}, "holds list. Expected a JSON object"),
        ({"fbid_gym": "{}"}, "corrupt: its SHA-256 is .*Expected None"),
        ({"fbid_gym": '{"sha256": "0"}'}, "corrupt: its SHA-256 is .*Expected '0'"),
    ],
)
def test_files_of_others_are_refused(file, metadata, message):
    safetensors.numpy.save_file({"x": np.zeros(3)}, file, metadata)
    with pytest.raises(RunError, match=message):
        load_bundle(file, RunError)


def test_what_lies_beside_a_bundle_stays(tmp_path, file):
    beside = [tmp_path / name for name in ("b.safetensors.old", "b.safetensors.new", "b.new")]
    for path in beside:
        path.write_text("years of work")
    for number in (1, 2):
        save_bundle(file, *_numbered(number))
    assert {path.read_text() for path in beside} == {"years of work"}
    with pytest.raises(InvalidValueError, match="Expected a file, not a folder"):
        save_bundle(tmp_path, *_numbered(1))


def test_more_than_can_be_read_is_not_written(file, monkeypatch):
    save_bundle(file, *_numbered(1))
    for name in ("MOST_JSON", "MOST_DATA"):
        with monkeypatch.context() as patch:
            patch.setattr(bundles, name, 10)
            with pytest.raises(InvalidValueError, match="Expected at most 10 bytes"):
                save_bundle(file, *_numbered(2))
            with pytest.raises(RunError, match="has more than 0 MB"):
                load_bundle(file, RunError)
        assert _read(file) == 1


def test_what_the_files_cannot_hold_is_refused_before_writing(file):
    with pytest.raises(InvalidValueError, match=r"tensor 'x': 'object'\. Expected booleans"):
        save_bundle(file, {}, {"x": np.array([None])})
    for value in (float("nan"), {1, 2}):
        with pytest.raises(InvalidValueError, match=r"b\.safetensors.*values JSON can hold"):
            save_bundle(file, {"value": value}, {})
    assert not file.exists()
