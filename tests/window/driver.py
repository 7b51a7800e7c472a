"""Runs inside a Blender window and plays a script there, with simulated keys and mouse moves.

Started by `blender_window.played`, with the folder for the results as the last word.
A script is a module of this folder with a generator function ``script``, which imports this one as
``blender``. It is stepped from a timer, so that Blender handles each batch of events before the
next; it may yield how long to wait, s. The pins have few vertices, unless the script has
``FINE_PINS = True``.
"""

import faulthandler
import importlib
import json
import subprocess
import sys
import traceback
from contextlib import contextmanager
from pathlib import Path

import addon_utils
import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

EXTENSION = "bl_ext.user_default.digiclay"
OUT = Path(sys.argv[-1])
#: Time between steps, s: software GL draws a window of this size in a third of it.
PAUSE = 0.4
SEEN = {}


def part(name):
    return importlib.import_module(f"{EXTENSION}.{name}")


def window():
    return bpy.context.window_manager.windows[0]


def event(kind, value="PRESS", at=(0, 0), **modifiers):
    window().event_simulate(kind, value, x=at[0], y=at[1], **modifiers)


def key(kind, at=None, **modifiers):
    """Press and release a key at a place, by default over the middle of the 3D view."""
    at = at or middle()
    event(kind, "PRESS", at, **modifiers)
    event(
        kind, "RELEASE", at, **{name: held for name, held in modifiers.items() if name != "unicode"}
    )


def hover(at, **modifiers):
    event("MOUSEMOVE", "NOTHING", at, **modifiers)


def click(at):
    hover(at)
    yield 0.2
    key("LEFTMOUSE", at)
    yield 0.3


def view():
    area = next(a for a in window().screen.areas if a.type == "VIEW_3D")
    return area, next(r for r in area.regions if r.type == "WINDOW")


def middle():
    _, region = view()
    return region.x + region.width // 2, region.y + region.height // 2


def evaluate():
    """Have Blender work out where things stand, unknown from an undo to the next picture."""
    window().view_layer.update()


def pixel(place, region=None):
    """Return where a place in the world is seen, in the first 3D view or another region, window pixels."""
    area, first = view()
    looking = region.data if region else area.spaces.active.region_3d
    at = location_3d_to_region_2d(region or first, looking, place)
    return (region or first).x + round(at.x), (region or first).y + round(at.y)


def world(x, y, z=40.0):
    """Return where a place in the first bed's space, mm, is in the world; 40 mm: the pins at rest."""
    evaluate()
    return bed().matrix_world @ (part("bridge").SCALE * 1e-3 * Vector((x, y, z)))


def on_the_bed(x, y, z=40.0):
    return pixel(world(x, y, z))


def in_the_view():
    """Return the override of the context with the first 3D view."""
    area, region = view()
    return bpy.context.temp_override(window=window(), area=area, region=region)


def call(operator, *how, **properties):
    with in_the_view():
        return operator(*how, **properties)


def choose_tool(name="digiclay.press_tool"):
    call(bpy.ops.wm.tool_set_by_id, name=name)


@contextmanager
def watch_overlay():
    """Collect what the overlay draws, with the address of the region in which it does."""
    module, drawn = part("overlay.draw"), []
    draw = module.draw

    def noted(picture, width, height):
        drawn.append((bpy.context.region.as_pointer(), picture))
        draw(picture, width, height)

    module.draw = noted
    try:
        yield drawn
    finally:
        module.draw = draw


def open_sidebar(tab="Digital Clay"):
    area, _ = view()
    area.spaces.active.show_region_ui = True
    yield None
    sidebar = next(r for r in area.regions if r.type == "UI")
    sidebar.active_panel_category = tab
    area.tag_redraw()
    yield None


def empty_scene():
    call(bpy.ops.object.select_all, action="SELECT")
    call(bpy.ops.object.delete)
    bpy.ops.ed.undo_push(message="Empty scene")
    hover(middle())
    yield None


def whole_view():
    key("HOME")
    yield None


def add_bed(**chosen):
    call(bpy.ops.mesh.digital_clay_add, **chosen)
    bpy.ops.ed.undo_push(message="Add")
    yield from whole_view()


def scene_with_bed(**chosen):
    yield from empty_scene()
    yield from add_bed(**chosen)


def open_browser(operator, name, **options):
    """Open the file browser of an operator, with the name of a file; return the context of its commands."""
    call(operator, "INVOKE_DEFAULT", **options)
    yield 1.0
    windows = bpy.context.window_manager.windows
    browser = next(each for each in windows if each.screen.areas[0].type == "FILE_BROWSER")
    area = browser.screen.areas[0]
    if name:
        chosen = area.spaces.active.params
        chosen.directory, chosen.filename = bytes(OUT), name
        yield None
    return bpy.context.temp_override(window=browser, area=area)


def beds():
    return [thing for thing in window().scene.objects if part("roles").is_bed(thing)]


def bed():
    return beds()[0]


def fingertip(number=0):
    return part("roles").fingertip_of(beds()[number])


def sessions():
    return part("sessions.running").list_sessions()


def session():
    """Return the session of the first bed, or None."""
    return part("sessions.running").find(bed())


def stopped():
    yield from until(lambda: not sessions())


def heights():
    """Return the heights drawn of the first bed, mm, rows by columns."""
    first = bed()
    return 1e3 * part("bridge").read_cells(first.data)["height"].reshape(
        first.digiclay.layout.rows, -1
    )


def preferences():
    """Return the extension's preferences; enabled by `main` it has none before."""
    entry = bpy.context.preferences.addons.new()
    entry.module = EXTENSION
    return entry.preferences


@contextmanager
def unfolded(name, root, *sections):
    """Show a panel with some sections unfolded in a tab of its own; Blender knows others as folded."""
    panels = part("panels")
    every = [kind for kind in panels.CLASSES if issubclass(kind, bpy.types.Panel)]
    names = ("bl_idname", "bl_parent_id", "bl_category", "bl_options")
    former = {
        kind: {key: getattr(kind, key) for key in names if hasattr(kind, key)} for kind in every
    }
    tab = f"Look at {name}"
    panels.unregister()
    for kind in every:
        if kind.bl_idname in (root, *(f"DIGICLAY_PT_part_{section}" for section in sections)):
            kind.bl_category, kind.bl_options = tab, set()
            kind.bl_idname = f"{kind.bl_idname}_{name}"
        if kind.bl_idname == f"{root}_{name}":
            kind.bl_parent_id = ""
        if getattr(kind, "bl_parent_id", "") == root:
            kind.bl_parent_id = f"{root}_{name}"
    panels.register()
    yield tab
    panels.unregister()
    for kind, before in former.items():
        for key, value in before.items():
            setattr(kind, key, value)
        if "bl_options" not in before and hasattr(kind, "bl_options"):
            del kind.bl_options
    panels.register()


def select(thing):
    call(bpy.ops.object.select_all, action="DESELECT")
    thing.select_set(True)
    window().view_layer.objects.active = thing
    bpy.ops.ed.undo_push(message="Select")


def grab(offset, axis, steps=6, look_as="", end="LEFTMOUSE", periods=0):
    """Move what is selected with G along an axis, by an offset in mm, step by step, and confirm it.

    Sessions follow each step before the next, for so many control `periods` at least. With
    `look_as` what stands in the scene is written down during the move, after each step.
    """
    evaluate()
    start = bpy.context.view_layer.objects.active.matrix_world.translation.copy()
    scale = part("bridge").SCALE * 1e-3
    key_at = pixel(start)
    hover(key_at)
    yield None
    key("G", key_at)
    yield 0.2
    key(axis, key_at)
    yield 0.2
    for step in range(1, steps + 1):
        place = [a + scale * step / steps * d for a, d in zip(start, offset, strict=True)]
        key_at = pixel(place)
        hover(key_at)
        yield None
        yield from settle(1)
        yield from simulate(periods)
        if look_as:
            look(f"{look_as} {step}")
    key(end, key_at)
    yield None


def start(thing=None):
    if thing is not None:
        select(thing)
    call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield from settle()


def after(name, *keys, **modifiers):
    """Press keys over the 3D view; look when the sessions have taken up whatever has happened."""
    for kind in keys:
        key(kind, **modifiers)
    yield from settle()
    look(name)


def undo(name, redo=False):
    yield from after(name, "Z", ctrl=True, shift=redo)


def until(found, every=0.25):
    """Wait until something is so, however slow the machine is; what is not so after minutes never will be."""
    for _ in range(int(120.0 / every)):
        yield every
        if found():
            return
    raise AssertionError("What was waited for did not come")


def rounds(count=3):
    """Let Blender go round its main loop: in each it reads events, handles them, and draws."""
    for _ in range(count):
        yield 0.02


def settle(ticks=3):
    """Wait until the sessions, if there are any, have ticked so often."""

    def last():
        return max((running.tick for running in sessions()), default=0)

    start = last()
    yield from until(lambda: not sessions() or last() >= start + ticks, every=0.1)


def simulate(periods):
    """Wait until all sessions have simulated so many control periods."""
    ends = {running.uid: running.state.period + periods for running in sessions()}
    yield from until(
        lambda: all(running.state.period >= ends.get(running.uid, 0) for running in sessions()),
        every=0.05,
    )


def look(name):
    """Write down what stands in the scene; everything is fetched anew, since undo invalidates it."""
    evaluate()
    bridge, running = part("bridge"), part("sessions.running")
    found = {"beds": len(beds()), "said": running.last_message()}
    found["sessions"] = len(sessions())
    for bed in beds()[:1]:
        session = running.find(bed)
        found["kept"] = len(bed.get("digiclay_state", b""))
        if not bed.data.is_editmode:  # a mesh that is being edited cannot be read
            cells = bridge.read_cells(bed.data)
            found["heights"] = [float(cells["height"].min()), float(cells["height"].max())]
            found["modes"] = np.bincount(cells["mode"], minlength=8).tolist()
        tip = part("roles").fingertip_of(bed)
        if tip is not None and not (session and session.blocking_reason):
            found["pose"] = bridge.pose(tip).tolist()
        if session is not None:
            found |= {
                "period": session.state.period,
                "factor": session.clock.factor,
                "paused": session.paused,
                "waits": session.blocking_reason,
                "gestures": len(session.gestures),
                "force": float(session.trace.force[-1]) if len(session.trace.rows) else 0.0,
            }
    SEEN[name] = found


def take_frame(name):
    """Draw the window anew, and write what the screen shows as a picture."""
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    # Blender's own screenshot reads a buffer that software GL leaves black.
    command = ["import", "-window", "root", "-quality", "10", str(OUT / f"{name}.png")]
    subprocess.run(command, check=True, timeout=120, capture_output=True)


def shot(name):
    take_frame(name)
    pixels = read_shot(name)[::4, ::4]
    SEEN.setdefault("colors", {})[name] = len(
        np.unique(pixels.reshape(-1, pixels.shape[2]), axis=0)
    )


def read_shot(name):
    """Return the pixels of a picture, (height, width, channels), the lower row first."""
    image = bpy.data.images.load(str(OUT / f"{name}.png"))
    pixels = np.array(image.pixels[:], np.float32).reshape(
        image.size[1], image.size[0], image.channels
    )
    bpy.data.images.remove(image)
    return pixels


def hand_over():
    (OUT / "seen.json").write_text(json.dumps(SEEN))


def finish():
    """Hand over what was seen, and leave with the extension taken back."""
    hand_over()
    addon_utils.disable(EXTENSION)
    bpy.ops.wm.quit_blender()


def main(name):
    faulthandler.enable()  # Blender that crashes says at which line of Python it did
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.smooth_view = 0  # the mouse is sent by where things are seen
    bpy.context.preferences.system.viewport_aa = "OFF"  # it costs software GL most of its time
    # What Blender saves by itself has the name of its process: others can have had that before.
    bpy.context.preferences.filepaths.temporary_directory = str(OUT)
    bpy.context.preferences.view.use_save_prompt = False  # nobody would answer
    if addon_utils.enable(EXTENSION) is None:
        SEEN["error"] = f"{EXTENSION} cannot be enabled"
    played = importlib.import_module(f"tests.window.{name}")
    if "error" not in SEEN and not getattr(played, "FINE_PINS", False):
        # The vertices of rounder pins cost software GL most of a frame.
        part("device.parts").MANY = 0
        for area in (
            area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"
        ):
            area.spaces.active.overlay.show_floor = False  # a sixth of what is left
    steps = played.script()

    def step():
        try:
            if "error" not in SEEN:
                return next(steps) or PAUSE
        except StopIteration:
            pass
        except Exception:
            # Whatever went wrong is the test's to report; without this Blender would sit there for
            # ever.
            SEEN["error"] = traceback.format_exc()
        finish()
        return None

    bpy.app.timers.register(step, first_interval=2.0, persistent=True)
