"""The objects the device is made of: their shapes, materials and roles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import bridge
from ..bridge import SCALE
from ..compat import bpy, shader_nodes
from ..core.modes import COLOURS, Mode
from . import heat, shapes
from .instant import Instant

__all__ = [
    "BED", "ELLIPSOID", "FINGERTIP", "HOUSING", "ROLE",
    "arrow", "ellipsoid", "fingertip", "housing", "marked", "material", "pins", "skin",
]  # fmt: skip

#: Marks the objects of the device; names are the user's to change.
ROLE = "digiclay_role"
BED, FINGERTIP, ELLIPSOID, HOUSING, PIN = "bed", "fingertip", "ellipsoid", "housing", "pin"

#: sRGB of what is no pin.
SKIN = (0.91, 0.60, 0.47)
CASE = (0.13, 0.14, 0.16)
ARROW = (0.80, 0.05, 0.05)
#: How much of the fingertip is left when one looks through it for the arrows.
CLEAR = 0.25
#: Space between the outermost pins and the wall, and the wall's thickness, in pitches.
GAP, WALL = 0.85, 1.7
#: Above this many pins they are drawn with fewer faces.
MANY = 4000
#: Radius of an arrow's head, in pitches.
HEAD = 0.36


def marked(data: Any, name: str, role: str, collection: Any, parent: Any | None = None) -> Any:
    """Make an object of data (None: an empty), marked with its role."""
    made = bpy.data.objects.new(name, data)
    made[ROLE] = role
    made.parent = parent
    collection.objects.link(made)
    return made


def material(name: str, colour: tuple[float, float, float], roughness: float, alpha: float = 1.0) -> Any:
    """Return the material of a part, as the user may have changed it, or make it."""
    found = next((m for m in bpy.data.materials if m.get(ROLE) == name), None)
    if found is not None:
        return found
    made = bpy.data.materials.new(f"Digital Clay {name.replace('_', ' ')}")
    made[ROLE] = name
    made.diffuse_color = bridge.linear(colour, alpha)
    made.roughness = roughness
    shader = next(node for node in shader_nodes(made).nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = bridge.linear(colour)
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Alpha"].default_value = alpha
    return made


def pins(instant: Instant, length: float) -> tuple[Any, Any]:
    """Make one pin a mode and one a level of force, in two collections that stand in no scene."""
    segments = 28 if len(instant.height) <= MANY else 12
    shape = shapes.rod(instant.actuator.bore / 2 * SCALE, length * SCALE, segments)
    mesh = bridge.mesh("Digital Clay Pin", shape, smooth_below=1.2)
    mesh.materials.append(None)
    modes = [(mode.name.lower(), COLOURS[mode]) for mode in Mode]
    levels = [(f"force_{level:02d}", colour) for level, colour in enumerate((heat.NO_FORCE, *heat.COLOURS))]
    return _worn("Digital Clay Pins", mesh, modes), _worn("Digital Clay Pins by Force", mesh, levels)


def _worn(name: str, mesh: Any, looks: Sequence[tuple[str, tuple[float, float, float]]]) -> Any:
    """Make a collection in which a mesh wears one material after another.

    The node that reads the collection sorts it by name: hence the code in front.
    """
    collection = bpy.data.collections.new(name)
    for code, (look, colour) in enumerate(looks):
        pin = marked(mesh, f"{code:02d} {look}", PIN, collection)
        pin.material_slots[0].link = "OBJECT"
        pin.material_slots[0].material = material(look, colour, roughness=0.45)
    return collection


def arrow(pitch: float) -> Any:
    """Make the arrow of a bed, which stands in no scene; the pitch in m."""
    mesh = bridge.mesh("Digital Clay Force", shapes.arrow(HEAD * pitch * SCALE))
    mesh.materials.append(material("force_arrow", ARROW, roughness=0.5))
    made = bpy.data.objects.new("Digital Clay Force", mesh)
    made[ROLE] = PIN
    return made


def housing(instant: Instant, deck: float, rim: float) -> Any:
    """Make the mesh of the case about the pins of an instant; floor inside and upper edge in m."""
    reach = np.abs(instant.position).max(axis=0) + instant.actuator.bore / 2 + GAP * instant.pitch
    half = float(reach[0]) * SCALE, float(reach[1]) * SCALE
    wall = WALL * instant.pitch * SCALE
    bottom = deck * SCALE - wall / 2
    shape = shapes.housing(half, wall, bottom, deck * SCALE, rim * SCALE)
    mesh = bridge.mesh("Digital Clay Housing", shape)
    mesh.materials.append(material("housing", CASE, roughness=0.55))
    return mesh


def fingertip(collection: Any, bed: Any) -> Any:
    """Make the fingertip: an empty to take hold of, and in it an ellipsoid to look at.

    The empty carries the pose alone. Its scale is locked: the finger's size is a parameter
    of the device, kept in the ellipsoid's scale.
    """
    made = marked(None, "Digital Clay Fingertip", FINGERTIP, collection, parent=bed)
    made.empty_display_type, made.show_in_front = "PLAIN_AXES", True
    made.rotation_mode = "QUATERNION"
    made.lock_scale = (True, True, True)
    mesh = bridge.mesh("Digital Clay Ellipsoid", shapes.ball())
    mesh.materials.append(None)
    ball = marked(mesh, mesh.name, ELLIPSOID, collection, parent=made)
    ball.hide_select = True
    ball.material_slots[0].link = "OBJECT"
    ball.material_slots[0].material = skin(clear=False)
    return made


def ellipsoid(tip: Any) -> Any | None:
    """Return the ellipsoid of a fingertip, or None when the user has deleted it."""
    return next((child for child in tip.children if child.get(ROLE) == ELLIPSOID), None)


def skin(clear: bool) -> Any:
    """Return the fingertip's material: opaque, or clear so that arrows under it are seen."""
    if clear:
        return material("fingertip_clear", SKIN, roughness=0.4, alpha=CLEAR)
    return material("fingertip", SKIN, roughness=0.4)
