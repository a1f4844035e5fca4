"""Settings as text: a line of JSON, or the query of an address.

    {"ahead": 0.5, "layer": "com_wrench"}           ?ahead=0.5&layer=com_wrench

What is not named is as at the start. So only what differs is named, and what the command line has
chosen for the start: elsewhere it may have chosen something else.
"""

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import parse_qsl, urlencode
from urllib.parse import quote as quoted

from eval.play.controls import Control, Menu, Settings, checked
from fbid_gym.errors import InvalidValueError

_LONGEST = 10_000
_CHOSEN = ("layer", "policy", "contact_limits", "terrain", "difficulty", "gait")


def to_text(offered: Mapping[str, Control], settings: Settings) -> str:
    """Return settings as one line of JSON, to be sent to somebody."""
    return json.dumps(_named(offered, settings))


def from_text(offered: Mapping[str, Control], text: Any) -> Settings:
    """Read what `to_text` wrote: what it names.

    Raises:
        FbidError: not such a text, or a value that may not be set.
    """
    expected = "settings as the page shows them, a line of JSON"
    if not isinstance(text, str) or len(text) > _LONGEST:
        raise InvalidValueError("settings", str(text)[:40], expected)
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        raise InvalidValueError("settings", text[:80], expected) from None
    if not isinstance(given, dict):
        raise InvalidValueError("settings", text[:80], expected)
    return {name: checked(offered, name, value) for name, value in given.items()}


def to_query(offered: Mapping[str, Control], settings: Settings) -> str:
    """Return settings as the query of an address, without its question mark."""
    written = {
        name: value if isinstance(value, str) else json.dumps(value)
        for name, value in _named(offered, settings).items()
    }
    return urlencode(written, safe="/:", quote_via=quoted)


def from_query(offered: Mapping[str, Control], query: str) -> Settings:
    """Read what `to_query` wrote: what it names.

    Raises:
        FbidError: not such a query, or a value that may not be set.
    """
    expected = "a link as the page shows it, with each setting once"
    if len(query) > _LONGEST:
        raise InvalidValueError("link", query[:40], expected)
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=True, errors="strict")
    except ValueError:
        raise InvalidValueError("link", query[:80], expected) from None
    if len(dict(pairs)) < len(pairs):
        raise InvalidValueError("link", query[:80], expected)
    return {name: checked(offered, name, _value(offered, name, word)) for name, word in pairs}


def _named(offered: Mapping[str, Control], settings: Settings) -> Settings:
    return {
        name: value
        for name, value in settings.items()
        if name in _CHOSEN or value != offered[name].default
    }


def _value(offered: Mapping[str, Control], name: str, word: str) -> Any:
    """What a word of a query stands for: itself in a menu, else a number, true or false."""
    if isinstance(offered.get(name), Menu):
        return word
    try:
        return json.loads(word)
    except (ValueError, RecursionError):
        return word
