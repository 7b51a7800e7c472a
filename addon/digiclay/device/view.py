"""Device in Blender: a bed of instanced pins, its housing and the fingertip.

A bed is one mesh with a vertex a pin. Geometry nodes put a pin on every vertex and pick,
by the integer attribute ``mode`` or by the force, the one that wears the right material:
this shows in Solid view too, and redraws 10 000 pins in a millisecond.

What is asked to be shown stands in the settings of the bed's modifier, an object's own:
copies of a bed keep theirs, undo and files carry them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import bridge
from ..bridge import SCALE
from ..compat import node_setting, set_node_setting
from ..core.base.errors import DigiclayError
from ..core.engine.state import State
from ..core.engine.system import System
from ..roles import (
    BED,
    ELLIPSOID,
    FINGERTIP,
    HOUSING,
    ROLE,
    bed_of,
    ellipsoid,
    fingertip_of,
    is_bed,
    is_edited,
)
from . import parts
from .form import find_modifier, require_modifier
from .instant import Instant
from .node_tree import ARROW_LENGTH, ARROWS, CASE, COLOR_BY_FORCE, SOURCES, TOP_FORCE, bed_nodes
from .parts import material

__all__ = [
    "BED", "COLORINGS", "ELLIPSOID", "FINGERTIP", "HOUSING", "ROLE", "add_modifier", "arrow_length",
    "bed_of", "build", "color_by", "color_source", "fingertip_of", "hold_parts", "housing_of", "is_bed",
    "is_drawn", "is_edited", "material", "picked_pins", "scale_arrows", "scale_colors", "show",
    "show_arrows", "show_state", "shows_arrows", "shows_force", "sources_of", "top_color", "underside",
    "wants_force",
]  # fmt: skip

#: What the color of a pin can tell.
COLORINGS = ("mode", "force")
#: Name of the bed's modifier.
MODIFIER = "Pins"

#: Marks a place no pin is picked for.
NO_PIN = -1


def picked_pins(bed: Any) -> tuple[int, ...]:
    """Return the pins whose heights the overlay shows, in the order they were picked."""
    display = getattr(bed, "digiclay_display", None)
    return () if display is None else tuple(pin for pin in display.picked if pin != NO_PIN)


def build(instant: Instant, collection: Any, lowest: float | None = None) -> Any:
    """Add a bed and its fingertip to a collection."""
    cells = bridge.points("Digital Clay", len(instant.height))
    bed = parts.marked(cells, cells.name, BED, collection)
    bed.modifiers.new(MODIFIER, "NODES").node_group = _make_tree(instant, lowest)
    parts.make_fingertip(collection, bed)
    hold_parts(bed)
    bridge.write_cells(bed.data, instant.position, instant.height, mode=instant.mode, force=instant.force)
    _place_fingertip(bed, instant)
    return bed


def _make_tree(instant: Instant, lowest: float | None = None) -> Any:
    """Make the geometry nodes that draw pins and housing of a bed; see `build`."""
    lowest = float(instant.height.min()) if lowest is None else lowest
    # The rim stays below most tops, so that the surface and little of the rods is seen over it.
    rim = float(np.median(instant.height)) - 1.2 * instant.pitch
    # The deck is so deep that no pin is stretched much more than another: it shows on their caps.
    deck = min(lowest, rim) - 2.5 * instant.pitch
    length = float(np.median(instant.height)) - deck
    drawn = parts.make_sources(instant, length, deck, rim)
    return bed_nodes(drawn, deck * SCALE, length * SCALE, SCALE * 1e-3)


def add_modifier(bed: Any, instant: Instant) -> None:
    """Draw a bed by new geometry nodes, which know its housing; what it is asked to show stays."""
    require_modifier(bed).node_group = _make_tree(instant, 0.0)


def hold_parts(bed: Any) -> None:
    """Have what a bed is drawn with stay out of the scene when the bed is appended to another file."""
    # Blender puts an appended collection of objects that stand in no scene into the scene, unless an
    # empty instances it. The fingertip is one; it shows nothing of it, since its instancing is off.
    tip = fingertip_of(bed)
    if tip is not None:
        tip.instance_collection = sources_of(bed)


def show(bed: Any, instant: Instant) -> None:
    """Show another instant of the same bed, its fingertip's pose included."""
    bridge.write_cells(bed.data, instant.position, instant.height, mode=instant.mode, force=instant.force)
    _place_fingertip(bed, instant)


def show_state(bed: Any, system: System, state: State) -> None:
    """Show the pins of a running session; the fingertip is the user's and stays where it is."""
    # Forces are gathered and written only while something drawn tells them.
    shown: dict[str, NDArray[Any]] = {"mode": state.mode()}
    if wants_force(bed):
        shown["force"] = state.row(system.rows.force)
    bridge.write_cells(bed.data, system.grid.positions, state.row(0), **shown)


def color_by(bed: Any, what: str) -> None:
    """Color the pins by what they do ("mode") or by the force on them ("force")."""
    if what not in COLORINGS:
        raise DigiclayError(f"view.color_by must be one of {', '.join(COLORINGS)} (got {what!r}).")
    set_node_setting(require_modifier(bed), COLOR_BY_FORCE, what == "force")


def color_source(bed: Any) -> str:
    """Return the quantity shown by the color of the pins: "mode" or "force"."""
    return "force" if node_setting(require_modifier(bed), COLOR_BY_FORCE) else "mode"


def top_color(bed: Any) -> float:
    """Return the force from which on a pin has the last color, N."""
    return float(node_setting(require_modifier(bed), TOP_FORCE))


def shows_force(bed: Any) -> bool:
    """Return whether the colors of the pins show the force on them."""
    return is_drawn(bed) and color_source(bed) == "force"


def scale_colors(bed: Any, top: float) -> None:
    """Set the force from which on a pin has the last color, N."""
    set_node_setting(require_modifier(bed), TOP_FORCE, _positive("top color", top, "N"))


def show_arrows(bed: Any, on: bool) -> None:
    """Draw the force on each pin as an arrow, through a fingertip made clear; or stop doing so."""
    set_node_setting(require_modifier(bed), ARROWS, bool(on))
    tip = fingertip_of(bed)
    ball = ellipsoid(tip) if tip is not None else None
    if ball is not None:
        ball.material_slots[0].material = parts.finger_material(clear=bool(on))


def shows_arrows(bed: Any) -> bool:
    """Return whether the bed's forces are drawn as arrows."""
    return bool(node_setting(require_modifier(bed), ARROWS))


def arrow_length(bed: Any) -> float:
    """Return the length of the arrow of 1 N, m of the device."""
    return float(node_setting(require_modifier(bed), ARROW_LENGTH)) * 1e-3


def scale_arrows(bed: Any, length: float) -> None:
    """Set the length of the arrow of 1 N, m of the device."""
    set_node_setting(require_modifier(bed), ARROW_LENGTH, _positive("arrow length", length, "m") * 1e3)


def wants_force(bed: Any) -> bool:
    """Return whether anything drawn needs the force on each pin."""
    return shows_force(bed) or (is_drawn(bed) and shows_arrows(bed))


def is_drawn(bed: Any) -> bool:
    """Return whether the bed still has the modifier that draws its pins."""
    return find_modifier(bed) is not None


def housing_of(bed: Any) -> Any | None:
    """Return the object that has the shape of a bed's housing, in the bed's space; None without."""
    modifier = find_modifier(bed)
    case = modifier.node_group.nodes.get(CASE) if modifier else None
    if case is not None:
        return case.inputs["Object"].default_value
    return next((child for child in bed.children if child.get(ROLE) == HOUSING), None)


def sources_of(bed: Any) -> Any | None:
    """Return the collection of all a bed is drawn with; None in older files, or without its nodes."""
    modifier = find_modifier(bed)
    drawn = modifier.node_group.nodes.get(SOURCES) if modifier else None
    return None if drawn is None else drawn.inputs["Collection"].default_value


def underside(bed: Any) -> float:
    """Return the height of the housing's underside in the space of its bed, Blender units."""
    housing: Any = housing_of(bed)
    return min(float(vertex.co.z) for vertex in housing.data.vertices)


def _place_fingertip(bed: Any, instant: Instant) -> None:
    """Put the fingertip, where there is one, to its pose in an instant."""
    tip = fingertip_of(bed)
    if tip is not None:
        bridge.place_fingertip(tip, instant.fingertip, instant.finger)


def _positive(name: str, value: float, unit: str) -> float:
    """Return a finite number above 0, or refuse it."""
    if not (np.isfinite(value) and value > 0.0):
        raise DigiclayError(f"Display.{name} must be above 0 {unit} (got {value:g} {unit}).")
    return float(value)
