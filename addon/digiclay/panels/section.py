"""Sub-panels with the parameters of one part each, made from the parts' declarations."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..core.methods import METHODS
from ..core.quantity import quantities
from ..core.scene import NEEDS, OPTIONAL, parameters
from ..settings.declared import title
from ..settings.properties import part_group
from .base import Panel, bed_of

__all__ = ["section_panel"]

#: Kinds of properties whose label stands beside the field.
BESIDE = {"ENUM", "STRING"}


def section_panel(section: str, parent: str, order: int, words: str = "") -> type:
    """Make the sub-panel of a part.

    Parameters
    ----------
    section : str
        Of `core.scene.SECTIONS`. A part a scene may leave out has a switch in the header.
    parent : str
        `bl_idname` of the panel it stands in.
    order : int
        Place among the others.
    words : str, optional
        Its heading, where that is not the section's name.
    """

    class Section(Panel, bpy.types.Panel):  # type: ignore[misc]
        bl_idname = f"DIGICLAY_PT_part_{section}"
        bl_label = words or title(section)
        bl_parent_id = parent
        bl_order = order
        bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

        @classmethod
        def poll(cls, context: Any) -> bool:
            """Show a blister only where the method forms one."""
            bed = bed_of(context)
            return bed is not None and (
                section != "blister" or METHODS[bed.digiclay.method].blister is not None
            )

        def draw_header(self, context: Any) -> None:
            if section in OPTIONAL:
                self.layout.prop(bed_of(context).digiclay, f"use_{section}", text="")

        def draw(self, context: Any) -> None:
            settings = bed_of(context).digiclay
            column = self.layout.column(align=True)
            column.active = in_use(settings, section)
            group = part_group(settings, section)
            for name in quantities(parameters(section, settings.method)):
                place = column.row(align=True)
                # A number's label stands in its field: beside it the sidebar would cut off the unit.
                place.use_property_split = group.bl_rna.properties[name].type in BESIDE
                place.use_property_decorate = False
                place.prop(group, name)

    Section.__name__ = Section.__qualname__ = Section.bl_idname
    return Section


def in_use(settings: Any, section: str) -> bool:
    """Tell whether a part is simulated: neither it nor the one it belongs to is switched off."""
    needed = NEEDS.get(section)
    switches = [name for name in (section, needed) if name in OPTIONAL]
    return all(getattr(settings, f"use_{name}") for name in switches)
