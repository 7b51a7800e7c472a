"""Geometry nodes of a bed: pins, colored by mode or by force, arrows on them, the live skin, and the housing.

The skin is weighted sums of the heights of the pins, in Blender's own code. It follows whatever
moves the pins: a session, a bake, undo. It needs no data of its own in a tick.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping

from ..compat import Collection, Node, NodeInputs, NodeOutputs, NodeSocket, NodeTree, Object, bpy
from ..core.base.modes import Mode
from . import heat
from .parts import (
    FOLLOWING,
    HIGH,
    LOW,
    NEAREST,
    PAIR,
    PREVIOUS,
    VALUE,
    WEIGHTS,
    SkinMeshes,
    Sources,
)
from .skin_lattice import KINDS

#: What an input of a node is given: a value, an output of another node, or a list of outputs.
Value = object
#: Names of the nodes that have the housing and the collection of all that is drawn.
CASE, SOURCES = "Housing", "Sources"

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02
#: Names of the settings: colors by force, one color for all pins, and arrows.
COLOR_BY_FORCE, TOP_FORCE, NEUTRAL = "Color by Force", "Top Color at (N)", "Neutral Color"
ARROWS, ARROW_LENGTH = "Force Arrows", "Arrow Length (mm/N)"
#: Names of the settings: what is seen (0 automatic, 1 pins, 2 skin, 3 both), which skin, whether
#: the pins are too small in the views for "automatic" to draw them, and whether the skin is tinted
#: by their modes.
FORM, MEMBRANE, FAR, TINT = "Form", "Membrane", "Far", "Tint"
#: Name of the setting that makes one mesh of all that is drawn, for what takes no instances.
REALIZE = "Realize Instances"
#: How long an arrow is drawn by default, mm for each N.
LENGTH = 150.0
#: Size of a place for a node in the editor, pixels.
WIDTH, HEIGHT = 220.0, 180.0
#: Smaller forces get no arrow, N: a millinewton is what the pulp of a fingertip just feels.
LEAST = 1e-3


def node(
    tree: NodeTree, kind: str, inputs: Mapping[str, Value] | None = None, **settings: object
) -> Node:
    """Add a node; each input gets a value, an output, or a list of outputs."""
    node = tree.nodes.new(kind)
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


def finish(tree: NodeTree, geometry: NodeSocket) -> None:
    """Have a tree give a geometry, and place its nodes, each to the right of those that feed it."""
    node(tree, "NodeGroupOutput", {"Geometry": geometry})
    feeding = defaultdict(list)
    for each in tree.links:
        feeding[each.to_node.name].append(each.from_node.name)
    columns: dict[str, int] = {}
    rows, places = Counter[int](), list[float]()
    for each in tree.nodes:  # in the order in which they were added
        column = 1 + max((columns[name] for name in feeding[each.name]), default=-1)
        places += WIDTH * column, -HEIGHT * rows[column]
        columns[each.name] = column
        rows[column] += 1
    tree.nodes.foreach_set("location", places)


def list_sources(tree: NodeTree) -> tuple[set[Collection], set[Object]]:
    """Return the collections that a tree draws, and the objects, also those in the collections."""
    inputs = [
        getattr(socket, "default_value", None) for node in tree.nodes for socket in node.inputs
    ]
    collections = {thing for thing in inputs if isinstance(thing, bpy.types.Collection)}
    objects = {thing for thing in inputs if isinstance(thing, bpy.types.Object)}
    objects.update(*(collection.objects for collection in collections))
    return collections, objects


def socket(tree: NodeTree, name: str, kind: str, default: Value, description: str) -> None:
    """Add a setting to a tree, which each object that uses the tree has for itself."""
    setting = tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    setting.default_value = default
    setting.description = description


def attribute(tree: NodeTree, name: Value, kind: str) -> NodeSocket:
    """Add a node that reads an attribute of the vertices of a name or text of nodes; return its output."""
    reader = node(tree, "GeometryNodeInputNamedAttribute", {"Name": name}, data_type=kind)
    return enabled(reader.outputs, "Attribute")


def number(tree: NodeTree, operation: str, *values: Value) -> NodeSocket:
    """Add a node that reckons with numbers or with outputs of other nodes; return its output."""
    math_node = node(tree, "ShaderNodeMath", operation=operation)
    for target, value in zip(math_node.inputs, values, strict=False):
        link(tree, value, target)
    return math_node.outputs["Value"]


def switch(tree: NodeTree, kind: str, on: Value, off: Value, then: Value) -> NodeSocket:
    """Add a node that hands on `then` where `on` holds and `off` (may be None) else; return its output."""
    # What is not handed on is not worked out either: that is how a part that is off costs nothing.
    inputs = {"Switch": on, **({} if off is None else {"False": off}), "True": then}
    return enabled(node(tree, "GeometryNodeSwitch", inputs, input_type=kind).outputs, "Output")


def combine(tree: NodeTree, **parts: Value) -> NodeSocket:
    """Add a node that makes a vector of X, Y and Z; return its output."""
    return node(tree, "ShaderNodeCombineXYZ", parts).outputs["Vector"]


def read_height(tree: NodeTree) -> NodeSocket:
    """Add the nodes that read the height of a vertex; return their output."""
    position = node(tree, "GeometryNodeInputPosition").outputs["Position"]
    return node(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs["Z"]


def mesh_of(tree: NodeTree, thing: Object) -> NodeSocket:
    """Add the node that reads an object's mesh; return its output."""
    return node(tree, "GeometryNodeObjectInfo", {"Object": thing}).outputs["Geometry"]


def sample(tree: NodeTree, table: NodeSocket, value: Value, kind: str, index: Value) -> NodeSocket:
    """Add the node that reads a value of other vertices, by their place; return its output."""
    given = {"Geometry": table, "Value": value, "Index": index}
    sampler = node(tree, "GeometryNodeSampleIndex", given, data_type=kind, domain="POINT")
    return enabled(sampler.outputs, "Value")


def store(tree: NodeTree, table: NodeSocket, name: str, kind: str, value: Value) -> NodeSocket:
    """Add the node that stores a value at every vertex; return its geometry."""
    given = {"Geometry": table, "Name": name, "Value": value}
    writer = node(tree, "GeometryNodeStoreNamedAttribute", given, data_type=kind, domain="POINT")
    return writer.outputs["Geometry"]


def bed_nodes(sources: Sources, deck: float, length: float, unit: float) -> NodeTree:
    """Make the node group that puts a pin on every vertex, an arrow where arrows are on, and the housing."""
    # Stretching one mesh costs half of drawing rod and cap apart. A cap is stretched with its
    # rod, from a flat one on a low pin to a round one on a high pin.
    tree = new_tree("Digital Clay Pins")
    for name, kind, default, words in SETTINGS:
        socket(tree, name, f"NodeSocket{kind}", default, words)
    settings = node(tree, "NodeGroupInput")
    cells = settings.outputs["Geometry"]
    parts = {"Collection": sources.collection, "Separate Children": True}
    choice = node(tree, "GeometryNodeCollectionInfo", parts, name=SOURCES)
    level = _level_of_force(tree, settings.outputs[TOP_FORCE], len(Mode))
    waiting = attribute(tree, "waiting", "BOOLEAN")
    last = len(Mode) + len(heat.COLORS) + 1
    mode = switch(tree, "INT", waiting, attribute(tree, "mode", "INT"), last)
    look = switch(tree, "INT", settings.outputs[COLOR_BY_FORCE], mode, level)
    instances = node(
        tree,
        "GeometryNodeInstanceOnPoints",
        {
            "Points": cells,
            "Instance": choice.outputs["Instances"],
            "Pick Instance": True,
            "Instance Index": switch(tree, "INT", settings.outputs[NEUTRAL], look, int(Mode.REST)),
            "Scale": _stretch(tree, deck, length),
        },
    )
    pins_on, skin_on, both_on = _form_switches(tree, settings)
    pins = switch(tree, "GEOMETRY", pins_on, None, instances.outputs["Instances"])
    drawn = _arrows_on_points(tree, sources.arrow, settings, pins, unit)
    skin = switch(tree, "GEOMETRY", skin_on, None, _skin(tree, sources, settings, both_on))
    case = node(tree, "GeometryNodeObjectInfo", {"Object": sources.housing}, name=CASE)
    every = {"Geometry": [case.outputs["Geometry"], drawn, skin]}
    joined = node(tree, "GeometryNodeJoinGeometry", every).outputs["Geometry"]
    whole = node(tree, "GeometryNodeRealizeInstances", {"Geometry": joined}).outputs["Geometry"]
    finish(tree, switch(tree, "GEOMETRY", settings.outputs[REALIZE], joined, whole))
    return tree


#: What each bed may choose for itself: name, type, default, description.
SETTINGS = (
    (COLOR_BY_FORCE, "Bool", False, "Color the pins by force, not by mode"),
    (NEUTRAL, "Bool", False, "Color all pins as those at rest"),
    (TOP_FORCE, "Float", heat.TOP, "Force of the last color, in N"),
    (ARROWS, "Bool", False, "Draw the force on each pin as an arrow onto its top"),
    (ARROW_LENGTH, "Float", LENGTH, "Length of the arrow of 1 N, in mm of the device"),
    (FORM, "Int", 0, "0: pins, a skin where they are too small; 1: pins; 2: skin; 3: both"),
    (MEMBRANE, "Bool", False, "Stretch the skin over the flat ends of the pins"),
    (TINT, "Bool", True, "Tint the skin by the modes of the pins under it"),
    (FAR, "Bool", False, "Pins are too small in the views; set by the extension"),
    (REALIZE, "Bool", False, "Make pins and arrows part of one mesh; slow"),
)


def _form_switches(tree: NodeTree, settings: Node) -> tuple[NodeSocket, NodeSocket, NodeSocket]:
    """Add the nodes that tell whether pins, skin, and both are drawn."""
    form = settings.outputs[FORM]
    automatic, pins, skin, both = (
        number(tree, "COMPARE", form, float(step), 0.5) for step in range(4)
    )
    # A picture has as many samples as it needs: there "automatic" means pins.
    in_view = node(tree, "GeometryNodeIsViewport").outputs["Is Viewport"]
    far = number(tree, "MULTIPLY", settings.outputs[FAR], in_view)
    near = number(tree, "SUBTRACT", 1.0, far)
    instead = number(tree, "MULTIPLY", automatic, far)
    pins = number(tree, "ADD", pins, number(tree, "MULTIPLY", automatic, near))
    skin = number(tree, "ADD", skin, instead)
    return number(tree, "ADD", pins, both), number(tree, "ADD", skin, both), both


def _skin(tree: NodeTree, sources: Sources, settings: Node, both: NodeSocket) -> NodeSocket:
    """Add the nodes of the skin, clear where pins are drawn under it; return its geometry."""
    smooth, membrane = (
        node(tree, "FunctionNodeInputString", string=name).outputs["String"] for name in KINDS
    )
    kind = switch(tree, "STRING", settings.outputs[MEMBRANE], smooth, membrane)
    pins = settings.outputs["Geometry"]
    skin = skin_nodes(tree, sources.skin, pins, kind)
    nearest = attribute(tree, NEAREST, "INT")
    mode = sample(tree, pins, attribute(tree, "mode", "INT"), "INT", nearest)
    worn = {"Geometry": skin, "Material Index": mode}
    tinted = node(tree, "GeometryNodeSetMaterialIndex", worn).outputs["Geometry"]
    skin = switch(tree, "GEOMETRY", settings.outputs[TINT], skin, tinted)
    look = {"Geometry": skin, "Material": sources.clear}
    clear = node(tree, "GeometryNodeSetMaterial", look).outputs["Geometry"]
    chosen = switch(tree, "GEOMETRY", both, skin, clear)
    # Exporters and Object > Convert have what is a mesh: not the weights it was made with.
    weights = (words + kind for words in WEIGHTS for kind in KINDS)
    for name in (LOW, HIGH, NEAREST, *weights):
        removed = {"Geometry": chosen, "Name": name}
        chosen = node(tree, "GeometryNodeRemoveAttribute", removed).outputs["Geometry"]
    return chosen


def _stretch(tree: NodeTree, deck: float, length: float) -> NodeSocket:
    """Add the nodes that give (1, 1, (z - deck) / length) at every vertex."""
    line = number(tree, "MULTIPLY_ADD", read_height(tree), 1.0 / length, -deck / length)
    return combine(tree, X=1.0, Y=1.0, Z=number(tree, "MAXIMUM", line, LEAST_STRETCH))


def _level_of_force(tree: NodeTree, top: NodeSocket, first: int) -> NodeSocket:
    """Add the nodes that choose a pin by the force on it; return its place among the pins."""
    force = attribute(tree, "force", "FLOAT")
    per_newton = number(tree, "DIVIDE", float(len(heat.COLORS)), top)
    levels = number(tree, "CEIL", number(tree, "MULTIPLY", force, per_newton))
    limits = {"Value": levels, "Max": len(heat.COLORS)}
    within = node(tree, "ShaderNodeClamp", limits).outputs["Result"]
    return number(tree, "ADD", within, float(first))


def _arrows_on_points(
    tree: NodeTree, arrow: NodeSocket, settings: Node, pins: NodeSocket, unit: float
) -> NodeSocket:
    """Add the nodes that draw the arrows beside the pins."""
    force = attribute(tree, "force", "FLOAT")
    compared = {"A": force, "B": LEAST}
    pressed = node(
        tree, "FunctionNodeCompare", compared, data_type="FLOAT", operation="GREATER_THAN"
    )
    shape = node(tree, "GeometryNodeObjectInfo", {"Object": arrow, "As Instance": True})
    per_newton = number(tree, "MULTIPLY", settings.outputs[ARROW_LENGTH], unit)
    size = number(tree, "MULTIPLY", force, per_newton)
    instances = node(
        tree,
        "GeometryNodeInstanceOnPoints",
        {
            "Points": settings.outputs["Geometry"],
            "Selection": pressed.outputs["Result"],
            "Instance": shape.outputs["Geometry"],
            "Scale": combine(tree, X=1.0, Y=1.0, Z=size),
        },
    )
    both = {"Geometry": [instances.outputs["Instances"], pins]}
    joined = node(tree, "GeometryNodeJoinGeometry", both).outputs["Geometry"]
    return switch(tree, "GEOMETRY", settings.outputs[ARROWS], pins, joined)


def skin_nodes(
    tree: NodeTree, sources: SkinMeshes, pins: NodeSocket, kind: NodeSocket
) -> NodeSocket:
    """Add the nodes that stretch a skin over pins; return its geometry."""
    names = [_prefixed(tree, words, kind) for words in WEIGHTS]
    height = read_height(tree)
    index = node(tree, "GeometryNodeInputIndex").outputs["Index"]
    points = mesh_of(tree, sources.pins)
    value = sample(tree, pins, height, "FLOAT", index)
    pair = _store_pair(tree, store(tree, points, VALUE, "FLOAT", value))
    lines = mesh_of(tree, sources.rows)
    value = _sum(tree, pair, names)
    pair = _store_pair(tree, store(tree, lines, VALUE, "FLOAT", value))
    up = combine(tree, Z=_sum(tree, pair, names))
    flat = mesh_of(tree, sources.skin)
    raised = node(tree, "GeometryNodeSetPosition", {"Geometry": flat, "Offset": up})
    return raised.outputs["Geometry"]


def _prefixed(tree: NodeTree, words: str, kind: NodeSocket) -> NodeSocket:
    """Add the nodes that put words before a name."""
    first = node(tree, "FunctionNodeInputString", string=words).outputs["String"]
    # What is linked first stands last.
    return node(tree, "GeometryNodeStringJoin", {"Strings": [kind, first]}).outputs["String"]


def _store_pair(tree: NodeTree, table: NodeSocket) -> NodeSocket:
    """Add the nodes that store height, slope and bend: sum and difference of the rises on both sides."""
    here = attribute(tree, VALUE, "FLOAT")
    sides = []
    for name in (PREVIOUS, FOLLOWING):
        beside = {"Value": here, "Index": attribute(tree, name, "INT")}
        kind = {"data_type": "FLOAT", "domain": "POINT"}
        read = node(tree, "GeometryNodeFieldAtIndex", beside, **kind)
        sides.append(enabled(read.outputs, "Value"))
    before = number(tree, "SUBTRACT", here, sides[0])
    after = number(tree, "SUBTRACT", sides[1], here)
    slope, bend = number(tree, "ADD", before, after), number(tree, "SUBTRACT", after, before)
    return store(tree, table, PAIR, "FLOAT_VECTOR", combine(tree, X=here, Y=slope, Z=bend))


def _sum(tree: NodeTree, table: NodeSocket, names: list[NodeSocket]) -> NodeSocket:
    """Add the nodes that add up heights, slopes and bends of two neighbors."""
    pair = attribute(tree, PAIR, "FLOAT_VECTOR")
    parts = []
    for side, name in zip((LOW, HIGH), names, strict=True):
        at = attribute(tree, side, "INT")
        weight = attribute(tree, name, "FLOAT_VECTOR")
        there = sample(tree, table, pair, "FLOAT_VECTOR", at)
        dot = node(tree, "ShaderNodeVectorMath", operation="DOT_PRODUCT")
        for target, value in zip(dot.inputs, (there, weight), strict=False):
            link(tree, value, target)
        parts.append(dot.outputs["Value"])
    return number(tree, "ADD", *parts)
