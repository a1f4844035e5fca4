"""The learning curve on disk: CSV rows that a resumed run continues and others read meanwhile."""

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fbid_gym.errors import RunError
from fbid_gym.reading import MOST_DATA, read_file

PROGRESS = ("steps", "wall_seconds", "fps", "falls", "return_mean", "length_mean")
"""Columns of `progress.csv`; those of the learner follow. Falls are all since the beginning."""

EVALUATIONS = (
    "steps", "wall_seconds", "episodes", "return_mean", "return_std", "return_q25", "return_q75",
    "length_mean", "survival", "velocity_error", "turning_error", "slip", "cost_of_transport",
)  # fmt: skip
"""Columns of `evaluations.csv`."""


def read_rows(path: Path) -> list[dict[str, str]]:
    """Return the complete rows by column: none before the file is there, never half of one.

    Raises:
        RunError: it cannot be read as a table.
    """
    if not path.exists():
        return []
    try:
        text = read_file(path, MOST_DATA, RunError).decode()
        return list(csv.DictReader(text[: text.rfind("\n") + 1].splitlines()))
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{path}: no table, or corrupt ({error}).") from error


def last_steps(path: Path) -> int:
    """Return the steps of the last complete row; 0 where there is none.

    Raises:
        RunError: it cannot be read as a table of a training.
    """
    rows = read_rows(path)
    try:
        return int(float(rows[-1]["steps"])) if rows else 0
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise RunError(f"{path}: is not the table of a training.") from error


def to_csv(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Return the rows as CSV with a header; of each row only these columns."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([row[name] for name in columns] for row in rows)
    return text.getvalue()


def check_kept(path: Path, columns: Sequence[str], size: int) -> None:
    """Check that a table still holds the bytes it had at a checkpoint.

    Raises:
        RunError: the file is shorter than that, or has another header.
    """
    header = to_csv(columns, ()).encode()
    found = read_file(path, MOST_DATA, RunError) if path.exists() else b""
    if len(found) < size or not found.startswith(header):
        raise RunError(
            f"{path}: has {len(found)} bytes. Expected at least the {size} it had at the "
            f"checkpoint, starting with {header.decode().strip()!r}."
        )


class TableWriter:
    """A CSV file with a fixed header, one complete row per `append`."""

    def __init__(self, path: Path, columns: Sequence[str], size: int | None) -> None:
        """Open the file.

        Args:
            path: the file.
            columns: its header.
            size: bytes to keep, as `size` said at the checkpoint and `check_kept` found; None to
                start the file anew.
        """
        self._columns = tuple(columns)
        if size is None:
            path.write_text(to_csv(columns, ()))
        else:
            # Rows after the checkpoint belong to steps that will be taken again.
            os.truncate(path, size)
        self._file = path.open("ab")

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._file.tell()

    def append(self, row: Mapping[str, float]) -> None:
        """Write one row; the keys are the columns."""
        _, line = to_csv(self._columns, [row]).splitlines(keepends=True)
        self._file.write(line.encode())
        self._file.flush()

    def sync(self) -> None:
        """Wait until the rows are on the disk."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()
