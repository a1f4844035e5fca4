"""Settings as the query of an address: ahead=0.5&layer=com_wrench.

Settings that are not named are as at the start. So a query names those that differ from the start,
and those that a command line may have chosen for it.
"""

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import parse_qsl, urlencode
from urllib.parse import quote as quoted

from eval.play.controls import Control, Settings, checked
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Choice

_LONGEST = 10_000
_CHOSEN = ("layer", "policy", "contact_limits", "sensors", "terrain", "difficulty", "gait")


def to_query(offered: Mapping[str, Control], settings: Settings) -> str:
    """Return settings as the query of an address, without its question mark."""
    written = {
        name: value if isinstance(value, str) else json.dumps(value)
        for name, value in settings.items()
        if name in _CHOSEN or value != offered[name].default
    }
    return urlencode(written, safe="/:", quote_via=quoted)


def words_of(query: str) -> dict[str, str]:
    """Return the words of a query by what they are for; InvalidValueError for no such query."""
    expected = "a link as the page shows it, with each setting once"
    if len(query) > _LONGEST:
        raise InvalidValueError("link", query[:40], expected)
    if not query:
        return {}
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=True, errors="strict")
    except ValueError:
        raise InvalidValueError("link", query[:80], expected) from None
    if len(dict(pairs)) < len(pairs):
        raise InvalidValueError("link", query[:80], expected)
    return dict(pairs)


def from_words(offered: Mapping[str, Control], words: Mapping[str, str]) -> Settings:
    """Return the settings that words stand for; FbidError for a value that may not be set."""
    return {n: checked(offered, n, _value(offered, n, word)) for n, word in words.items()}


def _value(offered: Mapping[str, Control], name: str, word: str) -> Any:
    """Read a word of a query: a name in a menu, else a number, true or false."""
    if name in offered and isinstance(offered[name].kind, Choice):
        return word
    try:
        return json.loads(word)
    except (ValueError, RecursionError):
        return word
