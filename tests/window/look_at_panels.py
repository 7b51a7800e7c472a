"""Played by `driver`: opens the sidebar's tab with every panel unfolded, and looks at each of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

#: Pins as a user sees them.
FINE_PINS = True
#: Panels unfolded in one picture, so that each is seen whole in a window of 800 pixels.
PICTURES = {
    "device": ("DIGICLAY_PT_device", "layout actuator supply fluid valve"),
    "device_rest": ("DIGICLAY_PT_device", "conduit valve_lag delay contact relaxation"),
    "finger": ("DIGICLAY_PT_finger", "fingertip"),
    "control": ("DIGICLAY_PT_control", "control blister"),
    "control_rest": ("DIGICLAY_PT_control", "sensors simulation recorder"),
}


def script(blender: Any) -> Iterator[float | None]:
    """Look at the tab without a bed, then at each panel of a bed, then at a bed that is to be rebuilt."""
    yield from blender.empty_scene()
    yield from blender.open_sidebar()
    blender.shot("panels_start")
    yield from blender.add_paper_bed()
    blender.shot("panels_all")
    for picture, (root, sections) in PICTURES.items():
        with blender.unfolded(picture, root, *sections.split()) as tab:
            yield from blender.open_sidebar(tab)
            blender.shot(f"panels_{picture}")
    bed = blender.beds()[0]
    bed.digiclay.layout.columns = 20
    bed.digiclay.layout.pitch = 1.0
    bed.digiclay.use_delay = False
    with blender.unfolded("stale", "DIGICLAY_PT_device", "layout", "delay") as tab:
        yield from blender.open_sidebar(tab)
        blender.shot("panels_stale")
    blender.SEEN["rebuild refused"] = refused(blender)
    bed.digiclay.layout.pitch = 3.0
    blender.SEEN["rebuilt"] = sorted(blender.call(bpy.ops.digiclay.rebuild))
    blender.SEEN["pins"] = len(blender.beds()[0].data.vertices)
    yield from own_methods(blender)


def own_methods(blender: Any) -> Iterator[float | None]:
    """Allow a folder with a method and a mistake, look at its parameters; take the permission back."""
    folder = Path(blender.OUT, "methods")
    blender.part("command_line").run(["new-method", "soft_pad", "--out", str(folder), "--quiet"])
    (folder / "broken.py").write_text("x = (", encoding="utf-8")
    chosen = blender.preferences()
    chosen.methods_folder, chosen.run_own_methods = str(folder), True
    blender.beds()[0].digiclay.chosen_method = "soft_pad"
    with blender.unfolded("own", "DIGICLAY_PT_control", "control") as tab:
        yield from blender.open_sidebar(tab)
        blender.shot("panels_own")
        chosen.run_own_methods = False
        yield from blender.open_sidebar(tab)
        blender.shot("panels_own_missing")
    chosen.run_own_methods = True
    area, _ = blender.view()
    area.type = "PREFERENCES"
    bpy.context.preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Digital Clay"
    bpy.ops.preferences.addon_expand(module=blender.EXTENSION)
    yield 1.0
    blender.shot("panels_preferences")
    area.type = "VIEW_3D"
    yield from blender.open_sidebar()


def refused(blender: Any) -> str:
    """Return what Rebuild says of settings that do not go together."""
    try:
        blender.call(bpy.ops.digiclay.rebuild)
    except RuntimeError as error:
        return str(error)
    return ""
