"""Why an operator cannot run now: each reason is a function of the context that gives words, or none: "".

A poll is given its reasons joined by ``or``, so that it says the first that holds and asks no further.
"""

from __future__ import annotations

from typing import Any

from ..device.view import bed_of
from ..live import running, waiting
from ..recorded import takes
from ..recorded.bake import is_baked
from .session_context import session_of

__all__ = [
    "allowed", "baked", "edited", "linked", "no_bed", "no_session", "no_surface", "no_take", "session_runs",
    "session_waits",
]  # fmt: skip


def allowed(operator: Any, why: str) -> bool:
    """Answer a poll: without a reason against it the operator can run, else Blender shows the reason."""
    if why:
        operator.poll_message_set(why)
    return not why


def no_bed(context: Any, words: str = "Select a bed or its fingertip first") -> str:
    """No part of a bed is active; `linked`, `baked` and `no_take` are to be asked after this."""
    return "" if bed_of(context) is not None else words


def session_runs(context: Any, words: str = "Stop the session first") -> str:
    """A session runs on the bed."""
    return words if running.of(bed_of(context)) is not None else ""


def edited(context: Any, words: str = "Go back to Object Mode first") -> str:
    """The active object, or the bed it belongs to, is being edited, painted or posed."""
    bed = bed_of(context)
    return "" if context.mode == "OBJECT" and (bed is None or bed.mode == "OBJECT") else words


def linked(context: Any) -> str:
    """The bed is another file's."""
    bed = bed_of(context)
    own = bed.library is None and bed.data.library is None
    return "" if own else "The bed is linked from another file: make it local first (Object > Relations)"


def baked(
    context: Any, words: str = "The bed plays a baked session: free the bake in the Takes panel first"
) -> str:
    """The bed plays a bake."""
    return words if is_baked(bed_of(context)) else ""


def no_take(context: Any) -> str:
    """Nothing was recorded with the bed."""
    return "" if takes.entries(bed_of(context)) else "The bed has no take: record one in a session first"


def no_surface(context: Any) -> str:
    """There is no bed, or its pins span no surface."""
    few = "A bed needs at least 2 x 2 pins to have a surface"
    return no_bed(context, "Select a bed of Digital Clay, or its fingertip") or (
        few if len(bed_of(context).data.vertices) < 4 else ""
    )


def no_session(context: Any) -> str:
    """There is no session the operator could be about."""
    return "" if session_of(context) else "No session runs on the active bed: start one first"


def session_waits(context: Any) -> str:
    """There is no session, or its bed cannot be written now."""
    active = session_of(context)
    if active is None:
        return no_session(context)
    bed, session = active
    why = waiting.obstacle(context, bed, session.system.grid.count)
    return f"The session waits: {why}" if why else ""
