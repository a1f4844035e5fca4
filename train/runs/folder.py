"""Where things lie in a run folder."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class RunFolder:
    """The folder of a run; what lies there or not is the reader's to find out."""

    path: Path

    @property
    def config(self) -> Path:
        """The resolved configuration; what makes a folder a run folder."""
        return self.path / "config.json"

    @property
    def versions(self) -> Path:
        """Of Python, packages, this repository and the platform, when the run began."""
        return self.path / "versions.json"

    @property
    def environment(self) -> Path:
        """What the arguments of the environment meant when the run began."""
        return self.path / "environment.json"

    @property
    def progress(self) -> Path:
        """One row per iteration."""
        return self.path / "progress.csv"

    @property
    def evaluations(self) -> Path:
        """One row per evaluation."""
        return self.path / "evaluations.csv"

    @property
    def checkpoint(self) -> Path:
        """The latest exact state."""
        return self.path / "checkpoint"

    @property
    def policy(self) -> Path:
        """The policy at the latest evaluation, at the end of training the final one."""
        return self.path / "policy"

    @property
    def best_policy(self) -> Path:
        """The policy of the evaluation with the highest mean return."""
        return self.path / "policy_best"

    @property
    def tensorboard(self) -> Path:
        """TensorBoard events."""
        return self.path / "tensorboard"

    @property
    def lock(self) -> Path:
        """Held by the process that trains."""
        return self.path / ".lock"

    @property
    def results(self) -> tuple[Path, ...]:
        """All that a run writes but its configuration, with what a killed write may leave."""
        files = (self.versions, self.environment)
        bundles = (self.checkpoint, self.policy, self.best_policy)
        return (
            *(*files, self.progress, self.evaluations, self.tensorboard, *bundles),
            *(path.with_name(f"{path.name}.new") for path in (self.config, *files, *bundles)),
            *(path.with_name(f"{path.name}.old") for path in bundles),
        )
