"""Common parts of the panels: location and bed."""

import re
import textwrap
from collections.abc import Callable
from typing import Any

from ..compat import Context, Menu, UILayout, bpy, bpy_struct
from ..roles import bed_of

CATEGORY = "Digital Clay"
#: The panels that others are sub-panels of.
SESSION, EXPORT, LABORATORY = "DIGICLAY_PT_session", "DIGICLAY_PT_export", "DIGICLAY_PT_laboratory"
#: What Blender calls a panel of ours with when it draws it.
Sidebar = bpy.types.Panel
#: Letters a line of the sidebar holds at its usual width.
LINE = 36


class Panel:
    """Mixin of a sub-panel in the 3D view's sidebar, shown while a part of a bed is active, or while none is.

    A panel derives from this and from `bpy.types.Panel`, has a `bl_label`, a `bl_idname` that
    starts with ``DIGICLAY_PT_`` and a `bl_order`, and draws only: it never changes anything.
    """

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY
    with_bed = True

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Show the panel when there is a bed it can be about, or one of none when there is none."""
        return (bed_of(context) is not None) == cls.with_bed


def declare(
    bases: tuple[type, ...], method: str, idname: str, label: str, **entries: Menu
) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that makes a class for Blender of its one method, the docstring included."""

    def make(function: Callable[..., Any]) -> Any:
        attributes = {
            "bl_idname": idname,
            "bl_label": label,
            method: function,
            "__doc__": function.__doc__,
        }
        return type(
            function.__name__, bases, attributes | {"__module__": function.__module__} | entries
        )

    return make


def panel(
    idname: str,
    label: str,
    order: int,
    *,
    parent: str = "",
    closed: bool = True,
    with_bed: bool = True,
) -> Callable[[Callable[[Sidebar, Context], None]], Any]:
    """Return a decorator that makes a panel of its `draw`, a sub-panel of `parent` if that is given."""

    return declare(
        (Panel, bpy.types.Panel),
        "draw",
        idname,
        label,
        bl_order=order,
        bl_parent_id=parent,
        bl_options={"DEFAULT_CLOSED"} if closed else set(),
        with_bed=with_bed,
    )


def menu(idname: str, label: str) -> Callable[[Callable[[Menu, Context], None]], Any]:
    """Return a decorator that makes a menu of its `draw`."""
    return declare((bpy.types.Menu,), "draw", idname, label)


def draw_lines(layout: UILayout, words: str, icon: str) -> None:
    """Draw words on as many lines as they need."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    whole = re.sub(r"(?<=\d) (?=\w)", "\u00a0", words)  # a number and its unit share a line
    for number, line in enumerate(textwrap.wrap(whole, LINE)):
        column.label(text=line, icon=icon if number == 0 else "BLANK1")


def draw_property(
    layout: UILayout, owner: bpy_struct, name: str, active: bool = True, expand: bool = False
) -> None:
    """Draw a property in a row of its own; a number's label in its field: beside it the unit is cut off."""
    row = layout.row(align=True)
    row.active = active
    if owner.bl_rna.properties[name].type in {"FLOAT", "INT"}:
        row.use_property_split = False
    row.prop(owner, name, expand=expand)
