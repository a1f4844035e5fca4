"""Bounds on a robot's file, measured on its text before MuJoCo reads it.

MuJoCo does what a file says: a `<replicate>` of a billion, or a texture of a million by a million
pixels, takes all time or all memory there is, and no error comes back. So the numbers that say how
many are looked at first. Whether it is an MJCF or a URDF at all, MuJoCo knows best.
"""

import io
import math
import re
import stat
import zipfile
from collections.abc import Iterator
from os.path import exists
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from fbid_gym.errors import RobotError
from fbid_gym.reading import MOST_DATA, read_file

MOST_TEXT = 2**24  # bytes of a file of text
MOST_DEPTH = 200  # elements within each other
MOST_ELEMENTS = 100_000  # with all that is repeated
MOST_CELLS = 2**24  # pixels of a texture, heights of a field, vertices of a flex
MOST_MEMORY = 2**32  # bytes of MuJoCo's own memory for a robot
_MOST_FILES = 1000
_FOLDERS = {"meshdir", "texturedir", "assetdir"}
# MuJoCo does not look into these: comments may hold "--", and letters of any encoding. What takes
# their place is no part of an attribute, in which they would be none. What is never closed goes on
# to the end, and is not looked for again.
_SKIPPED = re.compile(r"<!--(?:.*?-->|.*)|<\?(?:.*?\?>|.*)|<!\[CDATA\[(?:.*?\]\]>|.*)", re.DOTALL)
_NOTHING = "<!---->"
_AMPERSAND = re.compile(r"&(?!#?\w+;)")  # as MuJoCo reads it
_UNITS = {"K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}
# Elements that stand for many, and the attributes whose product says how many.
_REPEATING = {"replicate": ("count",), "composite": ("count",), "flexcomp": ("count",)}
_GRIDS = {"texture": ("width", "height"), "hfield": ("nrow", "ncol")}


def check_bounds(content: Path | str | bytes, label: str) -> None:
    """Refuse a description that MuJoCo could not read in bounded time and memory.

    Args:
        content: path of a file, with what it includes; a text; or a zip of files.
        label: what messages call it.

    Raises:
        RobotError: it asks for too much, is no text, holds a number that is not finite, or names a
            pipe or a device, which may never end.
        ExpatError: it is no XML.
    """
    named, folders, seen = set[str](), {""}, set[Path]()
    beside = content.parent if isinstance(content, Path) else Path()
    queue = [content] if isinstance(content, Path) else list[Path | bytes](_texts(content, label))
    while queue:
        text = queue.pop()
        if isinstance(text, Path):
            seen.add(text)
            if len(seen) > _MOST_FILES:
                _refuse(label, f"includes more than {_MOST_FILES} files")
            text = read_file(text, MOST_TEXT, RobotError)
        for element, attributes in _elements(text, label):
            folders |= {value for name, value in attributes.items() if name in _FOLDERS}
            named |= {value for name, value in attributes.items() if name.startswith("file")}
            part = beside / attributes.get("file", "")
            # MuJoCo looks beside the first file, and says what is missing.
            if element == "include" and seen and part not in seen and exists(part):
                queue.append(part)
    if not isinstance(content, bytes):
        _check_files(beside, folders, named)


def _texts(content: str | bytes, label: str) -> Iterator[bytes]:
    if isinstance(content, str):
        try:
            yield content.encode()
        except UnicodeEncodeError:
            _refuse(label, "is not UTF-8 text")
        return
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for entry in archive.infolist():
            if entry.filename.endswith((".xml", ".urdf")):
                if entry.file_size > MOST_TEXT:
                    _refuse(label, f"has more than {MOST_TEXT >> 20} MB of text")
                yield archive.read(entry)


def _elements(encoded: bytes, label: str) -> list[tuple[str, dict[str, str]]]:
    """Return the elements of a text, each checked, with their attributes."""
    text = _SKIPPED.sub(_NOTHING, encoded.decode(errors="surrogateescape").removeprefix("\ufeff"))
    try:
        plain = _AMPERSAND.sub("&amp;", text).encode()
    except UnicodeEncodeError:
        _refuse(label, "is not UTF-8 text")
    found, repeats = list[tuple[str, dict[str, str]]](), [1.0]
    total = 0.0

    def begin(element: str, attributes: dict[str, str]) -> None:
        nonlocal total
        found.append((element, attributes))
        _check_numbers(element, attributes, label)
        repeats.append(repeats[-1] * _product(attributes, _REPEATING.get(element, ())))
        total += repeats[-1]
        if total > MOST_ELEMENTS:
            _refuse(label, f"describes more than {MOST_ELEMENTS} elements, <{element}> among them")
        if len(repeats) > MOST_DEPTH:
            _refuse(label, f"nests more than {MOST_DEPTH} elements")

    def declare(name: str, *more: object) -> None:
        if any(more):
            _refuse(label, "declares entities, which MuJoCo does not know")

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.StartDoctypeDeclHandler = begin, declare
    parser.EndElementHandler = lambda element: repeats.pop()
    parser.Parse(plain, True)
    return found


def _check_files(beside: Path, folders: set[str], named: set[str]) -> None:
    """Look at meshes and textures wherever MuJoCo may find them; it says itself what is missing."""
    for name in named:
        for path in {beside / folder / name for folder in folders}:
            try:
                status = path.stat()
            except (OSError, ValueError):
                continue
            if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
                raise RobotError(f"{path}: cannot be read (no regular file).")
            if status.st_size > MOST_DATA:
                raise RobotError(
                    f"{path}: has more than {MOST_DATA >> 20} MB, the most that is read."
                )


def _check_numbers(element: str, attributes: dict[str, str], label: str) -> None:
    for name, value in attributes.items():
        where = f"<{element} {name}="
        numbers = [_number(word) or 0.0 for word in value.split() if name != "name"]
        if not all(map(math.isfinite, numbers)):
            _refuse(label, f"has {where}{value[:40]!r}>, where a finite number is expected")
        if element == "size" and _memory(value) > MOST_MEMORY:
            _refuse(label, f"asks for more than {MOST_MEMORY >> 30} GB by {where}{value[:40]!r}>")
        if element == "size" and name != "memory" and _memory(value) > MOST_ELEMENTS:
            _refuse(label, f"asks for more than {MOST_ELEMENTS} by {where}{value[:40]!r}>")
    if _product(attributes, _GRIDS.get(element, ())) > MOST_CELLS:
        _refuse(label, f"asks for a <{element}> of more than {MOST_CELLS} cells")


def _product(attributes: dict[str, str], names: tuple[str, ...]) -> float:
    """Count them; 1 where that is not said, or not in numbers."""
    words = (word for name in names for word in attributes.get(name, "").split())
    return math.prod(max(number, 1.0) for word in words if (number := _number(word)) is not None)


def _memory(word: str) -> float:
    """Bytes of "512M", or a number."""
    unit = _UNITS.get(word[-1:].upper())
    return (_number(word[:-1] if unit else word) or 0.0) * (unit or 1)


def _number(word: str) -> float | None:
    # Python would also take "1_000", which MuJoCo does not.
    try:
        return float(word) if "_" not in word else None
    except ValueError:
        return None


def _refuse(label: str, reason: str) -> NoReturn:
    raise RobotError(f"{label} {reason}.")
