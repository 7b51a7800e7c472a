"""Settings of a bed: every parameter of its scene, in the .blend as `Object.digiclay`.

A scene is made of them and of nothing else, so what the panels show is what is simulated.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from .. import bridge
from ..compat import Object, PropertyGroup, bpy, read_stored
from ..core.base.arrays import Floats
from ..core.base.errors import ParameterError
from ..core.base.quantity import Parameters, list_quantities
from ..core.control.methods import METHODS, find_method, list_methods
from ..core.files.tables import Record
from ..core.model.layout import Layout, make_grid
from ..core.scene.schema import NEEDS, OPTIONAL, SECTIONS, Presser, Scene, import_parameters
from ..core.scene.toml_table import ABSENT, FINGER_PARTS, FINGERS, resolve
from ..core.shapes.body import Body
from ..roles import fingertips_of, list_pressers
from . import devices
from .declared import Notes, read, title, write
from .groups import CLASSES, PRESSER_FIELDS, SETTINGS, find_group, method_of
from .shown_units import convert_units

_NAME = re.compile(rf"\b({'|'.join(SECTIONS)})\.(\w+)")


def relabel(error: ParameterError, numbers: Sequence[int]) -> ParameterError:
    """Return an error of the core as the panels show its owner, the number of a fingertip, rule and value."""

    def labeled(match: re.Match[str]) -> str:
        return f"{title(match[1])}: {title(match[2])}" if match[2] in _known(match[1]) else match[0]

    (*finger, owner), field = re.split(rf"^{FINGERS} #(\d+)\.", error.owner), title(error.field)
    if owner in SECTIONS:
        owner = f"{title(owner)}: {field}" if field else title(owner)
        field = ""
    if finger:
        owner = f"Fingertip {numbers[int(finger[-1]) - 1]}: {owner}"
    rule = convert_units(_NAME.sub(labeled, error.rule))
    return ParameterError(owner, field, rule, convert_units(error.value), error.hint)


def _known(section: str) -> set[str]:
    """Return the names of a section's parameters."""
    methods = list_methods() if section == "control" else ("virtual_master",)
    return {
        name for method in methods for name in list_quantities(import_parameters(section, method))
    }


#: How far a pin may stand from its place before the bed counts as another one, m: more than 32 bits
#: lose on a bed of meters, less than any change of pitch worth making.
AWAY = 1e-6


class StoredSettings(NamedTuple):
    """All that `read_scene` reads: scenes of equal stored settings are equal."""

    #: Of the bed.
    name: str
    #: Path of the .blend, at whose folder other paths may start.
    file: str
    #: As Blender stores them.
    values: Record
    #: Numbers of the fingertips, and what further ones store of their own.
    fingers: tuple[tuple[int, Record], ...]
    #: Of the pressers.
    pressers: tuple[Record, ...]


def read_stored_settings(bed: Object) -> StoredSettings:
    """Return what `read_scene` makes the scene of, in a small part of its time."""
    tips = fingertips_of(bed).items()
    fingers = tuple(
        (number, read_stored(tip, "digiclay") if number > 1 else {}) for number, tip in tips
    )
    pressers = tuple(read_stored(presser, "digiclay") for presser in list_pressers(bed))
    stored = read_stored(bed, "digiclay")
    return StoredSettings(bed.name, bpy.data.filepath, stored, fingers, pressers)


def scene_of(bed: Object) -> Scene:
    """Return the scene a bed's settings describe; the fingertip's path is one press in the middle."""
    scene = read_scene(bed)
    scene = replace(scene, bodies=tuple(_read_presser(each, scene) for each in list_pressers(bed)))
    reason = find_layout_mismatch(bed, scene.layout)
    if reason:
        plan = scene.layout
        rule = "must be that of the bed's pins"
        remedy = f"{reason}: press Rebuild in Laboratory > Device."
        raise ParameterError(
            "Layout", "", rule, f"{plan.rows} x {plan.columns}, {plan.arrangement}", remedy
        )
    return scene


def _read_presser(presser: Object, scene: Scene) -> Presser:
    """Return the body of a mesh object, whose underside a session reads: it has no path of its own."""
    group = presser.digiclay.presser
    values = read(group, Body, {}, presser.name, PRESSER_FIELDS)
    try:
        return Presser(Body(**values), scene.fingers[0].trajectory)
    except ParameterError as error:
        value = convert_units(error.value)
        raise ParameterError(
            presser.name, error.field, convert_units(error.rule), value, error.hint
        ) from None


def read_scene(bed: Object) -> Scene:
    """Return the scene a bed's settings describe, whatever the bed looks like by now; as `scene_of`."""
    try:
        return resolve(table_of(bed))
    except ParameterError as error:
        raise relabel(error, tuple(fingertips_of(bed))) from None


def table_of(bed: Object) -> Record:
    """Return a bed's settings as the tables of a scene file."""
    settings = bed.digiclay
    method = method_of(settings)
    formed = find_method(method).blister is not None  # refuses one that is not known here
    name = "".join(letter if letter.isprintable() else " " for letter in bed.name)
    table: Record = {"name": name, "preset": settings.preset}
    each = devices.list_settings(bed)
    fingers: list[Record] = [{} for _ in each]
    for section in SECTIONS:
        holders = (
            zip(each, fingers, strict=True) if section in FINGER_PARTS else [(settings, table)]
        )
        for row, (holder, part) in enumerate(holders, 1):
            owner = (
                f"{FINGERS} #{row}.{section}"
                if section in FINGER_PARTS and len(each) > 1
                else section
            )
            if section in OPTIONAL and not getattr(settings, f"use_{section}"):
                part[section] = ABSENT
            elif NEEDS.get(section) and not getattr(settings, f"use_{NEEDS[section]}"):
                continue
            elif section != "blister" or formed:
                kind = import_parameters(section, method)
                notes = _notes(holder).get(_key(section, method), {})
                values = read(part_group(holder, section), kind, notes, owner)
                part[section] = {key: _path(value) for key, value in values.items()}
    if settings.use_control:
        table["control"]["method"] = method
    return table | (fingers[0] if len(fingers) == 1 else {FINGERS: fingers})


def write_scene(bed: Object, scene: Scene) -> None:
    """Write a scene's values into a bed's settings; a part it leaves out keeps its own, unused."""
    settings = bed.digiclay
    # These two first: choosing them by hand sets others along with them.
    settings.preset = scene.preset
    setattr(settings, "method" if scene.method in METHODS else "own_method", scene.method)
    notes = _notes(settings)
    for section in SECTIONS:
        owner: Object = scene.fingers[0] if section in FINGER_PARTS else scene
        part: Parameters | None = getattr(owner, section)
        if section in OPTIONAL:
            setattr(settings, f"use_{section}", part is not None)
        if part is not None:
            notes[_key(section, scene.method)] = write(part_group(settings, section), part)
    _keep_notes(settings, notes)
    for holder, finger in zip(devices.list_settings(bed), scene.fingers, strict=False):
        parts = {section: getattr(finger, section) for section in FINGER_PARTS}
        if holder != settings:
            given = {section: part for section, part in parts.items() if part is not None}
            _keep_notes(
                holder,
                {section: write(getattr(holder, section), part) for section, part in given.items()},
            )


def _keep_notes(settings: PropertyGroup, notes: dict[str, Notes]) -> None:
    """Store what properties cannot hold, by part."""
    settings.notes = json.dumps({key: noted for key, noted in notes.items() if noted})


def rebuild_reason(bed: Object) -> str:
    """Return why a bed no longer shows the pins its settings describe, or an empty text."""
    settings = bed.digiclay
    notes = _notes(settings).get("layout", {})
    return find_layout_mismatch(bed, Layout(**read(settings.layout, Layout, notes, "layout")))


def part_group(settings: PropertyGroup, section: str) -> PropertyGroup:
    """Return the property group of a section; that of the control is its method's."""
    if section == "control":
        return find_group(settings)  # None: the method is not known here
    return getattr(settings, section)


def register() -> None:
    """Register the groups and hang them onto objects."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Object.digiclay = bpy.props.PointerProperty(type=SETTINGS, name="Digital Clay")


def unregister() -> None:
    """Undo `register` in the opposite order."""
    del bpy.types.Object.digiclay
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)


def _notes(settings: PropertyGroup) -> dict[str, Notes]:
    """Return what was noted of values the properties cannot hold, by part."""
    return json.loads(settings.notes) if settings.notes else {}


def _key(section: str, method: str) -> str:
    """Return what a part's notes are kept under; every method has parameters of its own."""
    return f"control.{method}" if section == "control" else section


def _path(value: Any) -> Any:
    """Return a value; a path that starts at the .blend's folder is one for the core as well."""
    relative = isinstance(value, str) and value.startswith("//")
    return bpy.path.abspath(value) if relative else value


def find_layout_mismatch(bed: Object, layout: Layout) -> str:
    """Return why a bed is not the one a layout describes, or an empty text."""
    pins, wanted = len(bed.data.vertices), layout.rows * layout.columns
    if pins != wanted:
        return f"The bed has {pins} pins, not {wanted}"
    places = bridge.read_points(bed.data)[:, :2] / bridge.SCALE
    if np.abs(places - _find_places(layout)).max() > AWAY:
        return "The pins differ from the parameters of Layout"
    return ""


@lru_cache(maxsize=32)
def _find_places(layout: Layout) -> Floats:
    """Return where the pins of a layout stand (n, 2), m."""
    return make_grid(layout).positions
