"""Geometry nodes of a bed: pins, colored by mode or by force, arrows on them, and the housing."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..core.base.modes import Mode
from . import heat
from .nodes import attribute, node, number, socket, switch
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
    tree = bpy.data.node_groups.new("Digital Clay Pins", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    _add_settings(tree)
    settings = node(tree, "NodeGroupInput", -1, 0)
    result = node(tree, "NodeGroupOutput", 9, 0)
    force_on, top = settings.outputs[COLOR_BY_FORCE], settings.outputs[TOP_FORCE]
    level = _level_of_force(tree, top, len(Mode), 3)
    choice = node(tree, "GeometryNodeCollectionInfo", 4, 0)
    choice.name, choice.inputs["Collection"].default_value = SOURCES, sources.collection
    choice.inputs["Separate Children"].default_value = True
    mode = attribute(tree, "mode", "INT", 2, 1)
    instances = node(tree, "GeometryNodeInstanceOnPoints", 5, 0)
    instances.inputs["Pick Instance"].default_value = True
    index = switch(tree, "INT", 4, 1, force_on, mode, level)
    tree.links.new(settings.outputs["Geometry"], instances.inputs["Points"])
    tree.links.new(choice.outputs["Instances"], instances.inputs["Instance"])
    tree.links.new(index, instances.inputs["Instance Index"])
    tree.links.new(_stretch(tree, deck, length), instances.inputs["Scale"])
    pins_on, skin_on, both_on = _form_switches(tree, settings, 16)
    pins = switch(tree, "GEOMETRY", 6, 1, pins_on, None, instances.outputs["Instances"])
    drawn = _arrows_on_points(tree, sources.arrow, settings, pins, unit, 7)
    skin = _skin(tree, sources, settings, both_on, 20)
    case = node(tree, "GeometryNodeObjectInfo", 7, 1)
    case.name, case.inputs["Object"].default_value = CASE, sources.housing
    both = node(tree, "GeometryNodeJoinGeometry", 8, 0)
    tree.links.new(case.outputs["Geometry"], both.inputs["Geometry"])
    tree.links.new(drawn, both.inputs["Geometry"])
    tree.links.new(switch(tree, "GEOMETRY", 7.5, 2, skin_on, None, skin), both.inputs["Geometry"])
    tree.links.new(both.outputs["Geometry"], result.inputs["Geometry"])
    return tree


def _add_settings(tree: Any) -> None:
    """Add what each bed may choose for itself."""
    socket(tree, COLOR_BY_FORCE, "NodeSocketBool", False, "Color the pins by force, not by mode")
    socket(tree, TOP_FORCE, "NodeSocketFloat", heat.TOP, "Force of the last color, in N")
    socket(tree, ARROWS, "NodeSocketBool", False, "Draw the force on each pin as an arrow onto its top")
    socket(tree, ARROW_LENGTH, "NodeSocketFloat", LENGTH, "Length of the arrow of 1 N, in mm of the device")
    socket(
        tree,
        FORM,
        "NodeSocketInt",
        0,
        "0: pins, a skin where they are too small; 1: pins; 2: skin; 3: both",
    )
    socket(tree, MEMBRANE, "NodeSocketBool", False, "Stretch the skin over the flat ends of the pins")
    socket(tree, FAR, "NodeSocketBool", False, "Pins are too small in the views; set by the extension")


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
    names = []
    for step, name in enumerate(KINDS):
        names.append(node(tree, "FunctionNodeInputString", -3, row + step))
        names[-1].string = name
    smooth, membrane = (name.outputs["String"] for name in names)
    kind = switch(tree, "STRING", -2, row, settings.outputs[MEMBRANE], smooth, membrane)
    skin = skin_nodes(tree, sources.skin, settings.outputs["Geometry"], kind, row)
    clear = node(tree, "GeometryNodeSetMaterial", 19, row)
    clear.inputs["Material"].default_value = sources.clear
    tree.links.new(skin, clear.inputs["Geometry"])
    chosen = switch(tree, "GEOMETRY", 20, row, both, skin, clear.outputs["Geometry"])
    # An instance is joined with the housing without a copy of its points and their attributes.
    whole = node(tree, "GeometryNodeGeometryToInstance", 21, row)
    tree.links.new(chosen, whole.inputs["Geometry"])
    return whole.outputs["Instances"]


def _stretch(tree: Any, deck: float, length: float) -> Any:
    """Add the nodes that give (1, 1, (z - deck) / length) at every vertex."""
    place = node(tree, "GeometryNodeInputPosition", 0, -2)
    parts = node(tree, "ShaderNodeSeparateXYZ", 1, -2)
    tree.links.new(place.outputs["Position"], parts.inputs["Vector"])
    line = number(tree, "MULTIPLY_ADD", 2, -2, parts.outputs["Z"], 1.0 / length, -deck / length)
    stretch = node(tree, "ShaderNodeCombineXYZ", 4, -2)
    stretch.inputs["X"].default_value = stretch.inputs["Y"].default_value = 1.0
    tree.links.new(number(tree, "MAXIMUM", 3, -2, line, LEAST_STRETCH), stretch.inputs["Z"])
    return stretch.outputs["Vector"]


def _level_of_force(tree: Any, top: Any, first: int, row: float) -> Any:
    """Add the nodes that choose a pin by the force on it; return its place among the pins."""
    force = attribute(tree, "force", "FLOAT", 0, row + 1)
    per_newton = number(tree, "DIVIDE", 0, row + 2, float(len(heat.COLORS)), top)
    levels = number(tree, "CEIL", 2, row + 1, number(tree, "MULTIPLY", 1, row + 1, force, per_newton))
    within = node(tree, "ShaderNodeClamp", 3, row + 1)
    within.inputs["Max"].default_value = len(heat.COLORS)
    tree.links.new(levels, within.inputs["Value"])
    return number(tree, "ADD", 3.5, row, within.outputs["Result"], float(first))


def _arrows_on_points(tree: Any, arrow: Any, settings: Any, pins: Any, unit: float, row: float) -> Any:
    """Add the nodes that draw the arrows beside the pins."""
    force = attribute(tree, "force", "FLOAT", 1, row + 1)
    pressed = node(tree, "FunctionNodeCompare", 3, row - 0.4)
    pressed.data_type, pressed.operation = "FLOAT", "GREATER_THAN"
    pressed.inputs["B"].default_value = LEAST
    tree.links.new(force, pressed.inputs["A"])
    shape = node(tree, "GeometryNodeObjectInfo", 3, row + 0.6)
    shape.inputs["Object"].default_value = arrow
    shape.inputs["As Instance"].default_value = True
    per_newton = number(tree, "MULTIPLY", 1, row + 2, settings.outputs[ARROW_LENGTH], unit)
    stretch = node(tree, "ShaderNodeCombineXYZ", 3, row + 2)
    stretch.inputs["X"].default_value = stretch.inputs["Y"].default_value = 1.0
    tree.links.new(number(tree, "MULTIPLY", 2, row + 1, force, per_newton), stretch.inputs["Z"])
    instances = node(tree, "GeometryNodeInstanceOnPoints", 4, row)
    tree.links.new(settings.outputs["Geometry"], instances.inputs["Points"])
    tree.links.new(pressed.outputs["Result"], instances.inputs["Selection"])
    tree.links.new(shape.outputs["Geometry"], instances.inputs["Instance"])
    tree.links.new(stretch.outputs["Vector"], instances.inputs["Scale"])
    both = node(tree, "GeometryNodeJoinGeometry", 5, row)
    tree.links.new(instances.outputs["Instances"], both.inputs["Geometry"])
    tree.links.new(pins, both.inputs["Geometry"])
    arrows = settings.outputs[ARROWS]
    return switch(tree, "GEOMETRY", 6, row - 1, arrows, pins, both.outputs["Geometry"])
