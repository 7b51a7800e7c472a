"""Physical parameters: default, unit, symbol, bounds and meaning in one place.

A part's parameters are a frozen dataclass that derives from `Parameters` and declares
its fields with `quantity`. Validation, messages, scene files, the table in the docs and
Blender's properties are derived from these declarations.
"""

from __future__ import annotations

import dataclasses
import math
import operator
import re
import unicodedata
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .errors import DigiclayError, ParameterError

#: Factor to the SI unit, and the SI unit, for values written as ``"3 mm"``.
UNITS: dict[str, tuple[float, str]] = {
    "m": (1.0, "m"), "cm": (1e-2, "m"), "mm": (1e-3, "m"), "um": (1e-6, "m"), "µm": (1e-6, "m"),
    "s": (1.0, "s"), "ms": (1e-3, "s"), "us": (1e-6, "s"), "µs": (1e-6, "s"),
    "Pa": (1.0, "Pa"), "kPa": (1e3, "Pa"), "bar": (1e5, "Pa"), "mbar": (1e2, "Pa"),
    "N": (1.0, "N"), "mN": (1e-3, "N"),
    "N/m": (1.0, "N/m"), "N/mm": (1e3, "N/m"), "1/m": (1.0, "1/m"), "1/mm": (1e3, "1/m"),
    "1/N": (1.0, "1/N"), "N s/m": (1.0, "N s/m"),
    "kg": (1.0, "kg"), "g": (1e-3, "kg"), "m/s": (1.0, "m/s"), "mm/s": (1e-3, "m/s"), "m/s2": (1.0, "m/s2"),
    "kg/m3": (1.0, "kg/m3"), "m2/s": (1.0, "m2/s"), "mm2/s": (1e-6, "m2/s"), "cSt": (1e-6, "m2/s"),
    "m3": (1.0, "m3"), "mm3": (1e-9, "m3"),
}  # fmt: skip

#: Smallest, unless 0, and largest number of a unit: far beyond all devices, and close enough to 1
#: that products of several neither overflow nor vanish.
EXTENTS: dict[str, tuple[float, float]] = {
    "m": (1e-12, 1e3), "s": (1e-9, 1e6), "Pa": (1e-6, 1e10), "N": (1e-12, 1e6), "N/m": (1e-6, 1e9),
    "1/m": (1e-6, 1e9), "1/N": (1e-6, 1e9), "m/s": (1e-12, 1e6), "m/s2": (1e-9, 1e9), "kg/m3": (1e-3, 1e6),
    "m2/s": (1e-12, 1e3), "N s/m": (1e-9, 1e9), "kg": (1e-9, 1e6), "m3": (1e-18, 1.0), "": (1e-9, 1e9),
}  # fmt: skip
#: Bounds of a parameter: the comparison that a valid value satisfies.
BOUNDS = {
    "above": operator.gt,
    "at_least": operator.ge,
    "below": operator.lt,
    "at_most": operator.le,
}
#: Plain signs in place of others.
PLAIN = str.maketrans("\N{GREEK SMALL LETTER MU}\N{MINUS SIGN}", "\N{MICRO SIGN}-")
#: A number, and the text after it.
WRITTEN = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)(?= |$))\s*((?!,).*)"
)


class Quantity(NamedTuple):
    """Declaration of one parameter.

    Bounds are in the parameter's own unit; ``above`` and ``below`` are exclusive, ``at_least`` and
    ``at_most`` inclusive. `source` is P (paper), D (derived), C (chosen) or the key of a reference
    in docs/nomenclature.md; several are separated by commas. A `later` one is unknown to older
    versions, and is only written if it is not the default, so that these read the rest. `whole` is
    the meaning of twice the value, which is shown in place of a semi-axis.
    """

    doc: str
    unit: str = ""
    symbol: str = ""
    source: str = "C"
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    choices: tuple[str, ...] = ()
    later: bool = False
    whole: str = ""

    def show(self, value: object) -> str:
        """Return a value as in messages, with the unit."""
        if isinstance(value, str):
            return repr(value)
        if isinstance(value, int) and abs(value) > 10**18:
            return f"a whole number of {int(value.bit_length() * math.log10(2.0)) + 1} digits"
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        return f"{text} {self.unit}".rstrip()

    def list_bounds(self) -> list[tuple[str, float]]:
        """Return the declared bounds, with their names in `BOUNDS`."""
        return [(word, getattr(self, word)) for word in BOUNDS if getattr(self, word) is not None]

    def broken_rule(self, value: Any) -> str:
        """Return the first rule that a value breaks, or ``""``."""
        if self.choices and value not in self.choices:
            return "must be one of " + ", ".join(self.choices)
        if not isinstance(value, (int, float)):
            return ""
        if not _finite(value):
            return "must be a finite number"
        for word, bound in self.list_bounds():
            if not BOUNDS[word](value, bound):
                return f"must be {word.replace('_', ' ')} {self.show(bound)}"
        return self._out_of_extent(value)

    def _out_of_extent(self, value: float) -> str:
        """Return the rule that a number beyond all devices breaks, or ``""``."""
        least, most = EXTENTS[self.unit]
        if self.at_most is None and self.below is None and value > most:
            return f"must be at most {self.show(most)}"
        if self.at_least is None and self.above is None and value < -most:
            return f"must be at least {self.show(-most)}"
        if self.above == 0.0 and value < least:
            return f"must be at least {self.show(least)}"
        return ""


def quantity(default: Any, doc: str, **fields: Any) -> Any:
    """Declare a dataclass field with its `Quantity`; `fields`: the other fields of that."""
    return dataclasses.field(default=default, metadata={"quantity": Quantity(doc, **fields)})


def list_quantities(parameters: type[Parameters] | Parameters) -> dict[str, Quantity]:
    """Return the declared quantities of a part, by field name."""
    return {f.name: f.metadata["quantity"] for f in dataclasses.fields(parameters)}


@dataclass(frozen=True, eq=False, repr=False)
class Parameters:
    """Base of every part's parameters: frozen and valid, or refused with ParameterError.

    It has the methods that dataclasses would make for each class, in a twentieth of a short
    command's time.
    """

    def _list_values(self) -> tuple[Any, ...]:
        return tuple([getattr(self, name) for name in self.__dataclass_fields__])

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._list_values() == other._list_values()

    def __hash__(self) -> int:
        return hash(self._list_values())

    def __repr__(self) -> str:
        values = map("{}={!r}".format, self.__dataclass_fields__, self._list_values())
        return f"{type(self).__qualname__}({', '.join(values)})"

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        for name, field in vars(cls).items():
            declared = (
                field.metadata.get("quantity") if isinstance(field, dataclasses.Field) else None
            )
            if declared and declared.unit not in EXTENTS:
                units = ", ".join(filter(None, EXTENTS))
                rule = f"must have one of the units {units}, or none for a number"
                raise ParameterError(cls.__name__, name, rule, repr(declared.unit))

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            declared: Quantity = field.metadata["quantity"]
            value = getattr(self, field.name)
            if isinstance(value, bool) and str(value).lower() in declared.choices:
                value = str(value).lower()  # TOML takes the word for a truth value
            value = _typed(self, field.name, value, field.default)
            object.__setattr__(self, field.name, value)
            for item in value if isinstance(value, tuple) else (value,):
                rule = declared.broken_rule(item)
                if rule:
                    raise ParameterError(type(self).__name__, field.name, rule, declared.show(item))
        try:
            self.check()
        except (DigiclayError, MemoryError, KeyboardInterrupt):
            raise
        except BaseException as error:  # of a method of one's own
            cause = f"{type(error).__name__}: {error}"
            raise ParameterError(
                type(self).__name__, "", "must pass its own check", cause
            ) from error

    def check(self) -> None:
        """Check the rules that join several fields; parts override this."""

    def list_idle(self) -> frozenset[str]:
        """Return the parameters without effect under the other choices: files have them only if changed."""
        return frozenset()


def refuse_overrides(kind: type, base: type, names: tuple[str, ...], reason: str) -> None:
    """Refuse a class that overrides attributes of its base which other code bypasses."""
    for name in names:
        if getattr(kind, name) is not getattr(base, name):
            raise ParameterError(
                kind.__name__, name, f"must be that of {base.__name__}: {reason}", "another"
            )


def _typed(owner: Parameters, name: str, value: Any, default: Any) -> Any:
    """Return `value` in the type of `default`; whole numbers are valid floats."""
    kind = type(default)
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind is float and number:
        return float(value) if _finite(value) else value
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if kind is tuple and isinstance(value, (list, tuple)) and value:
        return tuple(_typed(owner, name, item, default[0]) for item in value)
    if isinstance(value, kind) and kind is not tuple and (number or kind not in (int, float)):
        return value
    wanted = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    rule = f"must be {wanted.get(kind, 'a list of numbers')}"
    raise ParameterError(type(owner).__name__, name, rule, repr(value))


def _finite(value: float) -> bool:
    """Return whether a number is finite as a float; a whole number can be too large for one."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def normalize(text: str) -> str:
    """Return a quantity with plain signs for similar ones: Greek mu, ``²``, minus, special spaces."""
    return unicodedata.normalize("NFKC", text).translate(PLAIN)


def parse(text: str, unit: str) -> float:
    """Return a quantity with one of the `UNITS`, such as ``"3 mm"``, in an SI unit.

    Raises ValueError when the number or the unit cannot be read, or the unit is of another
    quantity.
    """
    match = WRITTEN.fullmatch(normalize(text).strip())
    if not match:
        raise ValueError(f"must be a number, or a text such as '1.5 {unit}'")
    value, name = float(match[1]), match[2]
    factor, si = UNITS.get(name, (0.0, ""))
    if not si:
        names = [key for key, (_, measured) in UNITS.items() if measured == unit]
        raise ValueError(f"must have a unit known here: {', '.join(names)}")
    if si != unit:
        raise ValueError(f"must be in {unit or 'no unit'} or a multiple of it")
    return value * factor


def show_digits(value: float, digits: int = 2) -> str:
    """Write a number with so many digits that count, and without an exponent below a million."""
    return f"{float(f'{value:.{digits}g}'):g}"


def find_nearest_name(name: str, names: list[str], alike: float = 0.5) -> str:
    """Return the name most similar to a misspelt one, or ``""``; `alike`, 0 to 1: least similarity."""
    import difflib  # only needed after a mistake

    return next(iter(difflib.get_close_matches(name, names, n=1, cutoff=alike)), "")
