"""Operators and menus.

No module here postpones its annotations: Blender reads an operator's properties from them.
"""

from __future__ import annotations

from ..compat import bpy
from . import (
    add_bed,
    bake_session,
    export_mesh,
    find_features,
    follow_server,
    import_run,
    make_mesh,
    open_scene,
    pick_pins,
    play_strokes,
    presets,
    press_adjust,
    press_finger,
    press_presets,
    press_shape,
    press_stroke,
    reload_methods,
    session_actions,
    session_loop,
    session_start,
    shape_in,
    shape_keep,
    take_actions,
    take_replay,
    toggle_skin,
)

CLASSES: tuple[type, ...] = (
    add_bed.AddBed,
    import_run.ImportRun,
    presets.ApplyPreset,
    presets.SavePreset,
    presets.RemovePreset,
    add_bed.Rebuild,
    toggle_skin.ToggleSkin,
    pick_pins.PickPins,
    pick_pins.ClearPins,
    press_stroke.Press,
    press_shape.PressShape,
    press_shape.PressLine,
    press_adjust.AdjustSize,
    press_adjust.AdjustDepth,
    press_adjust.AdjustStrength,
    press_adjust.ScaleSize,
    press_finger.TakeFinger,
    press_finger.FingerMenu,
    press_presets.ApplyBrush,
    press_presets.BrushMenu,
    press_presets.SaveBrush,
    export_mesh.ExportMesh,
    export_mesh.ExportMenu,
    make_mesh.MakeMesh,
    find_features.FindFeatures,
    find_features.KeepSurface,
    find_features.ForgetSurface,
    session_start.LeaveMode,
    session_start.Session,
    session_loop.GoOn,
    session_loop.Escape,
    session_actions.StopSession,
    session_actions.PauseSession,
    session_actions.StepSession,
    session_actions.RewindSession,
    session_actions.ResetSession,
    follow_server.FollowServer,
    follow_server.LeaveServer,
    shape_in.ShapeFromObject,
    shape_in.ShapeFromFile,
    shape_in.ShapeSample,
    shape_keep.KeepShape,
    shape_keep.RemoveShape,
    open_scene.OpenScene,
    open_scene.AddSample,
    open_scene.SessionSamples,
    open_scene.ShapeSamples,
    open_scene.Samples,
    open_scene.SceneFiles,
    take_actions.RecordTake,
    take_actions.KeepTake,
    take_replay.ReplayTake,
    take_actions.ExportTake,
    take_actions.RemoveTake,
    play_strokes.PlayStrokes,
    bake_session.Bake,
    bake_session.FreeBake,
    reload_methods.ReloadMethods,
)
#: Entries in Blender's own menus: the menu, and the function that draws the entry.
MENUS = (
    ("VIEW3D_MT_mesh_add", add_bed.entry),
    ("TOPBAR_MT_file_import", import_run.entry),
    ("TOPBAR_MT_file_export", export_mesh.entry),
    ("VIEW3D_MT_editor_menus", session_start.leave_entry),
    *open_scene.MENUS,
)


def register() -> None:
    """Register the operators and hang them into Blender's menus."""
    for operator in CLASSES:
        bpy.utils.register_class(operator)
    for menu, entry in MENUS:
        getattr(bpy.types, menu).append(entry)


def unregister() -> None:
    """Undo `register` in the opposite order."""
    for menu, entry in reversed(MENUS):
        getattr(bpy.types, menu).remove(entry)
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
