"""Panel Session: start and stop, and how the session fares."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import bed_state, running
from ..live.running import Running
from ..overlay.sections import error_words
from .base import Panel, bed_of, lines

__all__ = ["CLASSES", "Session"]


class Session(Panel, bpy.types.Panel):  # type: ignore[misc]
    """Sculpting live."""

    bl_idname = "DIGICLAY_PT_session"
    bl_label = "Session"
    bl_order = 40

    def draw(self, context: Any) -> None:
        """Draw what can be done, and how it goes."""
        bed = bed_of(context)
        session, column = running.of(bed), self.layout.column(align=True)
        if session is None:
            kept = bed_state.kept(bed) is not None
            words = "Go On Sculpting" if kept else "Start Sculpting"
            row = column.row(align=True)
            row.scale_y = 1.4
            row.operator("digiclay.session", text=words, icon="PLAY")
            column.operator("digiclay.session_reset", icon="LOOP_BACK")
        else:
            _buttons(column, session)
            _numbers(self.layout, session)
        said = session.waits and f"Waits: {session.waits}" if session else running.said()
        if said:
            lines(self.layout, said, "ERROR" if session else "INFO")


def _buttons(column: Any, session: Running) -> None:
    """Draw the buttons of a session."""
    row = column.row(align=True)
    row.scale_y = 1.4
    pause = ("Resume", "PLAY") if session.paused else ("Pause", "PAUSE")
    row.operator("digiclay.session_pause", text=pause[0], icon=pause[1])
    row.operator("digiclay.session_stop", text="Stop", icon="SNAP_FACE")
    row = column.row(align=True)
    row.operator("digiclay.session_step", icon="FRAME_NEXT")
    row.operator("digiclay.session_reset", icon="LOOP_BACK")
    count = len(session.gestures)
    words = f"Take Back a Gesture ({count})" if count else "Take Back a Gesture"
    column.operator("digiclay.session_rewind", text=words, icon="REW")


def _numbers(layout: Any, session: Running) -> None:
    """Draw how a session fares."""
    column = layout.column(align=True)
    period = session.system.period
    column.label(text=f"Simulated: {session.state.period * period:.1f} s")
    if session.paused:
        column.label(text="Paused", icon="PAUSE")
    elif session.factor:
        slow = session.factor < 0.9
        words = f"Speed: {session.factor:.2f} × real time"
        column.label(text=words, icon="ERROR" if slow else "NONE")
    column.label(text=error_line(session))
    if session.path is not None:
        column.label(text=f"Recording: {(len(session.path) - 1) * period:.1f} s", icon="REC")


def error_line(session: Running) -> str:
    """Return what is said of a session's error, here as in the overlay."""
    errors = session.errors
    return error_words(errors and (errors.height, errors.force))


CLASSES = (Session,)
