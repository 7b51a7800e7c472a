"""Runs inside a Blender window: adds the device from the menu, drags its fingertip, undoes, redoes.

Started by `test_window.py`, with the folder for the results after ``--``. A generator is
stepped from a timer, so that Blender handles each batch of simulated events in between.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import addon_utils
import bpy
import numpy as np

EXTENSION = "bl_ext.user_default.digiclay"
OUT = Path(sys.argv[sys.argv.index("--") + 1])
#: Time between steps, s: software GL draws a window of this size in a third of it.
PAUSE = 0.4
SEEN: dict[str, object] = {}


def event(kind: str, value: str = "PRESS", at: tuple[int, int] = (0, 0), **modifiers: object) -> None:
    """Simulate one event in the first window."""
    bpy.context.window_manager.windows[0].event_simulate(kind, value, x=at[0], y=at[1], **modifiers)


def key(kind: str, at: tuple[int, int], **modifiers: object) -> None:
    """Press and release a key."""
    event(kind, "PRESS", at, **modifiers)
    event(kind, "RELEASE", at, **{name: held for name, held in modifiers.items() if name != "unicode"})


def middle_of_the_view() -> tuple[int, int]:
    """Return the middle of the 3D view, window pixels."""
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    region = next(r for r in area.regions if r.type == "WINDOW")
    return region.x + region.width // 2, region.y + region.height // 2


def look(name: str) -> None:
    """Write down what stands in the scene; everything is fetched anew, since undo invalidates it."""
    bridge, view = (importlib.import_module(f"{EXTENSION}.{part}") for part in ("bridge", "view"))
    beds = [item for item in bpy.context.scene.objects if view.is_bed(item)]
    found: dict[str, object] = {"beds": len(beds)}
    if beds:
        graph = bpy.context.evaluated_depsgraph_get()
        drawn = [i for i in graph.object_instances if i.is_instance and i.parent.original == beds[0]]
        heights = bridge.read_cells(beds[0].data)["height"]
        found["pins drawn"] = len(drawn)
        found["heights"] = [float(heights.min()), float(heights.max())]
        found["pose"] = bridge.pose(view.fingertip_of(beds[0])).tolist()
    SEEN[name] = found


def session() -> Iterator[None]:
    """Do what a user does; every yield lets Blender work off the events."""
    centre = middle_of_the_view()
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    bpy.ops.ed.undo_push(message="Empty scene")
    event("MOUSEMOVE", "NOTHING", centre)
    yield
    key("A", centre, shift=True)
    yield
    # The Add menu searches for what is typed.
    for letter in "digital clay":
        key("SPACE" if letter == " " else letter.upper(), centre, unicode=letter)
        yield
    key("RET", centre)
    yield
    yield
    look("added")
    key("HOME", centre)
    yield
    view = importlib.import_module(f"{EXTENSION}.view")
    fingertip = view.fingertip_of(bpy.context.object)
    bpy.ops.object.select_all(action="DESELECT")
    fingertip.select_set(True)
    bpy.context.view_layer.objects.active = fingertip
    bpy.ops.ed.undo_push(message="Select the fingertip")
    yield
    key("G", centre)
    yield
    for part in range(1, 5):
        event("MOUSEMOVE", "NOTHING", (centre[0] + 30 * part, centre[1] - 10 * part))
        yield
    there = (centre[0] + 120, centre[1] - 40)
    key("LEFTMOUSE", there)
    yield
    look("dragged")
    yield
    # Blender's own screenshot reads a buffer that software GL leaves black.
    shot = ["import", "-window", "root", str(OUT / "dragged.png")]
    subprocess.run(shot, check=True, timeout=30, capture_output=True)
    image = bpy.data.images.load(shot[-1])
    SEEN["colours"] = len(np.unique(np.array(image.pixels[:]).reshape(-1, image.channels), axis=0))
    bpy.data.images.remove(image)
    yield
    key("Z", there, ctrl=True)
    yield
    yield
    look("undone")
    key("Z", there, ctrl=True, shift=True)
    yield
    yield
    look("redone")
    for _ in range(3):
        key("Z", there, ctrl=True)
        yield
        yield
    look("all undone")


def finish() -> None:
    """Hand over what was seen, and leave with the extension taken back."""
    (OUT / "seen.json").write_text(json.dumps(SEEN))
    addon_utils.disable(EXTENSION)
    bpy.ops.wm.quit_blender()


def main() -> None:
    """Enable the extension under the name Blender gives it, and start the session."""
    bpy.context.preferences.view.show_splash = False
    if addon_utils.enable(EXTENSION) is None:
        SEEN["error"] = f"{EXTENSION} cannot be enabled"
    steps = session()

    def step() -> float | None:
        try:
            if "error" not in SEEN:
                next(steps)
                return PAUSE
        except StopIteration:
            pass
        except Exception:
            # Whatever went wrong is the test's to report; without this Blender would sit there for ever.
            SEEN["error"] = traceback.format_exc()
        finish()
        return None

    bpy.app.timers.register(step, first_interval=2.0)


main()
