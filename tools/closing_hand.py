"""Hand that closes in wet clay: an armature bends a mesh that presses the pins.

`python tools/closing_hand.py FOLDER` writes closing_hand.blend, with the session baked, and
closing_hand.png into a folder, in some minutes. Lengths are in mm.
"""

import sys
from itertools import pairwise
from math import radians
from pathlib import Path

import bpy
import digiclay
import numpy as np
from digiclay.core.scene.scene_source import BODY_SAMPLES
from digiclay.core.session.render_settings import Still
from digiclay.device import parts, view
from digiclay.pictures import stage
from digiclay.pictures.still import add_picture_scene, render_picture
from digiclay.roles import fingertips_of
from mathutils import Matrix, Vector
from numpy.typing import NDArray

#: Joints of thumb and fingers of the sample's hand, from the palm to the tip.
FINGERS = {
    "thumb": ((-30, -28, 16), (-51, -4, 16), (-66, 24, 13)),
    "index": ((-27, 10, 19), (-33, 46, 18), (-37, 82, 13)),
    "middle": ((-8, 16, 20), (-10, 56, 19), (-11, 94, 13)),
    "ring": ((11, 12, 20), (14, 50, 18), (17, 85, 13)),
    "little": ((28, 1, 19), (37, 31, 17), (44, 60, 13)),
}
#: Ends of the bone of the palm.
PALM = (0, -110, 30), (0, 0, 20)
#: How far both bones of a finger bend, and those of the thumb, degrees.
BEND, THUMB = (40, 65), (22, 35)
#: Frame, share of the bend, height of the lowest point over the pins, and y: above, print, close,
#: lift.
KEYS = (
    (1, 0.0, 20, 0),
    (30, 0.0, -18, 0),
    (40, 0.0, -18, 0),
    (100, 1.0, -18, 0),
    (110, 1.0, -18, 0),
    (140, 1.0, 45, 55),
)
#: Turn of the hand about z, degrees: its fingers point to the camera.
TURN = 165.0
#: Steps from one bend to another, so that the lowest point stays at its depth.
STEPS = 8
#: Blender units per mm; height of the pins at rest.
UNIT, REST = 0.01, 40.0


def add_hand() -> tuple[bpy.types.Object, bpy.types.Object]:
    """Add the sample's hand, and bones that deform it; return armature and mesh."""
    bpy.ops.wm.ply_import(filepath=str(BODY_SAMPLES / "hand.ply"))
    hand = bpy.context.object
    hand.data.transform(Matrix.Scale(UNIT, 4))
    hand.data.shade_smooth()
    hand.data.materials.append(parts.material("body", parts.SKIN, roughness=0.6))
    bpy.ops.object.armature_add()
    armature = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    palm = bones[0]
    palm.head, palm.tail = (UNIT * Vector(end) for end in PALM)
    for name, joints in FINGERS.items():
        parent = palm
        for number, ends in enumerate(pairwise(joints)):
            bone = bones.new(f"{name}.{number}")
            bone.head, bone.tail = (UNIT * Vector(end) for end in ends)
            bone.align_roll((0.0, 0.0, 1.0))
            bone.parent, parent = parent, bone
    bpy.ops.object.mode_set(mode="OBJECT")
    hand.select_set(True)
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    armature.rotation_euler.z = radians(TURN)
    return armature, hand


def bend(armature: bpy.types.Object, share: float) -> None:
    """Bend the fingers by a share of their angles."""
    for name in FINGERS:
        for number, angle in enumerate(THUMB if name == "thumb" else BEND):
            bone = armature.pose.bones[f"{name}.{number}"]
            bone.rotation_mode = "XYZ"
            bone.rotation_euler.x = -radians(share * angle)


def read_points(hand: bpy.types.Object) -> NDArray[np.float64]:
    """Return the vertices as the armature has them, (v, 3), Blender units."""
    shown = hand.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([shown.matrix_world @ vertex.co for vertex in shown.data.vertices])


def close(armature: bpy.types.Object, hand: bpy.types.Object) -> None:
    """Key bends and places."""
    for start, end in pairwise(KEYS):
        steps = 1 if start[1] == end[1] else STEPS
        for frame, share, low, y in np.linspace(start, end, steps + 1).tolist():
            bend(armature, share)
            armature.location.y = UNIT * y
            bpy.context.view_layer.update()
            armature.location.z += UNIT * (REST + low) - read_points(hand)[:, 2].min()
            armature.keyframe_insert("location", frame=frame)
            for bone in armature.pose.bones:
                bone.keyframe_insert("rotation_euler", frame=frame)


def make_scene() -> tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Object]:
    """Return a scene at its last frame, a baked bed in it, and the hand that presses it."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = add_picture_scene("Closing hand", Still(engine="cycles", width=900, height=563))
    bpy.context.window.scene = scene
    bpy.ops.mesh.digital_clay_add(bed="paper", rows=100, columns=100, pitch=2.2)
    bed = bpy.context.object
    bed.location = 0.0, 0.0, 0.0
    view.color_by(bed, "neutral")
    for tip in fingertips_of(bed).values():
        for part in tip.children_recursive:
            part.hide_render = True
    armature, hand = add_hand()
    close(armature, hand)
    bpy.context.view_layer.objects.active = hand
    bpy.ops.digiclay.add_presser()
    bpy.context.view_layer.objects.active = bed
    scene.frame_end = KEYS[-1][0]
    bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=scene.frame_end)
    scene.frame_set(scene.frame_end)
    return scene, bed, hand


def main(folder: Path) -> Path:
    """Write scene and picture into a folder; return the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    digiclay.register()
    scene, bed, hand = make_scene()
    points = np.concatenate([stage.outline(bed), read_points(hand)])
    stage.set_up(scene, bed, None, points=points)
    picture = folder.resolve() / "closing_hand.png"
    bpy.ops.wm.save_as_mainfile(filepath=str(picture.with_suffix(".blend")))
    render_picture(scene, picture, picture)
    digiclay.unregister()
    return picture


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("The argument must be a folder")
    main(Path(sys.argv[1]))
