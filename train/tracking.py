"""The learning curve at Weights & Biases, beside TensorBoard: `--track`."""

import os
from collections.abc import Mapping
from typing import Any

from fbid_gym.errors import FbidError

PROJECT = "fbid_gym"
"""Where WANDB_PROJECT names no other."""


class TrackedLog:
    """Scalars for Weights & Biases. A training that is continued is another run of its group."""

    def __init__(self, name: str, config: Mapping[str, Any]) -> None:
        """Begin a run there, named after the run folder.

        Where, as whom and whether over a network at all is for wandb's own variables to say, such
        as WANDB_MODE=offline.

        Raises:
            FbidError: the package wandb is not installed, or refuses.
        """
        try:
            import wandb
        except ModuleNotFoundError as error:
            raise FbidError(
                "--track needs wandb, which is not installed. It comes with the extra 'track': "
                "pip install 'fbid_gym[track]'."
            ) from error
        project = os.environ.get("WANDB_PROJECT", PROJECT)
        try:
            self._run = wandb.init(project=project, name=name, group=name, config=dict(config))
        except wandb.Error as error:
            raise FbidError(f"--track: {error}") from error

    def append(self, group: str, row: Mapping[str, float]) -> None:
        """Write one scalar per column of the row but `steps`, which is their x-axis."""
        self._run.log(
            {f"{group}/{name}": value for name, value in row.items() if name != "steps"},
            step=int(row["steps"]),
        )

    def sync(self) -> None:
        """Do nothing: wandb sends its rows as they come."""

    def close(self) -> None:
        """Send what is left, and end the run."""
        self._run.finish()
