"""Deletes, edits and switches what a session needs while it runs; disables the extension; loads a file."""

import addon_utils
import bpy

from tests.window import driver as blender


def press():
    tip = blender.fingertip()
    for z in (46.0, 43.0, 40.0, 38.0, 37.0, 37.0, 40.0, 46.0):
        tip.location.z = (z + 8.0) * 1e-3 * blender.part("bridge").SCALE
        yield from blender.settle(1)
    bpy.ops.ed.undo_push(message="Press")
    yield None


def edit_in_mid_stroke():
    """Draw a stroke, go to Edit Mode before the fingertip has formed it, stop with Esc, and go on."""
    blender.select(blender.bed())
    yield None
    move, press = ("MOUSEMOVE", "NOTHING"), "LEFTMOUSE"
    settings = blender.part("press.brush").tool_settings(bpy.context)
    settings.brush = "RAISE"  # it takes the device of this bed longest
    way = [(*move, x) for x in (15, -15) * 8]  # more than the fingertip forms until Tab
    for kind, value, x in ((*move, -15), (press, "PRESS", -15), *way, (press, "RELEASE", -15)):
        blender.event(kind, value, blender.on_the_bed(x, -25.0))  # beside the sidebar
        yield 0.05
    (session,) = blender.sessions()
    yield from blender.until(lambda: blender.sessions()[0].tick > session.tick)
    strokes = blender.SEEN["strokes"] = []
    for name, kind in (("edited", "TAB"), ("stopped in Edit Mode", "ESC")):
        yield from blender.after(name, kind)
        strokes.append([len(session.strokes) for session in blender.sessions()])
    blender.shot("session_edited")
    blender.key("TAB")
    yield from blender.rounds()
    yield from blender.start()
    yield from blender.after("edited no more")
    yield from blender.until(lambda: not blender.session().strokes)
    strokes.append([blender.session().finished_strokes])
    settings.brush = "LOWER"


def script():
    after = blender.after
    yield from blender.scene_with_bed()
    yield from blender.open_sidebar()
    yield from blender.start()
    yield from press()
    blender.look("formed")

    blender.select(blender.fingertip())
    yield from after("fingertip deleted", "DEL")
    blender.shot("session_waits")
    yield from blender.undo("fingertip back")

    home = blender.window().workspace
    blender.window().workspace = bpy.data.workspaces["Animation"]
    yield None
    yield from after("in another workspace")
    blender.shot("session_workspace")
    blender.window().workspace = home
    yield None

    scene = blender.window().scene
    blender.window().scene = bpy.data.scenes.new("Other")
    yield None
    yield from after("in another scene")
    blender.SEEN["in another scene"]["waits"] = blender.sessions()[0].blocking_reason
    blender.window().scene = scene
    yield from after("scene back")

    yield from edit_in_mid_stroke()

    blender.bed().scale = (1.0, 1.0, 1.5)
    yield from after("scaled")
    blender.key("F", blender.on_the_bed(0.0, -25.0))  # at every redraw it would fail
    yield 1.0
    blender.SEEN["adjusting"] = [
        operator.bl_idname for operator in blender.window().modal_operators
    ]
    blender.bed().scale = (1.0, 1.0, 1.0)
    yield from after("scaled no more")

    blender.call(bpy.ops.mesh.digital_clay_add, rows=9, columns=9)
    bpy.context.view_layer.objects.active.location.x = 1.5
    yield from blender.start()
    blender.look("two beds")
    blender.select(bpy.context.view_layer.objects.active)
    yield from after("second bed deleted", "DEL")

    bpy.ops.ed.undo_push(message="Before")
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.key("DEL")
    yield from blender.stopped()
    blender.look("all deleted")
    blender.key("Z", ctrl=True)
    yield 1.0
    blender.look("all back")
    yield from blender.start(blender.bed())
    blender.look("started again")

    addon_utils.disable(blender.EXTENSION)
    yield 1.0
    blender.SEEN["panels left"] = [name for name in dir(bpy.types) if name.startswith("DIGICLAY_")]
    blender.hover(blender.middle())
    yield 1.0
    addon_utils.enable(blender.EXTENSION)
    yield None
    blender.look("enabled again")
    yield from blender.start()
    blender.look("going on")

    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    blender.look("another file")
    drawing = getattr(bpy.types.STATUSBAR_HT_header.draw, "_draw_funcs", [])
    blender.SEEN["keys drawn"] = [
        f.__module__ for f in drawing if f.__module__.startswith(blender.EXTENSION)
    ]
    blender.call(bpy.ops.mesh.digital_clay_add)
    yield from blender.start()
    blender.look("before quitting")
    blender.hand_over()
    bpy.ops.wm.quit_blender()  # with the session on: nobody disables the extension before
    yield 60.0
