"""Records takes, keeps, exports, replays, bakes and plays them; leaves files in mid-recording."""

import os
import shutil
from pathlib import Path

import bpy

from tests.window import driver as blender


def script():
    """Do what a user does with takes; the Takes panel is in sight from the first take on."""
    yield from blender.scene_with_bed(bed="paper")
    # Software GL draws a frame or two a second; in between the session is to catch up.
    blender.preferences().most_periods = 100
    # The least there is. Blender counts it from the start of the program.
    bpy.context.preferences.filepaths.auto_save_time = 1
    yield from blender.start(blender.fingertip())
    blender.call(bpy.ops.digiclay.take_record)
    yield from to_height(36.0, steps=3)
    yield from to_height(50.0, steps=2)
    with blender.unfolded("takes", "DIGICLAY_PT_takes") as tab:
        yield from blender.open_sidebar(tab)
        blender.shot("takes_recording")
        blender.SEEN["kept"] = sorted(blender.call(bpy.ops.digiclay.take_keep, name="A press"))
        yield None
        note("kept")
        file = blender.OUT / "press.toml"
        blender.SEEN["exported"] = sorted(
            blender.call(bpy.ops.digiclay.take_export, "EXEC_DEFAULT", filepath=str(file))
        )
        blender.SEEN["exported in a session"] = file.is_file()
        area, _ = blender.view()
        area.spaces.active.show_region_ui = False
        yield None
        blender.call(bpy.ops.digiclay.take_record)  # until Blender has saved by itself
        earlier = written()
        yield from ridge()
        yield from saved(earlier)
        blender.key("ESC")
        yield from blender.stopped()
        yield 1.0
        note("stopped")
        yield from blender.open_sidebar(tab)
        yield from replayed()
        yield from animated()
        yield from baked()
    yield from blender.open_sidebar()
    bpy.ops.wm.open_mainfile(filepath=str(blender.OUT / "recovered.blend"))
    yield 1.0
    note("recovered")
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    yield from leave_files()


def to_height(height, steps, periods=0):
    """Move the fingertip with G until its lowest point is at a height, mm; see `grab`."""
    now = 1e3 * blender.part("bridge").pose(blender.fingertip())[2]
    yield from blender.grab((0, 0, height - now), "Z", steps=steps, periods=periods)
    yield from blender.settle()


def ridge():
    yield from blender.grab((-16, 0, 0), "X", steps=2)
    yield from to_height(35.0, steps=4)
    # Lifted while its pins still sink, a fingertip is lost.
    yield from blender.simulate(100)
    note("pressed")
    # At 5 mm/s of the device's time, however slow the machine is; a quick tick takes a step at
    # once.
    yield from to_height(47.0, steps=60, periods=8)
    note("raised")
    yield from blender.grab((30, 0, 0), "X", steps=15, periods=20)
    yield from blender.settle()
    blender.shot("takes_ridge")
    yield from to_height(75.0, steps=1)
    note("ridge left")


def autosave():
    return Path(bpy.app.tempdir).parent / f"{os.getpid()}_autosave.blend"


def written():
    """Return when Blender last saved by itself, ns; 0 when it has not."""
    return autosave().stat().st_mtime_ns if autosave().is_file() else 0


def saved(earlier):
    """Wait until Blender has saved by itself again, which the session must let it do; keep the file."""
    yield from blender.until(lambda: written() > earlier)
    blender.SEEN["saved by itself"] = True
    shutil.copy(autosave(), blender.OUT / "recovered.blend")
    yield from blender.settle()
    note("saved while recording")
    blender.call(bpy.ops.digiclay.take_keep)
    blender.call(bpy.ops.digiclay.take_remove)


def replayed():
    before = fingertip()
    blender.call(bpy.ops.digiclay.take_replay, "INVOKE_DEFAULT")
    yield from blender.until(lambda: fingertip() != before)
    note("replaying")
    polls = (bpy.ops.digiclay.session.poll, bpy.ops.digiclay.shape_sample.poll)
    blender.SEEN["formed in a replay"] = [blender.call(poll) for poll in polls]
    blender.shot("takes_replaying")
    blender.key("ESC")
    yield 2.0
    note("replay stopped")
    blender.call(bpy.ops.digiclay.take_replay, "INVOKE_DEFAULT")
    end = blender.part("recorded.takes").read(blender.bed(), "1").end
    yield from blender.until(lambda: blender.part("live.beds").read_snapshot(blender.bed()) == end)
    yield 1.0
    note("replayed")


def animated():
    """Write the take as an animated file: stop it by Esc, then let it end; choose a file in the browser."""
    export = bpy.ops.export_anim.digital_clay
    options = {"file_format": "glb", "take": "1"}
    stopped, whole, browsed = (
        blender.OUT / f"{name}.glb" for name in ("stopped", "whole", "browsed")
    )
    blender.call(export, "INVOKE_DEFAULT", filepath=str(stopped), **options)
    blender.key("ESC")
    yield 1.0
    blender.SEEN["animation stopped"] = stopped.exists()
    blender.call(export, "INVOKE_DEFAULT", filepath=str(whole), **options)
    yield from blender.until(whole.is_file)
    with (yield from blender.open_browser(export, "", **options)):
        bpy.ops.file.cancel()  # a traceback of it fails every test of this script
    yield 1.0
    browser = yield from blender.open_browser(export, browsed.name, **options)
    blender.shot("animation_browser")
    with browser:
        bpy.ops.file.execute()
    yield from blender.until(browsed.is_file)
    blender.SEEN["animations"] = [whole.read_bytes() == browsed.read_bytes(), whole.stat().st_size]
    note("animated")


def baked():
    """Bake: stop it by Esc half way, then bake the take, play it, and free it again."""
    scene = blender.window().scene
    scene.frame_set(7)
    blender.call(bpy.ops.digiclay.bake, "INVOKE_DEFAULT", source="FINGERTIP", first=1, last=5000)
    yield 1.0
    blender.shot("takes_baking")
    blender.key("ESC")
    yield 1.0
    note("bake stopped")
    blender.call(bpy.ops.digiclay.bake, "INVOKE_DEFAULT", source="TAKE", take="1", first=1)
    yield from blender.until(lambda: blender.part("recorded.bake").is_baked(blender.bed()))
    yield 1.0
    note("baked")
    bed = blender.bed()
    blender.window().view_layer.objects.active = bed
    blender.SEEN["session on a bake"] = blender.call(bpy.ops.digiclay.session.poll)
    blender.hover(blender.on_the_bed(0.0, 0.0))
    yield None
    try:
        blender.call(bpy.ops.digiclay.press, "INVOKE_DEFAULT")
    except RuntimeError as error:
        blender.SEEN["pressed on a bake"] = str(error)
    scene.frame_set(1)
    scene.sync_mode = "FRAME_DROP"  # software GL draws two frames a second
    places = [fingertip()]
    blender.call(bpy.ops.screen.animation_play)

    def moved():
        places.append(fingertip())
        return max(places) - min(places) > 10e-3

    yield from blender.until(moved)
    blender.SEEN["played"] = places
    blender.shot("takes_played")
    blender.key("ESC")
    yield 1.0
    blender.call(bpy.ops.digiclay.bake_free)
    yield None
    note("freed")


def fingertip():
    return float(blender.fingertip().matrix_world.translation.z)


def note(name):
    blender.look(name)
    bed = blender.bed()
    blender.SEEN[name] |= {
        "takes": [list(one) for one in blender.part("recorded.takes").list_takes(bed)],
        "is baked": blender.part("recorded.bake").is_baked(bed),
        "replay can be pressed": blender.call(bpy.ops.digiclay.take_replay.poll),
        "frame": blender.window().scene.frame_current,
        "bed": blender.heights().round(4).tolist(),
    }


def leave_files():
    """Record, and let the file go away: load another one, save it first, and quit Blender."""
    yield from recording()
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    blender.look("loaded")
    yield from blender.open_sidebar()
    blender.shot("takes_closed_file")
    left = blender.part("live.handlers").file_path()
    bpy.ops.wm.recover_auto_save("EXEC_DEFAULT", filepath=str(left))
    yield 1.0
    blender.SEEN["kept when another was loaded"] = names()

    yield from recording()
    left.unlink()
    bpy.ops.wm.save_as_mainfile(filepath=str(blender.OUT / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(blender.OUT / "saved.blend"))
    yield 1.0
    blender.SEEN["kept when saved before"] = names()
    blender.SEEN["left although saved"] = left.exists()

    yield from recording()
    blender.hand_over()
    bpy.ops.wm.quit_blender()  # with the session on: nobody disables the extension before
    yield 60.0


def recording():
    if not blender.beds():
        blender.call(bpy.ops.mesh.digital_clay_add, rows=9, columns=9)
    yield from blender.start(blender.bed())
    blender.call(bpy.ops.digiclay.take_record)
    yield from blender.settle()


def names():
    return [entry.name for entry in blender.part("recorded.takes").list_takes(blender.bed())]
