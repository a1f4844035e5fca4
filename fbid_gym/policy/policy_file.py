"""The file of a policy: where it is, also of one that comes with the package, and its formats.

    assets/policies/QuadrupedWalk-v0/base_acceleration.safetensors

Instead of a path, commands also take `shipped:` and the name of one of these.
"""

import hashlib
import json
from pathlib import Path

from fbid_gym.bundles import SUFFIX, Bundle, load_bundle, read_tensors
from fbid_gym.errors import InvalidValueError, PolicyFileError, UnknownOptionError
from fbid_gym.own_files import asset_places
from fbid_gym.reading import MOST_DATA, read_file, read_object

FORMAT = 3
"""Of what is written. Formats 1 and 2 are folders of two files, which are still read."""

NAME = f"policy{SUFFIX}"
"""The file of a policy in a run folder."""

PREFIX = "shipped:"

_OLDER = "policy.json"  # of formats 1 and 2, beside the arrays


def place_of(source: str | Path) -> Path:
    """Return the file of a shipped policy by its name, else the path itself.

    Where the arm of a name is that of one policy alone, it is enough: `shipped:any-quadruped`.
    Raises UnknownOptionError where no policy of that name is shipped.
    """
    if not isinstance(source, str | Path):
        raise InvalidValueError("policy", source, "the path of one, or shipped:NAME")
    name = str(source)
    if not name.startswith(PREFIX):
        return Path(source)
    known = {PREFIX + each: file for each, file in shelved(shelf()).items()}
    arm = name.removeprefix(PREFIX)
    alone = [full for full in known if full.partition("/")[2] == arm]
    if name not in known and len(alone) != 1:
        raise UnknownOptionError("shipped policy", name, known or ("none",))
    return known[name] if name in known else known[alone[0]]


def shelf() -> Path:
    """Return the folder of the shipped policies, there or not."""
    places = asset_places("policies")
    return next((path for path in places if path.is_dir()), places[-1])


def shelved(folder: Path) -> dict[str, Path]:
    """Return the files of policies in a folder that is like `assets/policies`, by their names."""
    files = sorted(folder.glob(f"*/*{SUFFIX}"))
    return {f"{file.parent.name}/{file.name.removesuffix(SUFFIX)}": file for file in files}


def read_policy(path: Path) -> tuple[Path, Bundle]:
    """Read the policy in a file, in a run folder, or in a folder of before.

    Returns the file, for messages, and what it holds: no format, and the entries of format 3.
    PolicyFileError names a file that is not there, truncated, corrupt or of an unknown format.
    """
    for folder in (path, path / "policy"):
        # First, as arrays of before have the name that policies have now.
        if (folder / _OLDER).exists():
            return folder / _OLDER, _read_older(folder)
    file = path / NAME if path.is_dir() else path
    if not file.exists():
        raise PolicyFileError(
            f"{path}: no policy here. Expected a policy's file, or a run folder with {NAME}, which "
            "training writes at every evaluation and checkpoint."
        )
    if file.suffix == ".onnx":
        expected = "the policy that such a model is exported from, a run folder or a"
        raise PolicyFileError(f"{file}: an ONNX model. Expected {expected} {SUFFIX} file.")
    bundle = load_bundle(file, PolicyFileError)
    _check_format(file, bundle.data.pop("format", None), FORMAT)
    return file, bundle


def _read_older(folder: Path) -> Bundle:
    """Read formats 1 and 2; in the first all are clipped and trained by PPO, and do not say so."""
    file, arrays = folder / _OLDER, folder / NAME
    data = read_object(file, PolicyFileError)
    packed = read_file(arrays, MOST_DATA, PolicyFileError)
    expected = data.pop("sha256", None)
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    found = hashlib.sha256(hashlib.sha256(packed).digest() + text.encode()).hexdigest()
    if expected != found:
        raise PolicyFileError(
            f"{arrays}: corrupt, or from another save than {_OLDER} beside it: their SHA-256 is "
            f"{found}. Expected {expected!r}."
        )
    _check_format(file, data.pop("format", None), 1, 2)
    for nested in ("network", "normalisation"):
        if isinstance(data.get(nested), dict):
            data |= data.pop(nested)
    for told in ("hidden", "observation_size", "action_size"):  # by the arrays as well
        data.pop(told, None)
    usual = {"output": "clip", "algorithm": "ppo", "card": None}
    return Bundle(usual | data, read_tensors(packed, arrays, PolicyFileError))


def _check_format(file: Path, found: object, *known: int) -> None:
    if type(found) is not int or found not in known:
        expected = " or ".join(map(str, known))
        raise PolicyFileError(f"{file}: format is {found!r}. Expected {expected}.")
