"""Conversion between a part's parameters in SI and its property group, without loss of digits.

Blender keeps numbers in 32 bits and within their range. Where that is not all of an adopted value, the
value itself is noted down, and holds for as long as the property stays as it was written.
"""

from __future__ import annotations

import dataclasses
from decimal import Decimal, InvalidOperation
from typing import Any

from ..core.base.errors import ParameterError
from ..core.base.quantity import Parameters
from .declared import INT_MAX, format_list
from .shown_units import to_shown, to_si, unit_of

#: What a property was written as, and the value that stands for; by the parameter's name.
Notes = dict[str, tuple[Any, Any]]


def write(group: Any, part: Parameters) -> Notes:
    """Write a part's parameters into its property group; return what the properties cannot hold.

    `group` bpy.types.PropertyGroup.
    """
    notes: Notes = {}
    for name, field in _fields(type(part)).items():
        value = getattr(part, name)
        assign(group, type(part), name, value)
        kept = getattr(group, name)
        if _meant(kept, field) != value:
            notes[name] = (kept, value)
    return notes


def assign(group: Any, kind: type[Parameters], name: str, value: Any) -> None:
    """Write one parameter, in SI, into its property.

    `group` bpy.types.PropertyGroup; `kind`: class of the part; `name`: of the parameter; `value`: SI.
    """
    power = _power(_fields(kind)[name])
    if isinstance(value, tuple):
        value = format_list(value, power)
    elif isinstance(value, float):
        value = to_shown(value, power)
    elif isinstance(value, int) and not isinstance(value, bool):
        value = min(value, INT_MAX)
    setattr(group, name, value)


def reset(group: Any, kind: type[Parameters], name: str) -> None:
    """Write one parameter's default into its property.

    `group` bpy.types.PropertyGroup; `kind`: class of the part; `name`: of the parameter.
    """
    assign(group, kind, name, _fields(kind)[name].default)


def read(group: Any, kind: type[Parameters], notes: Notes, section: str) -> dict[str, Any]:
    """Return a part's parameters in SI, as a scene file's section would give them.

    `group` bpy.types.PropertyGroup; `kind`: the part's parameters; `notes`: from `write`; `section`: what
    messages call the part. Raises ParameterError: on a list that cannot be read as numbers.
    """
    values = {}
    for name, field in _fields(kind).items():
        kept = getattr(group, name)
        noted = notes.get(name)
        try:
            values[name] = noted[1] if noted and noted[0] == kept else _meant(kept, field)
        except InvalidOperation:
            raise ParameterError(section, name, "must be numbers separated by commas", repr(kept)) from None
    return values


def _fields(kind: type[Parameters]) -> dict[str, dataclasses.Field[Any]]:
    """Return a part's fields by name."""
    return {field.name: field for field in dataclasses.fields(kind)}


def _power(field: dataclasses.Field[Any]) -> int:
    """Return the power of ten between a parameter and how it is shown."""
    return unit_of(field.metadata["quantity"].unit, field.default)[1]


def _meant(kept: Any, field: dataclasses.Field[Any]) -> Any:
    """Return the value a property stands for."""
    if isinstance(field.default, tuple):
        return tuple(float(Decimal(word.strip()).scaleb(-_power(field))) for word in kept.split(","))
    return to_si(kept, _power(field)) if isinstance(kept, float) else kept
