"""Records a take, draws a ridge, keeps, exports, replays and bakes what was recorded, and plays the bake."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np


def script(blender: Any) -> Iterator[float | None]:
    """Do what a user does with takes; the Takes panel is in sight from the first take on."""
    yield from blender.empty_scene()
    yield from blender.add_paper_bed()
    # Software GL draws a frame or two a second; in between the session is to catch up.
    entry = bpy.context.preferences.addons.new()
    entry.module = blender.EXTENSION
    entry.preferences.most_periods = 100
    # The least there is. Blender counts it from the start of the program.
    bpy.context.preferences.filepaths.auto_save_time = 1
    blender.select(blender.fingertip())
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield from blender.settle()
    blender.call(bpy.ops.digiclay.take_record)
    yield from to_height(blender, 36.0, steps=3)
    yield from to_height(blender, 50.0, steps=2)
    with takes_alone(blender.part("panels")):
        yield from blender.open_sidebar("Look at Takes")
        blender.shot("takes_recording")
        blender.SEEN["kept"] = sorted(blender.call(bpy.ops.digiclay.take_keep, name="A press"))
        yield None
        note(blender, "kept")
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
        yield from ridge(blender)
        yield from saved(blender, earlier)
        blender.key("ESC", blender.middle())
        yield from blender.until(lambda: not blender.part("sessions.running").list_sessions())
        yield 1.0
        note(blender, "stopped")
        yield from blender.open_sidebar("Look at Takes")
        yield from replayed(blender)
        yield from baked(blender)
    yield from blender.open_sidebar()
    bpy.ops.wm.open_mainfile(filepath=str(blender.OUT / "recovered.blend"))
    yield 1.0
    note(blender, "recovered")


def to_height(blender: Any, height: float, steps: int) -> Iterator[float | None]:
    """Move the fingertip with G until its lowest point is at a height, mm."""
    now = 1e3 * blender.part("bridge").pose(blender.fingertip())[2]
    yield from blender.grab((0, 0, height - now), "Z", steps=steps)
    yield from blender.settle()


def ridge(blender: Any) -> Iterator[float | None]:
    """Press, lift slowly, and draw a ridge along."""
    yield from blender.grab((-16, 0, 0), "X", steps=2)
    yield from to_height(blender, 35.0, steps=4)
    note(blender, "pressed")
    yield from to_height(blender, 47.0, steps=24)
    note(blender, "raised")
    yield from blender.grab((30, 0, 0), "X", steps=10)
    yield from blender.settle()
    note(blender, "ridge")
    blender.shot("takes_ridge")
    yield from to_height(blender, 75.0, steps=1)
    note(blender, "ridge left")


def autosave() -> Path:
    """Return the file Blender saves by itself."""
    return Path(bpy.app.tempdir).parent / f"{os.getpid()}_autosave.blend"


def written() -> int:
    """Return when Blender last saved by itself, ns; 0 when it has not."""
    return autosave().stat().st_mtime_ns if autosave().is_file() else 0


def saved(blender: Any, earlier: int) -> Iterator[float | None]:
    """Wait until Blender has saved by itself again, which the session must let it do; keep the file."""
    yield from blender.until(lambda: written() > earlier)
    blender.SEEN["saved by itself"] = True
    shutil.copy(autosave(), blender.OUT / "recovered.blend")
    yield from blender.settle()
    note(blender, "saved while recording")
    blender.call(bpy.ops.digiclay.take_keep)
    blender.call(bpy.ops.digiclay.take_remove)


def replayed(blender: Any) -> Iterator[float | None]:
    """Replay the take: stop it by Esc half way, then let it come to its end."""
    before = fingertip(blender)
    blender.call(bpy.ops.digiclay.take_replay, "INVOKE_DEFAULT")
    yield from blender.until(lambda: fingertip(blender) != before)
    note(blender, "replaying")
    blender.shot("takes_replaying")
    blender.key("ESC", blender.middle())
    yield 2.0
    note(blender, "replay stopped")
    blender.call(bpy.ops.digiclay.take_replay, "INVOKE_DEFAULT")
    end = blender.part("recorded.takes").read(blender.beds()[0], "1").end
    yield from blender.until(lambda: blender.part("live.bed_state").read_snapshot(blender.beds()[0]) == end)
    yield 1.0
    note(blender, "replayed")


def baked(blender: Any) -> Iterator[float | None]:
    """Bake: stop it by Esc half way, then bake the take, play it, and free it again."""
    scene = blender.window().scene
    scene.frame_set(7)
    blender.call(bpy.ops.digiclay.bake, "INVOKE_DEFAULT", source="FINGERTIP", first=1, last=5000)
    yield 1.0
    blender.shot("takes_baking")
    blender.key("ESC", blender.middle())
    yield 1.0
    note(blender, "bake stopped")
    blender.call(bpy.ops.digiclay.bake, "INVOKE_DEFAULT", source="TAKE", take="1", first=1)
    yield from blender.until(lambda: blender.part("recorded.bake").is_baked(blender.beds()[0]))
    yield 1.0
    note(blender, "baked")
    bed = blender.beds()[0]
    blender.window().view_layer.objects.active = bed
    area, region = blender.view()
    with bpy.context.temp_override(window=blender.window(), area=area, region=region):
        blender.SEEN["session on a bake"] = bpy.ops.digiclay.session.poll()
    scene.frame_set(1)
    scene.sync_mode = "FRAME_DROP"  # software GL draws two frames a second
    places = [fingertip(blender)]
    blender.call(bpy.ops.screen.animation_play)

    def moved() -> bool:
        places.append(fingertip(blender))
        return max(places) - min(places) > 10e-3

    yield from blender.until(moved)
    blender.SEEN["played"] = places
    blender.shot("takes_played")
    blender.key("ESC", blender.middle())
    yield 1.0
    blender.call(bpy.ops.digiclay.bake_free)
    yield None
    note(blender, "freed")


def fingertip(blender: Any) -> float:
    """Return how high the fingertip's object is."""
    return float(blender.fingertip().matrix_world.translation.z)


def note(blender: Any, name: str) -> None:
    """Write down what stands in the scene, and what there is to tell of takes."""
    blender.look(name)
    bed = blender.beds()[0]
    area, region = blender.view()
    with bpy.context.temp_override(window=blender.window(), area=area, region=region):
        replay = bpy.ops.digiclay.take_replay.poll()
    height = blender.part("bridge").read_cells(bed.data)["height"]
    blender.SEEN[name] |= {
        "takes": [list(one) for one in blender.part("recorded.takes").list_takes(bed)],
        "is baked": blender.part("recorded.bake").is_baked(bed),
        "replay can be pressed": replay,
        "frame": blender.window().scene.frame_current,
        "highest": np.sort(1e3 * height)[-40:].round(3).tolist(),
        "bed": (1e3 * height).round(4).tolist(),
    }


@contextmanager
def takes_alone(panels: Any) -> Iterator[None]:
    """Show the Takes panel unfolded, in a tab of its own: below the others it is out of sight."""
    (kind,) = [one for one in panels.CLASSES if getattr(one, "bl_idname", "") == "DIGICLAY_PT_takes"]
    former = kind.bl_idname, kind.bl_category, kind.bl_options
    panels.unregister()
    kind.bl_idname, kind.bl_category, kind.bl_options = "DIGICLAY_PT_takes_alone", "Look at Takes", set()
    panels.register()
    try:
        yield
    finally:
        panels.unregister()
        kind.bl_idname, kind.bl_category, kind.bl_options = former
        panels.register()
