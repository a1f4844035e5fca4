"""The policies that come with the package, in `assets/policies`: a folder of each with its card.

    assets/policies/QuadrupedWalk-v0/base_acceleration/card.json
    assets/policies/QuadrupedWalk-v0/base_acceleration/policy/

Instead of a path, commands also take `shipped:` and the name of one of them.
"""

from pathlib import Path
from typing import NamedTuple

from fbid_gym.errors import UnknownOptionError
from fbid_gym.own_files import asset_places
from fbid_gym.policy.card import Card

PREFIX = "shipped:"
CARD = "card.json"


class Shipped(NamedTuple):
    """A policy that comes with the package."""

    name: str
    """Environment and arm, such as "QuadrupedWalk-v0/base_acceleration"."""
    env: str
    """Gymnasium id of its environment."""
    layer: str
    """Action layer that it acts through."""
    path: Path
    """Its folder, which `Policy.load` takes."""
    card: Card
    """Its training and its measured performance."""


def shipped() -> tuple[Shipped, ...]:
    """Return the policies that come with the package, by name.

    Raises:
        PolicyFileError: the card of one is damaged.
    """
    return shelved(shelf())


def shelved(folder: Path) -> tuple[Shipped, ...]:
    """Return the policies of a folder that is like `assets/policies`.

    Raises:
        PolicyFileError: the card of one is damaged.
    """
    found = []
    for name in names(folder):
        card = Card.read(folder / name / CARD)
        layer = str(card.env_args.get("action_layer", ""))
        found.append(Shipped(name, card.env_id, layer, folder / name, card))
    return tuple(found)


def place_of(source: str | Path) -> Path:
    """Return the folder of a policy: of a shipped one by its name, else the path itself.

    Raises:
        UnknownOptionError: no policy of that name is shipped.
    """
    name = str(source)
    if not name.startswith(PREFIX):
        return Path(source)
    folder = shelf()
    known = [PREFIX + each for each in names(folder)]
    if name not in known:
        raise UnknownOptionError("shipped policy", name, known or ("none",))
    return folder / name.removeprefix(PREFIX)


def shelf() -> Path:
    """Return the folder of the shipped policies, there or not."""
    places = asset_places("policies")
    return next((path for path in places if path.is_dir()), places[-1])


def names(folder: Path) -> list[str]:
    """Return the names of the policies in a folder that is like `assets/policies`."""
    return sorted(f"{p.parent.parent.name}/{p.parent.name}" for p in folder.glob(f"*/*/{CARD}"))
