"""Clicks past a cube in all kinds of views; sets sizes with F, draws symmetric strokes, lines and rings."""

from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from tests.window import driver as blender
from tests.window.hand_strokes import (
    act,
    add_bed,
    brush,
    drag,
    finish,
    focus_window,
    hand,
    line,
    note,
    on_the_screen,
    prepare,
    reset,
    rest,
    stroke,
    to,
)

MIRRORED = ((-27.0, 12.0), (-9.0, 12.0))
#: Radius of the ring, mm.
RADIUS = 21.0
#: How far the mouse goes sideways to make the fingertip larger, mm on the bed: half of what its
#: size grows.
WIDER = 4.0
#: Places of the pins, mm: behind the cube, and beside it.
COVERED, BARE = (15.0, -15.0), (-27.0, -27.0)
#: How far the cube is from the place it covers, Blender units.
DISTANCE = 0.25


def script():
    yield from past_objects()
    yield from prepare("TOP")
    blender.call(bpy.ops.view3d.view_all)
    # The first press starts the session.
    yield from act(to(on_the_screen(-24.0, -24.0)), "click 1")
    yield from sizes()
    yield from brushes()
    yield from reset()
    # What Ctrl-Z goes back to: a reset has no step of its own.
    bpy.ops.ed.undo_push(message="Reset")
    yield from symmetric()
    yield from shapes()


def write_down(name):
    """Note the sizes, in mm, and the sessions."""
    note(name)
    bed, settings, session = blender.bed(), brush(), blender.session()
    blender.SEEN[name] |= {
        "size": bed.digiclay.size,
        "drawn size": 2e3 * blender.part("bridge").finger_of(blender.fingertip()).width,
        "simulated": 2e3 * session.scene.fingers[0].fingertip.width if session else 0.0,
        "blister": bed.digiclay.blister.radius,
        "depth": settings.depth,
        "strength": settings.strength,
        "brush": settings.brush,
    }


def done(*words, name=""):
    """Let the hand do it, and the sessions take it up; write down what there is then."""
    process = hand(*words)
    yield from blender.until(lambda: process.poll() is not None)
    yield from rest()
    if name:
        write_down(name)


def keys(names):
    return " ".join(f"key {name} sleep 0.15" for name in names.split())


def sizes():
    start, end = on_the_screen(0.0, 0.0), on_the_screen(WIDER, 0.0)
    write_down("begun")
    yield from done(to(start), keys("f"), drag(start, end, 0.4, 60))
    blender.shot("size_f")
    yield from done("click 1", name="larger")
    yield from done(keys("ctrl+z"), name="undone")
    wider = to(start), keys("f"), drag(start, end, 0.4, 60)
    yield from done(*wider, keys("Escape"), name="escaped")
    yield from done(to(start), keys("f 2 4 Return"), name="typed")
    yield from done(to(start), keys("f 1 c m Return"), name="typed cm")
    yield from done(keys("bracketright bracketright bracketleft"), name="brackets")
    yield from done(keys("f 1 6 Return"))
    yield from done(to(start), keys("ctrl+f"), drag(start, (start[0] + 40, start[1]), 0.4, 60))
    blender.shot("size_depth")
    yield from done("click 1", name="deeper")
    yield from done(keys("ctrl+f 4 Return shift+f 5 0 Return"), name="strength")
    yield from done(keys("shift+f 1 0 0 Return"))


def brushes():
    """Choose brushes by the pie, give one another size, and come back; open the presets."""
    middle = on_the_screen(0.0, 0.0)
    right, left = ((middle[0] + way, middle[1]) for way in (110, -110))

    def choose(at, name=""):
        yield from done(to(middle), keys("e"))
        yield from done(to(at, 0.3), "click 1", name=name)

    yield from choose(right, "raise chosen")
    yield from done(to(middle), keys("f 2 4 Return shift+f 3 0 Return"), name="raise")
    yield from choose(left, "lower again")
    yield from choose(right, "raise again")
    yield from done(keys("ctrl+z"), name="raise undone")
    yield from choose(left)
    view = bpy.context.preferences.view
    for language in ("de_DE", "en_US"):
        view.language = language
        blender.call(bpy.ops.wm.call_panel, "INVOKE_DEFAULT", name="DIGICLAY_PT_press_presets")
        yield from rest()
        blender.shot(f"presets_{language}")
        yield from done(keys("Escape"))
        yield from done(to(middle), keys("e"))
        blender.shot(f"pie_{language}")
        yield from done(keys("Escape"))
    presets, settings = blender.part("press.brush_presets"), brush()
    files = Path(presets.HOME, "presets", presets.SUBFOLDER).glob("*.py")
    blender.SEEN["icons"] = [presets.find_icon(file, settings) for file in files]


def symmetric():
    brush().symmetry = "XY"
    yield from stroke("symmetric", *MIRRORED, 0.8, picture="symmetric")
    yield from act(keys("ctrl+z"))
    note("symmetric undone")
    brush().symmetry = "NONE"
    yield from reset()


def shapes():
    """Drag a line, then click with Shift; drag a ring; draw with a stabilizer."""
    settings = brush()
    settings.path = "LINE"
    yield from finish(line((-27.0, -24.0), (27.0, -24.0), 0.4))
    settings.path = "FREE"
    corner = on_the_screen(27.0, 27.0)
    yield from act(to(corner), "keydown shift sleep 0.1 click 1 sleep 0.1 keyup shift")
    note("lines")
    yield from reset()
    settings.path = "RING"
    process = line((0.0, 0.0), (RADIUS, 0.0), 0.4, last="")
    yield from blender.until(lambda: process.poll() is not None)
    yield 0.5
    blender.shot("ring_preview")
    yield from act("mouseup 1")
    note("ring")
    blender.shot("ring")
    yield from reset()
    settings.path, settings.stabilizer = "FREE", 9.0
    yield from stroke("stabilized", (-27.0, 0.0), (27.0, 0.0))
    settings.stabilizer = 0.0


def put():
    # A view that has changed knows so when drawn.
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    area, _ = blender.view()
    looking = area.spaces.active.region_3d
    place = blender.world(*COVERED)
    level = looking.view_perspective == "ORTHO" or looking.window_matrix[3][3] == 1.0
    eye = looking.view_matrix.inverted()
    way = eye.col[2].to_3d() if level else (eye.translation - place).normalized()
    bpy.data.objects["Cube"].location = place + DISTANCE * way


def try_both(name):
    """Click on the cube, then on the pins beside it; write down what each has pressed and selected."""
    put()
    blender.call(bpy.ops.object.select_all, action="DESELECT")
    yield 0.5
    blender.shot(f"past_{name}")
    seen = {}
    for what, place in (("covered", COVERED), ("bare", BARE)):
        yield from act(to(on_the_screen(*place), 0.3), "click 1 sleep 0.3")
        seen[what] = sum(session.finished_strokes for session in blender.sessions())
        seen[f"{what} selected"] = [
            thing.name for thing in blender.window().view_layer.objects.selected
        ]
    blender.SEEN[name] = seen
    yield from reset()


def past_objects():
    yield from put_cube()
    area, _ = blender.view()
    space = area.spaces.active
    yield from try_both("perspective")
    blender.call(bpy.ops.view3d.view_persportho)
    yield 0.5
    yield from try_both("orthographic")
    blender.call(bpy.ops.view3d.view_persportho)
    blender.call(bpy.ops.object.camera_add)
    blender.window().scene.camera = bpy.context.object
    blender.call(bpy.ops.view3d.camera_to_view)
    yield 0.5
    yield from try_both("camera")
    blender.call(bpy.ops.view3d.view_camera)
    space.shading.show_xray = True
    yield 0.5
    yield from try_both("xray")
    space.shading.show_xray = False
    yield from drawn_under()
    blender.call(bpy.ops.screen.region_quadview)
    yield 0.5
    yield from quarters()
    blender.call(bpy.ops.screen.region_quadview)
    yield 0.5
    blender.SEEN["reported"] = read_reports()
    yield from add_from_elsewhere()


def put_cube():
    add_bed()
    blender.call(bpy.ops.mesh.primitive_cube_add, size=0.12)
    blender.choose_tool()
    yield from focus_window()
    blender.window().view_layer.objects.active = blender.bed()
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield 1.0


def drawn_under():
    put()
    yield 0.5
    yield from finish(line((-24.0, COVERED[1]), (24.0, COVERED[1])))
    blender.SEEN["drawn under"] = blender.heights()[7].tolist()
    yield from reset()


def quarters():
    bpy.data.objects["Cube"].location = blender.world(*COVERED) + Vector((0.0, 0.0, DISTANCE))
    yield 1.0
    blender.shot("past_quarters")
    aim, found = blender.part("press.aim"), {}
    area, _ = blender.view()
    regions = [region for region in area.regions if region.type == "WINDOW"]
    for region in regions:
        with bpy.context.temp_override(window=blender.window(), area=area, region=region):
            context = bpy.context
            kind = "top" if abs(context.region_data.view_matrix[2][2]) > 0.99 else "other"
            bed = blender.bed()
            for what, place in (("covered", COVERED), ("bare", BARE)):
                point = 1e-3 * np.array([[*place, 40.0]])
                (xy,) = blender.part("bridge").project(context, bed, point)
                hit = aim.find_target(context, (float(xy[0]), float(xy[1]))) is not None
                found.setdefault(f"{kind} {what}", []).append(hit)
    blender.SEEN["quarters"] = found | {"count": len(regions)}


def read_reports():
    area = next(area for area in blender.window().screen.areas if area.type == "PROPERTIES")
    area.type = "INFO"
    with bpy.context.temp_override(window=blender.window(), area=area, region=area.regions[-1]):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    return str(bpy.context.window_manager.clipboard)


def add_from_elsewhere():
    """Add a small bed into a cube that is seen along each axis; write down where the bed is."""
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.call(bpy.ops.object.delete)
    blender.call(bpy.ops.mesh.primitive_cube_add)
    for axis in ("TOP", "FRONT", "BOTTOM"):
        blender.call(bpy.ops.view3d.view_axis, type=axis)
        yield 0.5
        blender.call(bpy.ops.mesh.digital_clay_add, rows=6, columns=6)
        (bed,) = blender.beds()
        blender.SEEN[axis] = [float(bed.location.xy.length), bed.location.z]
        bpy.data.batch_remove([bed, *bed.children_recursive])
