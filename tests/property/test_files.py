"""Files with changed bits: none is accepted as anything but what it was."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from tests.test_policy import make_policy
from train.runs.archive import KEPT, as_archive, read_archive

BITS = st.lists(st.floats(0.0, 1.0, exclude_max=True), max_size=3)
SHARE = st.one_of(st.just(1.0), st.floats(0.0, 1.0))
"""Of a file, that is left of it."""


def _damage(file: Path, bits: list[float], kept: float) -> None:
    content = bytearray(file.read_bytes())
    for share in bits:
        place = int(share * 8 * len(content))
        content[place // 8] ^= 1 << place % 8
    file.write_bytes(content[: round(kept * len(content))])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("files")


@given(st.integers(0, 2**31), BITS, SHARE)
def test_policies(folder: Path, seed: int, bits: list[float], kept: float) -> None:
    policy, file = make_policy(seed, (5, 4, 3)), folder / "mine.safetensors"
    policy.save(file)
    _damage(file, bits, kept)
    try:
        found = Policy.load(file)
    except FbidError as error:
        assert "\n" not in str(error).strip()
        return
    # Another layout of the same JSON is the same policy.
    both = [(own.mean, own.variance, *own.weights, *own.biases) for own in (found, policy)]
    for one, other in zip(*both, strict=True):
        np.testing.assert_array_equal(one, other)
    for field in ("env_id", "env_args", "activation", "clip", "trained_steps", "versions"):
        assert getattr(found, field) == getattr(policy, field)


@pytest.mark.filterwarnings("ignore:Duplicate name")
@given(st.lists(st.binary(max_size=200), min_size=len(KEPT), max_size=len(KEPT)), BITS, SHARE)
def test_archives(folder: Path, contents: list[bytes], bits: list[float], kept: float) -> None:
    """Files of runs may be missing, as where their names are damaged; none is another."""
    packed = {run: dict(zip(KEPT, contents, strict=True)) for run in ("a", "b")}
    path = folder / f"{os.urandom(8).hex()}.zip"  # read once for a name and a time
    path.write_bytes(as_archive(packed))
    _damage(path, bits, kept)
    try:
        found = read_archive(path)
    except FbidError as error:
        assert "\n" not in str(error).strip()
        return
    for files in found.values():
        for name, content in files.items():
            assert content == packed["a"][name]
