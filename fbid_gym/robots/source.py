"""Sources of a robot: a file, a text, a spec, or the name of a published robot."""

import codecs
import hashlib
import importlib
import importlib.util
import io
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard, Union
from xml.parsers.expat import ExpatError

import mujoco

from fbid_gym.checks import check_choices
from fbid_gym.errors import InvalidValueError, RobotError, shown
from fbid_gym.reading import read_file
from fbid_gym.robots.archive import pack
from fbid_gym.robots.bounds import MOST_TEXT, check_bounds
from fbid_gym.robots.mjcf import warnings_heard

MENAGERIE = "menagerie:"  # how the names of robots of `mujoco_menagerie` begin
_EXPECTED = (
    "the path or text of an MJCF or URDF, an mujoco.MjSpec, a name of robot_descriptions, or "
    f"{MENAGERIE}NAME"
)
_SUFFIXES = (".xml", ".urdf")  # that MuJoCo knows a file by
_DESCRIPTION = "_description"  # the end of the names of robot_descriptions

RobotSource = Union[str, Path, mujoco.MjSpec, "Source"]


@dataclass(frozen=True)
class Source:
    """Source of a robot's description; reading it twice gives the same robot."""

    # Path of a file; text of an MJCF or URDF; or a spec, as a zip of its MJCF and assets.
    content: Path | str | bytes
    digest: str  # SHA-256 of the content, of a file without what it includes

    @classmethod
    def of(cls, source: RobotSource) -> "Source":
        """Resolve what a user gives.

        Raises:
            InvalidValueError: none of the kinds.
            RobotError: no such file, or no such published robot.
            UnknownOptionError: `mujoco_menagerie` has no robot or no file of this name.
        """
        if isinstance(source, Source):
            return source
        if isinstance(source, mujoco.MjSpec):
            return cls.known(pack(source))
        if isinstance(source, str) and source.removeprefix("\ufeff").lstrip().startswith("<"):
            return cls.known(source.removeprefix("\ufeff"))
        if not isinstance(source, str | Path):
            raise InvalidValueError("robot", source, _EXPECTED)
        path = Path(source)
        if is_published(source) and not is_file(path):
            path = (_of_menagerie if source.startswith(MENAGERIE) else _described)(source)
        if not is_file(path):
            fault = "is a folder" if os.path.isdir(path) else "does not exist"
            given = f"Robot file {shown(str(path))} {fault}"
            raise RobotError(f"{given}. Expected the path of an MJCF or URDF.")
        return cls.known(path.resolve())

    @classmethod
    def known(cls, content: Path | str | bytes) -> "Source":
        """Return the source of a content, see the attribute."""
        return cls(content, hashlib.sha256(_bytes(content)).hexdigest())

    @property
    def label(self) -> str:
        """Its name in messages."""
        return f"Robot file {str(self.content)!r}" if self.folder else "The robot's description"

    @property
    def folder(self) -> Path | None:
        """The folder of a file."""
        return self.content.parent if isinstance(self.content, Path) else None

    @property
    def name(self) -> str:
        """The robot's name, where the description gives none."""
        return self.content.stem if isinstance(self.content, Path) else "robot"

    @property
    def text(self) -> bytes:
        """Contents of the file, or the text."""
        return _bytes(self.content).removeprefix(codecs.BOM_UTF8)

    @property
    def is_urdf(self) -> bool:
        """Whether it is a URDF."""
        if isinstance(self.content, bytes):
            return False
        text = re.sub(rb"<!--.*?-->", b"", self.text, flags=re.DOTALL)
        root = re.search(rb"<(robot|mujoco)\b", text)
        return root is not None and root.group(1) == b"robot"

    def read(self) -> tuple[mujoco.MjSpec, list[str]]:
        """Parse it; returns its spec, and what MuJoCo warned of meanwhile.

        Raises RobotError where MuJoCo cannot parse it, it asks for more than `bounds` allow, or the
        file has changed.
        """
        if self.folder and self.known(self.content).digest != self.digest:
            raise RobotError(f"{self.label} has changed since the robot was loaded.")
        try:
            check_bounds(self.content, self.label)
            with warnings_heard() as heard:
                spec = self._parsed()
        except (ExpatError, ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
            kind = "URDF" if self.is_urdf else "MJCF"
            raise RobotError(f"{self.label} is not a valid {kind}: {error}") from error
        # Equal limits are locked joints, which they are made.
        told = [text for text in heard if "equal lower and upper limits" not in text]
        return spec, [f"MuJoCo: {text}." for text in dict.fromkeys(told)]

    def _parsed(self) -> mujoco.MjSpec:
        if isinstance(self.content, bytes):
            return mujoco.MjSpec.from_zip(io.BytesIO(self.content))
        if isinstance(self.content, str):
            return mujoco.MjSpec.from_string(self.content)
        text = _bytes(self.content)
        if self.content.suffix in _SUFFIXES and not text.startswith(codecs.BOM_UTF8):
            return mujoco.MjSpec.from_file(str(self.content))
        spec = mujoco.MjSpec.from_string(text.removeprefix(codecs.BOM_UTF8).decode())
        spec.modelfiledir = str(self.content.parent)
        return spec


def is_published(source: object) -> TypeGuard[str]:
    """Tell whether a source is, or could be, a published robot's name; its publisher knows."""
    return isinstance(source, str) and (
        source.startswith(MENAGERIE) or source.endswith(_DESCRIPTION)
    )


def is_file(path: Path) -> bool:
    """Return whether a path is that of a file; one that is too long, or no path at all, is not."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _bytes(content: Path | str | bytes) -> bytes:
    if isinstance(content, Path):
        return read_file(content, MOST_TEXT, RobotError)
    return content.encode(errors="surrogatepass") if isinstance(content, str) else content


def _described(name: str) -> Path:
    """Path of a robot of `robot_descriptions`, which keeps a cache of its own."""
    if importlib.util.find_spec("robot_descriptions") is None:
        raise RobotError(
            f"{name!r} is no file, and the package robot_descriptions, which would know a robot of "
            "this name, is not installed (pip install robot_descriptions)."
        )
    own = f"robot_descriptions.{name}"
    try:
        module = importlib.import_module(own)
    except Exception as error:  # it fetches what it does not have, in whatever way
        if isinstance(error, ModuleNotFoundError) and error.name == own:
            raise RobotError(f"The package robot_descriptions has no robot {name!r}.") from None
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RobotError(f"robot_descriptions cannot provide {name!r}: {reason}") from error
    path = getattr(module, "MJCF_PATH", None) or getattr(module, "URDF_PATH", None)
    if path is None:
        raise RobotError(f"{name!r} of robot_descriptions has neither an MJCF nor a URDF.")
    return Path(path)


def _of_menagerie(name: str) -> Path:
    """Path of a robot of `mujoco_menagerie`, which fetches it at its first use and keeps it."""
    if importlib.util.find_spec("mujoco_menagerie") is None:
        raise RobotError(
            f"{name!r} is a robot of the package mujoco-menagerie, which is not installed: "
            "pip install 'fbid_gym[menagerie]'."
        )
    import mujoco_menagerie as menagerie

    robot, _, file = name.removeprefix(MENAGERIE).partition("/")
    check_choices("robot of mujoco_menagerie", [robot], menagerie.names())
    found = menagerie.get(robot)
    check_choices(f"file of {MENAGERIE}{robot}", [file] if file else [], found.entry_names)
    try:
        return Path(found.xml(file or found.default_model))
    except (menagerie.MenagerieError, OSError) as error:
        reason = " ".join(str(error).split())
        raise RobotError(f"mujoco_menagerie cannot provide {name!r}: {reason}") from error
