"""Device in Blender: a bed of instanced pins, its housing and the fingertip.

A bed is one mesh with one vertex per pin. Geometry nodes put a pin on every vertex and pick,
by the integer attribute ``mode`` or by the force, the one that wears the right material:
this shows in Solid view too, and redraws 10 000 pins in a millisecond.

What is asked to be shown stands in the settings of the bed's modifier, an object's own:
copies of a bed keep theirs, undo and files carry them.
"""

from typing import Any

import numpy as np

from .. import bridge
from ..bridge import SCALE
from ..compat import (
    ID,
    Collection,
    Mesh,
    Modifier,
    NodeTree,
    Object,
    has_node_setting,
    node_setting,
    set_node_setting,
)
from ..core.base.arrays import Array
from ..core.base.errors import DigiclayError
from ..core.engine.state import State
from ..core.engine.system import System
from ..roles import BED, HOUSING, ROLE, fingertips_of
from . import parts
from .instant import Instant
from .node_tree import ARROWS, CASE, COLOR_BY_FORCE, FAR, FORM, NEUTRAL, SOURCES, bed_nodes

#: What the color of a pin can tell; and forms of a bed in view: its pins, a live skin over them, or
#: both. In the order of the numbers in the settings of the geometry nodes.
COLORINGS = ("mode", "force", "neutral")
FORMS = ("automatic", "pins", "skin", "both")
#: Where a bed keeps the form that it had before its skin was toggled, until a form is chosen.
BEFORE = "digiclay_form_before"
#: Name of the bed's modifier.
MODIFIER = "Pins"

#: Marks a place no pin is picked for.
NO_PIN = -1


def picked_pins(bed: Object) -> tuple[int, ...]:
    """Return the pins whose heights the overlay shows, in the order they were picked."""
    display = getattr(bed, "digiclay_display", None)
    return () if display is None else tuple(pin for pin in display.picked if pin != NO_PIN)


def build(instant: Instant, collection: Collection, lowest: float | None = None) -> Object:
    """Add a bed and its fingertips to a collection."""
    cells = make_cells(instant)
    bed = parts.marked(cells, cells.name, BED, collection)
    bed.modifiers.new(MODIFIER, "NODES").node_group = _make_tree(instant, lowest)
    for number in range(1, len(instant.finger) + 1):
        parts.make_fingertip(bed, number)
    hold_parts(bed)
    bridge.place_fingertips(bed, instant.fingertip, instant.finger)
    return bed


def make_cells(instant: Instant) -> Mesh:
    """Make the mesh of a bed at an instant."""
    cells = bridge.points("Digital Clay", len(instant.height))
    bridge.write_cells(cells, instant.position, instant.height, **instant.looks)
    return cells


def _make_tree(instant: Instant, lowest: float | None = None) -> NodeTree:
    """Make the geometry nodes that draw pins and housing of a bed; see `build`."""
    lowest = float(instant.height.min()) if lowest is None else lowest
    # The rim stays below most tops, so that the surface and little of the rods is seen over it.
    rim = float(np.median(instant.height)) - 1.2 * instant.pitch
    # The deck is so deep that no pin is stretched much more than another: it shows on their caps.
    deck = min(lowest, rim) - 2.5 * instant.pitch
    length = float(np.median(instant.height)) - deck
    drawn = parts.make_sources(instant, length, deck, rim)
    return bed_nodes(drawn, deck * SCALE, length * SCALE, SCALE * 1e-3)


def add_modifier(bed: Object, instant: Instant) -> None:
    """Draw a bed by new geometry nodes, which know its housing; what it is asked to show stays."""
    modifier = find_modifier(bed)
    if modifier is None:  # the user has removed it, or its nodes
        modifier = bed.modifiers.new(MODIFIER, "NODES")
        bed.modifiers.move(len(bed.modifiers) - 1, 0)
    modifier.node_group = _make_tree(instant, 0.0)


def hold_parts(bed: Object) -> None:
    """Have what a bed is drawn with stay out of the scene when the bed is appended to another file."""
    # Blender puts an appended collection of objects that stand in no scene into the scene, unless
    # an empty instances it. The fingertip is one; it shows nothing of it, since its instancing is
    # off.
    for tip in fingertips_of(bed).values():
        tip.instance_collection = sources_of(bed)


def show(bed: Object, instant: Instant) -> None:
    """Show another instant of the same bed, the poses of its fingertips included."""
    bridge.write_cells(bed.data, instant.position, instant.height, **instant.looks)
    bridge.place_fingertips(bed, instant.fingertip, instant.finger)


def show_state(bed: Object, system: System, state: State) -> None:
    """Show the pins of a running session; the fingertip is the user's and stays where it is."""
    # Forces are gathered and written only while something drawn tells them.
    shown: dict[str, Array] = {"mode": state.mode(), "waiting": state.waiting()}
    if wants_force(bed):
        shown["force"] = state.row(system.rows.force)
    bridge.write_cells(bed.data, system.grid.positions, state.row(0), **shown)


def find_modifier(bed: Object) -> Modifier | None:
    """Return the modifier that draws the pins, or None when the user has removed or changed it."""
    for modifier in bed.modifiers:
        tree = modifier.node_group if modifier.type == "NODES" else None
        if tree is not None and ARROWS in tree.interface.items_tree:
            return modifier
    return None


def require_modifier(bed: Object) -> Modifier:
    """Return the modifier that draws the pins, or refuse a bed without. Raises DigiclayError."""
    modifier = find_modifier(bed)
    if modifier is None:
        rule = "must have the geometry nodes modifier that draws its pins (got none)"
        raise DigiclayError(f"{bed.name} {rule}. Undo its removal, or press Rebuild.")
    return modifier


def is_drawn(bed: Object) -> bool:
    """Return whether the bed still has the modifier that draws its pins."""
    return find_modifier(bed) is not None


def has_setting(bed: Object, name: str) -> bool:
    """Return whether a bed's geometry nodes have a setting: those of older files have none of the skin's."""
    modifier = find_modifier(bed)
    return modifier is not None and has_node_setting(modifier, name)


def read_setting(bed: Object, name: str, default: Any) -> Any:
    """Return a setting of a bed's geometry nodes, see `node_tree.SETTINGS`; the default without it."""
    return node_setting(find_modifier(bed), name) if has_setting(bed, name) else default


def write_setting(bed: Object, name: str, value: Any) -> None:
    """Change a setting of a bed's geometry nodes, of its own type. Raises DigiclayError without it."""
    modifier = require_modifier(bed)
    if not has_setting(bed, name):
        raise DigiclayError(f"{bed.name} has no skin. Rebuild it in Laboratory > Device.")
    set_node_setting(modifier, name, value)


def color_by(bed: Object, what: str) -> None:
    """Color the pins by one of `COLORINGS`: what they do, the force on them, or all alike."""
    neutral = what == "neutral"
    if neutral or has_setting(bed, NEUTRAL):
        write_setting(bed, NEUTRAL, neutral)
    write_setting(bed, COLOR_BY_FORCE, what == "force")


def read_coloring(bed: Object) -> str:
    """Return one of `COLORINGS`; "mode" for a bed without its geometry nodes."""
    if read_setting(bed, NEUTRAL, False):
        return "neutral"
    return "force" if read_setting(bed, COLOR_BY_FORCE, False) else "mode"


def shows_force(bed: Object) -> bool:
    """Return whether the colors of the pins show the force on them."""
    return read_coloring(bed) == "force"


def show_arrows(bed: Object, on: bool) -> None:
    """Draw the force on each pin as an arrow, through a fingertip made clear; or stop doing so."""
    write_setting(bed, ARROWS, bool(on))
    for number, tip in fingertips_of(bed).items():
        parts.color_fingertip(tip, number, clear=bool(on))


def wants_force(bed: Object) -> bool:
    """Return whether anything drawn needs the force on each pin."""
    return shows_force(bed) or bool(read_setting(bed, ARROWS, False))


def can_show_skin(bed: Object) -> bool:
    """Return whether a bed's geometry nodes have a skin: those of older files have none."""
    return has_setting(bed, FORM)


def read_form(bed: Object) -> str:
    """Return one of `FORMS`; "pins" for a bed without a skin."""
    number = int(read_setting(bed, FORM, FORMS.index("pins")))
    return FORMS[min(max(number, 0), len(FORMS) - 1)]


def set_form(bed: Object, form: str) -> None:
    """Show a bed as one of `FORMS`. Raises DigiclayError for a bed without a skin."""
    write_setting(bed, FORM, FORMS.index(form))
    bed.pop(BEFORE, None)


def show_form(bed: Object) -> None:
    """Show a bed that is shown as "automatic" as a skin for a sculptor, unless its pins tell forces."""
    if read_form(bed) == "automatic" and not wants_force(bed):
        set_form(bed, "skin")
        bed[BEFORE] = "automatic"


def is_far(bed: Object) -> bool:
    """Return whether the pins of a bed are too small in the views to be drawn one by one."""
    return bool(read_setting(bed, FAR, False))


def is_skin_shown(bed: Object) -> bool:
    """Return whether a skin is seen in the views."""
    form = read_form(bed)
    return form in ("skin", "both") or (form == "automatic" and is_far(bed))


def housing_of(bed: Object) -> Object | None:
    """Return the object that has the shape of a bed's housing, in the bed's space; None without."""
    case = _read_node(bed, CASE, "Object")
    return case or next((child for child in bed.children if child.get(ROLE) == HOUSING), None)


def sources_of(bed: Object) -> Collection | None:
    """Return the collection of all a bed is drawn with; None in older files, or without its nodes."""
    return _read_node(bed, SOURCES, "Collection")


def _read_node(bed: Object, name: str, input_name: str) -> ID | None:
    """Return what an input of one of a bed's geometry nodes is set to; None without."""
    modifier = find_modifier(bed)
    drawn = modifier.node_group.nodes.get(name) if modifier else None
    return None if drawn is None else drawn.inputs[input_name].default_value


def underside(bed: Object) -> float:
    """Return the height of the housing's underside in the space of its bed, Blender units."""
    housing: Object = housing_of(bed)
    return float(bridge.read_points(housing.data)[:, 2].min())
