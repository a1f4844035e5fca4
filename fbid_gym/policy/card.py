"""Card of a shipped policy: its training and its measured performance."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

from fbid_gym.errors import PolicyFileError
from fbid_gym.policy.policy_file import typed
from fbid_gym.reading import read_object

FORMAT = 1


class Measured(NamedTuple):
    """A number over the card's episodes.

    Attributes:
        mean: over the episodes.
        low: lower end of its interval.
        high: upper end.
        unit: such as "m/s"; "share" of shares.
    """

    mean: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Card:
    """Training and measured performance of a shipped policy."""

    env_id: str
    """Environment of its training, with `env_args`."""
    env_args: Mapping[str, Any]
    """The action layer and its options among them."""
    environment: Mapping[str, Any]
    """Meaning of these arguments when it was shipped."""
    algorithm: str
    """Algorithm of the training."""
    seed: int
    """Of the training."""
    steps: int
    """Environment steps, over all robots, that it has learnt from."""
    total_steps: int
    """Of the whole training."""
    evaluations: int
    """Of the training: it is the one that returned most in one of them."""
    best_return: float
    """Its return there."""
    command: str
    """Command line that trains it again."""
    wall_seconds: float
    """Duration of the training up to there, s."""
    trained_with: Mapping[str, Any]
    """The commit, and versions of Python and packages."""
    measured_with: Mapping[str, Any]
    """The same of the code that measured it."""
    episodes: int
    """That were played for `metrics`, in an environment of each, on seeds of their own."""
    first_seed: int
    """Of these."""
    confidence: float
    """Of the intervals."""
    metrics: Mapping[str, Measured]
    """By the names of `train.episodes.METRICS`."""
    sha256: str
    """Digest of the policy, which is in its `policy.json`."""
    note: str = ""
    """Changes since it was measured."""

    def to_json(self) -> dict[str, Any]:
        """Return it as `card.json` holds it."""
        metrics = {name: value._asdict() for name, value in self.metrics.items()}
        return {"format": FORMAT, **asdict(self), "metrics": metrics}

    @classmethod
    def read(cls, file: Path) -> "Card":
        """Read a `card.json`.

        Raises:
            PolicyFileError: missing, corrupt, of an unknown format, or a value of another type.
        """
        data = read_object(file, PolicyFileError)
        if data.get("format") != FORMAT:
            raise PolicyFileError(f"{file}: format is {data.get('format')!r}. Expected {FORMAT}.")
        values = {}
        for item in fields(cls):
            usual = None if item.default is MISSING else item.default
            value = data.get(item.name, usual)
            values[item.name] = typed(value, _KINDS[item.type], item.name, file)
        metrics = values["metrics"].items()
        return cls(**{**values, "metrics": {name: _measured(x, name, file) for name, x in metrics}})

    def lines(self) -> list[str]:
        """Return it in words, a line each."""
        learnt = f"{self.steps:,} of {self.total_steps:,} steps, {self.wall_seconds / 60:.0f} min"
        return [
            f"environment: {self.env_id} {dict(self.env_args)}",
            f"trained:     {self.algorithm.upper()}, seed {self.seed}, {learnt}",
            f"             {self.command}",
            f"chosen:      best of {self.evaluations} evaluations of its training, "
            f"return {self.best_return:.1f}",
            f"commit:      {self.trained_with.get('commit')}",
            f"measured:    {self.episodes} episodes from seed {self.first_seed}, with "
            f"{self.confidence:.0%} intervals",
            *(
                f"  {name:18} {x.mean:.4g} ({x.low:.4g} to {x.high:.4g}) {x.unit}".rstrip()
                for name, x in self.metrics.items()
            ),
            *([f"note:        {self.note}"] if self.note else []),
        ]


_KINDS: Mapping[Any, tuple[type, ...]] = {
    str: (str,),
    int: (int,),
    float: (int, float),
    Mapping[str, Any]: (dict,),
    Mapping[str, Measured]: (dict,),
}


def _measured(value: Any, name: str, file: Path) -> Measured:
    if not isinstance(value, dict) or value.keys() != set(Measured._fields):
        expected = ", ".join(Measured._fields)
        raise PolicyFileError(f"{file}: metric {name!r} is {value!r}. Expected {expected}.")
    kinds = {"unit": (str,)}
    return Measured(
        **{
            key: typed(each, kinds.get(key, (int, float)), f"{key} of {name!r}", file)
            for key, each in value.items()
        }
    )


def expected(measured: Measured, card: Card, episodes: int) -> tuple[float, float]:
    """Return where the mean of as many fresh episodes is expected, as surely as the card's is.

    The interval of the card is that of its own episodes' mean; what fewer of them come to
    scatters more.
    """
    wider = math.sqrt(1.0 + card.episodes / episodes)
    return (
        measured.mean - wider * (measured.mean - measured.low),
        measured.mean + wider * (measured.high - measured.mean),
    )
