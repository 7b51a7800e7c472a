"""Brush presets of the Press tool, by Blender's own presets: their folder, and the fingertip in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.model.fingertip import Fingertip
from ..settings import finger_size
from . import brush

#: Folder of the presets below ``presets``, here and in the user's own folder.
SUBFOLDER = "digiclay_press"
#: Names that the lines of a preset begin with.
DEFINES = (
    "wm = bpy.context.window_manager",
    'settings = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties('
    f'"{brush.OPERATOR}")',
)
#: Folder with a folder ``presets``.
HOME = str(Path(__file__).parents[1])


def preset_values(settings: Any) -> list[str]:
    """Return what a preset keeps: the form of the fingertip, and every setting of the tool."""
    names = [rna.identifier for rna in settings.bl_rna.properties if rna.identifier != "rna_type"]
    return ["wm.digiclay_finger", *(f"settings.{name}" for name in names)]


def register() -> None:
    """Let Blender find the presets that come along, and presets the fingertip."""
    bpy.types.WindowManager.digiclay_finger = bpy.props.FloatVectorProperty(
        name="Fingertip (mm)",
        description="Length, width and height of the fingertip that the Press tool is about, in mm",
        size=3,
        get=lambda _: _read_finger(),
        set=lambda _, axes: _take_finger(axes),
    )
    bpy.utils.register_preset_path(HOME)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_preset_path(HOME)
    del bpy.types.WindowManager.digiclay_finger


def _read_finger() -> tuple[float, float, float]:
    """Return the fingertip's length, width and height, mm; that of a new bed without one."""
    bed = brush.bed_in_use(bpy.context)
    finger = Fingertip() if bed is None else finger_size.read_finger(bed.digiclay)
    return 2e3 * finger.length, 2e3 * finger.width, 2e3 * finger.height


def _take_finger(axes: Any) -> None:
    """Give the fingertip a length, width and height, mm."""
    bed = brush.bed_in_use(bpy.context)
    if bed is not None and bed.library is None:
        length, width, height = (round(5e-4 * float(axis), 9) for axis in axes)
        finger_size.resize(bed.digiclay, Fingertip(length, width, height))
