"""Descriptions of robots, mutated: each is read, or refused in one sentence, and soon."""

import random
import re
import time
import warnings
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot
from fbid_gym.robots.assets import asset_path

_MOST_SECONDS = 30.0
_NASTY = ("nan", "inf", "-1e308", "1e999", "0", "-1", "1e-300", "1e20", "", "x", "0 0 0 0 0 0 0")
_KINDS = ("number", "cut", "repeat", "byte", "element")
_ELEMENTS = (
    '<replicate count="1000000000"><geom size="1"/></replicate>',
    '<composite type="cable" count="100000 1 1"/>',
    "<frame>" * 300,
    '<include file="/dev/zero"/>',
    "<!--",
    '<body name="x"><freejoint/></body>',
    "<worldbody/>",
)

UNIT = "changes"


def cases() -> st.SearchStrategy[dict[str, Any]]:
    """Return the choice of a robot and of what is done to its text."""
    change = st.tuples(st.sampled_from(_KINDS), st.integers(0, 2**31)).map(list)
    return st.fixed_dictionaries(
        {
            "robot": st.sampled_from(["biped.xml", "quadruped.xml"]),
            "changes": st.lists(change, min_size=1, max_size=4),
        }
    )


def amount(case: dict[str, Any]) -> int:
    """Return how often the text of a case is changed."""
    return len(case["changes"])


def faults(case: dict[str, Any]) -> Iterator[str]:
    """Yield what goes wrong in a case, one sentence each."""
    text = asset_path(case["robot"]).read_text()
    for kind, seed in case["changes"]:
        text = _changed(text, kind, random.Random(seed))
    began = time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # MuJoCo's, of models that it takes all the same
            Robot.from_mjcf(text, ["left", "right"])
    except FbidError:
        pass
    if time.monotonic() - began > _MOST_SECONDS:
        yield f"took more than {_MOST_SECONDS:g} s"


def _changed(text: str, kind: str, rng: random.Random) -> str:
    if kind == "number":
        numbers = list(re.finditer(r"-?\d+(\.\d+)?", text))
        if numbers:
            chosen = rng.choice(numbers)
            return text[: chosen.start()] + rng.choice(_NASTY) + text[chosen.end() :]
    first = rng.randrange(len(text) + 1)
    last = min(first + rng.randrange(1, 200), len(text))
    if kind == "cut":
        return text[:first] + text[last:]
    if kind == "repeat":
        return text[:last] + text[first:]
    if kind == "byte":
        return text[:first] + chr(rng.choice([0, 1, 0xE9, 0xDC80, 0xFFFF, 60])) + text[first + 1 :]
    ends = [match.end() for match in re.finditer(r"<body[^>]*>", text)] or [first]
    place = rng.choice(ends)
    return text[:place] + rng.choice(_ELEMENTS) + text[place:]
