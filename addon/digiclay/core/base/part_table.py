"""Parameters of a part from a TOML table, with errors of one line."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from .errors import ParameterError
from .quantity import Parameters, find_nearest_name, list_quantities, parse

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
    """Build a part from its section.

    `section`: what messages call it; `kind`: class of the part; `defaults`: values that differ from the
    class's own; `own`: what the section says.
    """
    known = list_quantities(kind)
    refuse_unknown(section, own, (*known, "method") if section == "control" else tuple(known))
    given = {key: _measured(section, key, value, known[key].unit) for key, value in own.items()}
    try:
        return kind(**{**defaults, **given})
    except ParameterError as error:
        rule = error.rule.replace(f"{error.owner}.", f"{section}.")
        said = own.get(error.field)
        value = show_value(said) if isinstance(said, str) else shorten(error.value)
        raise ParameterError(section, error.field, rule, value, error.hint) from None


class ReadParts:
    """Parts that were read so far: what many tables have in common is read once.

    Parts are frozen, so that those who get the same one do not disturb each other.
    """

    def __init__(self) -> None:
        self._parts: dict[tuple[Any, ...], Any] = {}

    def read(self, section: str, kind: type[Part], defaults: Table, own: Table) -> Part:
        """Build a part from its section, or return the one that was built of the same.

        `section`, `kind`, `defaults`, `own`: as `read_part` has them.
        """
        key = section, kind, repr(defaults), repr(own)
        part: Part = self.keep(key, read_part, section, kind, defaults, own)
        return part

    def keep(self, key: tuple[Any, ...], make: Callable[..., Any], *given: Any) -> Any:
        """Return what was made for a key, or make it. `given`: its arguments."""
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
