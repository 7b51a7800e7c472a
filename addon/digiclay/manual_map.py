"""Manual map: sections of the shipped guide that *Online Manual* and F1 open, by operator and property."""

from pathlib import Path, PurePath

from .compat import bpy

#: `tools/manual.py` makes it from docs/guide.md.
PAGE = Path(__file__).absolute().with_name("manual") / "guide.html"

#: Pattern of what is looked up, in lower case, and the anchor of its section; the first that fits
#: counts. The properties of an operator are looked up as the operator. An empty anchor is the
#: page's beginning.
ENTRIES = (
    ("bpy.ops.mesh.digital_clay_add", "#first-ridge"),
    ("bpy.ops.mesh.digital_clay_make", "#export"),
    ("bpy.ops.export_mesh.digital_clay", "#export"),
    ("bpy.ops.export_anim.digital_clay", "#export"),
    ("bpy.ops.import_scene.digital_clay_run", ""),
    ("bpy.ops.digiclay.add_fingertip", "#several-fingertips"),
    ("bpy.ops.digiclay.add_hand", "#several-fingertips"),
    ("bpy.ops.digiclay.*_presser", "#pressers"),
    ("bpy.ops.digiclay.session", "#first-ridge"),
    ("bpy.ops.digiclay.session_go_on", "#first-ridge"),
    ("bpy.ops.digiclay.session_*", "#keys"),
    ("bpy.ops.digiclay.finish_strokes", "#keys"),
    ("bpy.ops.digiclay.leave_mode", "#troubleshooting"),
    ("bpy.ops.digiclay.press", "#brushes"),
    ("bpy.ops.digiclay.press_brush", "#brushes"),
    ("bpy.ops.digiclay.press_curves", "#brushes"),
    ("bpy.ops.digiclay.press_locks*", "#locks"),
    ("bpy.ops.digiclay.press_*", "#keys"),
    ("bpy.ops.digiclay.skin_toggle", "#display"),
    ("bpy.ops.digiclay.*_pins", "#display"),
    ("bpy.ops.digiclay.shape_*", "#panels"),
    ("bpy.ops.digiclay.preset_*", "#panels"),
    ("bpy.ops.digiclay.rebuild", "#panels"),
    ("bpy.ops.digiclay.take_*", "#takes"),
    ("bpy.ops.digiclay.bake*", "#takes"),
    ("bpy.ops.digiclay.play_strokes", "#takes"),
    ("bpy.ops.digiclay.find_features", "#export"),
    ("bpy.ops.digiclay.*_surface", "#export"),
    ("bpy.ops.digiclay.*", ""),
    ("bpy.types.display.*", "#display"),
    ("bpy.types.digiclay_pg_layout.*", "#beds"),
    ("bpy.types.digiclay_pg_*", "#panels"),
)


def locate_manual(page: PurePath) -> str:
    """Return the address at which a browser opens a page of this machine, whatever its folders are called."""
    return page.as_uri()


def manual_map() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return the address of the manual and its entries; Blender calls this for each look-up."""
    return locate_manual(PAGE), ENTRIES


def register() -> None:
    """Add the entries to Blender's own, which come after them."""
    bpy.utils.register_manual_map(manual_map)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_manual_map(manual_map)
