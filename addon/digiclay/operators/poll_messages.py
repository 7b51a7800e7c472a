"""Reasons for disabled operators: each function returns a message, or an empty text.

`Action.poll_message` joins them by ``or``, so that Blender shows the first that holds.
"""

from __future__ import annotations

from typing import Any

from ..device import form
from ..device.view import bed_of, is_edited
from ..live import running
from ..live.waiting import active_session, blocking_reason
from ..recorded import takes
from ..recorded.bake import is_baked
from ..ui_text import localize


def no_bed(context: Any, message: str = "Select a bed or its fingertip first") -> str:
    """No part of a bed is active; `linked`, `baked` and `no_take` are to be asked after this."""
    return "" if bed_of(context) is not None else message


def session_runs(context: Any, message: str = "Stop the session first") -> str:
    """A session runs on the bed."""
    return message if running.find(bed_of(context)) is not None else ""


def edited(context: Any, message: str = "Go back to Object Mode first") -> str:
    """The active object, or the bed it belongs to, is being edited, painted or posed."""
    return message if is_edited(context) else ""


def linked(context: Any) -> str:
    """The bed is another file's."""
    bed = bed_of(context)
    own = bed.library is None and bed.data.library is None
    return "" if own else "The bed is linked from another file: make it local first (Object > Relations)"


def baked(
    context: Any, message: str = "The bed plays a baked session: free the bake in the Takes panel first"
) -> str:
    """The bed plays a bake."""
    return message if is_baked(bed_of(context)) else ""


def no_take(context: Any) -> str:
    """Nothing was recorded with the bed."""
    return "" if takes.list_takes(bed_of(context)) else "The bed has no take: record one in a session first"


def no_surface(context: Any) -> str:
    """There is no bed, or its pins span no surface."""
    few = "A bed needs at least 2 x 2 pins to have a surface"
    return no_bed(context, "Select a bed of Digital Clay, or its fingertip") or (
        few if len(bed_of(context).data.vertices) < 4 else ""
    )


def no_skin(context: Any) -> str:
    """The bed's geometry nodes have no skin: removed, or of an older file."""
    has = form.can_show_skin(bed_of(context))
    return "" if has else "The bed is of an older file and has no skin: rebuild it in the panel Device"


def no_session(context: Any) -> str:
    """There is no session the operator could be about."""
    return "" if active_session(context) else "No session runs on the active bed: start one first"


def session_waits(context: Any) -> str:
    """There is no session, or its bed cannot be written now."""
    active = active_session(context)
    if active is None:
        return no_session(context)
    bed, session = active
    why = blocking_reason(context, bed, session.system.grid.count)
    return localize("The session waits: {}", why) if why else ""
