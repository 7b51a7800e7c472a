"""TOML text, checked before parsing, and parts of its tables, with errors of one line."""

import html
import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..base.errors import ParameterError
from ..base.quantity import Parameters, find_nearest_name, list_quantities, parse

#: Named values, as TOML and JSON have them: those that are read only, and those that may be
#: changed.
Table = Mapping[str, Any]
Record = dict[str, Any]

#: Most bytes of a text: the packed heights of the largest bed, 20 million cells, take 107 MB.
LARGEST = 128_000_000
#: Most names of a dotted key, each stored with all before it, and most letters of a word or a
#: number.
PARTS, LETTERS = 16, 1000
_NAME = r'(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|\'[^\'\n]*+\')'
#: Parts of a text: a key of too many names, a word, texts, a comment. Without backtracking: an
#: unterminated text extends as far as possible.
_PIECES = re.compile(
    rf"(?P<key>{_NAME}(?:[ \t]*+\.[ \t]*+{_NAME}){{{PARTS}}})|(?P<word>[A-Za-z0-9_-]++)"
    r'|"""(?:[^"\\]|\\.|"(?!""))*+(?:""")?|\'\'\'(?:[^\']|\'(?!\'\'))*+(?:\'\'\')?'
    r'|"(?:[^"\\\n]|\\.)*+"?|\'[^\'\n]*+\'?|#[^\n]*+',
    re.DOTALL,
)


def parse_tables(text: str) -> Record:
    """Return the tables of a TOML text; ValueError with ``(at line ...)`` if known, or RecursionError."""
    if len(text) > LARGEST:
        raise ValueError(
            f"must have at most {LARGEST // 1_000_000} MB (got {len(text) / 1e6:.0f} MB)"
        )
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


def format_value(value: object) -> str:
    """Return a text, number, truth value, list or table of them in TOML; a float is restored exactly."""
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, Mapping):
        pairs = (f"{format_value(str(key))} = {format_value(item)}" for key, item in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(format_value, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # The escapes of JSON are those of TOML, which also needs one for the delete character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


Part = TypeVar("Part", bound=Parameters)


def refuse_unknown(section: str, table: Table, names: Sequence[str]) -> None:
    """Refuse unknown keys. `section`: its name in the message; `names`: known keys."""
    for key, value in table.items():
        if key in names:
            continue
        owner = section and f"{section}."
        close = find_nearest_name(key, list(names))
        asked = f"Did you mean {owner}{close}?" if close else f"Known here: {', '.join(names)}."
        name = key if re.fullmatch(r"[\w-]+", key) else repr(key)
        raise ParameterError(f"{owner}{name}", "", "must be a known key", show_value(value), asked)


def read_part(section: str, kind: type[Part], defaults: Table, table: Table) -> Part:
    """Return a part from the table of its section; `defaults`: values in place of those of the class."""
    quantities = list_quantities(kind)
    names = (*quantities, "method") if section == "control" else tuple(quantities)
    refuse_unknown(section, table, names)
    given = {
        key: _measured(section, key, value, quantities[key].unit) for key, value in table.items()
    }
    try:
        return kind(**{**defaults, **given})
    except ParameterError as error:
        rule = error.rule.replace(f"{error.owner}.", f"{section}.")
        written = table.get(error.field)
        value = show_value(written) if isinstance(written, str) else shorten(error.value)
        raise ParameterError(section, error.field, rule, value, error.hint) from None


class ReadParts:
    """Cache of parts: equal sections of many tables are read once.

    Parts are frozen, and can be shared.
    """

    def __init__(self) -> None:
        self._parts: dict[tuple[Any, ...], Any] = {}

    def read(self, make: Callable[..., Any], *given: Any) -> Any:
        """Return the result of a function, from the cache for equal arguments."""
        key = make, *(value if isinstance(value, type) else repr(value) for value in given)
        if key not in self._parts:
            self._parts[key] = make(*given)
        return self._parts[key]


def _measured(section: str, key: str, value: Any, unit: str) -> Any:
    """Return a value in SI units if it is written with a unit, also within a list."""
    if isinstance(value, list):
        return [_measured(section, key, item, unit) for item in value]
    if not isinstance(value, str) or not unit:
        return value
    try:
        return parse(value, unit)
    except ValueError as error:
        raise ParameterError(section, key, str(error), show_value(value)) from None


class Described:
    """Base of values that are shown by a title and a few facts, in a notebook as a table of HTML."""

    if TYPE_CHECKING:  # a field or a property

        @property
        def name(self) -> str: ...

    def describe(self) -> dict[str, str]:
        """Return what matters most of it, by name."""
        raise NotImplementedError

    def __repr__(self) -> str:
        facts = (f"  {name}: {text}" for name, text in self.describe().items())
        return "\n".join([f"{type(self).__name__} {self.name}".rstrip(), *facts])

    def _repr_html_(self) -> str:
        left = 'style="text-align:left"'
        title, *_ = html.escape(repr(self)).splitlines()
        lines = (
            f"<tr><th {left}>{html.escape(name)}</th><td {left}>{html.escape(text)}</td></tr>"
            for name, text in self.describe().items()
        )
        return f"<table><caption {left}>{title}</caption>{''.join(lines)}</table>"


def show_value(value: object) -> str:
    """Return a value from a file as one short line."""
    if isinstance(value, dict):
        return "a section" if value else "an empty section"
    return shorten(repr(value))


def shorten(text: str) -> str:
    """Return a text shortened to a line."""
    return text if len(text) <= 60 else f"{text[:57]}..."
