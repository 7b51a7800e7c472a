"""Panels Show and View Details, and their properties: pins or skin, colors, arrows, overlay.

Colors, arrows and skin are settings of the bed's geometry nodes; these properties read and write
them there, so that there is one place they stand in.
"""

# No postponed annotations here: Blender reads a group's properties from them.
from collections.abc import Callable
from typing import Any

from ..compat import Context, Object, bpy
from ..core.base.errors import DigiclayError
from ..core.scene.assembly import assemble
from ..core.session import snapshot
from ..core.session.recent_trace import PICKED, SPAN
from ..device import heat, view
from ..device.node_tree import (
    ARROW_LENGTH,
    ARROWS,
    COLOR_BY_FORCE,
    FORM,
    LENGTH,
    MEMBRANE,
    NEUTRAL,
    REALIZE,
    TINT,
    TOP_FORCE,
)
from ..live import beds
from ..overlay import views
from ..overlay.ready_view import reveal
from ..roles import bed_of, ellipsoid, fingertips_of, is_edited
from ..sessions import running
from ..settings import properties
from ..settings.declared import choice, flag, number
from ..ui_text import localize
from .base import LABORATORY, Sidebar, draw_property, panel

COLORINGS = (
    ("mode", "Mode", "Color the pins by what they do"),
    ("force", "Force", "Color the pins by the force on them"),
    ("neutral", "Neutral", "Color all pins alike, as those at rest"),
)
FORMS = (
    ("automatic", "Automatic", "Pins, or the skin where pins are smaller than about 8 pixels"),
    ("pins", "Pins", "Pins alone"),
    ("skin", "Skin", "The surface of the pins as a skin, without the pins"),
    ("both", "Both", "Pins under a clear skin"),
)
SKINS = (
    (
        "smooth",
        "Smooth",
        "Smooth over the tops of the pins, without steps and never beyond them. Edges are rounded; "
        "the membrane and exported meshes go through every pin",
    ),
    ("membrane", "Membrane", "Stretched over the flat ends of the pins"),
)


def _write_forces(bed: Object) -> None:
    """Write the forces, which nothing drew until now; those stored last where no session runs."""
    session, stored = running.find(bed), beds.read_snapshot(bed)
    try:
        if session is not None:
            view.show_state(bed, session.system, session.state)
        elif stored is not None:
            system = assemble(properties.scene_of(bed))
            view.show_state(bed, system, snapshot.load(system, stored))
    except DigiclayError:
        # The bed is edited, or its settings have changed since the state was kept: what was last
        # drawn stays.
        return


def _in_nodes(
    name: str, default: Any, write: Callable[[Any, Any], None] | None = None
) -> dict[str, Callable[..., Any]]:
    """Return `get` and `set` of a property stored in a bed's geometry nodes; the default without them."""

    def put(display: Any, value: Any) -> None:
        if view.has_setting(display.id_data, name):
            write(display.id_data, value) if write else view.write_setting(
                display.id_data, name, value
            )

    return {"get": lambda display: view.read_setting(display.id_data, name, default), "set": put}


def _color(bed: Object, code: int) -> None:
    what = COLORINGS[code][0]
    if what != "neutral" or view.has_setting(bed, NEUTRAL):  # older files have none
        view.color_by(bed, what)
    _write_forces(bed)


def _arrows(bed: Object, on: bool) -> None:
    view.show_arrows(bed, on)
    _write_forces(bed)


def show_details(display: Any, context: Context) -> None:
    """Show the bed beside the overlay, which is larger now."""
    views.follow()
    bed = display.id_data
    if display.overlay and display.overlay_full and running.find(bed) is not None:
        reveal(context, bed, [bed, *filter(None, map(ellipsoid, fingertips_of(bed).values()))])


class Display(bpy.types.PropertyGroup):
    """Display properties of a bed."""

    form: choice(
        "Show",
        "What is shown of the bed, also in renders: pins, or the surface they form as a skin",
        items=FORMS,
        get=lambda display: view.FORMS.index(view.read_form(display.id_data)),
        set=_in_nodes(FORM, 0, lambda bed, code: view.set_form(bed, FORMS[code][0]))["set"],
    )
    skin: choice(
        "Skin",
        "Shape of the skin between the pins",
        items=SKINS,
        **_in_nodes(MEMBRANE, 0, lambda bed, code: view.write_setting(bed, MEMBRANE, bool(code))),
    )
    tint: flag(
        "Mode Tint",
        "Tint the skin by what the pins do: those that rest or hold are plain clay",
        **_in_nodes(TINT, False),
    )
    color: choice(
        "Color",
        "Quantity shown by the color of a pin",
        items=COLORINGS,
        get=lambda display: view.COLORINGS.index(view.read_coloring(display.id_data)),
        set=_in_nodes(COLOR_BY_FORCE, 0, _color)["set"],
    )
    top_force: number(
        "Top Color at (N)",
        "Force of the last color, in N",
        min=1e-3,
        max=1e3,
        soft_max=2.0,
        precision=3,
        step=1,
        **_in_nodes(TOP_FORCE, heat.TOP),
    )
    arrows: flag(
        "Force Arrows",
        "Draw the force on each pin as an arrow, with a transparent fingertip; also in renders",
        **_in_nodes(ARROWS, False, _arrows),
    )
    arrow_length: number(
        "Arrow Length (mm/N)",
        "Length of the arrow of 1 N, in mm of the device",
        min=0.1,
        max=1e5,
        soft_min=10.0,
        soft_max=1000.0,
        precision=1,
        step=1000,
        **_in_nodes(ARROW_LENGTH, LENGTH),
    )
    realize: flag(
        "Realize Instances",
        "Make pins and arrows part of the bed's mesh, for Object > Convert > Mesh and for exporters that "
        "leave out instances; slows a session down",
        **_in_nodes(REALIZE, False),
    )
    overlay: flag(
        "Overlay",
        "While a session runs, show force and state in a corner of the 3D view",
        default=True,
        update=lambda display, context: views.follow(),
    )
    overlay_full: flag(
        "Overlay Details",
        "Show curves, heights of picked pins and modes in the overlay, not only force and state",
        update=show_details,
    )
    seconds: number(
        "Past (s)",
        "Time span of the overlay's curves, in s",
        default=5.0,
        min=0.5,
        max=SPAN,
        precision=1,
        step=50,
    )
    picked: bpy.props.IntVectorProperty(
        name="Picked Pins",
        description="Pins whose heights the overlay shows; -1 for none",
        size=PICKED,
        default=[view.NO_PIN] * PICKED,
        min=view.NO_PIN,
    )


@panel("DIGICLAY_PT_show", "Show", 20, closed=False)
def show(sidebar: Sidebar, context: Context) -> None:
    """What is seen of the bed."""
    bed, layout = bed_of(context), sidebar.layout
    layout.enabled = not is_edited(context)
    if not view.is_drawn(bed):
        layout.label(text="The bed's geometry nodes were removed", icon="ERROR")
    column, shown = layout.column(), bed.digiclay_display
    column.enabled = view.can_show_skin(bed)
    column.prop(shown, "form", text="")
    draw_property(column, shown, "tint", shown.form != "pins")
    layout.prop(shown, "overlay")


@panel("DIGICLAY_PT_display", "View Details", 0, parent=LABORATORY)
def details(sidebar: Sidebar, context: Context) -> None:
    """Skin, colors and arrows of the bed, details of the overlay; a disabled item takes no time."""
    bed, layout = bed_of(context), sidebar.layout
    layout.enabled = not is_edited(context)
    layout.use_property_split = True
    layout.use_property_decorate = False
    shown, column = bed.digiclay_display, layout.column()
    column.enabled = view.is_drawn(bed)
    skin = column.column()
    skin.enabled = view.can_show_skin(bed)
    draw_property(skin, shown, "skin", shown.form != "pins", expand=True)
    draw_property(column, shown, "color", shown.form != "skin", expand=True)
    draw_property(column, shown, "top_force", shown.color == "force")
    draw_property(column, shown, "arrows")
    draw_property(column, shown, "arrow_length", shown.arrows)
    draw_property(column, shown, "realize", view.has_setting(bed, REALIZE))
    column = layout.column()
    column.active = shown.overlay
    draw_property(column, shown, "overlay_full")
    draw_property(column, shown, "seconds", shown.overlay_full)
    pins = ", ".join(map(str, view.picked_pins(bed)))
    column.label(text=localize("Picked pins: {}", pins or localize("none")))
    row = column.row(align=True)
    row.operator("digiclay.pick_pins")
    row.operator("digiclay.clear_pins")


CLASSES = (show, details)


def register() -> None:
    """Register the properties and hang them onto objects."""
    bpy.utils.register_class(Display)
    bpy.types.Object.digiclay_display = bpy.props.PointerProperty(
        type=Display, name="Digital Clay Display"
    )


def unregister() -> None:
    """Undo `register`; the overlay's draw handler goes as well."""
    views.stop()
    del bpy.types.Object.digiclay_display
    bpy.utils.unregister_class(Display)
