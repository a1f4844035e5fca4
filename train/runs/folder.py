"""Files of a run folder, on the disk or in the archive of its study."""

from pathlib import Path
from typing import NamedTuple

from fbid_gym.bundles import fresh_path
from fbid_gym.policy import Policy
from train.runs.archive import found


class RunFolder(NamedTuple):
    """The paths of a run; whether anything is there is the reader's to find out."""

    path: Path  # the folder itself
    # The resolved configuration as JSON; makes a folder a run folder. A resume may change it.
    config: Path
    # Of Python, packages, this repository and the platform, when the run began: JSON.
    versions: Path
    environment: Path  # meaning of the arguments of an environment of ours when the run began: JSON
    robot: Path  # the robot, where it is none of the built-in ones: as `Robot.save` writes it
    progress: Path  # one row per iteration: CSV
    evaluations: Path  # one row per evaluation: CSV
    checkpoint: Path  # the latest exact state: a file of `fbid_gym.bundles`
    replay: Path  # the replay buffer, of algorithms that have one: files of `train.replay`
    policy: Path  # the policy at the latest evaluation or checkpoint, whichever is later
    best_policy: Path  # the policy of the evaluation with the highest mean return
    tensorboard: Path  # TensorBoard events
    lock: Path  # held by the process that trains

    @classmethod
    def of(cls, path: Path) -> "RunFolder":
        """Return the paths to read in a folder, there or not, or in a copy of a packed one.

        Raises:
            RunError: an archive that may hold it cannot be read.
        """
        return cls.to_write(found(path))._replace(path=path)

    @classmethod
    def to_write(cls, path: Path) -> "RunFolder":
        """Return the paths in a folder, there or not."""
        names = (
            *("config.json", "versions.json", "environment.json", "robot.zip", "progress.csv"),
            *("evaluations.csv", "checkpoint.safetensors", "replay", "policy.safetensors"),
            *("policy_best.safetensors", "tensorboard", ".lock"),
        )
        return cls(path, *(path / name for name in names))

    @property
    def exported_steps(self) -> int:
        """Steps that the exported policy was trained for; 0 without one.

        Raises:
            PolicyFileError: its file cannot be read.
        """
        found = [place for place in (self.policy, self.older[1]) if place.exists()]
        return Policy.load(found[0]).trained_steps if found else 0

    @property
    def older(self) -> tuple[Path, ...]:
        """Folders that were in the place of files of today: checkpoint and policies."""
        return tuple(self.path / name for name in ("checkpoint", "policy", "policy_best"))

    @property
    def results(self) -> set[Path]:
        """All files of a run beside its configuration, with leftovers of killed writes."""
        replaced = {self.checkpoint, self.policy, self.best_policy}
        return {
            *(self.progress, self.evaluations, self.tensorboard, self.replay),
            *replaced,
            *map(fresh_path, replaced),
            *self.beginnings,
            *self.older,
        }

    @property
    def beginnings(self) -> set[Path]:
        """Files that a run may leave that is killed before its configuration is written."""
        written = {self.versions, self.environment, self.robot}
        return {*written, *map(fresh_path, (self.config, *written))}
