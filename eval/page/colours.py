"""Which colour of the page an action layer has: the same in every report."""

from collections.abc import Iterable

NUM_COLOURS = 10  # of the page's style, `c0`, `c1` and so on

COLOURS = (
    "base acceleration",
    "joint position",
    "torque",
    "joint acceleration",
    "com wrench",
    "joint position feedforward",
)
"""A layer has the same colour in every report; layers with options take the remaining ones."""


def colours_of(names: Iterable[str]) -> dict[str, int]:
    """Return the number of the colour of each name: of a layer, of one with options, of an arm."""
    words = {name: name.replace("_", " ") for name in names}
    chosen = {name: COLOURS.index(its) for name, its in words.items() if its in COLOURS}
    free = [k for k in range(NUM_COLOURS) if k not in chosen.values()]
    for k, name in enumerate(sorted(words.keys() - chosen.keys())):
        chosen[name] = free[k % len(free)]
    return chosen
