"""Card of a shipped policy: its training and its measured performance."""

import math
from collections.abc import Mapping
from typing import Any

from msgspec import Struct


class Measured(Struct, frozen=True, forbid_unknown_fields=True):
    """A number over the card's episodes."""

    mean: float
    """Over the episodes."""
    low: float
    """Lower end of its interval."""
    high: float
    """Upper end."""
    unit: str
    """Such as "m/s"; "share" of shares."""


class Card(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Training and measured performance of a shipped policy; its file holds it."""

    environment: Mapping[str, Any]
    """Meaning of the policy's arguments when it was shipped."""
    seed: int
    """Of the training."""
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
    note: str = ""
    """Changes since it was measured."""

    def expected(self, metric: str, episodes: int) -> tuple[float, float]:
        """Return where the mean of as many fresh episodes is expected, as surely as the card's is.

        The interval of the card is that of its own episodes' mean; what fewer of them come to
        scatters more.
        """
        measured, wider = self.metrics[metric], math.sqrt(1.0 + self.episodes / episodes)
        return (
            measured.mean - wider * (measured.mean - measured.low),
            measured.mean + wider * (measured.high - measured.mean),
        )
