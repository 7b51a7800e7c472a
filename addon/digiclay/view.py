"""The device in Blender: a bed of instanced pins, its housing and the fingertip.

A bed is one mesh with a vertex a pin. Geometry nodes put a pin on every vertex and pick,
by the integer attribute ``mode``, the one that wears the mode's material: this shows in
Solid view too, and redraws 10 000 pins in a millisecond.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import bridge, device_shapes
from .bridge import SCALE
from .compat import bpy, shader_nodes
from .core.modes import COLOURS, Mode
from .instant import Instant
from .node_tree import pins_on_points

__all__ = ["BED", "FINGERTIP", "build", "fingertip_of", "is_bed", "material", "show", "underside"]

#: Marks the objects of the device; names are the user's to change.
ROLE = "digiclay_role"
BED, FINGERTIP, HOUSING, PIN = "bed", "fingertip", "housing", "pin"

#: sRGB of what is no pin.
SKIN = (0.91, 0.60, 0.47)
CASE = (0.13, 0.14, 0.16)
#: Space between the outermost pins and the wall, and the wall's thickness, in pitches.
GAP, WALL = 0.85, 1.7
#: Above this many pins they are drawn with fewer faces.
MANY = 4000


def build(instant: Instant, collection: Any, lowest: float | None = None) -> Any:
    """Add a bed, its housing and its fingertip to a collection.

    Parameters
    ----------
    instant : Instant
        What to show at first.
    collection : bpy.types.Collection
        Where the objects go.
    lowest : float, optional
        Lowest pin top the housing must have room for, m; the instant's own when left out, so
        that a still shows the formed surface and not the rods under it.

    Returns
    -------
    bpy.types.Object
        The bed; housing and fingertip are its children. Its origin is the centre of the
        bed's floor.
    """
    lowest = float(instant.height.min()) if lowest is None else lowest
    # The rim stays below most tops, so that the surface and little of the rods is seen over it.
    rim = float(np.median(instant.height)) - 1.2 * instant.pitch
    # The deck is so deep that no pin is stretched much more than another: it shows on their caps.
    deck = min(lowest, rim) - 2.5 * instant.pitch
    bed = _object(bridge.points("Digital Clay", len(instant.height)), BED, collection)
    modifier = bed.modifiers.new("Pins", "NODES")
    length = float(np.median(instant.height)) - deck
    modifier.node_group = pins_on_points(_pins(instant, length), deck * SCALE, length * SCALE)
    child = _object(_housing(instant, deck, rim), HOUSING, collection, parent=bed)
    child.hide_select = True
    _object(_fingertip(), FINGERTIP, collection, parent=bed)
    show(bed, instant)
    return bed


def show(bed: Any, instant: Instant) -> None:
    """Show another instant of the same bed."""
    bridge.write_cells(bed.data, instant.position, instant.height, mode=instant.mode, force=instant.force)
    fingertip = fingertip_of(bed)
    if fingertip is not None:
        bridge.place_fingertip(fingertip, instant.fingertip, instant.finger)


def is_bed(thing: Any) -> bool:
    """Tell whether an object is a bed of this extension."""
    return thing is not None and thing.get(ROLE) == BED


def fingertip_of(bed: Any) -> Any | None:
    """Return the fingertip that belongs to a bed, or None when the user has deleted it."""
    return next((child for child in bed.children if child.get(ROLE) == FINGERTIP), None)


def underside(bed: Any) -> float:
    """Return the height of the housing's underside in the space of its bed, Blender units."""
    case = next(child for child in bed.children if child.get(ROLE) == HOUSING)
    return min(float(vertex.co.z) for vertex in case.data.vertices)


def material(name: str, colour: tuple[float, float, float], roughness: float) -> Any:
    """Return the material of a part, as the user may have changed it, or make it."""
    found = next((m for m in bpy.data.materials if m.get(ROLE) == name), None)
    if found is not None:
        return found
    made = bpy.data.materials.new(f"Digital Clay {name.replace('_', ' ')}")
    made[ROLE] = name
    made.diffuse_color = bridge.linear(colour)
    made.roughness = roughness
    shader = next(node for node in shader_nodes(made).nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = bridge.linear(colour)
    shader.inputs["Roughness"].default_value = roughness
    return made


def _object(mesh: Any, role: str, collection: Any, parent: Any | None = None) -> Any:
    """Make an object of a mesh, marked with its role."""
    made = bpy.data.objects.new(mesh.name, mesh)
    made[ROLE] = role
    made.parent = parent
    collection.objects.link(made)
    return made


def _pins(instant: Instant, length: float) -> Any:
    """Make one pin a mode, in a collection that stands in no scene.

    The node that reads the collection sorts it by name: hence the code in front.
    """
    segments = 28 if len(instant.height) <= MANY else 12
    shape = device_shapes.rod(instant.actuator.bore / 2 * SCALE, length * SCALE, segments)
    mesh = bridge.mesh("Digital Clay Pin", shape, smooth_below=1.2)
    mesh.materials.append(None)
    pins = bpy.data.collections.new("Digital Clay Pins")
    for mode in Mode:
        pin = bpy.data.objects.new(f"{mode:02d} {mode.name.lower()}", mesh)
        pin[ROLE] = PIN
        pin.material_slots[0].link = "OBJECT"
        pin.material_slots[0].material = material(mode.name.lower(), COLOURS[mode], roughness=0.45)
        pins.objects.link(pin)
    return pins


def _housing(instant: Instant, deck: float, rim: float) -> Any:
    """Make the case about the pins of an instant; floor inside and upper edge in m."""
    reach = np.abs(instant.position).max(axis=0) + instant.actuator.bore / 2 + GAP * instant.pitch
    half = float(reach[0]) * SCALE, float(reach[1]) * SCALE
    wall = WALL * instant.pitch * SCALE
    bottom = deck * SCALE - wall / 2
    shape = device_shapes.housing(half, wall, bottom, deck * SCALE, rim * SCALE)
    mesh = bridge.mesh("Digital Clay Housing", shape)
    mesh.materials.append(material("housing", CASE, roughness=0.55))
    return mesh


def _fingertip() -> Any:
    """Make the fingertip, a unit sphere; the object's scale gives the semi-axes."""
    mesh = bridge.mesh("Digital Clay Fingertip", device_shapes.ball())
    mesh.materials.append(material("fingertip", SKIN, roughness=0.4))
    return mesh
