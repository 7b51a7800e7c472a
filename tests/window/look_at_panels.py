"""Played by `driver`: opens the tab with every panel unfolded, looks at each, and exports a form."""

from pathlib import Path

import bpy
import numpy as np

from tests.window import driver as blender

FINE_PINS = True
#: Panels unfolded in one picture, so that each is seen whole in a window of 800 pixels.
PICTURES = {
    "device": ("DIGICLAY_PT_device", "layout actuator supply fluid valve"),
    "device_rest": ("DIGICLAY_PT_device", "conduit valve_lag delay contact relaxation"),
    "laboratory": ("DIGICLAY_PT_laboratory", "fingertip"),
    "details": ("DIGICLAY_PT_display", ""),
    "takes": ("DIGICLAY_PT_takes", ""),
    "control": ("DIGICLAY_PT_control", "control blister"),
    "control_rest": ("DIGICLAY_PT_control", "sensors simulation recorder"),
}


def script():
    """Look at the tab without a bed, then at each panel of a bed, then at a bed that is to be rebuilt."""
    yield from blender.empty_scene()
    yield from blender.open_sidebar()
    blender.shot("panels_start")
    yield from blender.add_bed(bed="paper")
    blender.shot("panels_all")
    for picture, (root, sections) in PICTURES.items():
        with blender.unfolded(picture, root, *sections.split()) as tab:
            yield from blender.open_sidebar(tab)
            blender.shot(f"panels_{picture}")
    bed = blender.bed()
    bed.digiclay.layout.columns = 20
    bed.digiclay.layout.pitch = 1.0
    bed.digiclay.use_delay = False
    with blender.unfolded("stale", "DIGICLAY_PT_device", "layout", "delay") as tab:
        yield from blender.open_sidebar(tab)
        blender.shot("panels_stale")
    blender.SEEN["rebuild refused"] = refused()
    bed.digiclay.layout.pitch = 3.0
    blender.SEEN["rebuilt"] = sorted(blender.call(bpy.ops.digiclay.rebuild))
    blender.SEEN["pins"] = len(blender.bed().data.vertices)
    yield from own_methods()
    yield from export()


def own_methods():
    """Allow a folder with a method and a mistake, look at its parameters; take the permission back."""
    folder = Path(blender.OUT, "methods")
    blender.part("command_line").run(["new-method", "soft_pad", "--out", str(folder), "--quiet"])
    (folder / "broken.py").write_text("x = (", encoding="utf-8")
    chosen = blender.preferences()
    chosen.methods_folder, chosen.run_own_methods = str(folder), True
    blender.bed().digiclay.chosen_method = "soft_pad"
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


def refused():
    try:
        blender.call(bpy.ops.digiclay.rebuild)
    except RuntimeError as error:
        return str(error)
    return ""


def export():
    """Form a ridge and a pit on another bed, and take them out of the bed in every way there is."""
    yield from blender.scene_with_bed(bed="paper")
    bed = blender.bed()
    form(bed)
    with blender.unfolded("export", "DIGICLAY_PT_features") as tab:
        yield from blender.open_sidebar(tab)
        blender.call(bpy.ops.digiclay.find_features)
        yield None
        yield None
        blender.shot("export_features")
    blender.SEEN["listed"] = bed["digiclay_features"]
    blender.call(bpy.ops.mesh.digital_clay_make, "EXEC_DEFAULT", True, kind="solid", skin="smooth")
    made = blender.window().view_layer.objects.active
    blender.SEEN["groups"] = [group.name for group in made.vertex_groups]
    made.location.y -= 0.9
    blender.select(bed)
    blender.call(
        bpy.ops.mesh.digital_clay_make, "EXEC_DEFAULT", True, kind="features", skin="smooth"
    )
    yield None
    yield from blender.whole_view()
    yield None
    blender.shot("export_meshes")
    count = len(bpy.data.objects)
    blender.key("Z", ctrl=True)
    yield None
    yield None
    blender.SEEN["undone"] = count - len(bpy.data.objects)
    blender.select(blender.bed())
    yield from export_by_browser()


def export_by_browser():
    """Export by File > Export: look at the browser's options, change the format, and confirm."""
    export = bpy.ops.export_mesh.digital_clay
    chosen = {"kind": "solid", "file_format": "3mf"}
    browser = yield from blender.open_browser(export, "für später.stl", **chosen)
    blender.shot("export_browser")
    with browser:
        bpy.ops.file.execute()
    yield 0.5
    blender.SEEN["files"] = sorted(path.name for path in blender.OUT.glob("*.3mf"))


def form(bed):
    instant = blender.part("device.instant").Instant
    cells = blender.part("bridge").read_cells(bed.data)
    x, y = cells["position"].T * 1e3
    along = np.clip(np.abs(x) - 15.0, 0.0, None)
    raised = 14.0 * np.exp(-(along**2 + (y - 12.0) ** 2) / 60.0) - 9.0 * np.exp(
        -(x**2 + (y + 18) ** 2) / 80.0
    )
    blender.part("device.view").show(
        bed,
        instant(
            position=cells["position"], height=0.04 + 1e-3 * raised,
            mode=np.where(np.abs(raised) > 0.5, 1, 0), force=np.zeros(len(x)),
            fingertip=np.array([0.0, -0.018, 0.06, 1.0, 0.0, 0.0, 0.0]),
        ),
    )  # fmt: skip
    bpy.ops.ed.undo_push(message="Form")
