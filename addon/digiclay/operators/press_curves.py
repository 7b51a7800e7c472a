"""Strokes along curves, texts and Grease Pencil strokes, and stamps of what is filled."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .. import bridge
from ..bridge import SCALE
from ..compat import (
    ID,
    Context,
    Menu,
    NodeTree,
    Object,
    Operator,
    OperatorProperties,
    bpy,
)
from ..core.base.arrays import Floats
from ..core.base.errors import ParameterError, one_line
from ..core.shapes.mesh_relief import ShapeMesh
from ..device.node_tree import finish, new_tree, node
from ..exchange.shape_show import read_relief
from ..live import beds
from ..press import aim, brush, tool
from ..sessions.sculpting import queue_stroke
from ..settings import devices
from ..settings.declared import flag
from ..strokes.curve_paths import join_edges, lay_lines, refuse_paths
from ..strokes.stamps import cut_stamp
from ..strokes.stroke import STAMPS, Brush
from ..ui_text import localize
from .action import Result, action
from .poll_messages import Need, no_finger, no_view
from .press_stroke import open_session

#: Objects with lines, and those of them that Blender can fill.
LINED, FILLED = ("CURVE", "FONT", "CURVES", "GREASEPENCIL", "GPENCIL"), ("CURVE", "FONT")
#: Brushes by which filled shapes are stamped.
CUT = {Brush.RAISE: Brush.STAMP, Brush.LOWER: Brush.IMPRINT, Brush.STAMP: Brush.STAMP}
#: What stands in a report of names at most, characters.
NAMES = 100


def list_curves(context: Context) -> list[Object]:
    """Return the selected objects with lines."""
    return [thing for thing in context.selected_objects if thing.type in LINED]


no_curves = Need(
    lambda context: not list_curves(context), "Select curves, texts or Grease Pencil strokes"
)


def read_lines(context: Context, thing: Object, bed: Object) -> list[Floats]:
    """Return the lines of an object, with its modifiers, (k, 2), m, in the space of a bed."""
    legacy = thing.type == "GPENCIL"
    return list((_read_layers if legacy else _read_edges)(context, thing, bed))


def _read_edges(context: Context, thing: Object, bed: Object) -> list[Floats]:
    """Return the lines of an object by geometry nodes, which take them from any kind."""
    name, temporary = thing.name, list[ID]()
    try:
        if thing.type in FILLED:
            thing = thing.copy()
            thing.data = thing.data.copy()
            temporary += [thing, thing.data]
            _bare(thing.data)
            context.scene.collection.objects.link(thing)
        mesh, tree = bpy.data.meshes.new("Lines"), _make_tree(thing)
        carrier = bpy.data.objects.new("Lines", mesh)
        temporary += [carrier, mesh, tree]
        carrier.matrix_world = bed.matrix_world
        carrier.modifiers.new("Lines", "NODES").node_group = tree
        context.scene.collection.objects.link(carrier)
        evaluated = carrier.evaluated_get(context.evaluated_depsgraph_get())
        mesh = evaluated.to_mesh()
        if len(mesh.polygons):
            rule = "must be lines, not the surface that its modifiers make of them"
            raise ParameterError(name, "modifiers", rule, f"{len(mesh.polygons)} faces")
        flat = bridge.read_points(mesh)[:, :2] / SCALE
        edges = np.empty(2 * len(mesh.edges), np.int32)
        mesh.edges.foreach_get("vertices", edges)
        evaluated.to_mesh_clear()
    finally:
        bpy.data.batch_remove(temporary)
    return join_edges(flat, edges.reshape(-1, 2).astype(np.int64))


def _bare(curve: ID) -> None:
    """Leave of a curve or text what has no face."""
    if curve.dimensions == "2D":
        curve.fill_mode = "NONE"
    curve.extrude = curve.bevel_depth = 0.0
    curve.bevel_object = None


def _make_tree(thing: Object) -> NodeTree:
    """Return geometry nodes that make edges of an object's lines, in the space of what they are on."""
    tree = new_tree("Lines")
    source = node(tree, "GeometryNodeObjectInfo", {"Object": thing}, transform_space="RELATIVE")
    last = source.outputs["Geometry"]
    first = ["GeometryNodeGreasePencilToCurves"] if thing.type == "GREASEPENCIL" else []
    for kind in (*first, "GeometryNodeRealizeInstances", "GeometryNodeCurveToMesh"):
        step = node(tree, kind)
        tree.links.new(last, step.inputs[0])
        last = step.outputs[0]
    finish(tree, last)
    return tree


def _read_layers(context: Context, thing: Object, bed: Object) -> Iterator[Floats]:
    """Yield the lines of a Grease Pencil object of Blender 4.2, (k, 2), m."""
    matrix = np.array(bed.matrix_world.inverted() @ thing.matrix_world)
    for layer in thing.evaluated_get(context.evaluated_depsgraph_get()).data.layers:
        if layer.hide or layer.active_frame is None:
            continue
        for stroke in layer.active_frame.strokes:
            places = np.array([(*point.co, 1.0) for point in stroke.points]).reshape(-1, 4)
            line = (places @ matrix.T)[:, :2] / SCALE
            yield np.concatenate([line, line[:1]]) if stroke.use_cyclic else line


def _read_filled(context: Context, thing: Object, bed: Object) -> ShapeMesh:
    """Return the faces of a filled object in the space of a bed, m."""
    hint = "Only texts and closed 2D curves with a fill mode can be filled."
    if thing.type not in FILLED:
        raise ParameterError(thing.name, "fill", "must be a curve or a text", thing.type, hint)
    try:
        return read_relief(thing, bed, context.evaluated_depsgraph_get())
    except ParameterError as error:
        raise ParameterError(thing.name, "fill", error.rule, error.value, hint) from None


@action(
    "digiclay.press_curves",
    "Form along Curves",
    no_view.reworded("Curves are formed in a 3D view"),
    no_curves,
    no_finger,
    options=("UNDO",),
    fill=flag("Fill", "Stamp the filled texts and 2D curves instead, with an edge", default=False),
)
def form_curves(operator: Operator, context: Context) -> Result | None:
    """Queue strokes of the brush along the selected curves, texts and Grease Pencil strokes"""
    if brush.tool_settings(context) is None:
        tool.take_up(context)
    settings: OperatorProperties = brush.tool_settings(context)
    bed, kind, things = brush.bed_in_use(context), Brush(settings.brush), list_curves(context)
    brush.take_finger(context, bed)
    sizes = devices.read_sizes(bed)
    context.view_layer.update()
    grid, _ = aim.read_surface(bed)
    if operator.fill:
        if kind not in CUT:
            rule = "must be Raise, Lower or Stamp to fill curves"
            raise ParameterError("Press", "brush", rule, brush.LABELS[kind])
        stamp, path = cut_stamp([_read_filled(context, thing, bed) for thing in things], grid)
        if not stamp.values.any():
            raise ParameterError("Curves", "fill", "must lie over the bed", "none of it does")
        strokes = [
            replace(brush.lay_stroke(settings, path, kind, stamp=stamp, **sizes), brush=CUT[kind])
        ]
        words = localize("Stamp queued")
    else:
        if kind in STAMPS:
            rule = "must be another one along curves"
            raise ParameterError("Press", "brush", rule, brush.LABELS[kind], "Or choose Fill.")
        paths, left = list[Floats](), list[str]()
        for thing in things:
            found, whole = lay_lines(thing.name, read_lines(context, thing, bed), grid)
            paths += found
            left += [] if whole else [thing.name]
        refuse_paths(paths)
        # A closed path that accumulates would count at its end from what it has formed.
        strokes = [
            replace(brush.lay_stroke(settings, path, kind, **sizes), accumulate=False)
            for path in paths
        ]
        words = localize("Strokes queued: {}", len(paths))
        if left:
            names = one_line(", ".join(left), NAMES)
            words += localize("; not over the bed, or not all of it: {}", names)
    session = open_session(operator, context, bed, strokes[0].brush, strokes[0].falloff)
    if session is None:
        return {"CANCELLED"}
    for stroke in strokes:
        session, _ = queue_stroke(session, stroke)
    beds.put(session)
    operator.report({"INFO"}, words)
    return None


def entry(menu: Menu, context: Context) -> None:
    """Offer them in the Object menu where there is a bed to form."""
    if brush.bed_in_use(context) is not None:
        menu.layout.separator()
        tool.draw_curves(menu.layout)
