"""Forms a valley with G, undoes, pauses, saves and loads; forms a shape; forms with several fingertips."""

import bpy
import numpy as np

from tests.window import driver as blender


def script():
    for step in (valley, shape, several_fingers):
        yield from step()
        bpy.ops.wm.read_homefile(use_empty=True)
        yield 1.0


def valley():
    after, undo = blender.after, blender.undo
    yield from blender.scene_with_bed(bed="paper")
    yield from blender.open_sidebar()
    yield from blender.whole_view()
    blender.look("added")
    blender.select(blender.fingertip())
    yield None
    yield from blender.grab((9, 0, 0), "X", steps=2)
    blender.look("dragged")
    blender.key("Z", ctrl=True)
    yield 0.8
    blender.look("drag undone")
    yield from blender.start()
    blender.look("started")
    yield from blender.grab((0, 0, -9), "Z", look_as="pressing")
    yield from after("pressed")
    yield from blender.grab((22, 0, 0), "X", steps=8, look_as="drawing")
    yield from after("drawn")
    blender.shot("session_ridge")
    yield from blender.grab((0, 0, 14), "Z")
    yield from after("lifted")
    blender.shot("session_lifted")
    yield from undo("lift undone")
    yield from undo("draw undone")
    blender.shot("session_undone")
    yield from undo("draw redone", redo=True)
    yield from undo("lift redone", redo=True)

    yield from after("paused", "P")
    yield from after("paused later")
    yield from after("single step", "P", shift=True)
    blender.shot("session_paused")
    yield from after("resumed", "P")
    yield from after("rewound", "BACK_SPACE")
    yield from undo("rewinding undone")

    path = str(blender.OUT / "mid_session.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    blender.look("saved")
    yield None
    bpy.ops.wm.open_mainfile(filepath=path)
    yield from after("loaded")
    blender.shot("session_loaded")
    yield from blender.start(blender.bed())
    blender.look("going on")
    yield from after("stopped", "ESC")
    blender.shot("session_stopped")
    for _ in range(3):
        blender.key("Z", ctrl=True)
        yield 0.6


def shape():
    """Display a sample shape, press the fingertip into it live, and keep what was formed."""
    yield from blender.scene_with_bed(bed="paper")
    yield from blender.open_sidebar()
    yield from blender.whole_view()
    blender.select(blender.bed())
    blender.look("flat")
    blender.call(bpy.ops.digiclay.shape_sample, "EXEC_DEFAULT", True, sample="ripple", rise=12.0)
    yield None
    blender.look("displayed")
    blender.call(bpy.ops.wm.call_panel, "INVOKE_DEFAULT", name="DIGICLAY_PT_shapes")
    yield None
    blender.shot("shape_panel")
    blender.key("ESC")
    yield None

    yield from blender.start(blender.fingertip())
    blender.look("session on a shape")
    yield from blender.grab((0, 0, -10), "Z", look_as="into the shape")
    yield from blender.settle()
    blender.shot("shape_pressed")
    yield from blender.grab((0, 0, 25), "Z")
    yield from blender.settle()
    blender.key("ESC")
    yield None
    yield None
    blender.look("formed shape")
    blender.call(bpy.ops.digiclay.shape_keep, "EXEC_DEFAULT", True)
    yield None
    blender.SEEN["kept"] = len(blender.bed().digiclay.shape.heights)
    blender.call(bpy.ops.mesh.digital_clay_make, "EXEC_DEFAULT", True, kind="solid", beside=False)
    yield None
    mesh = blender.window().view_layer.objects.active
    blender.SEEN["mesh"] = (
        max(vertex.co.z for vertex in mesh.data.vertices) / blender.part("bridge").SCALE
    )
    blender.key("Z", ctrl=True)
    yield None

    blender.key("Z", ctrl=True)
    yield None
    blender.SEEN["keeping undone"] = blender.bed().digiclay.shape.file

    blender.call(bpy.ops.wm.call_menu, "INVOKE_DEFAULT", name="DIGICLAY_MT_samples")
    yield None
    blender.shot("sample_menu")
    blender.key("ESC")
    yield None
    blender.call(bpy.ops.digiclay.add_sample, "EXEC_DEFAULT", True, sample="session:signature")
    yield None
    yield from blender.whole_view()
    blender.shot("sample_signature")
    blender.SEEN["beds"] = len(blender.beds())
    blender.key("Z", ctrl=True)
    yield None
    blender.SEEN["beds after undo"] = len(blender.beds())


def note(name):
    session, roles = blender.sessions()[0], blender.part("roles")
    bed = blender.bed()
    blender.SEEN[name] = {
        "numbers": list(session.numbers),
        "tips": list(roles.fingertips_of(bed)),
        "poses": (1e3 * session.poses[:, :3]).tolist(),
        "waits": session.blocking_reason,
        "forces": session.state.finger_forces().tolist(),
    }


def list_hidden():
    """Take a picture; return which fingertips the overlay in it covers."""
    _, region = blender.view()
    with blender.watch_overlay() as drawn:
        blender.shot("hand above")
    box = drawn[0][1].boxes[0]
    tips = blender.part("roles").fingertips_of(blender.bed()).items()
    places = np.array([blender.pixel(tip.matrix_world.translation) for _, tip in tips])
    aside = places - [region.x + box.x, region.y + box.y]
    inside = ((aside > 0.0) & (aside < [box.width, box.height])).all(axis=1)
    return [number for (number, _), covered in zip(tips, inside, strict=True) if covered]


def several_fingers():
    """Press two fingertips, then a hand by its palm; delete it, undo that, copy a fingertip."""
    yield from blender.scene_with_bed(bed="paper")
    yield from blender.open_sidebar()
    yield from blender.start()
    blender.call(bpy.ops.digiclay.add_fingertip)
    yield from blender.settle()
    note("two")
    roles = blender.part("roles")
    for number, x in ((1, -14.0), (2, 14.0)):
        tip = roles.fingertips_of(blender.bed())[number]
        tip.location.x, tip.location.y = 1e-2 * x, 0.0
        blender.select(tip)
        yield from blender.grab((0.0, 0.0, -9.0), "Z", periods=4)
    note("two pressed")
    blender.shot("two")
    blender.select(blender.bed())
    blender.bed().digiclay_display.overlay_full = True
    blender.call(bpy.ops.digiclay.add_hand)
    yield from blender.settle()
    note("hand")
    blender.SEEN["hand"]["hidden"] = list_hidden()
    yield from blender.grab((0.0, 0.0, -9.0), "Z", periods=4)
    note("hand pressed")
    blender.shot("hand")
    yield from blender.grab((0.0, 0.0, 12.0), "Z", periods=4)
    blender.key("DEL")
    yield from blender.settle(10)
    note("deleted")
    yield from blender.undo("undone")
    yield from blender.settle(10)
    note("hand again")
    blender.select(roles.fingertips_of(blender.bed())[4])
    blender.key("D", shift=True)
    yield 0.5
    blender.key("RET")
    yield from blender.settle(10)
    note("copied")
    blender.shot("copied")
    blender.call(bpy.ops.digiclay.session_stop)
    yield from blender.stopped()
