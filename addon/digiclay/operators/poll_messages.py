"""Reasons for disabled operators: each function returns a message, or an empty text.

An operator lists its own as `needs`; Blender shows the message of the first that is not met. Those about a
bed come after `no_bed`.
"""

from __future__ import annotations

from typing import Any

from .. import bridge, preferences
from ..compat import bpy
from ..device import form
from ..exchange import formed_bed
from ..live import bed_state, follow, loop
from ..live.beds import active_session, blocking_reason
from ..press import brush
from ..recorded import takes
from ..recorded.bake import is_baked
from ..roles import bed_of, fingertip_of, is_bed, is_edited
from ..sessions import running
from ..settings import own_presets
from ..ui_text import localize


def no_bed(context: Any, message: str = "Select a bed or its fingertip first") -> str:
    """No part of a bed is active."""
    return "" if bed_of(context) is not None else message


def session_runs(context: Any, message: str = "Stop the session first") -> str:
    """A session runs on the bed."""
    return message if running.find(bed_of(context)) is not None else ""


def edited(context: Any, message: str = "Go back to Object Mode first") -> str:
    """The active object, or the bed it belongs to, is being edited, painted or posed."""
    return message if is_edited(context) else ""


def inside_edit(context: Any) -> str:
    """A new bed is an object: it cannot be added inside another object's edit mode."""
    return edited(context, "Leave Edit Mode first: the device is an object of its own")


def in_object_mode(context: Any) -> str:
    """No other mode is to be left."""
    return "" if context.mode != "OBJECT" else "This is Object Mode already"


def linked(context: Any) -> str:
    """The bed is another file's."""
    bed = bed_of(context)
    local = bed.library is None and bed.data.library is None
    return "" if local else "The bed is linked from another file: make it local first (Object > Relations)"


def baked(
    context: Any, message: str = "The bed plays a baked session: free the bake in the Takes panel first"
) -> str:
    """The bed plays a bake."""
    return message if is_baked(bed_of(context)) else ""


def no_bake(context: Any) -> str:
    """The bed plays no bake."""
    return "" if is_baked(bed_of(context)) else "The bed has no bake"


def no_take(context: Any) -> str:
    """Nothing was recorded with the bed."""
    return "" if takes.list_takes(bed_of(context)) else "The bed has no take: record one in a session first"


def no_surface(context: Any) -> str:
    """There is no bed, or its pins span no surface."""
    few = "A bed needs at least 2 x 2 pins to have a surface"
    return no_bed(context, "Select a bed of Digital Clay, or its fingertip") or (
        few if len(bed_of(context).data.vertices) < 4 else ""
    )


def from_rest(context: Any) -> str:
    """No surface was stored to measure features from."""
    stored = formed_bed.has_reference(bed_of(context))
    return "" if stored else "Features are measured from the bed at rest already"


def no_skin(context: Any) -> str:
    """The bed's geometry nodes have no skin: removed, or of an older file."""
    has = form.can_show_skin(bed_of(context))
    return "" if has else "The bed is of an older file and has no skin: rebuild it in the panel Device"


def no_shape(context: Any) -> str:
    """The bed displays nothing."""
    return "" if bed_of(context).digiclay.use_shape else "The bed has no shape"


def no_own_preset(context: Any) -> str:
    """The bed's parameters are of no preset of the user's own."""
    own = bed_of(context).digiclay.own_preset in own_presets.names()
    return "" if own else "Apply a preset of your own first: those that come along cannot be removed"


def no_own_methods(context: Any) -> str:
    """The preferences do not allow to run own methods."""
    return "" if preferences.get(context).run_own_methods else "Turn on Run Own Methods first"


def no_window(context: Any) -> str:
    """There is no window for a session."""
    in_window = not bpy.app.background and context.window is not None
    return "" if in_window else "A live session needs a window; takes can be baked without"


def no_session(context: Any) -> str:
    """There is no session the operator could be about."""
    return "" if active_session(context) else "No session runs on the active bed: start one first"


def no_undriven(context: Any) -> str:
    """No session waits for an operator that drives it."""
    return "" if running.list_sessions() and context.window is not None else "No session runs"


def driven(context: Any) -> str:
    """An operator drives the sessions, which takes Esc itself; at any other time the key has other uses."""
    return "" if loop.is_aside() else "The session takes the key itself"


def session_waits(context: Any) -> str:
    """There is no session, or its bed cannot be written now."""
    active = active_session(context)
    if active is None:
        return no_session(context)
    bed, session = active
    why = blocking_reason(context, bed, session.system.grid.count)
    return localize("The session waits: {}", why) if why else ""


def no_gesture(context: Any) -> str:
    """The fingertip has formed nothing yet."""
    active = active_session(context)
    formed = active is not None and (active[1].gestures or active[1].strokes)
    return "" if formed else "There is no gesture to take back: the fingertip has not touched since"


def nothing_to_reset(context: Any) -> str:
    """The bed is at rest, or its session waits."""
    if active_session(context) is not None:
        return session_waits(context)
    return no_bed(context) or (
        "The bed is at rest already" if bed_state.read_snapshot(bed_of(context)) is None else ""
    )


def no_server(context: Any) -> str:
    """The session follows no server."""
    active = active_session(context)
    follows = active is not None and follow.find(active[1].uid) is not None
    return "" if follows else "The session follows no server"


def cannot_record(context: Any) -> str:
    """No session runs on the bed, or it records already."""
    session = running.find(bed_of(context))
    if session is None:
        return "Start a session first"
    return "A take is being recorded already" if session.recording is not None else ""


def no_recording(context: Any) -> str:
    """No session on the bed records."""
    session = running.find(bed_of(context))
    return "" if session is not None and session.recording is not None else "Record a take first"


def no_place(context: Any) -> str:
    """The mouse is in no 3D view in Object Mode, or there is no bed in it."""
    if context.area is None or context.area.type != "VIEW_3D" or context.mode != "OBJECT":
        return "Pins are pressed in a 3D view, in Object Mode"
    seen = any(map(is_bed, context.visible_objects))
    return "" if seen else "Add a bed first: Add > Mesh > Digital Clay"


def no_tool(context: Any) -> str:
    """Another tool is in use."""
    return "" if brush.tool_settings(context) is not None else "Select the Press tool"


def no_tool_in_view(context: Any) -> str:
    """There is no view with the Press tool."""
    in_view = context.area is not None and context.area.type == "VIEW_3D"
    return "" if in_view and not no_tool(context) else "Select the Press tool in a 3D view"


def no_finger(context: Any) -> str:
    """There is no bed whose fingertip could be scaled."""
    bed = brush.bed_in_use(context)
    if bed is None or fingertip_of(bed) is None:
        return "Select a bed of Digital Clay, or its fingertip"
    if bed.library is not None:
        return "The bed is linked from another file: make it local first"
    return bridge.find_scale_fault(bed)
