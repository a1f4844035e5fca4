"""A robot in one file: its MJCF, the files that needs, and what else is said of it.

`robot.zip` is a zip as `mujoco.MjSpec.from_zip` reads it, with a `robot.json` of arguments of
`Robot.from_mjcf` beside the MJCF.
"""

import hashlib
import io
import json
import lzma
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco

from fbid_gym.checks import check_choices
from fbid_gym.errors import RobotError
from fbid_gym.reading import parse_object, read_file
from fbid_gym.robots import meshes
from fbid_gym.robots.mjcf import compile_spec

SUFFIX, _FILE = ".zip", "robot.json"
# What `robot.json` may say: arguments of `Robot.from_mjcf`.
ARGUMENTS = ("feet", "name", "home", "base", "torque_limit", "armature")
MOST_BYTES = 2**28  # of a robot, packed or not, and of a file that it needs


def pack(spec: mujoco.MjSpec) -> bytes:
    """Return a spec as a zip of its MJCF and of the files that needs; the spec stays as it is.

    Raises RobotError where it cannot be written, or a file is not there.
    """
    original, spec = spec, spec.copy()
    files: dict[str, bytes] = {}

    def keep(file: str, content: bytes) -> str:
        """Keep a file under a name after what it holds, so that it is kept once."""
        name = hashlib.sha256(content).hexdigest()[:16] + Path(file).suffix.lower()
        files[name] = content
        return name

    compiled: mujoco.MjModel | None = None
    for index, mesh in enumerate(spec.meshes):
        if not mesh.file:
            continue
        try:
            mesh.file = keep(mesh.file, _content(spec, mesh.file, spec.meshdir))
        except RobotError:
            # Attached specs have folders of their own, which MuJoCo alone knows.
            compiled = compiled or compile_spec(original.copy(), "The robot's spec")
            meshes.take_over(mesh, keep("mesh.obj", meshes.as_obj(compiled, index)))
    for part in (*spec.hfields, *spec.skins):
        if part.file:
            part.file = keep(part.file, _content(spec, part.file, spec.meshdir))
    for texture in spec.textures:
        if texture.file:
            texture.file = keep(texture.file, _content(spec, texture.file, spec.texturedir))
        for face, file in enumerate(texture.cubefiles):
            if file:
                texture.cubefiles[face] = keep(file, _content(spec, file, spec.texturedir))
    spec.meshdir = spec.texturedir = ""
    spec.assets = files  # written where it compiles
    try:
        text = spec.to_xml()
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"The robot's spec cannot be written as an MJCF: {error}") from error
    return _zipped({**files, "robot.xml": text.encode()})


def _content(spec: mujoco.MjSpec, file: str, folder: str) -> bytes:
    inside = Path(file).name if spec.strippath else file
    for name in (str(Path(folder, inside)), inside):
        if name in spec.assets:
            found = spec.assets[name]
            return found if isinstance(found, bytes) else str(found).encode()
    return read_file(Path(spec.modelfiledir, folder, inside), MOST_BYTES, RobotError)


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """A zip that depends on the contents alone."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name)  # of 1980
            archive.writestr(entry, files[name], zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def with_arguments(packed: bytes, arguments: Mapping[str, Any]) -> bytes:
    """Return what `pack` gave with arguments of `Robot.from_mjcf` in it; None are left out."""
    given = {name: value for name, value in arguments.items() if value is not None}
    text = json.dumps(given, indent=1, default=lambda array: array.tolist())
    archive = io.BytesIO(packed)
    with zipfile.ZipFile(archive, "a") as file:
        # A date of its own would make two archives of one robot different files.
        file.writestr(zipfile.ZipInfo(_FILE), text + "\n")
    return archive.getvalue()


def split(archive: bytes, name: str) -> tuple[bytes, dict[str, Any]]:
    """Split what `with_arguments` gave into a `pack` and arguments; messages call it `name`.

    Raises:
        RobotError: no archive of a robot, or more than 256 MB of it.
        UnknownOptionError: an argument that there is not.
    """
    label = f"Robot file {name!r}"
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as opened:
            entries = opened.infolist()
            if sum(entry.file_size for entry in entries) > MOST_BYTES:
                raise RobotError(f"{label} unpacks to more than {MOST_BYTES >> 20} MB.")
            contents = {entry.filename: opened.read(entry) for entry in entries}
    except (
        *(OSError, ValueError, EOFError, RuntimeError),  # ValueError: a name that is no UTF-8
        *(zipfile.BadZipFile, zlib.error, lzma.LZMAError),
    ) as error:
        raise RobotError(f"{label} is not a zip that can be read: {error}") from error
    text = contents.pop(_FILE, None)
    if text is None:
        raise RobotError(f"{label} holds no {_FILE}. Expected a file that `Robot.save` wrote.")
    arguments = parse_object(text, Path(name, _FILE), RobotError)
    check_choices(f"argument in {_FILE}", arguments, ARGUMENTS)
    return _zipped(contents), arguments


def digest(archive: bytes) -> str:
    """Return the SHA-256 of what is in an archive, however it is packed."""
    found = hashlib.sha256()
    with zipfile.ZipFile(io.BytesIO(archive)) as file:
        for name in sorted(file.namelist()):
            for part in (name.encode(), file.read(name)):
                found.update(len(part).to_bytes(8, "big") + part)
    return found.hexdigest()
