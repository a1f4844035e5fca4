"""The learning curve as TensorBoard events that a resumed run continues."""

from collections.abc import Mapping
from pathlib import Path

from torch.utils.tensorboard import SummaryWriter


class TensorBoardLog:
    """Scalars for TensorBoard."""

    def __init__(self, folder: Path, steps: int) -> None:
        """Open a new event file; TensorBoard hides earlier events beyond the steps it begins at."""
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
