"""A ball that presses the small bed of the tests of sessions."""

import bpy
import numpy as np
from digiclay import bridge
from digiclay.roles import PRESSES
from mathutils import Vector

from tests.blender.at_hand import done, looked
from tests.blender.session.live import only_bed

#: A ball of 12 mm, its lowest point 45 mm above the floor: 5 mm above the pins.
RADIUS, ABOVE = 12e-3, 45e-3


def place(ball, z, x=0.0):
    """Put the lowest point of a ball to a height, m."""
    origin = ball[PRESSES].location if PRESSES in ball else only_bed().location
    ball.location = origin + Vector((x, 0.0, z + RADIUS)) * bridge.SCALE


def add_ball():
    """Add a ball of 5,120 triangles over the bed, which presses it."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=RADIUS * bridge.SCALE)
    made = bpy.context.object
    made.name = "Ball"
    place(made, ABOVE)
    looked()
    assert bpy.ops.digiclay.add_presser() == {"FINISHED"}
    done("Add Presser")
    return made


def press(ball, clock, depth=4e-3, lift=True):
    """Press a ball into the pins at 60 mm/s, and lift it; return the messages."""
    notes = []
    down = np.linspace(ABOVE, 40e-3 - depth, 6)
    for z in [*down, *[down[-1]] * 3, *(down[::-1] if lift else ())]:
        place(ball, z)
        notes += clock.tick()
    return notes


def sphere(bed, depth=4e-3):
    """Return the height of a ball over the pins, at most that at rest, m."""
    x, y = bridge.read_cells(bed.data)["position"].T
    square = RADIUS**2 - x**2 - y**2
    return np.minimum(40e-3 - depth + RADIUS - np.sqrt(np.maximum(square, 0.0)), 40e-3)
