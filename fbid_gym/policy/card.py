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


class OnRobot(Struct, frozen=True, forbid_unknown_fields=True):
    """Results of a policy on a robot that it never saw, beside the zero action of its layer."""

    robot: str
    """Its name."""
    mass: float
    """kg."""
    joints: int
    returned: float
    """Mean over the episodes."""
    survived: float
    """Share of the episodes without a fall."""
    zero_returned: float
    zero_survived: float


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
    robots: tuple[str, ...] = ()
    """Names of those that it learnt with, where these were several."""
    unseen: tuple[OnRobot, ...] = ()
    """Robots that it never saw."""
    unseen_episodes: int = 0
    """On each of them."""
    note: str = ""
    """Changes since it was measured."""

    def transfer(self) -> list[str]:
        """Say in a few sentences what it learnt with and how it did on robots that it never saw."""
        told, those = list[str](), self.unseen
        if self.robots:
            played = self.environment.get("robot", "the robot of the environment")
            many = len(self.robots) > 20
            names = ", ".join((self.robots[0], "...", self.robots[-1]) if many else self.robots)
            told.append(f"Learnt with {len(self.robots)} robots: {names}; measured on {played}.")
        if not those:
            return told
        up = sum(x.survived for x in those) / len(those)
        zero = sum(x.zero_survived for x in those) / len(those)
        told.append(
            f"On {len(those)} robots that it never saw, {self.unseen_episodes} episodes each: "
            f"{up:.1%} without a fall (zero action {zero:.1%}), a greater return than the zero "
            f"action's on {sum(x.returned > x.zero_returned for x in those)}."
        )
        for words, bad in (
            ("It falls in more than half of them on", [x for x in those if x.survived < 0.5]),
            ("It earns less than the zero action on",
             [x for x in those if x.returned < x.zero_returned]),
        ):  # fmt: skip
            if bad:
                those_of = (f"{x.robot} ({x.mass:.3g} kg, {x.joints} joints)" for x in bad)
                told.append(f"{words} {', '.join(those_of)}.")
        return told

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
