"""Environments with layers, not all with all: neither knows of the other."""

from collections.abc import Iterable

from fbid_gym.actions import LAYERS


def pairs(names: Iterable[str], each: int = 2) -> list[tuple[str, str]]:
    """Each environment with so many layers, all layers in turn."""
    layers = [*LAYERS]
    return [
        (name, layers[(each * i + k) % len(layers)])
        for i, name in enumerate(names)
        for k in range(each)
    ]
