"""Geometry nodes of a bed: pins, colored by mode or by force, arrows on them, and the housing."""

from __future__ import annotations

from typing import Any

from ..core.base.modes import Mode
from . import heat
from .nodes import attribute, combine, new_tree, node, number, read_height, socket, switch
from .parts import Sources
from .skin_lattice import KINDS
from .skin_nodes import skin_nodes

#: Names of the nodes that have the housing and the collection of all that is drawn.
CASE, SOURCES = "Housing", "Sources"

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02
#: Names of the settings: colors by force, and arrows.
COLOR_BY_FORCE, TOP_FORCE = "Color by Force", "Top Color at (N)"
ARROWS, ARROW_LENGTH = "Force Arrows", "Arrow Length (mm/N)"
#: Names of the settings: what is seen (0 automatic, 1 pins, 2 skin, 3 both), which skin, and whether the pins
#: are too small in the views for "automatic" to draw them.
FORM, MEMBRANE, FAR = "Form", "Membrane", "Far"
#: How long an arrow is drawn by default, mm for each N.
LENGTH = 150.0
#: Smaller forces get no arrow, N: a millinewton is what the pulp of a fingertip just feels.
LEAST = 1e-3


def bed_nodes(sources: Sources, deck: float, length: float, unit: float) -> Any:
    """Make the node group that puts a pin on every vertex, an arrow where arrows are on, and the housing."""
    # Stretching one mesh costs half of drawing rod and cap apart. A cap is stretched with its
    # rod, from a flat one on a low pin to a round one on a high pin.
    tree = new_tree("Digital Clay Pins")
    for name, kind, default, words in SETTINGS:
        socket(tree, name, f"NodeSocket{kind}", default, words)
    settings = node(tree, "NodeGroupInput", -1, 0)
    cells = settings.outputs["Geometry"]
    parts = {"Collection": sources.collection, "Separate Children": True}
    choice = node(tree, "GeometryNodeCollectionInfo", 4, 0, parts, name=SOURCES)
    level = _level_of_force(tree, settings.outputs[TOP_FORCE], len(Mode), 3)
    mode = attribute(tree, "mode", "INT", 2, 1)
    instances = node(tree, "GeometryNodeInstanceOnPoints", 5, 0, {
        "Points": cells, "Instance": choice.outputs["Instances"], "Pick Instance": True,
        "Instance Index": switch(tree, "INT", 4, 1, settings.outputs[COLOR_BY_FORCE], mode, level),
        "Scale": _stretch(tree, deck, length),
    })  # fmt: skip
    pins_on, skin_on, both_on = _form_switches(tree, settings, 16)
    pins = switch(tree, "GEOMETRY", 6, 1, pins_on, None, instances.outputs["Instances"])
    drawn = _arrows_on_points(tree, sources.arrow, settings, pins, unit, 7)
    skin = switch(tree, "GEOMETRY", 7.5, 2, skin_on, None, _skin(tree, sources, settings, both_on, 20))
    case = node(tree, "GeometryNodeObjectInfo", 7, 1, {"Object": sources.housing}, name=CASE)
    every = {"Geometry": [case.outputs["Geometry"], drawn, skin]}
    joined = node(tree, "GeometryNodeJoinGeometry", 8, 0, every)
    node(tree, "NodeGroupOutput", 9, 0, {"Geometry": joined.outputs["Geometry"]})
    return tree


#: What each bed may choose for itself: name, type, default, description.
SETTINGS = (
    (COLOR_BY_FORCE, "Bool", False, "Color the pins by force, not by mode"),
    (TOP_FORCE, "Float", heat.TOP, "Force of the last color, in N"),
    (ARROWS, "Bool", False, "Draw the force on each pin as an arrow onto its top"),
    (ARROW_LENGTH, "Float", LENGTH, "Length of the arrow of 1 N, in mm of the device"),
    (FORM, "Int", 0, "0: pins, a skin where they are too small; 1: pins; 2: skin; 3: both"),
    (MEMBRANE, "Bool", False, "Stretch the skin over the flat ends of the pins"),
    (FAR, "Bool", False, "Pins are too small in the views; set by the extension"),
)


def _form_switches(tree: Any, settings: Any, row: float) -> tuple[Any, Any, Any]:
    """Add the nodes that tell whether pins, skin, and both are drawn."""
    form = settings.outputs[FORM]
    automatic, pins, skin, both = (
        number(tree, "COMPARE", 0, row + step, form, float(step), 0.5) for step in range(4)
    )
    # A picture has as many samples as it needs: there "automatic" means pins.
    in_view = node(tree, "GeometryNodeIsViewport", 0, row + 4).outputs["Is Viewport"]
    far = number(tree, "MULTIPLY", 1, row + 4, settings.outputs[FAR], in_view)
    near = number(tree, "SUBTRACT", 2, row + 4, 1.0, far)
    instead = number(tree, "MULTIPLY", 3, row, automatic, far)
    pins = number(tree, "ADD", 4, row + 1, pins, number(tree, "MULTIPLY", 3, row + 1, automatic, near))
    skin = number(tree, "ADD", 4, row + 2, skin, instead)
    return number(tree, "ADD", 5, row + 1, pins, both), number(tree, "ADD", 5, row + 2, skin, both), both


def _skin(tree: Any, sources: Sources, settings: Any, both: Any, row: float) -> Any:
    """Add the nodes of the skin, clear where pins are drawn under it; return its geometry."""
    smooth, membrane = (
        node(tree, "FunctionNodeInputString", -3, row + step, string=name).outputs["String"]
        for step, name in enumerate(KINDS)
    )
    kind = switch(tree, "STRING", -2, row, settings.outputs[MEMBRANE], smooth, membrane)
    skin = skin_nodes(tree, sources.skin, settings.outputs["Geometry"], kind, row)
    look = {"Geometry": skin, "Material": sources.clear}
    clear = node(tree, "GeometryNodeSetMaterial", 19, row, look).outputs["Geometry"]
    chosen = switch(tree, "GEOMETRY", 20, row, both, skin, clear)
    # An instance is joined with the housing without a copy of its points and their attributes.
    return node(tree, "GeometryNodeGeometryToInstance", 21, row, {"Geometry": chosen}).outputs["Instances"]


def _stretch(tree: Any, deck: float, length: float) -> Any:
    """Add the nodes that give (1, 1, (z - deck) / length) at every vertex."""
    line = number(tree, "MULTIPLY_ADD", 2, -2, read_height(tree, -2), 1.0 / length, -deck / length)
    return combine(tree, 4, -2, X=1.0, Y=1.0, Z=number(tree, "MAXIMUM", 3, -2, line, LEAST_STRETCH))


def _level_of_force(tree: Any, top: Any, first: int, row: float) -> Any:
    """Add the nodes that choose a pin by the force on it; return its place among the pins."""
    force = attribute(tree, "force", "FLOAT", 0, row + 1)
    per_newton = number(tree, "DIVIDE", 0, row + 2, float(len(heat.COLORS)), top)
    levels = number(tree, "CEIL", 2, row + 1, number(tree, "MULTIPLY", 1, row + 1, force, per_newton))
    limits = {"Value": levels, "Max": len(heat.COLORS)}
    within = node(tree, "ShaderNodeClamp", 3, row + 1, limits).outputs["Result"]
    return number(tree, "ADD", 3.5, row, within, float(first))


def _arrows_on_points(tree: Any, arrow: Any, settings: Any, pins: Any, unit: float, row: float) -> Any:
    """Add the nodes that draw the arrows beside the pins."""
    force = attribute(tree, "force", "FLOAT", 1, row + 1)
    pressed = node(
        tree, "FunctionNodeCompare", 3, row - 0.4, {"A": force, "B": LEAST},
        data_type="FLOAT", operation="GREATER_THAN",
    )  # fmt: skip
    shape = node(tree, "GeometryNodeObjectInfo", 3, row + 0.6, {"Object": arrow, "As Instance": True})
    per_newton = number(tree, "MULTIPLY", 1, row + 2, settings.outputs[ARROW_LENGTH], unit)
    size = number(tree, "MULTIPLY", 2, row + 1, force, per_newton)
    instances = node(tree, "GeometryNodeInstanceOnPoints", 4, row, {
        "Points": settings.outputs["Geometry"], "Selection": pressed.outputs["Result"],
        "Instance": shape.outputs["Geometry"], "Scale": combine(tree, 3, row + 2, X=1.0, Y=1.0, Z=size),
    })  # fmt: skip
    both = {"Geometry": [instances.outputs["Instances"], pins]}
    joined = node(tree, "GeometryNodeJoinGeometry", 5, row, both).outputs["Geometry"]
    return switch(tree, "GEOMETRY", 6, row - 1, settings.outputs[ARROWS], pins, joined)
