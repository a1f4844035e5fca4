"""What is read from strangers is small, whole and a file, or refused in one sentence."""

import os

import pytest

from fbid_gym.errors import RunError
from fbid_gym.reading import MOST_JSON, read_file, read_object


def test_files_are_read_as_they_are(tmp_path):
    (tmp_path / "a").write_bytes(bytes(range(256)))
    assert read_file(tmp_path / "a", 256, RunError) == bytes(range(256))
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert read_file(tmp_path / "b", 256, RunError) == bytes(range(256))
    (tmp_path / "c").write_text('{"a": [1, 2.5, null, "é"]}')
    assert read_object(tmp_path / "c", RunError) == {"a": [1, 2.5, None, "é"]}


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "absent", "link", "large", "nul"])
def test_what_is_no_file_or_too_large_is_refused(kind, tmp_path):
    path = tmp_path / "x"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "link":
        path.symlink_to(path)
    elif kind == "large":
        with path.open("wb") as file:
            file.truncate(2 * MOST_JSON)
    elif kind == "nul":
        path = tmp_path / "a\0b"
    with pytest.raises(RunError, match="cannot be read|has more than 16 MB"):
        read_object(path, RunError)


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[1]", "3", "\xff", '{"a": NaN}', '{"a": -Infinity}', '{"a": 1e999}'),
        '{"a":' * 10_000 + "1" + "}" * 10_000,
        '{"a": ' + "9" * 10_000 + "}",
    ],
    ids=range(10),
)
def test_what_is_no_object_of_numbers_and_words_is_refused(text, tmp_path):
    (tmp_path / "x").write_text(text, encoding="latin-1")
    with pytest.raises(RunError, match=r"x: (not JSON, truncated or corrupt|holds )"):
        read_object(tmp_path / "x", RunError)
