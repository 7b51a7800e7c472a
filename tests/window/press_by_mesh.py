"""Played by `driver`: a monkey's head presses the bed, dragged with G; then it is taken back."""

import bpy


def script(blender):
    yield from blender.empty_scene()
    yield from blender.add_paper_bed()
    origin = blender.beds()[0].location
    # Upside down, its lowest point some millimeters above the pins.
    bpy.ops.mesh.primitive_monkey_add(
        size=0.4, location=(origin.x, origin.y, origin.z + 0.65), rotation=(3.1416, 0.0, 0.0)
    )
    yield 0.5
    blender.SEEN["added"] = sorted(blender.call(bpy.ops.digiclay.add_presser))
    yield from blender.open_sidebar()
    blender.key("HOME", blender.middle())
    yield None
    yield from blender.start(bpy.data.objects["Suzanne"])
    yield from blender.grab((0, 0, -17), "Z", look_as="pressing")
    yield from blender.after("pressed")
    blender.shot("mesh_pressed")
    yield from blender.grab((0, 0, 40), "Z")
    yield from blender.after("lifted")
    blender.shot("mesh_lifted")
    yield from blender.after("rewound", "BACK_SPACE")
    yield from blender.after("stopped", "ESC")
