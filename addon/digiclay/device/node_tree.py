"""Geometry nodes of a bed: pins, colored by mode or by force, arrows on them, the live skin, and the housing.

The skin is weighted sums of the heights of the pins, in Blender's own code. It follows whatever moves the
pins: a session, a bake, undo. It needs no data of its own in a tick.
"""

from collections.abc import Mapping

from ..compat import Node, NodeInputs, NodeOutputs, NodeSocket, NodeTree, Object, bpy
from ..core.base.modes import Mode
from . import heat
from .parts import FOLLOWING, HIGH, LOW, NEAREST, PAIR, PREVIOUS, VALUE, WEIGHTS, SkinMeshes, Sources
from .skin_lattice import KINDS

#: What an input of a node is given: a value, an output of another node, or a list of outputs.
Value = object
#: Names of the nodes that have the housing and the collection of all that is drawn.
CASE, SOURCES = "Housing", "Sources"

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02
#: Names of the settings: colors by force, and arrows.
COLOR_BY_FORCE, TOP_FORCE = "Color by Force", "Top Color at (N)"
ARROWS, ARROW_LENGTH = "Force Arrows", "Arrow Length (mm/N)"
#: Names of the settings: what is seen (0 automatic, 1 pins, 2 skin, 3 both), which skin, whether the pins
#: are too small in the views for "automatic" to draw them, and whether the skin is tinted by their modes.
FORM, MEMBRANE, FAR, TINT = "Form", "Membrane", "Far", "Tint"
#: How long an arrow is drawn by default, mm for each N.
LENGTH = 150.0
#: Smaller forces get no arrow, N: a millinewton is what the pulp of a fingertip just feels.
LEAST = 1e-3


def node(
    tree: NodeTree,
    kind: str,
    column: float,
    row: float,
    inputs: Mapping[str, Value] | None = None,
    **settings: object,
) -> Node:
    """Add a node at a place of a coarse grid; each input gets a value, an output, or a list of outputs."""
    node = tree.nodes.new(kind)
    node.location = (220.0 * column, -180.0 * row)
    for name, value in settings.items():
        setattr(node, name, value)
    for name, value in (inputs or {}).items():
        link(tree, value, enabled(node.inputs, name))
    return node


def link(tree: NodeTree, value: Value, target: NodeSocket) -> None:
    """Give an input a value, an output, or a list of outputs in the order in which they are to be linked."""
    if isinstance(value, list):
        for each in value:
            tree.links.new(each, target)
    elif isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, target)
    else:
        target.default_value = value


def enabled(sockets: NodeInputs | NodeOutputs, name: str) -> NodeSocket:
    """Return the socket of a name that is in use: nodes have one for each type, all of the same name."""
    return next((each for each in sockets if each.name == name and each.enabled), sockets[name])


def new_tree(name: str) -> NodeTree:
    """Add a tree that takes a geometry."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    return tree


def socket(tree: NodeTree, name: str, kind: str, default: Value, description: str) -> None:
    """Add a setting to a tree, which each object that uses the tree has for itself."""
    setting = tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    setting.default_value = default
    setting.description = description


def attribute(tree: NodeTree, name: Value, kind: str, column: float, row: float) -> NodeSocket:
    """Add a node that reads an attribute of the vertices of a name or text of nodes; return its output."""
    reader = node(tree, "GeometryNodeInputNamedAttribute", column, row, {"Name": name}, data_type=kind)
    return enabled(reader.outputs, "Attribute")


def number(tree: NodeTree, operation: str, column: float, row: float, *values: Value) -> NodeSocket:
    """Add a node that reckons with numbers or with outputs of other nodes; return its output."""
    math_node = node(tree, "ShaderNodeMath", column, row, operation=operation)
    for target, value in zip(math_node.inputs, values, strict=False):
        link(tree, value, target)
    return math_node.outputs["Value"]


def switch(
    tree: NodeTree, kind: str, column: float, row: float, on: Value, off: Value, then: Value
) -> NodeSocket:
    """Add a node that hands on `then` where `on` holds and `off` (may be None) else; return its output."""
    # What is not handed on is not worked out either: that is how a part that is off costs nothing.
    ways = {"Switch": on, **({} if off is None else {"False": off}), "True": then}
    return enabled(node(tree, "GeometryNodeSwitch", column, row, ways, input_type=kind).outputs, "Output")


def combine(tree: NodeTree, column: float, row: float, **parts: Value) -> NodeSocket:
    """Add a node that makes a vector of X, Y and Z; return its output."""
    return node(tree, "ShaderNodeCombineXYZ", column, row, parts).outputs["Vector"]


def read_height(tree: NodeTree, row: float) -> NodeSocket:
    """Add the nodes that read the height of a vertex; return their output."""
    position = node(tree, "GeometryNodeInputPosition", 0, row).outputs["Position"]
    return node(tree, "ShaderNodeSeparateXYZ", 1, row, {"Vector": position}).outputs["Z"]


def mesh_of(tree: NodeTree, thing: Object, column: float, row: float) -> NodeSocket:
    """Add the node that reads an object's mesh; return its output."""
    return node(tree, "GeometryNodeObjectInfo", column, row, {"Object": thing}).outputs["Geometry"]


def sample(
    tree: NodeTree, table: NodeSocket, value: Value, kind: str, index: Value, column: float, row: float
) -> NodeSocket:
    """Add the node that reads a value of other vertices, by their place; return its output."""
    given = {"Geometry": table, "Value": value, "Index": index}
    sampler = node(tree, "GeometryNodeSampleIndex", column, row, given, data_type=kind, domain="POINT")
    return enabled(sampler.outputs, "Value")


def store(
    tree: NodeTree, table: NodeSocket, name: str, kind: str, value: Value, column: float, row: float
) -> NodeSocket:
    """Add the node that stores a value at every vertex; return its geometry."""
    given = {"Geometry": table, "Name": name, "Value": value}
    writer = node(tree, "GeometryNodeStoreNamedAttribute", column, row, given, data_type=kind, domain="POINT")
    return writer.outputs["Geometry"]


def bed_nodes(sources: Sources, deck: float, length: float, unit: float) -> NodeTree:
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
    instances = node(
        tree,
        "GeometryNodeInstanceOnPoints",
        5,
        0,
        {
            "Points": cells,
            "Instance": choice.outputs["Instances"],
            "Pick Instance": True,
            "Instance Index": switch(tree, "INT", 4, 1, settings.outputs[COLOR_BY_FORCE], mode, level),
            "Scale": _stretch(tree, deck, length),
        },
    )
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
    (TINT, "Bool", True, "Tint the skin by the modes of the pins under it"),
    (FAR, "Bool", False, "Pins are too small in the views; set by the extension"),
)


def _form_switches(tree: NodeTree, settings: Node, row: float) -> tuple[NodeSocket, NodeSocket, NodeSocket]:
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


def _skin(tree: NodeTree, sources: Sources, settings: Node, both: NodeSocket, row: float) -> NodeSocket:
    """Add the nodes of the skin, clear where pins are drawn under it; return its geometry."""
    smooth, membrane = (
        node(tree, "FunctionNodeInputString", -3, row + step, string=name).outputs["String"]
        for step, name in enumerate(KINDS)
    )
    kind = switch(tree, "STRING", -2, row, settings.outputs[MEMBRANE], smooth, membrane)
    pins = settings.outputs["Geometry"]
    skin = skin_nodes(tree, sources.skin, pins, kind, row)
    nearest = attribute(tree, NEAREST, "INT", 16, row - 2)
    mode = sample(tree, pins, attribute(tree, "mode", "INT", 16, row - 3), "INT", nearest, 17, row - 2)
    worn = {"Geometry": skin, "Material Index": mode}
    tinted = node(tree, "GeometryNodeSetMaterialIndex", 18, row - 2, worn).outputs["Geometry"]
    skin = switch(tree, "GEOMETRY", 18.5, row - 1, settings.outputs[TINT], skin, tinted)
    look = {"Geometry": skin, "Material": sources.clear}
    clear = node(tree, "GeometryNodeSetMaterial", 19, row, look).outputs["Geometry"]
    chosen = switch(tree, "GEOMETRY", 20, row, both, skin, clear)
    # An instance is joined with the housing without a copy of its points and their attributes.
    return node(tree, "GeometryNodeGeometryToInstance", 21, row, {"Geometry": chosen}).outputs["Instances"]


def _stretch(tree: NodeTree, deck: float, length: float) -> NodeSocket:
    """Add the nodes that give (1, 1, (z - deck) / length) at every vertex."""
    line = number(tree, "MULTIPLY_ADD", 2, -2, read_height(tree, -2), 1.0 / length, -deck / length)
    return combine(tree, 4, -2, X=1.0, Y=1.0, Z=number(tree, "MAXIMUM", 3, -2, line, LEAST_STRETCH))


def _level_of_force(tree: NodeTree, top: NodeSocket, first: int, row: float) -> NodeSocket:
    """Add the nodes that choose a pin by the force on it; return its place among the pins."""
    force = attribute(tree, "force", "FLOAT", 0, row + 1)
    per_newton = number(tree, "DIVIDE", 0, row + 2, float(len(heat.COLORS)), top)
    levels = number(tree, "CEIL", 2, row + 1, number(tree, "MULTIPLY", 1, row + 1, force, per_newton))
    limits = {"Value": levels, "Max": len(heat.COLORS)}
    within = node(tree, "ShaderNodeClamp", 3, row + 1, limits).outputs["Result"]
    return number(tree, "ADD", 3.5, row, within, float(first))


def _arrows_on_points(
    tree: NodeTree, arrow: NodeSocket, settings: Node, pins: NodeSocket, unit: float, row: float
) -> NodeSocket:
    """Add the nodes that draw the arrows beside the pins."""
    force = attribute(tree, "force", "FLOAT", 1, row + 1)
    pressed = node(
        tree,
        "FunctionNodeCompare",
        3,
        row - 0.4,
        {"A": force, "B": LEAST},
        data_type="FLOAT",
        operation="GREATER_THAN",
    )
    shape = node(tree, "GeometryNodeObjectInfo", 3, row + 0.6, {"Object": arrow, "As Instance": True})
    per_newton = number(tree, "MULTIPLY", 1, row + 2, settings.outputs[ARROW_LENGTH], unit)
    size = number(tree, "MULTIPLY", 2, row + 1, force, per_newton)
    instances = node(
        tree,
        "GeometryNodeInstanceOnPoints",
        4,
        row,
        {
            "Points": settings.outputs["Geometry"],
            "Selection": pressed.outputs["Result"],
            "Instance": shape.outputs["Geometry"],
            "Scale": combine(tree, 3, row + 2, X=1.0, Y=1.0, Z=size),
        },
    )
    both = {"Geometry": [instances.outputs["Instances"], pins]}
    joined = node(tree, "GeometryNodeJoinGeometry", 5, row, both).outputs["Geometry"]
    return switch(tree, "GEOMETRY", 6, row - 1, settings.outputs[ARROWS], pins, joined)


def skin_nodes(
    tree: NodeTree, sources: SkinMeshes, pins: NodeSocket, kind: NodeSocket, row: float
) -> NodeSocket:
    """Add the nodes that stretch a skin over pins; return its geometry."""
    names = [_prefixed(tree, words, kind, row + step) for step, words in enumerate(WEIGHTS)]
    height = read_height(tree, row + 3)
    index = node(tree, "GeometryNodeInputIndex", 1, row + 2).outputs["Index"]
    points = mesh_of(tree, sources.pins, 1, row)
    value = sample(tree, pins, height, "FLOAT", index, 2, row)
    pair = _store_pair(tree, store(tree, points, VALUE, "FLOAT", value, 3, row), 4, row)
    lines = mesh_of(tree, sources.rows, 6, row + 2)
    value = _sum(tree, pair, names, 6, row)
    pair = _store_pair(tree, store(tree, lines, VALUE, "FLOAT", value, 10, row), 11, row)
    up = combine(tree, 17, row + 1, Z=_sum(tree, pair, names, 13, row))
    flat = mesh_of(tree, sources.skin, 16, row)
    raised = node(tree, "GeometryNodeSetPosition", 18, row, {"Geometry": flat, "Offset": up})
    return raised.outputs["Geometry"]


def _prefixed(tree: NodeTree, words: str, kind: NodeSocket, row: float) -> NodeSocket:
    """Add the nodes that put words before a name."""
    first = node(tree, "FunctionNodeInputString", -1, row, string=words).outputs["String"]
    # What is linked first stands last.
    return node(tree, "GeometryNodeStringJoin", 0, row, {"Strings": [kind, first]}).outputs["String"]


def _store_pair(tree: NodeTree, table: NodeSocket, column: float, row: float) -> NodeSocket:
    """Add the nodes that store height and slope: the harmonic mean of the slopes on both sides, or 0."""
    here = attribute(tree, VALUE, "FLOAT", column, row + 1)
    sides = []
    for step, name in enumerate((PREVIOUS, FOLLOWING), 2):
        beside = {"Value": here, "Index": attribute(tree, name, "INT", column, row + step)}
        kind = {"data_type": "FLOAT", "domain": "POINT"}
        read = node(tree, "GeometryNodeFieldAtIndex", column + 0.5, row + step, beside, **kind)
        sides.append(enabled(read.outputs, "Value"))
    before = number(tree, "SUBTRACT", column + 1, row + 2, here, sides[0])
    after = number(tree, "SUBTRACT", column + 1, row + 3, sides[1], here)
    product = number(tree, "MULTIPLY", column + 1, row + 4, before, after)
    same_way = number(tree, "MAXIMUM", column + 1, row + 5, product, 0.0)
    twice = number(tree, "MULTIPLY", column + 1, row + 6, same_way, 2.0)
    total = number(tree, "ADD", column + 1, row + 7, before, after)
    slope = number(tree, "DIVIDE", column + 1, row + 8, twice, total)  # Blender divides by 0 to 0
    pair = combine(tree, column + 1.5, row + 1, X=here, Y=slope)
    return store(tree, table, PAIR, "FLOAT_VECTOR", pair, column + 1.7, row)


def _sum(tree: NodeTree, table: NodeSocket, names: list[NodeSocket], column: float, row: float) -> NodeSocket:
    """Add the nodes that add up heights and slopes of two neighbors."""
    pair = attribute(tree, PAIR, "FLOAT_VECTOR", column, row + 5)
    parts = []
    for step, (side, name) in enumerate(zip((LOW, HIGH), names, strict=True)):
        at = attribute(tree, side, "INT", column, row + 6 + step)
        weight = attribute(tree, name, "FLOAT_VECTOR", column, row + 8 + step)
        there = sample(tree, table, pair, "FLOAT_VECTOR", at, column + 1, row + 5 + step)
        dot = node(tree, "ShaderNodeVectorMath", column + 2, row + 5 + step, operation="DOT_PRODUCT")
        for target, value in zip(dot.inputs, (there, weight), strict=False):
            link(tree, value, target)
        parts.append(dot.outputs["Value"])
    return number(tree, "ADD", column + 3, row + 5, *parts)
