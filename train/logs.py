"""The learning curve on disk: CSV rows and TensorBoard events that a resumed run continues."""

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from torch.utils.tensorboard import SummaryWriter

from fbid_gym.errors import RunError


class CsvLog:
    """A CSV file with a fixed header, one complete row per `append`."""

    def __init__(self, path: Path, columns: Sequence[str], size: int | None) -> None:
        """Open the file.

        Args:
            path: the file.
            columns: its header.
            size: bytes to keep, as `size` said at the checkpoint; None to start the file anew.

        Raises:
            RunError: the file is shorter than that, or has another header.
        """
        self._columns = tuple(columns)
        header = _line(self._columns)
        if size is None:
            path.write_bytes(header)
        else:
            found = path.read_bytes() if path.exists() else b""
            if len(found) < size or not found.startswith(header):
                raise RunError(
                    f"{path}: has {len(found)} bytes. Expected at least the {size} it had at the "
                    f"checkpoint, starting with {header.decode().strip()!r}."
                )
            # Rows after the checkpoint belong to steps that will be taken again.
            os.truncate(path, size)
        self._file = path.open("ab")

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._file.tell()

    def append(self, row: Mapping[str, float]) -> None:
        """Write one row; the keys are the columns."""
        self._file.write(_line([row[name] for name in self._columns]))
        self._file.flush()

    def sync(self) -> None:
        """Wait until the rows are on the disk."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class TensorBoardLog:
    """Scalars for TensorBoard."""

    def __init__(self, folder: Path, steps: int) -> None:
        """Open a new event file.

        Args:
            folder: of the event files.
            steps: where the run continues; TensorBoard hides earlier events beyond it.
        """
        self._writer = SummaryWriter(str(folder), purge_step=steps + 1 if steps else None)

    def append(self, group: str, row: Mapping[str, float]) -> None:
        """Write one scalar per column of the row but `steps`, which is their x-axis."""
        for name, value in row.items():
            if name != "steps":
                self._writer.add_scalar(f"{group}/{name}", value, int(row["steps"]))

    def sync(self) -> None:
        """Write the events out."""
        self._writer.flush()

    def close(self) -> None:
        """Write the events out and close the file."""
        self._writer.close()


def _line(values: Sequence[object]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(values)
    return text.getvalue().encode()
