"""Conversion between scene files' tables and `schema.Scene`."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from typing import Any

from ..base.errors import ParameterError
from ..base.part_table import cut, read_part, refuse_unknown, shown
from ..base.quantity import quantities
from ..control.methods import METHODS
from .schema import NEEDS, OPTIONAL, SECTIONS, UNASKED, Path, Scene, Waypoint, parameters

__all__ = ["ABSENT", "PRESETS", "resolve", "text"]

Table = Mapping[str, Any]

#: What stands for a part that is left out.
ABSENT = "absent"
#: What a preset changes of the defaults.
PRESETS: dict[str, dict[str, dict[str, Any]]] = {
    "paper": {},
    "fast": {"valve": {"orifice_diameter": 0.6e-3}},
    "viscous": {"fluid": {"viscosity": 3.2e-6, "density": 908.0}, "valve": {"orifice_diameter": 0.6e-3}},
}
TEXTS = ("name", "description", "preset")
TOP_LEVEL = (*TEXTS, *SECTIONS, "trajectory")
#: Share of the flat-plate law a cell of a hexagonal bed carries: its cells stand closer.
HEXAGONAL_SHARE = 0.29


def resolve(table: Table, name: str = "") -> Scene:
    """Make a scene of the tables of a scene file; whatever they leave open gets its default.

    Parameters
    ----------
    table : mapping
        As `tomllib.loads` gives it.
    name : str, optional
        The scene's name, where the table has none.

    Raises
    ------
    ParameterError
        Its owner is the section.
    """
    refuse_unknown("", table, TOP_LEVEL)
    texts: dict[str, Any] = {
        key: _text(key, table.get(key, default))
        for key, default in zip(TEXTS, (name, "", "paper"), strict=True)
    }
    if texts["preset"] not in PRESETS:
        raise ParameterError("preset", "", f"must be one of {', '.join(PRESETS)}", repr(texts["preset"]))
    given = {
        section: _section(section, table.get(section, ABSENT if section in UNASKED else {}))
        for section in SECTIONS
    }
    method = _method(given["control"])
    parts: dict[str, Any] = {}
    for section in SECTIONS:
        own, needed = given[section], NEEDS.get(section)
        if (
            own is None
            or (needed and given[needed] is None)
            or (section == "blister" and not _forms_one(method, own))
        ):
            parts[section] = None
            continue
        defaults = dict(PRESETS[texts["preset"]].get(section, {}))
        if section == "blister":
            defaults |= METHODS[method].blister or {}
        if section == "contact" and parts["layout"].arrangement == "hexagonal":
            defaults["share"] = HEXAGONAL_SHARE
        parts[section] = read_part(section, parameters(section, method), defaults, own)
    path = _path(table.get("trajectory", {}), parts["actuator"].rest_height)
    return Scene(**parts, **texts, trajectory=path, method=method)


def _text(key: str, value: Any) -> str:
    """Return a value that must be a text."""
    if not isinstance(value, str):
        raise ParameterError(key, "", "must be a text", shown(value))
    if not all(letter.isprintable() or (letter in "\n\t" and key == "description") for letter in value):
        raise ParameterError(key, "", "must be printable", shown(value))
    return value


def _section(section: str, value: Any) -> dict[str, Any] | None:
    """Return the table of a section, or None for a part that is left out."""
    if value == ABSENT and section in OPTIONAL:
        return None
    if isinstance(value, dict):
        return dict(value)
    rule = f"must be a section, [{section}]" + (f', or "{ABSENT}"' if section in OPTIONAL else "")
    raise ParameterError(section, "", rule, shown(value))


def _method(control: dict[str, Any] | None) -> str:
    """Take the method out of the control's section."""
    method = (control or {}).pop("method", "virtual_master")
    if not isinstance(method, str) or method not in METHODS:
        raise ParameterError("control", "method", f"must be one of {', '.join(METHODS)}", shown(method))
    return method


def _forms_one(method: str, own: dict[str, Any]) -> bool:
    """Tell whether a method forms a blister; refuse a section [blister] where it does not."""
    if METHODS[method].blister is None and own:
        raise ParameterError(
            "blister", "", f"must be left out: the method {method} forms no blister", shown(own)
        )
    return METHODS[method].blister is not None


def _path(table: Any, rest_height: float) -> Path:
    """Read the section of the finger's path."""
    if not isinstance(table, dict):
        raise ParameterError("trajectory", "", "must be a section, [trajectory]", shown(table))
    refuse_unknown("trajectory", table, ("interpolation", "waypoints"))
    kind = table.get("interpolation", "smooth")
    if "waypoints" not in table:
        path = dataclasses.replace(Path.press(rest_height), interpolation=kind)
    else:
        rows = table["waypoints"]
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            rule = "must be a list of tables such as {time = 0, position = [0, 0, 0.046]}"
            raise ParameterError("trajectory", "waypoints", rule, shown(rows))
        path = Path(
            kind, tuple(_waypoint(f"trajectory.waypoints #{i}", row) for i, row in enumerate(rows, 1))
        )
    try:
        path.trajectory()
    except ParameterError as error:
        raise ParameterError("trajectory", error.field, error.rule, cut(error.value)) from None
    return path


def _waypoint(owner: str, row: Table) -> Waypoint:
    """Read one waypoint; where it is and when has no sensible default."""
    refuse_unknown(owner, row, tuple(quantities(Waypoint)))
    for key in ("time", "position"):
        if key not in row:
            raise ParameterError(owner, key, "must be given", "none")
    return read_part(owner, Waypoint, {}, row)


def text(scene: Scene) -> str:
    """Write a scene as a scene file that resolves to an equal one: every parameter, in SI units."""
    return "\n".join(_lines(scene)) + "\n"


def _lines(scene: Scene) -> Iterator[str]:
    """Give the lines of a scene file."""
    yield "# Every parameter of the scene, in SI units."
    yield from (f"{key} = {_toml(getattr(scene, key))}" for key in TEXTS)
    yield from (f'{section} = "{ABSENT}"' for section in OPTIONAL if getattr(scene, section) is None)
    for section in SECTIONS:
        part = getattr(scene, section)
        if part is None:
            continue
        yield f"\n[{section}]"
        if section == "control":
            yield f"method = {_toml(scene.method)}"
        for key, known in quantities(part).items():
            note = f"{known.unit}: {known.doc}" if known.unit else known.doc
            yield f"{key} = {_toml(getattr(part, key))}  # {note}"
    yield "\n[trajectory]"
    yield f"interpolation = {_toml(scene.trajectory.interpolation)}"
    yield "waypoints = ["
    for point in scene.trajectory.waypoints:
        pairs = (f"{field.name} = {_toml(getattr(point, field.name))}" for field in dataclasses.fields(point))
        yield f"  {{ {', '.join(pairs)} }},"
    yield "]"


def _toml(value: Any) -> str:
    """Write a value; a float is written so that it reads back as the same one."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, str):
        # JSON's escapes are TOML's; only TOML wants the delete character escaped as well.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
