"""Conversion between scene files' tables and `schema.Scene`."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping

from ..base.errors import ParameterError
from ..base.quantity import Parameters, list_quantities
from ..control.methods import METHODS, find_method
from ..files.tables import (
    ReadParts,
    Record,
    Table,
    format_value,
    read_part,
    refuse_unknown,
    shorten,
    show_value,
)
from ..model.laws import import_part
from ..model.layout import Layout
from ..model.trajectory import Path, Waypoint
from .schema import (
    BODY,
    FINGER_SECTIONS,
    LATER,
    NEEDS,
    OPTIONAL,
    SECTIONS,
    UNASKED,
    Finger,
    Presser,
    Scene,
    import_parameters,
)

#: Value of the section of an omitted part.
ABSENT = "absent"
#: Changes of the defaults by a preset; a .blend stores its number: new ones are added at the end.
PRESETS: dict[str, dict[str, Record]] = {
    "paper": {},
    "fast": {"valve": {"orifice_diameter": 0.6e-3}},
    "viscous": {
        "fluid": {"viscosity": 3.2e-6, "density": 908.0},
        "valve": {"orifice_diameter": 0.6e-3},
    },
    # For hands. The valve of Roberts 2003, whose lift the paper uses too, works at 1 kHz and above,
    # against 3 bar and above: its lag is at most 1 / (2π 1 kHz).
    "design": {"valve": {"orifice_diameter": 0.6e-3}, "valve_lag": {"time_constant": 0.16e-3}},
}
TEXTS = ("name", "description", "preset")
#: Key of the format of a file written by hand; see `keep_former_share`.
FORMAT = "format"
#: Section of a file of `digiclay fit`: intervals of its values, which a scene does not have.
UNCERTAINTY = "uncertainty"
#: List of tables with the sections of several fingers.
FINGERS = "finger"
#: List of tables of bodies, each with the keys of `shapes.body.Body` and its path.
BODIES = "body"
#: Sections of a finger that are parts; the other one is its path.
FINGER_PARTS = tuple(section for section in FINGER_SECTIONS if section in SECTIONS)
#: Parts of which a file says that they are absent.
NAMED = tuple(section for section in OPTIONAL if section not in LATER)
TOP_LEVEL = (FORMAT, UNCERTAINTY, *TEXTS, *SECTIONS, "trajectory", FINGERS, BODIES)


def resolve(table: Table, name: str = "", cache: ReadParts | None = None) -> Scene:
    """Return a scene from the tables of a scene file, with defaults for all they leave open.

    `name`: its default name; `cache`: parts of similar tables, which are not read again. Raises
    ParameterError, whose owner is the section.
    """
    cache = cache or ReadParts()
    refuse_unknown("", table, TOP_LEVEL)
    texts: Record = {
        key: _check_text(key, table.get(key, default))
        for key, default in zip(TEXTS, (name, "", "paper"), strict=True)
    }
    if texts["preset"] not in PRESETS:
        raise ParameterError(
            "preset", "", f"must be one of {', '.join(PRESETS)}", repr(texts["preset"])
        )
    if table.get(FORMAT, 1) not in (1, 2) or isinstance(table.get(FORMAT), (bool, float)):
        raise ParameterError(FORMAT, "", "must be 1 or 2", show_value(table[FORMAT]))
    bodies = _read_bodies(table.get(BODIES, []), cache)
    tables = _split_fingers(table)
    shared = {
        section: _read_section(section, table)
        for section in SECTIONS
        if section not in FINGER_PARTS
    }
    method = (shared["control"] or {}).pop("method", "virtual_master")
    defaults = _find_defaults(texts["preset"], method)
    parts = _read_parts(shared, defaults, cache, method)
    defaults = _add_share(defaults, parts["layout"])
    rest_height = parts["actuator"].rest_height
    fingers = tuple(
        _read_finger(owner, given, defaults, rest_height, cache) for owner, given in tables
    )
    if _has_bodies_alone(table):
        # What is recorded as a fingertip's path is the first body's.
        fingers = (Finger(None, None, None, bodies[0].trajectory),)
    scene = Scene(**parts, **texts, fingers=fingers, method=method, bodies=bodies)
    if bodies and FINGERS not in table and "trajectory" not in table:
        _refuse_finger_without_path(table)
    return scene


def _has_bodies_alone(table: Table) -> bool:
    """Return whether nothing but bodies presses."""
    return bool(table.get(BODIES)) and not any(key in table for key in (*FINGER_SECTIONS, FINGERS))


def _refuse_finger_without_path(table: Table) -> None:
    """Refuse sections of a finger beside bodies, which would press with it where nobody said."""
    for section in FINGER_PARTS:
        if table.get(section, ABSENT) != ABSENT:
            rule = (
                "must be left out where only bodies press: a finger beside them has a [trajectory]"
            )
            raise ParameterError(section, "", rule, show_value(table[section]))


def _read_bodies(given: object, cache: ReadParts) -> tuple[Presser, ...]:
    """Return the bodies of a list of tables, each with a path."""
    if not isinstance(given, list) or not all(isinstance(table, dict) for table in given):
        rule = f"must be a list of tables, [[{BODIES}]]"
        raise ParameterError(BODIES, "", rule, show_value(given))
    bodies = []
    for number, table in enumerate(given, 1):
        owner, keys = f"{BODIES} #{number}", dict(table)
        path = keys.pop("trajectory", None)
        if not isinstance(path, dict) or "waypoints" not in path:
            shown = "none" if path is None else show_value(path)
            raise ParameterError(owner, "trajectory", "must be a path with waypoints", shown)
        body = cache.read(read_part, owner, import_part(*BODY), {}, keys)
        if body.given:
            raise ParameterError(owner, "file", "or mesh must be given", "none")
        bodies.append(Presser(body, cache.read(_read_path, f"{owner}.trajectory", path, 0.0)))
    return tuple(bodies)


def _find_defaults(preset: str, method: str) -> dict[str, Table]:
    """Return the defaults of sections that differ from those of their classes."""
    return {**PRESETS[preset], "blister": find_method(method).blister or {}}


def _add_share(defaults: dict[str, Table], layout: Layout) -> dict[str, Table]:
    """Return the defaults with the contact's share that belongs to the area of a cell."""
    return {**defaults, "contact": {**defaults.get("contact", {}), "share": layout.share}}


def keep_former_share(table: Table) -> Table:
    """Return the tables of a file with the contact's share that version 0.2 gave a bed, if it was another.

    It was the same at any pitch. A file with ``format = 2`` has the share of the area of a cell.
    """
    given = table.get("layout")
    if table.get(FORMAT, 1) != 1 or not isinstance(given, dict) or _has_bodies_alone(table):
        return table
    layout = read_part("layout", Layout, {}, given)
    former = 0.29 if layout.arrangement == "hexagonal" else 0.34

    def keep(finger: Table) -> Table:
        contact = finger.get("contact", {})
        if not isinstance(contact, dict) or "share" in contact:
            return finger
        return {**finger, "contact": {**contact, "share": former}}

    if former == layout.share:
        return table
    fingers = table.get(FINGERS)
    if FINGERS not in table:
        return keep(table)
    if not isinstance(fingers, list) or not all(isinstance(finger, dict) for finger in fingers):
        return table
    return {**table, FINGERS: [keep(finger) for finger in fingers]}


def tabulate(scene: Scene) -> Record:
    """Return tables that resolve to an equal scene, without what is as its preset, method and bed have it.

    So a change of one of these changes what follows from it, as in a scene file.
    """
    defaults = _add_share(_find_defaults(scene.preset, scene.method), scene.layout)
    press = Path.press(scene.actuator.rest_height)

    def list_changed(part: Parameters, usual: Parameters) -> Record:
        values = {name: getattr(part, name) for name in list_quantities(part)}
        return {name: value for name, value in values.items() if value != getattr(usual, name)}

    def tabulate_parts(sections: Iterable[str], owner: Scene | Finger) -> Record:
        tables: Record = {}
        for section in sections:
            part = getattr(owner, section)
            if part is not None:
                usual = import_parameters(section, scene.method)(**defaults.get(section, {}))
                tables[section] = list_changed(part, usual)
            elif section in NAMED:
                tables[section] = ABSENT
        return tables

    def tabulate_finger(finger: Finger) -> Record:
        path, tables = finger.trajectory, tabulate_parts(FINGER_PARTS, finger)
        if path != press or scene.bodies:
            tables["trajectory"] = tabulate_path(path)
        return tables

    def tabulate_path(path: Path) -> Record:
        points = list(map(vars, path.waypoints))
        return {"interpolation": path.interpolation, "waypoints": points}

    tables = tabulate_parts((name for name in SECTIONS if name not in FINGER_PARTS), scene)
    tables |= {key: getattr(scene, key) for key in TEXTS}
    if scene.control:
        tables["control"]["method"] = scene.method
    if scene.simulation.duration == scene.lasting:
        tables["simulation"].pop("duration", None)
    if scene.bodies:
        tables[BODIES] = [
            {**vars(each.body), "trajectory": tabulate_path(each.trajectory)}
            for each in scene.bodies
        ]
    fingers = [tabulate_finger(finger) for finger in scene.fingers]
    return {**tables, **fingers[0]} if len(fingers) == 1 else {**tables, FINGERS: fingers}


def _split_fingers(table: Table) -> list[tuple[str, Table]]:
    """Return the prefix of each finger's sections in messages, and the sections.

    The sections of one finger are beside the others; those of several in a list of tables.
    """
    single = {section: table[section] for section in FINGER_SECTIONS if section in table}
    if FINGERS not in table:
        return [("", single)]
    given = table[FINGERS]
    if not isinstance(given, list) or not all(isinstance(finger, dict) for finger in given):
        raise ParameterError(
            FINGERS, "", f"must be a list of tables, [[{FINGERS}]]", show_value(given)
        )
    if single:
        section = next(iter(single))
        rule = f"must be left out where there is [[{FINGERS}]]: give it there"
        raise ParameterError(section, "", rule, show_value(single[section]))
    owners = [f"{FINGERS} #{number}." for number in range(1, len(given) + 1)]
    for owner, finger in zip(owners, given, strict=True):
        refuse_unknown(owner.removesuffix("."), finger, FINGER_SECTIONS)
    return list(zip(owners, given, strict=True))


def merge_one_finger(table: Table) -> Record:
    """Return the tables with the sections of the only finger beside the others, where settings change them.

    `resolve` refuses what is not a list of one table, or would be given twice.
    """
    given = table.get(FINGERS)
    if not (isinstance(given, list) and len(given) == 1 and isinstance(given[0], dict)):
        return dict(table)
    if any(section in table or section not in FINGER_SECTIONS for section in given[0]):
        return dict(table)
    return {**{key: value for key, value in table.items() if key != FINGERS}, **given[0]}


def _read_parts(
    tables: Mapping[str, Table | None],
    defaults: Mapping[str, Table],
    cache: ReadParts,
    method: str = "",
    owner: str = "",
) -> Record:
    """Return the parts of sections; `owner`: prefix of their names in messages."""
    parts: Record = dict.fromkeys(tables)
    for section, given in tables.items():
        if given is None or (section in NEEDS and tables[NEEDS[section]] is None):
            continue
        if section != "blister" or _forms_blister(method, given):
            kind, usual = import_parameters(section, method), defaults.get(section, {})
            if section == "control":
                _refuse_another_method(given, kind, method)
            parts[section] = cache.read(read_part, owner + section, kind, usual, given)
    return parts


def _refuse_another_method(given: Table, kind: type[Parameters], method: str) -> None:
    """Refuse a key that only other control methods have. `kind`: parameters of the chosen method."""
    for key in [key for key in given if key not in ("method", *list_quantities(kind))]:
        others = [
            name for name in METHODS if key in list_quantities(import_parameters("control", name))
        ]
        if others:
            rule, hint = f"must be a parameter of {method}", f"It is one of {', '.join(others)}."
            raise ParameterError("control", key, rule, show_value(given[key]), hint)


def _read_finger(
    owner: str, table: Table, defaults: Mapping[str, Table], rest_height: float, cache: ReadParts
) -> Finger:
    """Return a finger from its sections; `owner`: prefix of their names in messages."""
    tables = {section: _read_section(section, table, owner) for section in FINGER_PARTS}
    parts = _read_parts(tables, defaults, cache, owner=owner)
    path = cache.read(_read_path, f"{owner}trajectory", table.get("trajectory", {}), rest_height)
    return Finger(**parts, trajectory=path)


def _check_text(key: str, value: object) -> str:
    """Return a value that must be a text."""
    if not isinstance(value, str):
        raise ParameterError(key, "", "must be a text", show_value(value))
    printed = value.replace("\n", "").replace("\t", "") if key == "description" else value
    if not printed.isprintable():
        raise ParameterError(key, "", "must be printable", show_value(value))
    return value


def _read_section(section: str, table: Table, owner: str = "") -> Record | None:
    """Return the table of a section, or None for an omitted part."""
    value = table.get(section, ABSENT if section in UNASKED else {})
    if isinstance(value, str) and value == ABSENT and section in OPTIONAL:
        return None
    if isinstance(value, dict):
        return dict(value)
    rule = f"must be a section, [{section}]" + (f', or "{ABSENT}"' if section in OPTIONAL else "")
    raise ParameterError(owner + section, "", rule, show_value(value))


def _forms_blister(method: str, section: Table) -> bool:
    """Return whether a method forms a blister; refuse a section [blister] if it does not."""
    formed = find_method(method).blister is not None
    if not formed and section:
        rule = f"must be left out: the method {method} forms no blister"
        raise ParameterError("blister", "", rule, show_value(section))
    return formed


def _read_path(owner: str, table: object, rest_height: float) -> Path:
    """Read the section of the fingertip path."""
    if not isinstance(table, dict):
        raise ParameterError(owner, "", "must be a section, [trajectory]", show_value(table))
    refuse_unknown(owner, table, ("interpolation", "waypoints"))
    kind = table.get("interpolation", "smooth")
    if "waypoints" not in table:
        path = dataclasses.replace(Path.press(rest_height), interpolation=kind)
    else:
        rows = table["waypoints"]
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            rule = "must be a list of tables such as {time = 0, position = [0, 0, 0.046]}"
            raise ParameterError(owner, "waypoints", rule, show_value(rows))
        points = (_read_waypoint(f"{owner}.waypoints #{i}", row) for i, row in enumerate(rows, 1))
        path = Path(kind, tuple(points))
    try:
        path.trajectory()
    except ParameterError as error:
        raise ParameterError(owner, error.field, error.rule, shorten(error.value)) from None
    return path


def _read_waypoint(owner: str, row: Table) -> Waypoint:
    """Read a waypoint, whose time and position have no default."""
    refuse_unknown(owner, row, tuple(list_quantities(Waypoint)))
    for key in ("time", "position"):
        if key not in row:
            raise ParameterError(owner, key, "must be given", "none")
    return read_part(owner, Waypoint, {}, row)


def format_scene(scene: Scene) -> str:
    """Return a scene file, in SI units, that resolves to an equal scene.

    Raises ParameterError for a scene whose method is not loaded: its parameters are unknown here.
    """
    find_method(scene.method)
    return "\n".join(_write_lines(scene)) + "\n"


def _write_lines(scene: Scene) -> Iterator[str]:
    """Yield the lines of a scene file; a single finger is written as by versions without several."""
    alone = len(scene.fingers) == 1
    sections = (name for name in SECTIONS if alone or name not in FINGER_SECTIONS)
    parts = {name: scene.section(name) for name in sections}
    yield "# Every parameter of the scene, in SI units."
    yield from (f"{key} = {format_value(getattr(scene, key))}" for key in TEXTS)
    yield from _write_absent(parts)
    if not scene.fingers:
        yield f"{FINGERS} = []"
    for name, part in parts.items():
        yield from _write_part(name, part, scene.method if name == "control" else "")
    for finger in scene.fingers:
        if alone:
            yield from _write_part("trajectory", finger.trajectory)
            break
        yield f"\n[[{FINGERS}]]"
        parts = {name: getattr(finger, name) for name in FINGER_PARTS}
        yield from _write_absent(parts)
        for name, part in parts.items():
            yield from _write_part(f"{FINGERS}.{name}", part)
        yield from _write_part(f"{FINGERS}.trajectory", finger.trajectory)
    for each in scene.bodies:
        yield from _write_part(f"[{BODIES}]", each.body)
        yield from _write_part(f"{BODIES}.trajectory", each.trajectory)


def _write_absent(parts: Table) -> Iterator[str]:
    """Yield the lines of parts that are absent."""
    for name, part in parts.items():
        if part is None and name in NAMED:
            yield f'{name} = "{ABSENT}"'


def _write_part(section: str, part: Parameters | Path | None, method: str = "") -> Iterator[str]:
    """Yield the lines of a section, for the control with its method; none for an omitted part."""
    if part is None:
        return
    if isinstance(part, Path):
        yield from _write_path(section, part)
        return
    yield f"\n[{section}]"
    if method:
        yield f"method = {format_value(method)}"
    idle = part.list_idle()
    for field in dataclasses.fields(part):
        declared, value = field.metadata["quantity"], getattr(part, field.name)
        if not (declared.later or field.name in idle) or value != field.default:
            note = f"{declared.unit}: {declared.doc}" if declared.unit else declared.doc
            yield f"{field.name} = {format_value(value)}  # {note}"


def _write_path(section: str, path: Path) -> Iterator[str]:
    """Yield the lines of a finger's path."""
    yield f"\n[{section}]"
    yield f"interpolation = {format_value(path.interpolation)}"
    yield "waypoints = ["
    for point in path.waypoints:
        pairs = (f"{name} = {format_value(value)}" for name, value in vars(point).items())
        yield f"  {{ {', '.join(pairs)} }},"
    yield "]"
