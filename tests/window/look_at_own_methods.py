"""Played by `driver`: the panel with a control method of a folder and without it, and the preferences."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
from look_at_panels import unfolded


def script(blender: Any) -> Iterator[float | None]:
    """Allow a folder with a method and a mistake, look at its parameters; take the permission back."""
    yield from blender.empty_scene()
    yield from blender.add_paper_bed()
    folder = Path(blender.OUT, "methods")
    blender.part("command_line").run(["new-method", "soft_pad", "--out", str(folder), "--quiet"])
    (folder / "broken.py").write_text("x = (", encoding="utf-8")
    entry = bpy.context.preferences.addons.new()  # the driver enables the extension without preferences
    entry.module = blender.EXTENSION
    chosen = entry.preferences
    chosen.methods_folder = str(folder)
    chosen.run_own_methods = True
    bed = blender.beds()[0]
    bed.digiclay.chosen_method = "soft_pad"
    with unfolded(blender.part("panels"), "own", {"DIGICLAY_PT_control"}, ["control"]) as tab:
        yield from blender.open_sidebar(tab)
        blender.shot("own_method")
        chosen.run_own_methods = False
        yield from blender.open_sidebar(tab)
        blender.shot("own_method_missing")
    chosen.run_own_methods = True
    area, _ = blender.view()
    area.type = "PREFERENCES"
    bpy.context.preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Digital Clay"
    bpy.ops.preferences.addon_expand(module=blender.EXTENSION)
    yield 1.0
    blender.shot("own_method_preferences")
    area.type = "VIEW_3D"
    yield from blender.open_sidebar()
