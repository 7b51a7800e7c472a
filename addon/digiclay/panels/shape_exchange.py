"""Panels Shapes, Export and Features: initial shape of the bed, export of the formed surface."""

from typing import Any

from ..compat import Context, UILayout
from ..exchange import formed_bed
from ..roles import bed_of, is_edited
from .base import EXPORT, SESSION, Sidebar, panel

#: Property of a bed that holds the list of its features; the operator that lists them writes it.
LISTED = "digiclay_features"
#: Lines shown of a long list.
MOST = 24


@panel("DIGICLAY_PT_shapes", "Shapes", 0, parent=SESSION)
def shapes(sidebar: Sidebar, context: Context) -> None:
    """Initial shape of the bed."""
    settings = bed_of(context).digiclay
    sidebar.layout.enabled = not is_edited(context)
    column = sidebar.layout.column(align=True)
    column.operator("digiclay.shape_from_object", icon="OBJECT_DATA")
    column.operator_context = "INVOKE_DEFAULT"
    column.operator("digiclay.shape_from_file", text="Shape from File...", icon="FILE_FOLDER")
    column.operator_menu_enum(
        "digiclay.shape_sample", "sample", text="Sample Shape", icon="RNDCURVE"
    )
    if not settings.use_shape:
        sidebar.layout.label(text="No shape: sessions begin at rest", icon="INFO")
    else:
        _draw_shape(sidebar.layout, settings.shape)
    column = sidebar.layout.column(align=True)
    column.operator("digiclay.shape_keep", icon="PINNED")
    column.operator("mesh.digital_clay_make", icon="OUTLINER_OB_MESH")


def _draw_shape(layout: UILayout, shape: Any) -> None:
    """Draw what is displayed, and how the surface gets there."""
    box = layout.box()
    row = box.row()
    row.label(text=shape.file or "Formed", icon="RNDCURVE")
    row.operator("digiclay.shape_remove", text="", icon="X")
    column = box.column()
    column.use_property_split = True
    column.use_property_decorate = False
    column.prop(shape, "refresh")
    if shape.refresh != "one_time":
        column.prop(shape, "surfaces")


@panel(EXPORT, "Export", 30, closed=False)
def export(sidebar: Sidebar, context: Context) -> None:
    """Formed surface as meshes."""
    column = sidebar.layout.column(align=True)
    column.operator_menu_enum("mesh.digital_clay_make", "kind", text="Make Mesh", icon="MESH_DATA")
    column.menu("DIGICLAY_MT_export", text="Export", icon="EXPORT")


@panel("DIGICLAY_PT_features", "Features", 0, parent=EXPORT)
def features(sidebar: Sidebar, context: Context) -> None:
    """List of bosses and creases, and the surface they are measured from."""
    bed, layout = bed_of(context), sidebar.layout
    column = layout.column(align=True)
    column.operator("digiclay.find_features", icon="VIEWZOOM")
    lines = str(bed.get(LISTED, "")).splitlines()
    if lines:
        listed = column.box().column(align=True)
        listed.scale_y = 0.8
        for line in lines[:MOST]:
            listed.label(text=line)
        if len(lines) > MOST:
            listed.label(text="...")
    has_reference = formed_bed.has_reference(bed)
    column = layout.column(align=True)
    column.label(
        text="Measured from the kept surface" if has_reference else "Measured from the bed at rest"
    )
    column.operator("digiclay.keep_surface")
    column.operator("digiclay.forget_surface")


CLASSES = (shapes, export, features)
