"""Played by `driver`: a monkey's head presses the bed, dragged with G; taken back; moved in Pose Mode."""

import bpy

from tests.window import driver as blender


def script():
    yield from blender.scene_with_bed(bed="paper")
    origin = blender.bed().location
    # Upside down, its lowest point some millimeters above the pins.
    bpy.ops.mesh.primitive_monkey_add(
        size=0.4, location=(origin.x, origin.y, origin.z + 0.65), rotation=(3.1416, 0.0, 0.0)
    )
    yield 0.5
    blender.SEEN["added"] = sorted(blender.call(bpy.ops.digiclay.add_presser))
    yield from blender.open_sidebar()
    yield from blender.whole_view()
    yield from blender.start(bpy.data.objects["Suzanne"])
    yield from blender.grab((0, 0, -17), "Z", look_as="pressing")
    yield from blender.after("pressed")
    blender.shot("mesh_pressed")
    yield from blender.grab((0, 0, 40), "Z")
    yield from blender.after("lifted")
    blender.shot("mesh_lifted")
    yield from blender.after("rewound", "BACK_SPACE")
    yield from blender.after("stopped", "ESC")
    monkey = bpy.context.object
    blender.call(bpy.ops.object.armature_add, location=monkey.location)
    armature = bpy.context.object
    monkey.modifiers.new("Armature", "ARMATURE").object = armature
    group = monkey.vertex_groups.new(name=armature.pose.bones[0].name)
    group.add(range(len(monkey.data.vertices)), 1.0, "REPLACE")
    blender.call(bpy.ops.object.mode_set, mode="POSE")
    yield from blender.start()
    blender.SEEN["mode"] = bpy.context.mode
    # Along the bone, which points up.
    armature.pose.bones[0].location.y = -0.45
    yield from blender.settle(6)
    yield from blender.after("posed")
    blender.shot("mesh_posed")
    yield from blender.after("left", "ESC")
