"""Blender properties from the declarations of the core's parameters.

A property shows its parameter in the unit a person reads, with the unit in its label, the bounds
as its range, and meaning, symbol, bounds and default in its tooltip.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal, InvalidOperation
from typing import Any

from ..compat import Context, PropertyGroup, bpy
from ..core.base.errors import ParameterError
from ..core.base.quantity import EXTENTS, Parameters, Quantity
from ..core.control.displays import SHAPES
from .shown_units import to_shown, to_si, unit_of

#: What Blender's whole numbers hold at most.
INT_MAX = 2**31 - 1
#: How far inside a bound that is not allowed itself a property ends, as a share of the default; no
#: nearer than numbers of the unit can be, by the same share of those, since Blender's numbers are
#: rounded.
INSIDE = 1e-6
#: How many times the default dragging the mouse reaches; typing reaches all of the range.
REACH = 10.0
#: Fields that take a shape's name or file.
SHAPED = ("shape", "field", "file")

#: What the names of properties of twice a parameter begin with.
WHOLE = "whole_"
#: Labels of parameters whose names, stored in files, are spelled otherwise, or mean two things.
LABELS = {"centring_time": "Centering Time", "drive.share": "Shared Commands"}

Update = Callable[[Any, Any], None]


def _named(declare: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of Blender's that declares a property, given label and tooltip first."""
    return lambda name, words="", **options: declare(name=name, description=words, **options)


choice = _named(bpy.props.EnumProperty)
number = _named(bpy.props.FloatProperty)
integer = _named(bpy.props.IntProperty)
flag = _named(bpy.props.BoolProperty)
text = _named(bpy.props.StringProperty)


def group(
    name: str, kind: type[Parameters], updates: dict[str, Update], names: Iterable[str] = ()
) -> type:
    """Make the property group of a part, or of some fields of it.

    `updates` of its fields are called with group and context.
    """
    fields = _fields(kind)
    properties = {
        field: _property(fields[field], updates.get(field), f"{name}.{field}")
        for field in names or fields
    }
    return make_group(name, kind.__doc__ or "", properties)


def make_group(name: str, words: str, properties: dict[str, Any]) -> type:
    """Make a property group of properties."""
    content = {"__annotations__": properties, "__module__": __name__, "__doc__": words}
    return type(f"DIGICLAY_PG_{name}", (bpy.types.PropertyGroup,), content)


def whole(field: dataclasses.Field[Any], get: Callable[[PropertyGroup], float], put: Update) -> Any:
    """Make the property of twice a parameter, computed by `get` and taken by `put`; no keyframes."""
    quantity: Quantity = field.metadata["quantity"]
    quantity = quantity._replace(doc=quantity.whole, symbol=f"2 {quantity.symbol}")
    default: Any = field.default
    unit, power = unit_of(quantity.unit, default)
    return bpy.props.FloatProperty(
        **_numbers(quantity, 2.0 * default, power),
        name=f"{title(field.name)} ({unit})",
        description=_tooltip(quantity, 2.0 * default, unit, power),
        get=get,
        set=put,
        options=set(),
    )


def title(name: str) -> str:
    """Return a name of the core as a label: ``valve_lag`` is Valve Lag."""
    return LABELS.get(name) or name.replace("_", " ").title()


def _property(field: dataclasses.Field[Any], update: Update | None, key: str) -> Any:
    """Make the property of one parameter, ``drive.share`` for instance."""
    quantity: Quantity = field.metadata["quantity"]
    default = field.default
    unit, power = unit_of(quantity.unit, default)
    label = LABELS.get(key) or title(field.name)
    label = f"Half {label}" if quantity.whole else label
    options: dict[str, Any] = {
        "name": f"{label} ({unit})" if unit else label,
        "description": _tooltip(quantity, default, unit, power),
        "update": update,
    }
    if quantity.choices:
        items = [(choice, title(choice), "") for choice in quantity.choices]
        return bpy.props.EnumProperty(items=items, default=default, **options)
    if isinstance(default, bool):
        return bpy.props.BoolProperty(default=default, **options)
    if isinstance(default, int):
        low, high = quantity.at_least or 0, min(quantity.at_most or INT_MAX, INT_MAX)
        return bpy.props.IntProperty(default=default, min=int(low), max=int(high), **options)
    if isinstance(default, float):
        return bpy.props.FloatProperty(**_numbers(quantity, default, power), **options)
    if isinstance(default, tuple):
        return bpy.props.StringProperty(default=format_list(default, power), **options)
    if field.name in SHAPED:
        options |= {"search": _shapes, "search_options": {"SUGGESTION"}}
    return bpy.props.StringProperty(default=default, **options)


def format_list(values: tuple[float, ...], power: int) -> str:
    """Write a list of SI values in the unit they are shown in, 10**power to an SI unit: ``4, 70, 1400``."""
    return ", ".join(repr(to_shown(value, power)).removesuffix(".0") for value in values)


def _numbers(quantity: Quantity, default: float, power: int) -> dict[str, Any]:
    """Return default, range, and how a number is shown and dragged."""
    start = to_shown(default, power)
    least = to_shown(EXTENTS[quantity.unit][0], power)
    inside = max(INSIDE * (abs(start) or 1.0), (1.0 + INSIDE) * least)
    reach = REACH * (abs(start) or 0.1)
    low = _bound(quantity.at_least, quantity.above, power, inside)
    high = _bound(quantity.at_most, quantity.below, power, -inside)
    decimals = len(f"{start:.6f}".rstrip("0").partition(".")[2])
    return {
        "default": start,
        **({} if low is None else {"min": low}),
        **({} if high is None else {"max": high}),
        "soft_min": -reach if low is None else low,
        "soft_max": reach if high is None else min(high, max(reach, start)),
        "precision": min(6, max(2, decimals + 1)),
        "step": int(min(100, max(1, round(5.0 * abs(start))))),
    }


def _bound(closed: float | None, opened: float | None, power: int, inside: float) -> float | None:
    """Return an end of a range in the unit shown; an end that is not allowed itself is moved inside."""
    if closed is not None:
        return to_shown(float(closed), power)
    return None if opened is None else to_shown(float(opened), power) + inside


def _tooltip(quantity: Quantity, default: object, unit: str, power: int) -> str:
    """Return meaning, symbol, bounds and default of a parameter; Blender adds the full stop."""

    def value(number: float) -> str:
        plain = isinstance(default, int)
        return f"{number if plain else to_shown(float(number), power):.6g} {unit}".rstrip()

    parts = [quantity.doc[0].upper() + quantity.doc[1:]]
    parts += [f"symbol {quantity.symbol}"] if quantity.symbol else []
    parts += [
        f"{word.replace('_', ' ')} {value(number)}" for word, number in quantity.list_bounds()
    ]
    if isinstance(default, tuple):
        parts.append(
            f"separated by commas, by default {format_list(default, power)} {unit}".rstrip()
        )
    elif isinstance(default, (int, float)):
        parts.append(f"by default {value(default)}")
    return "; ".join(parts)


def _shapes(group: PropertyGroup, context: Context, text: str) -> list[str]:
    """Suggest the shapes that have a name; a file's path may be typed as well."""
    return [name for name in SHAPES if text.lower() in name]


#: What a property was written as, and the value that stands for; by the parameter's name.
Notes = dict[str, tuple[Any, Any]]


def write(group: PropertyGroup, part: Parameters) -> Notes:
    """Write a part's parameters into its property group; return what the properties cannot hold."""
    notes: Notes = {}
    for name, field in _fields(type(part)).items():
        value = getattr(part, name)
        assign(group, type(part), name, value)
        stored = getattr(group, name)
        if _meant(stored, field) != value:
            notes[name] = (stored, value)
    return notes


def assign(group: PropertyGroup, kind: type[Parameters], name: str, value: Any) -> None:
    """Write one parameter, in SI, into its property."""
    power = _power(_fields(kind)[name])
    if isinstance(value, tuple):
        value = format_list(value, power)
    elif isinstance(value, float):
        value = to_shown(value, power)
    elif isinstance(value, int) and not isinstance(value, bool):
        value = min(value, INT_MAX)
    setattr(group, name, value)


def fill(
    group: PropertyGroup, kind: type[Parameters], names: Iterable[str], values: Mapping[str, Any]
) -> None:
    """Write some parameters into their properties: those that values give, and defaults of the others."""
    fields = _fields(kind)
    for name in names:
        assign(group, kind, name, values.get(name, fields[name].default))


def read(
    group: PropertyGroup,
    kind: type[Parameters],
    notes: Notes,
    section: str,
    names: Iterable[str] = (),
) -> dict[str, Any]:
    """Return a part's parameters, or some, in SI, as a scene file's section would give them."""
    values, fields = {}, _fields(kind)
    for name in names or fields:
        field = fields[name]
        stored = getattr(group, name)
        noted = notes.get(name)
        try:
            values[name] = noted[1] if noted and noted[0] == stored else _meant(stored, field)
        except InvalidOperation:
            raise ParameterError(
                section, name, "must be numbers separated by commas", repr(stored)
            ) from None
    return values


def _fields(kind: type[Parameters]) -> dict[str, dataclasses.Field[Any]]:
    """Return a part's fields by name."""
    return {field.name: field for field in dataclasses.fields(kind)}


def _power(field: dataclasses.Field[Any]) -> int:
    """Return the power of ten between a parameter and how it is shown."""
    return unit_of(field.metadata["quantity"].unit, field.default)[1]


def _meant(stored: Any, field: dataclasses.Field[Any]) -> Any:
    """Return the value a property stands for."""
    if isinstance(field.default, tuple):
        return tuple(
            float(Decimal(word.strip()).scaleb(-_power(field))) for word in stored.split(",")
        )
    return to_si(stored, _power(field)) if isinstance(stored, float) else stored
