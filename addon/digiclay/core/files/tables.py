"""TOML text, checked before parsing, and parts of its tables, with errors of one line."""

import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from ..base.errors import ParameterError
from ..base.quantity import Parameters, find_nearest_name, list_quantities, parse

#: Most bytes of a text: the heights of the largest bed, 20 million cells, packed, take 107 MB of them.
LARGEST = 128_000_000
#: Most names of a dotted key, each of which is kept with all before it; most letters of a word or a number.
PARTS, LETTERS = 16, 1000
_NAME = r'(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|\'[^\'\n]*+\')'
#: What a text is made of, as far as it matters here: a key of too many names, a word, texts, a comment.
#: Nothing is gone over twice: a text without an end reaches as far as it can.
_PIECES = re.compile(
    rf"(?P<key>{_NAME}(?:[ \t]*+\.[ \t]*+{_NAME}){{{PARTS}}})|(?P<word>[A-Za-z0-9_-]++)"
    r'|"""(?:[^"\\]|\\.|"(?!""))*+(?:""")?|\'\'\'(?:[^\']|\'(?!\'\'))*+(?:\'\'\')?'
    r'|"(?:[^"\\\n]|\\.)*+"?|\'[^\'\n]*+\'?|#[^\n]*+',
    re.DOTALL,
)


def parse_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text; ValueError with ``(at line ...)`` where known, or RecursionError."""
    if len(text) > LARGEST:
        raise ValueError(f"must have at most {LARGEST // 1_000_000} MB (got {len(text) / 1e6:.0f} MB)")
    for piece in _PIECES.finditer(text):
        if piece["key"]:
            rule = f"a key must have at most {PARTS} names, got {piece['key'][:20]}..."
        elif piece["word"] and len(piece["word"]) > LETTERS:
            rule = f"a word or number must have at most {LETTERS} letters, got {len(piece['word'])}"
        else:
            continue
        line = text.count("\n", 0, piece.start()) + 1
        raise ValueError(f"{rule} (at line {line})")
    return tomllib.loads(text)


def format_value(value: Any) -> str:
    """Write a text, number, truth value, or a list of them; a float reads back as the same one."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(format_value, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's; only TOML wants the delete character escaped as well.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


Table = Mapping[str, Any]
Part = TypeVar("Part", bound=Parameters)


def refuse_unknown(section: str, table: Table, names: Sequence[str]) -> None:
    """Refuse keys that mean nothing. `section`: what the message calls it; `names`: known keys."""
    for key, value in table.items():
        if key in names:
            continue
        owner = section and f"{section}."
        close = find_nearest_name(key, list(names))
        asked = f"Did you mean {owner}{close}?" if close else f"Known here: {', '.join(names)}."
        name = key if re.fullmatch(r"[\w-]+", key) else repr(key)
        raise ParameterError(f"{owner}{name}", "", "must be a known key", show_value(value), asked)


def read_part(section: str, kind: type[Part], defaults: Table, own: Table) -> Part:
    """Build a part from its section `own`; `defaults`: values that differ from the class's own."""
    quantities = list_quantities(kind)
    refuse_unknown(section, own, (*quantities, "method") if section == "control" else tuple(quantities))
    given = {key: _measured(section, key, value, quantities[key].unit) for key, value in own.items()}
    try:
        return kind(**{**defaults, **given})
    except ParameterError as error:
        rule = error.rule.replace(f"{error.owner}.", f"{section}.")
        own_value = own.get(error.field)
        value = show_value(own_value) if isinstance(own_value, str) else shorten(error.value)
        raise ParameterError(section, error.field, rule, value, error.hint) from None


class ReadParts:
    """Parts that were read so far: what many tables have in common is read once.

    Parts are frozen, so that those who get the same one do not disturb each other.
    """

    def __init__(self) -> None:
        self._parts: dict[tuple[Any, ...], Any] = {}

    def read(self, make: Callable[..., Any], *given: Any) -> Any:
        """Return what a function makes of its arguments, or what it made of equal ones before."""
        key = make, *(one if isinstance(one, type) else repr(one) for one in given)
        if key not in self._parts:
            self._parts[key] = make(*given)
        return self._parts[key]


def _measured(section: str, key: str, value: Any, unit: str) -> Any:
    """Turn quantities written with a unit into SI, also within a list."""
    if isinstance(value, list):
        return [_measured(section, key, item, unit) for item in value]
    if not isinstance(value, str) or not unit:
        return value
    try:
        return parse(value, unit)
    except ValueError as error:
        raise ParameterError(section, key, str(error), show_value(value)) from None


def show_value(value: Any) -> str:
    """Write a value from a file on one short line."""
    if isinstance(value, dict):
        return "a section" if value else "an empty section"
    return shorten(repr(value))


def shorten(text: str) -> str:
    """Shorten a text that would not fit on a line."""
    return text if len(text) <= 60 else f"{text[:57]}..."
