"""Display properties of a bed: colors, arrows, overlay, picked pins.

Colors and arrows are settings of the bed's geometry nodes; these properties read and write
them there, so that there is one place they stand in.
"""

# No postponed annotations here: Blender reads a group's properties from them.
from collections.abc import Iterable
from typing import Any

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..core.scene.assembly import assemble
from ..core.session import snapshot
from ..core.session.recent_trace import PICKED, SPAN
from ..live import bed_state, running
from ..overlay import views
from ..settings import properties
from . import form, heat, view
from .node_tree import LENGTH
from .skin_lattice import KINDS

COLORINGS = (
    ("mode", "Mode", "Color the pins by what they do"),
    ("force", "Force", "Color the pins by the force on them"),
)
FORMS = (
    ("automatic", "Automatic", "Pins, and the skin instead where they are smaller than about 3 pixels"),
    ("pins", "Pins", "Pins alone"),
    ("skin", "Skin", "The surface of the pins as a skin, without the pins"),
    ("both", "Both", "Pins under a clear skin"),
)
SKINS = (
    ("smooth", "Smooth", "Smooth through the tops of the pins, and never beyond them"),
    ("membrane", "Membrane", "Stretched over the flat ends of the pins"),
)
#: Marks a place no pin is picked for.
NONE = -1


def picked_pins(bed: Any) -> tuple[int, ...]:
    """Return the pins whose heights the overlay shows, in the order they were picked."""
    display = getattr(bed, "digiclay_display", None)
    return () if display is None else tuple(pin for pin in display.picked if pin != NONE)


def pick_pins(bed: Any, pins: Iterable[int]) -> None:
    """Choose the pins whose heights the overlay shows.

    `bed` bpy.types.Object. Raises DigiclayError: on more than 6 pins, one twice, or one the bed does not
    have.
    """
    chosen, count = tuple(pins), len(bed.data.vertices)
    if len(chosen) > PICKED or len(set(chosen)) != len(chosen):
        raise DigiclayError(f"Display.picked must be at most {PICKED} different pins (got {list(chosen)}).")
    unknown = [pin for pin in chosen if not 0 <= pin < count]
    if unknown:
        raise DigiclayError(f"Display.picked must be pins 0 to {count - 1} of {bed.name} (got {unknown[0]}).")
    bed.digiclay_display.picked = (*chosen, *[NONE] * (PICKED - len(chosen)))
    views.redraw()


def _rewrite(bed: Any) -> None:
    """Write the forces, which nothing wanted until now; those kept last where no session runs."""
    session, kept = running.find(bed), bed_state.read_snapshot(bed)
    try:
        if session is not None:
            view.show_state(bed, session.system, session.state)
        elif kept is not None:
            system = assemble(properties.scene_of(bed))
            view.show_state(bed, system, snapshot.load(system, kept))
    except DigiclayError:
        # The bed is edited, or its settings have changed since the state was kept: what was last drawn stays.
        return


def _form(display: Any) -> int:
    return form.FORMS.index(form.read_form(display.id_data))


def _set_form(display: Any, code: int) -> None:
    if form.can_show_skin(display.id_data):
        form.set_form(display.id_data, FORMS[code][0])


def _skin(display: Any) -> int:
    return KINDS.index(form.read_kind(display.id_data))


def _set_skin(display: Any, code: int) -> None:
    if form.can_show_skin(display.id_data):
        form.set_kind(display.id_data, SKINS[code][0])


def _color(display: Any) -> int:
    bed = display.id_data
    return 1 if view.is_drawn(bed) and view.color_source(bed) == "force" else 0


def _set_color(display: Any, code: int) -> None:
    bed = display.id_data
    if view.is_drawn(bed):
        view.color_by(bed, COLORINGS[code][0])
        _rewrite(bed)


def _arrows(display: Any) -> bool:
    bed = display.id_data
    return view.is_drawn(bed) and view.shows_arrows(bed)


def _set_arrows(display: Any, on: bool) -> None:
    bed = display.id_data
    if view.is_drawn(bed):
        view.show_arrows(bed, on)
        _rewrite(bed)


def _top(display: Any) -> float:
    bed = display.id_data
    return view.top_color(bed) if view.is_drawn(bed) else heat.TOP


def _set_top(display: Any, top: float) -> None:
    if view.is_drawn(display.id_data):
        view.scale_colors(display.id_data, top)


def _length(display: Any) -> float:
    bed = display.id_data
    return 1e3 * view.arrow_length(bed) if view.is_drawn(bed) else LENGTH


def _set_length(display: Any, length: float) -> None:
    if view.is_drawn(display.id_data):
        view.scale_arrows(display.id_data, 1e-3 * length)


def _take_overlay(display: Any, context: Any) -> None:
    views.follow()


class Display(bpy.types.PropertyGroup):
    """Display properties of a bed."""

    form: bpy.props.EnumProperty(
        name="Show",
        description="What is seen of the bed, also in renders: pins, or the surface they form as a skin",
        items=FORMS,
        get=_form,
        set=_set_form,
    )
    skin: bpy.props.EnumProperty(
        name="Skin",
        description="How the skin runs between the pins",
        items=SKINS,
        get=_skin,
        set=_set_skin,
    )
    color: bpy.props.EnumProperty(
        name="Color",
        description="Quantity shown by the color of a pin",
        items=COLORINGS,
        get=_color,
        set=_set_color,
    )
    top_force: bpy.props.FloatProperty(
        name="Top Color at (N)",
        description="Force of the last color, in N",
        min=1e-3,
        max=1e3,
        soft_max=2.0,
        precision=3,
        step=1,
        get=_top,
        set=_set_top,
    )
    arrows: bpy.props.BoolProperty(
        name="Force Arrows",
        description="Draw the force on each pin as an arrow, with a transparent fingertip; also in renders",
        get=_arrows,
        set=_set_arrows,
    )
    arrow_length: bpy.props.FloatProperty(
        name="Arrow Length (mm/N)",
        description="Length of the arrow of 1 N, in mm of the device",
        min=0.1,
        max=1e5,
        soft_min=10.0,
        soft_max=1000.0,
        precision=1,
        step=1000,
        get=_length,
        set=_set_length,
    )
    overlay: bpy.props.BoolProperty(
        name="Overlay",
        description="While a session runs, show force and state in a corner of the 3D view",
        default=True,
        update=_take_overlay,
    )
    overlay_full: bpy.props.BoolProperty(
        name="Overlay Details",
        description="Show curves, heights of picked pins and modes in the overlay, not force and state alone",
        update=_take_overlay,
    )
    seconds: bpy.props.FloatProperty(
        name="Past (s)",
        description="Time span of the overlay's curves, in s",
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
        default=[NONE] * PICKED,
        min=NONE,
    )


def register() -> None:
    """Register the properties and hang them onto objects."""
    bpy.utils.register_class(Display)
    bpy.types.Object.digiclay_display = bpy.props.PointerProperty(type=Display, name="Digital Clay Display")


def unregister() -> None:
    """Undo `register`; the overlay's draw handler goes as well."""
    views.stop()
    del bpy.types.Object.digiclay_display
    bpy.utils.unregister_class(Display)
