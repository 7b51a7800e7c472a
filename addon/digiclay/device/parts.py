"""Objects of the device: shapes, materials and roles; meshes of the live skin."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import bridge, roles
from ..bridge import SCALE
from ..compat import ID, Collection, Material, Mesh, Object, bpy, shader_nodes
from ..core.base.errors import DigiclayError
from ..core.base.modes import COLORS, WAITING, Mode
from ..core.model.underside import Mesh as Body
from ..ui_text import localize
from . import heat, primitives
from .instant import Instant
from .palettes import CLAY, PLAIN, TINTED, mix_tint
from .palettes import FINGERS as FINGER_COLORS
from .skin_lattice import Pass, SkinLattice, choose_parts, make_lattice

#: sRGB of what is no pin.
SKIN = (0.91, 0.60, 0.47)
CASE = (0.13, 0.14, 0.16)
ARROW = (0.80, 0.05, 0.05)
#: How much of the fingertip is left when one looks through it for the arrows, and of the skin for
#: the pins.
CLEAR, CLEAR_CLAY = 0.25, 0.6
#: Space between the outermost pins and the wall, and the wall's thickness, in pitches.
GAP, WALL = 0.85, 1.7
#: Above this many pins they are drawn with fewer faces.
MANY = 4000
#: Radius of an arrow's head, in pitches.
HEAD = 0.36
#: Name of the first fingertip; others also have their number.
FINGERTIP_NAME = "Digital Clay Fingertip"
#: Words about fingertips beyond the last one.
TOO_MANY = "A bed has at most {} fingertips (got {})."
#: Half the edge of the cube that a palm is drawn as, m.
PALM_SIZE = 9e-3
#: Attributes of the meshes: neighbors for the slope, neighbors for the sum, and what is stored on
#: the way.
PREVIOUS = "previous"
FOLLOWING = "following"
LOW = "low"
HIGH = "high"
VALUE = "value"
PAIR = "pair"
#: Attribute of the faces of the skin: the nearest pin.
NEAREST = "pin"
#: Attributes of the weights: their first half; the other is the name of the skin.
WEIGHTS = ("weight low ", "weight high ")


def marked(
    data: ID | None, name: str, role: str, *collections: Collection, parent: Object | None = None
) -> Object:
    """Make an object of data (None: an empty) in some collections, marked with its role."""
    thing = bpy.data.objects.new(name, data)
    thing[roles.ROLE] = role
    thing.parent = parent
    for collection in collections:
        collection.objects.link(thing)
    return thing


def material(
    name: str, color: tuple[float, float, float], roughness: float, alpha: float = 1.0
) -> Material:
    """Return the material of a part, as the user may have changed it, or make it."""
    existing = next((m for m in bpy.data.materials if m.get(roles.ROLE) == name), None)
    if existing is not None:
        return existing
    material = bpy.data.materials.new(f"Digital Clay {name.replace('_', ' ')}")
    material[roles.ROLE] = name
    material.diffuse_color = bridge.linear(color, alpha)
    material.roughness = roughness
    shader = next(node for node in shader_nodes(material).nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = bridge.linear(color)
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Alpha"].default_value = alpha
    return material


class SkinMeshes(NamedTuple):
    """Meshes of the skin: points of the pins and of the rows, and the skin itself, flat."""

    pins: Object
    rows: Object
    skin: Object


class Sources(NamedTuple):
    """Objects drawn by a bed's geometry nodes, in a collection outside all Blender scenes."""

    #: First one pin per mode, then one per level of force, in the order of their codes; then
    #: one that waits; then the others.
    collection: Collection
    #: An arrow of length 1 that points down and ends at the origin.
    arrow: Object
    housing: Object
    #: Objects of the live skin.
    skin: SkinMeshes
    #: Material of a skin over pins that are drawn.
    clear: Material


def make_sources(instant: Instant, length: float, deck: float, rim: float) -> Sources:
    """Make what a bed is drawn with; length of the pins, floor and upper edge of the housing in m."""
    segments = 28 if len(instant.height) <= MANY else 12
    shape = primitives.rod(instant.actuator.bore / 2 * SCALE, length * SCALE, segments)
    mesh = bridge.mesh("Digital Clay Pin", shape, smooth_below=1.2)
    mesh.materials.append(None)
    looks = [(mode.name.lower(), COLORS[mode]) for mode in Mode]
    looks += [
        (f"force_{level:02d}", color) for level, color in enumerate((heat.NO_FORCE, *heat.COLORS))
    ]
    looks.append(("waiting", WAITING))
    collection = bpy.data.collections.new("Digital Clay Parts")
    # The node that reads the collection sorts it by name: hence the number in front.
    for code, (look, color) in enumerate(looks):
        pin = marked(mesh, f"{code:02d} {look}", roles.PIN, collection)
        pin.material_slots[0].link = "OBJECT"
        pin.material_slots[0].material = material(look, color, roughness=0.45)
    arrow = marked(_arrow(instant.pitch), f"{len(looks)} force arrow", roles.PIN, collection)
    case = marked(_housing(instant, deck, rim), f"{len(looks) + 1} housing", roles.PIN, collection)
    meshes = make_meshes(make_lattice(instant, choose_parts(len(instant.height))), deck, _clays())
    skin = [
        marked(mesh, f"{code} {mesh.name}", roles.PIN, collection)
        for code, mesh in enumerate(meshes, len(looks) + 2)
    ]
    clear = material("skin_clear", CLAY, roughness=0.6, alpha=CLEAR_CLAY)
    return Sources(collection, arrow, case, SkinMeshes(*skin), clear)


def _clays() -> list[Material]:
    """Return the material of the skin over pins of each mode."""
    clay = material("skin", CLAY, roughness=0.6)
    return [
        clay if mode in PLAIN else material(TINTED + mode.name.lower(), mix_tint(COLORS[mode]), 0.6)
        for mode in Mode
    ]


def _arrow(pitch: float) -> Mesh:
    """Make the mesh of a bed's arrow; the pitch in m."""
    mesh = bridge.mesh("Digital Clay Force", primitives.arrow(HEAD * pitch * SCALE))
    mesh.materials.append(material("force_arrow", ARROW, roughness=0.5))
    return mesh


def _housing(instant: Instant, deck: float, rim: float) -> Mesh:
    """Make the mesh of the case about the pins of an instant; floor inside and upper edge in m."""
    reach = np.abs(instant.position).max(axis=0) + instant.actuator.bore / 2 + GAP * instant.pitch
    half = float(reach[0]) * SCALE, float(reach[1]) * SCALE
    wall = WALL * instant.pitch * SCALE
    bottom = deck * SCALE - wall / 2
    shape = primitives.housing(half, wall, bottom, deck * SCALE, rim * SCALE)
    mesh = bridge.mesh("Digital Clay Housing", shape)
    mesh.materials.append(material("housing", CASE, roughness=0.55))
    return mesh


def make_meshes(lattice: SkinLattice, deck: float, materials: Sequence[Material]) -> SkinMeshes:
    """Make the meshes of a skin; a material for each mode."""
    pins = _points("Digital Clay Skin Pins", lattice.along.previous.size)
    _write_neighbors(pins, lattice.along)
    rows = _points("Digital Clay Skin Rows", lattice.across.previous.size)
    _write_neighbors(rows, lattice.across)
    _write_weights(rows, lattice.along)
    count = len(lattice.place)
    skin = _points("Digital Clay Skin", count)
    flat = np.column_stack([lattice.place, np.where(lattice.sunk, deck, 0.0)]) * SCALE
    skin.vertices.foreach_set("co", flat.astype(np.float32).ravel())
    skin.loops.add(lattice.faces.size)
    skin.loops.foreach_set("vertex_index", lattice.faces.ravel())
    skin.polygons.add(len(lattice.faces))
    skin.polygons.foreach_set("loop_start", np.arange(0, lattice.faces.size, 4, dtype=np.int32))
    skin.update(calc_edges=True)
    _write_weights(skin, lattice.across)
    skin.attributes.new(NEAREST, "INT", "FACE").data.foreach_set("value", lattice.pin)
    for each in materials:
        skin.materials.append(each)
    return SkinMeshes(pins, rows, skin)


def _points(name: str, count: int) -> Mesh:
    """Make a mesh of loose vertices."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(count)
    return mesh


def _write_neighbors(mesh: Mesh, step: Pass) -> None:
    """Write the neighbors that the slopes of a pass need."""
    for name, values in ((PREVIOUS, step.previous), (FOLLOWING, step.following)):
        mesh.attributes.new(name, "INT", "POINT").data.foreach_set("value", values)


def _write_weights(mesh: Mesh, step: Pass) -> None:
    """Write the neighbors that a pass adds up, and their weights."""
    for name, values in ((LOW, step.low), (HIGH, step.high)):
        mesh.attributes.new(name, "INT", "POINT").data.foreach_set("value", values)
    for kind, weights in step.weights.items():
        for name, share in zip(WEIGHTS, weights, strict=True):
            attribute = mesh.attributes.new(name + kind, "FLOAT_VECTOR", "POINT")
            attribute.data.foreach_set("vector", share.astype(np.float32).ravel())


def make_body(name: str, body: Body) -> Mesh:
    """Make the mesh of a body that presses the pins; its vertices in m."""
    mesh = bridge.mesh(name, (body.vertices * SCALE, body.triangles.tolist()))
    mesh.materials.append(material("body", SKIN, roughness=0.6))
    return mesh


def make_fingertip(bed: Object, number: int = 1, palm: Object | None = None) -> Object:
    """Make a fingertip of a bed, or of a palm on it: an empty that is moved, in it an ellipsoid."""
    homes = bed.users_collection
    # The empty carries the pose alone. Its scale is locked: the fingertip's size is a parameter
    # of the device, kept in the ellipsoid's scale.
    tip = marked(None, name_fingertip(number), roles.FINGERTIP, *homes, parent=palm or bed)
    hold_fingertip(bed, number, tip)
    tip.empty_display_type, tip.show_in_front = "PLAIN_AXES", True
    tip.rotation_mode = "QUATERNION"
    tip.lock_scale = (True, True, True)
    mesh = bridge.mesh("Digital Clay Ellipsoid", primitives.ball())
    mesh.materials.append(None)
    ball = marked(mesh, mesh.name, roles.ELLIPSOID, *homes, parent=tip)
    tip[roles.BALL] = ball
    tip[roles.OWNED] = ball[roles.OWNED] = True
    lock_in_place(ball)
    ball.material_slots[0].link = "OBJECT"
    color_fingertip(tip, number, clear=False)
    return tip


def name_fingertip(number: int) -> str:
    """Return the name of a fingertip, unless the user gives it another one."""
    return FINGERTIP_NAME + f" {number}" * (number > 1)


def find_free_number(bed: Object) -> int:
    """Return the least number that no fingertip of a bed has; raise DigiclayError where all have one."""
    taken = roles.fingertips_of(bed)
    free = (number for number in range(1, len(roles.FINGERS) + 1) if number not in taken)
    number = next(free, None)
    if number is None:
        raise DigiclayError(localize(TOO_MANY, len(roles.FINGERS), len(roles.FINGERS) + 1))
    return number


def hold_fingertip(bed: Object, number: int, tip: Object) -> None:
    """Have a bed, and the palm that a fingertip stands on, hold it as that of a number."""
    bed[roles.FINGERS[number - 1]] = tip
    palm = roles.owner_of(tip, roles.PALM)
    if palm is not None:
        palm[roles.FINGERS[number - 1]], tip[roles.HAND] = tip, palm


def make_palm(bed: Object) -> Object:
    """Make the palm of a hand over a bed: an empty that moves its fingertips as one."""
    palm = marked(None, "Digital Clay Hand", roles.PALM, *bed.users_collection, parent=bed)
    palm[roles.OWNED] = True
    palm.empty_display_type, palm.empty_display_size = "CUBE", PALM_SIZE * SCALE
    return palm


def lock_in_place(ball: Object) -> None:
    """Have an ellipsoid selected by a click, and moved by its fingertip alone."""
    ball.hide_select = False
    ball.lock_location = ball.lock_rotation = ball.lock_scale = (True, True, True)


def color_fingertip(tip: Object, number: int, *, clear: bool) -> None:
    """Give the ellipsoid of a fingertip the color of its number, opaque, or clear so that arrows are seen."""
    ball = roles.ellipsoid(tip)
    if ball is not None:
        index = (number - 1) % len(FINGER_COLORS)
        kind, color = (
            (f"fingertip_{index + 1}", FINGER_COLORS[index]) if index else ("fingertip", SKIN)
        )
        name, alpha = (f"{kind}_clear", CLEAR) if clear else (kind, 1.0)
        ball.material_slots[0].material = material(name, color, roughness=0.4, alpha=alpha)
