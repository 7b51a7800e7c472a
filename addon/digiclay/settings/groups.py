"""Property groups of a bed's settings, and the effects of presets, methods and layouts on them."""

import dataclasses
import importlib
from typing import Any

from .. import bridge
from ..compat import Context, PropertyGroup, bpy
from ..core.base.quantity import list_quantities
from ..core.control.methods import METHODS, list_added, list_methods
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout
from ..core.scene.schema import NEEDS, OPTIONAL, SECTIONS, UNASKED, import_parameters
from ..core.scene.toml_table import PRESETS
from ..core.shapes.body import Body
from ..ui_text import localize
from . import devices
from .declared import (
    WHOLE,
    Update,
    choice,
    fill,
    flag,
    group,
    make_group,
    number,
    read,
    text,
    title,
    whole,
)

#: Blender keeps no reference to the texts of a list that is made on demand: this one does.
OFFERED: list[tuple[str, str, str, int]] = []


def method_of(settings: PropertyGroup) -> str:
    """Return the name of a bed's control method, whether or not it is known here."""
    return settings.own_method or settings.method


def name_pointer(name: str) -> str:
    """Return the attribute of the control's group with the parameters of a method."""
    return name if name in METHODS else f"own_{name}"


def find_group(settings: PropertyGroup) -> PropertyGroup | None:
    """Return the properties of the parameters of a bed's control method; None where it is not known here."""
    return getattr(settings.control, name_pointer(method_of(settings)), None)


def method_property(settings: PropertyGroup) -> str:
    """Return the property that offers the methods: the plain one while there are built-in ones only."""
    return "chosen_method" if settings.own_method or list_added() else "method"


def list_offered(settings: PropertyGroup, context: Context) -> list[tuple[str, str, str, int]]:
    """Return the methods to choose from, and the bed's own where that is not known here."""
    added = list_added()
    offered = [(name, localize(title(name)), "") for name in METHODS]
    offered += [(name, title(name), method.describe()) for name, method in added.items()]
    missing = settings.own_method
    if missing and missing not in added:
        offered.append((missing, localize("{} (not loaded)", title(missing)), ""))
    OFFERED[:] = [(*item, number) for number, item in enumerate(offered)]
    return OFFERED


def place_of(settings: PropertyGroup) -> int:
    """Return the place of a bed's method among those offered."""
    names = [name for name, *_ in list_offered(settings, None)]
    return names.index(method_of(settings))


def choose(settings: PropertyGroup, number: int) -> None:
    """Set the method by its place among those offered."""
    name = list_offered(settings, None)[number][0]
    if name in METHODS:
        settings.method = name
    else:
        settings.own_method = name


#: Sections whose parameters are the same whatever the method.
PLAIN = tuple(section for section in SECTIONS if section != "control")

PRESET_WORDS = {
    "paper": "The device of the paper",
    "fast": "A wider orifice: pins move faster",
    "viscous": "A wider orifice and a silicone oil twice as viscous",
    "design": "For hands: a wider orifice and a quicker valve",
}


PRESET_ITEMS = [(name, title(name), PRESET_WORDS.get(name, "")) for name in PRESETS]


def take_preset(settings: PropertyGroup, context: Context) -> None:
    """Set what the chosen preset, or another one, changes of the defaults."""
    for section in sorted({section for preset in PRESETS.values() for section in preset}):
        names = sorted({name for preset in PRESETS.values() for name in preset.get(section, {})})
        values = PRESETS[settings.preset].get(section, {})
        fill(getattr(settings, section), import_parameters(section, ""), names, values)


def take_method(settings: PropertyGroup, context: Context) -> None:
    """Set the blister the chosen built-in method is made for; it takes the place of one of one's own."""
    if settings.own_method:
        settings.own_method = ""
    take_blister(settings, context)


def take_blister(settings: PropertyGroup, context: Context) -> None:
    """Set the blister that the method is made for; none where it forms none, or is not known here."""
    method = list_methods().get(method_of(settings))
    values = method.blister if method is not None else None
    if values is not None:
        kind = import_parameters("blister", "")
        fill(settings.blister, kind, list_quantities(kind), values)
        devices.suit_blister(settings)


def take_cell(layout: PropertyGroup, context: Context) -> None:
    """Set the share of the contact laws that a cell carries, which goes with its area."""
    plan = Layout(**read(layout, Layout, {}, "layout"))
    for settings in devices.list_settings(layout.id_data):
        fill(settings.contact, import_parameters("contact", ""), ("share",), {"share": plan.share})


def take_size(fingertip: PropertyGroup, context: Context) -> None:
    """Show the fingertip in its new size."""
    tip = devices.find_tip(fingertip.id_data)
    if tip is not None:
        bridge.resize_fingertip(tip, devices.read_finger(fingertip.id_data.digiclay))


#: What happens after a change, by section and field.
UPDATES: dict[str, dict[str, Update]] = {
    "layout": dict.fromkeys(("arrangement", "pitch"), take_cell),
    "fingertip": dict.fromkeys(("length", "width", "height"), take_size),
}


def method_items() -> list[tuple[str, str, str]]:
    """Return the methods with the first lines of their modules."""
    words = {
        name: importlib.import_module(f"..core.{method.module}", __package__).__doc__ or ""
        for name, method in METHODS.items()
    }
    return [
        (name, title(name), text.partition("\n")[0].removesuffix("."))
        for name, text in words.items()
    ]


def use_properties() -> dict[str, Any]:
    """Return a switch for every part a scene may leave out."""
    switches = {}
    for section in OPTIONAL:
        along = [
            other for other, needed in NEEDS.items() if needed == section and other not in OPTIONAL
        ]
        words = " and ".join([title(section).lower(), *(title(other).lower() for other in along)])
        switches[f"use_{section}"] = flag(
            title(section),
            f"Simulate the {words}; without it, no time is spent on it",
            default=section not in UNASKED,
        )
    return switches


def pointers(groups: dict[str, type]) -> dict[str, Any]:
    """Return a pointer to each group."""
    return {
        name: bpy.props.PointerProperty(type=kind, name=title(name))
        for name, kind in groups.items()
    }


def whole_axis(field: dataclasses.Field[Any]) -> Any:
    """Return the property of a fingertip's whole length, width or height, by the stored semi-axis."""
    return whole(
        field,
        lambda group: 2.0 * getattr(group, field.name),
        lambda group, size: devices.set_axis(group.id_data.digiclay, field.name, size),
    )


METHOD_GROUPS = {name: group(name, import_parameters("control", name), {}) for name in METHODS}
CONTROL = make_group("control", "Gains and thresholds, method by method.", pointers(METHOD_GROUPS))
GROUPS = {
    section: group(section, import_parameters(section, "virtual_master"), UPDATES.get(section, {}))
    for section in PLAIN
}
for axis in dataclasses.fields(Fingertip):
    GROUPS["fingertip"].__annotations__[WHOLE + axis.name] = whole_axis(axis)
#: Parameters of a mesh object that presses a bed.
PRESSER_FIELDS = ("stiffness", "damping", "cap", "tip_radius", "samples")
PRESSER = group("presser", Body, {}, PRESSER_FIELDS)
METHOD = {"name": "Method", "words": "Control method of the cells; a choice also sets its blister"}
SETTINGS = make_group(
    "settings",
    "Every parameter of a bed's scene.",
    {
        "preset": choice(
            "Preset",
            "Fluid and valves; a choice sets their parameters",
            items=PRESET_ITEMS,
            update=take_preset,
        ),
        "method": choice(
            **METHOD, items=method_items(), default="virtual_master", update=take_method
        ),
        "own_method": bpy.props.StringProperty(options={"HIDDEN"}, update=take_blister),
        "chosen_method": choice(**METHOD, items=list_offered, get=place_of, set=choose),
        "own_preset": text(
            "Own Preset", "The custom preset that was applied last", options={"HIDDEN"}
        ),
        "size": number(
            "Size (mm)",
            "Width of the fingertip, in mm; its length and height change in proportion",
            get=lambda settings: 1e3 * devices.read_size(settings.id_data),
            set=lambda settings, value: devices.set_size(settings.id_data, 1e-3 * value),
            min=1e3 * devices.SMALLEST,
            max=1e3 * devices.LARGEST,
            soft_max=60.0,
            step=50,
            precision=1,
        ),
        "blister_follows": flag(
            "Blister Follows",
            "Keep the size of the blister in proportion to that of the fingertip",
            default=True,
        ),
        "blister_suits": bpy.props.FloatProperty(options={"HIDDEN"}),
        "notes": bpy.props.StringProperty(options={"HIDDEN"}),
        **use_properties(),
        **pointers({**GROUPS, "control": CONTROL, "presser": PRESSER}),
    },
)
#: In the order they are registered: a group comes after those it points to.
CLASSES = (*METHOD_GROUPS.values(), *GROUPS.values(), CONTROL, PRESSER, SETTINGS)
