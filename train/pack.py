"""Pack the finished runs of a folder into one archive: `python -m train.pack studies/walking`.

`studies/walking.zip` then holds their curves, settings and policies, and every command reads
`studies/walking/RUN` from it where there is no such folder. Runs that it held before stay in it;
a folder replaces the run of its name. Checkpoints, TensorBoard events and the policy of the best
evaluation are not packed.
"""

import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import tyro

from fbid_gym.errors import FbidError, RunError
from train.command import run_command
from train.runs.archive import KEPT, SUFFIX, as_archive, read_archive
from train.runs.files import write
from train.runs.folder import RunFolder
from train.runs.reading import load


@dataclass(frozen=True)
class PackConfig:
    """Pack the finished runs of a folder into an archive of its name beside it."""

    runs: tyro.conf.Positional[Path]
    """Folder of the run folders."""
    remove: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Remove the folders that were packed, with what was not: they cannot be trained further."""


class Packed(NamedTuple):
    """Result of `pack`."""

    archive: Path  # the archive
    runs: tuple[Path, ...]  # folders that were packed
    left: tuple[str, ...]  # why others were not, a sentence each


def pack(folder: Path) -> Packed:
    """Pack the finished runs of a folder.

    Raises:
        RunError: there is none, an earlier archive cannot be read, or it became too large. Nothing
            is written then.
    """
    archive = folder.absolute().with_name(folder.absolute().name + SUFFIX)
    runs = read_archive(archive) if archive.exists() else {}
    packed, left = list[Path](), list[str]()
    for config in sorted(folder.glob(f"*/{RunFolder.to_write(folder).config.name}")):
        run = config.parent
        try:
            load(run)  # finished, and whole
        except FbidError as error:
            left.append(str(error))
            continue
        runs[run.name] = {n: (run / n).read_bytes() for n in KEPT if (run / n).is_file()}
        packed.append(run)
    if not packed:
        raise RunError(" ".join([f"{folder}: holds no finished run.", *left]))
    write(archive, as_archive(runs))
    return Packed(archive, tuple(packed), tuple(left))


def main(config: PackConfig) -> None:
    """Pack, remove, and say what was done."""
    done = pack(config.runs)
    if config.remove:
        for run in done.runs:
            shutil.rmtree(run)
    print("\n".join([*done.left, f"{len(done.runs)} runs in {done.archive}"]))


if __name__ == "__main__":
    sys.exit(run_command("train.pack", PackConfig, main, about=__doc__))
