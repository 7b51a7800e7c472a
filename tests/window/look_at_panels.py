"""Played by `driver`: opens the sidebar's tab with every panel unfolded, and looks at each of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

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
        with unfolded(blender.part("panels"), picture, {root}, sections.split()) as tab:
            yield from blender.open_sidebar(tab)
            blender.shot(f"panels_{picture}")
    bed = blender.beds()[0]
    bed.digiclay.layout.columns = 20
    bed.digiclay.layout.pitch = 1.0
    bed.digiclay.use_delay = False
    with unfolded(blender.part("panels"), "stale", {"DIGICLAY_PT_device"}, ["layout", "delay"]) as tab:
        yield from blender.open_sidebar(tab)
        blender.shot("panels_stale")
    blender.SEEN["rebuild refused"] = refused(blender)
    bed.digiclay.layout.pitch = 3.0
    blender.SEEN["rebuilt"] = sorted(blender.call(bpy.ops.digiclay.rebuild))
    blender.SEEN["pins"] = len(blender.beds()[0].data.vertices)
    yield from blender.open_sidebar()


@contextmanager
def unfolded(panels: Any, name: str, roots: set[str], sections: list[str]) -> Iterator[str]:
    """Show some panels unfolded in a tab of their own; Blender remembers by its name which one is folded."""
    wanted = roots | {f"DIGICLAY_PT_part_{section}" for section in sections}
    every = [kind for kind in panels.CLASSES if issubclass(kind, bpy.types.Panel)]
    names = ("bl_idname", "bl_parent_id", "bl_category", "bl_options")
    former = {kind: {key: getattr(kind, key) for key in names if hasattr(kind, key)} for kind in every}
    tab = f"Look at {name}"
    panels.unregister()
    for kind in every:
        if kind.bl_idname in wanted:
            kind.bl_category, kind.bl_options = tab, set()
            kind.bl_idname = f"{kind.bl_idname}_{name}"
        if getattr(kind, "bl_parent_id", "") in roots:
            kind.bl_parent_id = f"{kind.bl_parent_id}_{name}"
    panels.register()
    yield tab
    panels.unregister()
    for kind, known in former.items():
        for key, value in known.items():
            setattr(kind, key, value)
        if "bl_options" not in known and hasattr(kind, "bl_options"):
            del kind.bl_options
    panels.register()


def refused(blender: Any) -> str:
    """Return what Rebuild says of settings that do not go together."""
    try:
        blender.call(bpy.ops.digiclay.rebuild)
    except RuntimeError as error:
        return str(error)
    return ""
