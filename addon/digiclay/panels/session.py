"""Panels Session, Takes and Laboratory: start and stop, recordings, speed and error."""

from ..compat import Context, UILayout
from ..live import beds, follow
from ..overlay.sections import correction_message, effort_message, error_message
from ..recorded import bake, takes
from ..roles import bed_of, list_pressers
from ..sessions import running
from ..sessions.running import Running
from ..settings.groups import PRESSER_FIELDS
from ..ui_text import localize
from .base import LABORATORY, SESSION, Sidebar, draw_lines, draw_property, panel


@panel(SESSION, "Session", 10, closed=False)
def session_panel(sidebar: Sidebar, context: Context) -> None:
    """Live sculpting."""
    bed = bed_of(context)
    session, column = running.find(bed), sidebar.layout.column(align=True)
    if session is None:
        has_state = beds.read_snapshot(bed) is not None
        words = "Go On Sculpting" if has_state else "Start Sculpting"
        row = column.row(align=True)
        row.scale_y = 1.4
        row.operator("digiclay.session", text=words, icon="PLAY")
        column.operator("digiclay.session_reset", icon="LOOP_BACK")
    else:
        if context.mode != "OBJECT":
            row = column.row()
            row.scale_y = 1.4
            row.operator("digiclay.leave_mode", icon="LOOP_BACK")
        _buttons(column, session)
        if session.recording is not None:
            column.label(
                text=localize("Recording: {:.1f} s", _measure_recording(session)), icon="REC"
            )
    row = sidebar.layout.row(align=True)
    row.operator("digiclay.add_fingertip", icon="ADD")
    row.operator_menu_enum("digiclay.add_hand", "side", icon="VIEW_PAN")
    words = (
        session.blocking_reason and localize("Waits: {}", session.blocking_reason)
        if session
        else running.last_message(bed)
    )
    if words:
        draw_lines(sidebar.layout, words, "ERROR" if session else "INFO")


def _buttons(column: UILayout, session: Running) -> None:
    """Draw the buttons of a session."""
    row = column.row(align=True)
    row.scale_y = 1.4
    pause = ("Resume", "PLAY") if session.paused else ("Pause", "PAUSE")
    row.operator("digiclay.session_pause", text=pause[0], icon=pause[1])
    row.operator("digiclay.session_stop", text="Stop", icon="SNAP_FACE")
    column.operator("digiclay.finish_strokes", icon="FF")
    column.operator("digiclay.session_reset", icon="LOOP_BACK")
    count = len(session.gestures)
    words = localize("Take Back a Gesture ({})", count) if count else "Take Back a Gesture"
    column.operator("digiclay.session_rewind", text=words, icon="REW")


def _numbers(layout: UILayout, session: Running) -> None:
    """Draw how a session fares."""
    column = layout.column(align=True)
    period = session.system.period
    column.label(text=localize("Simulated: {:.1f} s", session.state.period * period))
    if session.paused:
        column.label(text="Paused", icon="PAUSE")
    elif factor := session.clock.factor:  # 0 while the session waits
        words = localize("Speed: {:.2f} × real time", factor)
        column.label(text=words, icon="ERROR" if factor < 0.9 else "NONE")
    draw_lines(column, error_line(session), "NONE")
    draw_lines(column, correction_message(session.correction), "NONE")


def _measure_recording(session: Running) -> float:
    """Return the length of what a session has recorded, s."""
    return (len(session.recording.path) - 1) * session.system.period if session.recording else 0.0


def error_line(session: Running) -> str:
    """Return the text of a session's error, as in the overlay."""
    errors = session.errors
    return error_message((errors.height, errors.force) if errors else None)


@panel(LABORATORY, "Laboratory", 40)
def laboratory(sidebar: Sidebar, context: Context) -> None:
    """Single steps, speed and error of a session, and the server that it follows."""
    session, column = running.find(bed_of(context)), sidebar.layout.column(align=True)
    column.operator("digiclay.session_step", icon="FRAME_NEXT")
    following = session and follow.find(session.uid)
    if following:
        column.operator("digiclay.leave_server", icon="UNLINKED")
        words = localize("Follows {}", following.address)
        column.label(text=words, icon="ERROR" if following.silent else "LINKED")
    else:
        column.operator("digiclay.follow_server", icon="LINKED")
    if session is not None:
        _numbers(sidebar.layout, session)


@panel("DIGICLAY_PT_takes", "Takes", 1, parent=SESSION)
def takes_panel(sidebar: Sidebar, context: Context) -> None:
    """Takes of the bed, and its bake."""
    layout, bed = sidebar.layout, bed_of(context)
    session = running.find(bed)
    if session is not None and session.recording is not None:
        words = localize("Keep Take ({:.1f} s)", _measure_recording(session))
        layout.operator("digiclay.take_keep", text=words, icon="CHECKMARK")
    else:
        layout.operator("digiclay.take_record", icon="RECORD_ON")
    for entry in takes.list_takes(bed):
        row = layout.row(align=True)
        row.label(text=f"{entry.name} ({entry.seconds:.1f} s)", icon="TRACKING")
        row.operator("digiclay.take_replay", text="", icon="PLAY").take = entry.number
        baking = row.operator("digiclay.bake", text="", icon="RENDER_ANIMATION")
        baking.source, baking.take = "TAKE", entry.number
        row.operator("digiclay.take_export", text="", icon="EXPORT").take = entry.number
        row.operator("export_anim.digital_clay", text="", icon="MESH_GRID").take = entry.number
        row.operator("digiclay.take_remove", text="", icon="X").take = entry.number
        draw_lines(layout, effort_message(entry.effort), "NONE")
    layout.operator("digiclay.play_strokes", icon="CURVE_PATH")
    layout.separator()
    if bake.is_baked(bed):
        layout.operator("digiclay.bake_free", icon="TRASH")
    else:
        layout.operator("digiclay.bake", text="Bake Animated Fingertip").source = "FINGERTIP"


@panel("DIGICLAY_PT_pressers", "Pressers", 2, parent=SESSION)
def pressers_panel(sidebar: Sidebar, context: Context) -> None:
    """Meshes that press the bed, and the contact of the active one."""
    layout = sidebar.layout
    layout.operator("digiclay.add_presser", icon="ADD")
    for presser in list_pressers(bed_of(context)):
        row = layout.row(align=True)
        row.label(text=presser.name, icon="MESH_DATA", translate=False)
        row.operator("digiclay.remove_presser", text="", icon="X").presser = presser.name
        if presser == context.object:
            column = layout.column(align=True)
            for name in PRESSER_FIELDS:
                draw_property(column, presser.digiclay.presser, name)


CLASSES = (session_panel, takes_panel, pressers_panel, laboratory)
