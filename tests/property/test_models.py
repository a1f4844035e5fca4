"""Descriptions of robots, mutated: each is read, or refused in one sentence, and soon."""

import contextlib
import random
import re
import warnings

from hypothesis import given
from hypothesis import strategies as st

from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot
from fbid_gym.robots.built_in import asset_path

NASTY = ("nan", "inf", "-1e308", "1e999", "0", "-1", "1e-300", "1e20", "", "x", "0 0 0 0 0 0 0")
ELEMENTS = (
    '<replicate count="1000000000"><geom size="1"/></replicate>',
    '<composite type="cable" count="100000 1 1"/>',
    "<frame>" * 300,
    '<include file="/dev/zero"/>',
    "<!--",
    '<body name="x"><freejoint/></body>',
    "<worldbody/>",
)
KINDS = ("number", "cut", "repeat", "byte", "element")
CHANGE = st.tuples(st.sampled_from(KINDS), st.integers(0, 2**31))


@given(st.sampled_from(["biped.xml", "quadruped.xml"]), st.lists(CHANGE, min_size=1, max_size=4))
def test_models(robot: str, changes: list[tuple[str, int]]) -> None:
    text = asset_path(robot).read_text()
    for kind, seed in changes:
        text = _changed(text, kind, random.Random(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo's, of models that it takes all the same
        with contextlib.suppress(FbidError):
            Robot.from_mjcf(text, ["left", "right"])


def _changed(text: str, kind: str, rng: random.Random) -> str:
    if kind == "number":
        numbers = list(re.finditer(r"-?\d+(\.\d+)?", text))
        if numbers:
            chosen = rng.choice(numbers)
            return text[: chosen.start()] + rng.choice(NASTY) + text[chosen.end() :]
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
    return text[:place] + rng.choice(ELEMENTS) + text[place:]
