"""Drives a session by playback and gizmo, in other windows and views; picks, copies and deletes beds."""

import bpy
import numpy as np

from tests.window import driver as blender

#: Size of the move gizmo: its arrows end so many pixels from its middle.
ARROW = 65


def script():
    yield from blender.scene_with_bed(rows=9, columns=9)
    yield from pick()
    yield from escape()
    yield from units()
    yield from blender.scene_with_bed()
    yield from gizmo()
    yield from playback()
    yield from windows()
    yield from render()
    yield from views()


def gizmo():
    yield from blender.start(blender.bed())
    blender.select(blender.fingertip())
    blender.choose_tool("builtin.move")
    yield None
    tip = blender.fingertip().matrix_world.translation.copy()
    below = tip.copy()
    below.z -= 0.12
    here, there = np.array(blender.pixel(tip)), np.array(blender.pixel(below))
    arrow = here - ARROW * (there - here) / np.linalg.norm(there - here)

    def mouse(at, *kind):
        blender.event(*(kind or ("MOUSEMOVE", "NOTHING")), tuple(np.rint(at).astype(int).tolist()))

    # The arrow is lit up by one move over it, and taken by the next event.
    for shift in (3, 1, 0):
        mouse(arrow + shift)
        yield None
    mouse(arrow, "LEFTMOUSE", "PRESS")
    for step in range(1, 7):
        mouse(arrow + step / 6 * (there - here))
        yield None
        if step == 6:  # the pins give way as fast as the machine simulates them
            yield from blender.until(lambda: lowest() < 39.9)
        blender.look(f"gizmo {step}")
    blender.shot("play_gizmo")
    mouse(arrow + there - here, "LEFTMOUSE", "RELEASE")
    yield from blender.settle()
    blender.key("ESC")
    yield 0.5
    at_rest()


def playback():
    """Play a keyframed fingertip; the first Esc stops the session, the next one the playback."""
    tip = blender.fingertip()
    for frame, z in ((1, 0.54), (24, 0.44), (48, 0.54)):
        tip.location = 0.0, 0.0, z
        tip.keyframe_insert("location", frame=frame)
    scene = blender.window().scene
    scene.frame_end = 48
    scene.sync_mode = "FRAME_DROP"  # software GL draws two frames a second
    scene.frame_set(1)
    yield from blender.start(blender.bed())
    blender.call(bpy.ops.screen.animation_play)
    yield from blender.until(lambda: lowest() < 39.5)
    blender.look("played")
    blender.shot("play_playback")
    for name in ("after one Esc", "after two"):
        blender.key("ESC")
        yield 1.0
        blender.look(name)
        blender.SEEN[name]["plays"] = bpy.context.screen.is_animation_playing
    blender.fingertip().animation_data_clear()
    at_rest()


def lowest():
    return float(blender.heights().min())


def windows():
    """Close a second window in mid-session; then close the one the session was started in."""
    yield from blender.start(blender.bed())
    bpy.ops.wm.window_new()
    yield 1.0
    yield from closed("second window closed")
    blender.key("ESC")
    yield 0.5
    bpy.ops.wm.window_new()
    yield 1.0
    blender.select(blender.bed())
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.digiclay.session("INVOKE_DEFAULT")
    yield from blender.settle()
    blender.look("started in the second")
    blender.call(bpy.ops.digiclay.take_record)
    yield from blender.settle()
    yield from closed("its own window closed", lambda: not blender.sessions())
    list_takes = blender.part("recorded.takes").list_takes
    kept = blender.SEEN["kept"] = [[entry.name for entry in list_takes(blender.bed())]]
    for turn in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        turn()
        yield 0.5
    kept.append([entry.name for entry in list_takes(blender.bed())])


def closed(name, then=lambda: True):
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    yield 1.5
    yield from blender.until(then)
    blender.look(name)
    blender.SEEN[name]["windows"] = len(bpy.context.window_manager.windows)


def render():
    scene = blender.window().scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.location.z = 3.0
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 128, False
    scene.render.resolution_x, scene.render.resolution_y = 240, 180
    bpy.context.preferences.view.render_display_type = "NONE"
    yield from blender.start(blender.bed())
    blender.call(bpy.ops.render.render, "INVOKE_DEFAULT")
    waits = []
    blender.SEEN["waits in a render"] = waits

    def rendered():
        waits.extend({session.blocking_reason for session in blender.sessions()} - set(waits))
        return not bpy.app.is_job_running("RENDER")

    yield from blender.until(rendered)
    yield from blender.after("rendered")


def views():
    """Press in an orthographic view, and in the top view of a quad view, and see what is written there."""
    blender.choose_tool()
    area, _ = blender.view()
    area.spaces.active.region_3d.view_perspective = "ORTHO"
    # Blender works out the matrices of a view when it draws it.
    yield from blender.until(lambda: area.spaces.active.region_3d.window_matrix[3][2] == 0.0)
    yield from tapped(blender.pixel(blender.world(-15.0, 9.0)), "orthographic")
    blender.shot("play_orthographic")
    areas = len(blender.window().screen.areas)
    # A quarter of a small view has no room for the overlay.
    blender.call(bpy.ops.screen.screen_full_area)
    yield from blender.until(lambda: len(blender.window().screen.areas) < areas)
    blender.part("operators.pin_view").pick_pins(blender.bed(), [312])
    blender.call(bpy.ops.screen.region_quadview)
    yield from blender.until(lambda: top_quarter() is not None)
    yield from tapped(blender.pixel(blender.world(15.0, -9.0), top_quarter()), "quad view")
    with blender.watch_overlay() as drawn:
        yield from blender.until(lambda: len(find_words(drawn)) == 4)
    marks = find_words(drawn)
    blender.SEEN["drawn in the quarters"] = sorted(marks.values())
    area, _ = blender.view()
    turned = area.spaces.active.region_3d
    own = next(
        one.as_pointer() for one in area.regions if one.type == "WINDOW" and one.data == turned
    )
    blender.SEEN["drawn where the view can be turned"] = marks[own]
    blender.shot("play_quad")
    blender.call(bpy.ops.screen.region_quadview)
    yield None
    blender.call(bpy.ops.screen.screen_full_area)
    yield None
    blender.choose_tool("builtin.select_box")
    yield None


def find_words(drawn):
    """Return by region whether words are drawn there beside the dots of pins, which no cursor has."""
    return {region: bool(picture.words) for region, picture in drawn if picture.dots}


def top_quarter():
    """Return the quarter of a quad view that looks from straight above, once it has been drawn as such."""
    area, _ = blender.view()
    quarters = [region for region in area.regions if region.type == "WINDOW"]
    for region in quarters if len(quarters) == 4 else []:
        matrix = np.array(region.data.view_matrix)
        # Before the first drawing all of a matrix may be 0, or the unit matrix.
        if np.allclose(matrix[:3, :3], np.eye(3), atol=1e-3) and matrix[2, 3] < 0.0:
            return region
    return None


def tapped(at, name):
    blender.hover(at)
    yield 0.3
    blender.event("LEFTMOUSE", "PRESS", at)
    # The Press tool presses 4 mm below the pins.
    yield from blender.until(lambda: blender.part("bridge").pose(blender.fingertip())[2] < 36.1e-3)
    blender.look(name)
    blender.event("LEFTMOUSE", "RELEASE", at)
    # Until the gesture has ended it takes the next press for its own.
    yield from blender.until(lambda: not held())


def held():
    return "DIGICLAY_OT_press" in [
        operator.bl_idname for operator in blender.window().modal_operators
    ]


def at_rest():
    blender.select(blender.bed())
    blender.call(bpy.ops.digiclay.session_reset)
    blender.fingertip().location = 0.0, 0.0, 0.54
    bpy.ops.ed.undo_push(message="At rest")


def modal():
    return [one.bl_idname for one in bpy.context.window_manager.windows[0].modal_operators]


def pick():
    """Begin to pick in one workspace, and go on in another; there, click beside all views as well."""
    picked = blender.part("device.view").picked_pins
    blender.call(bpy.ops.digiclay.pick_pins, "INVOKE_DEFAULT")
    yield None
    yield from blender.click(blender.on_the_bed(-6, -9))
    blender.SEEN["picked"] = list(picked(blender.bed()))
    home = blender.window().workspace
    blender.window().workspace = bpy.data.workspaces["Animation"]
    yield None
    yield None
    timeline = next(
        area for area in blender.window().screen.areas if area.type == "DOPESHEET_EDITOR"
    )
    yield from blender.click((timeline.x + timeline.width // 2, timeline.y + timeline.height // 2))
    blender.SEEN["clicked in the timeline"] = list(picked(blender.bed()))
    yield from blender.whole_view()
    yield from blender.click(blender.on_the_bed(6, -9))
    blender.SEEN["picked elsewhere"] = list(picked(blender.bed()))
    blender.SEEN["told in"] = list(blender.part("operators.action")._TOLD)
    blender.key("RET")
    yield 0.3
    blender.SEEN["after Enter"] = modal(), list(blender.part("operators.action")._TOLD)
    blender.window().workspace = home
    yield None


def escape():
    """Press Esc while nobody drives the session: over a 3D view, and over another editor."""
    loop, session_loop = blender.part("live.loop"), blender.part("operators.session_loop")
    # Long enough that the key comes in it for sure; else it is a tenth of a second every 20 s.
    usual = session_loop.EVERY, session_loop.MOMENT
    session_loop.EVERY, session_loop.MOMENT = 0.5, 5.0
    for name in ("VIEW_3D", "PROPERTIES"):
        blender.select(blender.bed())
        blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
        area = next(one for one in blender.window().screen.areas if one.type == name)
        at = area.x + area.width // 2, area.y + area.height // 2
        blender.hover(at)
        yield from blender.until(loop.is_aside)
        before = modal(), len(blender.sessions())
        blender.key("ESC", at)
        yield 0.5
        after = len(blender.sessions())
        yield session_loop.MOMENT
        blender.SEEN[f"Esc over {name}"] = [*before, after, modal(), loop.token()]
    session_loop.EVERY, session_loop.MOMENT = usual


def counted(name):
    """Count the beds, those with a fingertip, the objects of the scene, those hidden, and the sessions."""
    scene = blender.window().scene
    tips = [blender.part("roles").fingertip_of(bed) for bed in blender.beds()]
    whole = sum(tip is not None for tip in tips)
    hidden = sum(thing.hide_get() for thing in scene.objects)
    blender.SEEN[name] = [len(tips), whole, len(scene.objects), hidden, len(blender.sessions())]


def looked(name):
    watch = blender.part("device.part_watch")
    yield 1.0
    yield from blender.until(lambda: not bpy.app.timers.is_registered(watch._repair_when_idle))
    if blender.sessions():
        yield from blender.until(lambda: not all(one.stale for one in blender.sessions()))
    yield 0.5
    counted(name)


def pressed(name, kind, **held):
    blender.key(kind, **held)
    yield from looked(name)


def changed_by_f9(name):
    """Click on "Linked" in the panel of a copy that F9 opens beside the mouse, and leave the panel."""
    x, y = blender.middle()
    blender.hover((x, y))
    yield 0.2
    blender.key("F9", (x, y))
    yield 0.5
    yield from blender.click((x + 137, y - 51))
    yield from looked(name)
    blender.SEEN["linked by F9"] = len({bed.data.name for bed in blender.beds()}) == 1
    for at in ((x, y + 60), (x - 250, y + 150)):
        blender.hover(at)
        yield 0.3


def units():
    """Delete a bed, undo and redo that; drag a copy off, undo and redo that; hide; delete in mid-session."""
    blender.hover(blender.middle())
    blender.select(blender.bed())
    yield 0.5
    counted("one bed")
    yield from pressed("deleted", "DEL")
    yield from pressed("delete undone", "Z", ctrl=True)
    yield from pressed("delete redone", "Z", ctrl=True, shift=True)
    yield from pressed("delete undone again", "Z", ctrl=True)
    blender.select(blender.bed())
    blender.key("D", shift=True)
    yield 1.0
    counted("copy in hand")
    x, y = blender.middle()
    blender.hover((x + 120, y))
    yield 0.5
    blender.key("LEFTMOUSE", (x + 120, y))
    yield from looked("copied")
    yield from changed_by_f9("copy changed by F9")
    yield from pressed("copy undone", "Z", ctrl=True)
    yield from pressed("copy redone", "Z", ctrl=True, shift=True)
    blender.select(blender.bed())
    yield from pressed("hidden", "H")
    yield from pressed("shown", "H", alt=True)
    yield from blender.start(blender.beds()[1])
    counted("session")
    # A bed with a session is not selected, so that no outline encloses its pins.
    blender.select(blender.beds()[1])
    yield from pressed("deleted in mid-session", "DEL")
    yield from pressed("undone after it", "Z", ctrl=True)
    blender.call(bpy.ops.object.select_all, action="SELECT")
    bpy.ops.ed.undo_push(message="Select")
    blender.key("D", alt=True)
    yield 1.0
    blender.key("RIGHTMOUSE")
    yield from looked("all copied")
    blender.call(bpy.ops.object.select_all, action="SELECT")
    bpy.ops.ed.undo_push(message="Select")
    yield from pressed("all deleted", "DEL")
    yield from pressed("all back", "Z", ctrl=True)
