"""The policies that come with the package, with their cards."""

from pathlib import Path
from typing import NamedTuple

from fbid_gym.errors import PolicyFileError
from fbid_gym.policy import policy_file
from fbid_gym.policy.card import Card
from fbid_gym.policy.policy import Policy


class Shipped(NamedTuple):
    """A policy that comes with the package."""

    name: str
    """Environment and arm, such as "QuadrupedWalk-v0/base_acceleration"."""
    path: Path
    """Its file, which `Policy.load` takes."""
    policy: Policy
    """What the file holds, with the environment and the arguments of its training."""
    card: Card
    """Its training and its measured performance."""

    @property
    def layer(self) -> str:
        """Action layer that it acts through."""
        return str(self.policy.env_args.get("action_layer", ""))

    def lines(self) -> list[str]:
        """Return its card in words, a line each."""
        policy, card = self.policy, self.card
        steps = f"{policy.trained_steps:,} of {card.total_steps:,} steps"
        learnt = f"{steps}, {card.wall_seconds / 60:.0f} min"
        return [
            f"environment: {policy.env_id} {dict(policy.env_args)}",
            f"trained:     {policy.algorithm.upper()}, seed {card.seed}, {learnt}",
            f"             {card.command}",
            f"chosen:      best of {card.evaluations} evaluations of its training, "
            f"return {card.best_return:.1f}",
            f"commit:      {card.trained_with.get('commit')}",
            f"measured:    {card.episodes} episodes from seed {card.first_seed}, with "
            f"{card.confidence:.0%} intervals",
            *(
                f"  {name:18} {x.mean:.4g} ({x.low:.4g} to {x.high:.4g}) {x.unit}".rstrip()
                for name, x in card.metrics.items()
            ),
            *(f"robots:      {sentence}" for sentence in card.transfer()),
            *([f"note:        {card.note}"] if card.note else []),
        ]


def shipped(folder: Path | None = None) -> tuple[Shipped, ...]:
    """Return the policies that come with the package, or in a folder like theirs, by name.

    Raises PolicyFileError where one is damaged, or has no card.
    """
    found = []
    for name, file in policy_file.shelved(folder or policy_file.shelf()).items():
        policy = Policy.load(file)
        if policy.card is None:
            raise PolicyFileError(f"{file}: has no card. Expected a policy of eval.tools.ship.")
        found.append(Shipped(name, file, policy, policy.card))
    return tuple(found)
