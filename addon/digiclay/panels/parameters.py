"""Panels Device and Control: presets, method, and a sub-panel of parameters for each part."""

from ..compat import Context, Menu, PropertyGroup, bpy
from ..core.base.quantity import list_quantities
from ..core.control.methods import list_methods
from ..core.scene.schema import NEEDS, OPTIONAL, SECTIONS, import_parameters
from ..core.scene.toml_table import FINGER_PARTS, PRESETS
from ..roles import bed_of, is_edited
from ..sessions import running
from ..settings import own_presets, properties
from ..settings.declared import WHOLE, title
from ..settings.devices import find_settings
from ..settings.groups import method_of, method_property
from ..settings.properties import part_group
from ..ui_text import localize
from .base import LABORATORY, Panel, Sidebar, draw_lines, menu, panel

#: Kinds of properties whose label stands beside the field.
BESIDE = {"ENUM", "STRING"}


@panel("DIGICLAY_PT_start", "Digital Clay", 0, closed=False, with_bed=False)
def start(sidebar: Sidebar, context: Context) -> None:
    """Content of the tab without an active bed: how to add one."""
    words = localize("Select a bed or its fingertip, or add a new device:")
    draw_lines(sidebar.layout, words, "NONE")
    sidebar.layout.operator("mesh.digital_clay_add", text="Add Digital Clay", icon="MESH_GRID")
    # A session may have ended with its file.
    draw_lines(sidebar.layout, running.last_message(), "INFO")


@menu("DIGICLAY_MT_presets", "Presets")
def presets(entries: Menu, context: Context) -> None:
    """Presets of the core and of the user."""
    for name in PRESETS:
        entries.layout.operator("digiclay.preset_apply", text=title(name)).preset = name
    names = own_presets.names()
    if names:
        entries.layout.separator()
    for name in names:
        entries.layout.operator("digiclay.preset_apply", text=name).preset = name
    entries.layout.separator()
    entries.layout.operator_context = "INVOKE_DEFAULT"
    entries.layout.operator("digiclay.preset_parts", text="Parts from File...", icon="FILE_FOLDER")


@panel("DIGICLAY_PT_device", "Device", 2, parent=LABORATORY)
def device(sidebar: Sidebar, context: Context) -> None:
    """Type of device."""
    bed = bed_of(context)
    settings = bed.digiclay
    row = sidebar.layout.row(align=True)
    row.menu(presets.bl_idname, text=settings.own_preset or title(settings.preset))
    row.operator("digiclay.preset_save", text="", icon="ADD")
    row.operator("digiclay.preset_remove", text="", icon="REMOVE")
    reason = properties.rebuild_reason(bed)
    if reason:
        column = sidebar.layout.column()
        column.alert = True
        column.label(text=reason, icon="ERROR")
    sidebar.layout.operator("digiclay.rebuild", icon="FILE_REFRESH")


@panel("DIGICLAY_PT_control", "Control", 3, parent=LABORATORY)
def control(sidebar: Sidebar, context: Context) -> None:
    """Control of the cells."""
    settings = bed_of(context).digiclay
    row = sidebar.layout.row()
    row.active, row.enabled = settings.use_control, not is_edited(context)
    row.prop(settings, method_property(settings))
    method = method_of(settings)
    if method not in list_methods():
        draw_lines(
            sidebar.layout,
            localize("{}: no such method is loaded. See the preferences", method),
            "ERROR",
        )


def section_panel(section: str, parent: str, order: int, words: str = "") -> type:
    """Make the sub-panel of a part."""

    class Section(Panel, bpy.types.Panel):
        bl_idname = f"DIGICLAY_PT_part_{section}"
        bl_label = words or title(section)
        bl_parent_id = parent
        bl_order = order
        bl_options = {"DEFAULT_CLOSED"}

        @classmethod
        def poll(cls, context: Context) -> bool:
            """Show a blister only where the method forms one, and parameters of a method that is known."""
            bed = bed_of(context)
            if bed is None or section not in ("blister", "control"):
                return bed is not None
            method = list_methods().get(method_of(bed.digiclay))
            return method is not None and (section == "control" or method.blister is not None)

        def draw_header(self, context: Context) -> None:
            self.layout.enabled = not is_edited(context)
            if section in OPTIONAL:
                self.layout.prop(bed_of(context).digiclay, f"use_{section}", text="")

        def draw(self, context: Context) -> None:
            settings = bed_of(context).digiclay
            column = self.layout.column(align=True)
            column.active, column.enabled = in_use(settings, section), not is_edited(context)
            if section in FINGER_PARTS:
                number, settings = find_settings(context)
                if number > 1:
                    column.label(text=localize("Fingertip {}", number))
            group = part_group(settings, section)
            quantities = list_quantities(
                import_parameters(section, method_of(bed_of(context).digiclay))
            )
            for name in (
                WHOLE + name if quantity.whole else name for name, quantity in quantities.items()
            ):
                row = column.row(align=True)
                # A number's label stands in its field: beside it the sidebar would cut off the
                # unit.
                row.use_property_split = group.bl_rna.properties[name].type in BESIDE
                row.use_property_decorate = False
                row.prop(group, name)

    Section.__name__ = Section.__qualname__ = Section.bl_idname
    return Section


def in_use(settings: PropertyGroup, section: str) -> bool:
    """Return whether a part is simulated: neither it nor the one it belongs to is switched off."""
    needed = NEEDS.get(section)
    switches = [name for name in (section, needed) if name in OPTIONAL]
    return all(getattr(settings, f"use_{name}") for name in switches)


#: Parts that the panel Device shows: those before sensors and control, but the fingertip.
PARTS = [part for part in SECTIONS[: SECTIONS.index("sensors")] if part != "fingertip"]
CLASSES = (
    presets,
    start,
    section_panel("fingertip", LABORATORY, 1),
    device,
    *(section_panel(section, device.bl_idname, order) for order, section in enumerate(PARTS)),
    control,
    section_panel("control", control.bl_idname, 0, words="Gains and Thresholds"),
    section_panel("blister", control.bl_idname, 1),
    section_panel("sensors", control.bl_idname, 2),
    section_panel("simulation", control.bl_idname, 3, words="Time Steps"),
    section_panel("recorder", control.bl_idname, 4),
)
