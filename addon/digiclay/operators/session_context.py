"""Which session an operator is about, and how it says why it declines."""

from __future__ import annotations

from typing import Any

from ..device.view import bed_of
from ..live import running, waiting
from ..live.running import Running

__all__ = ["decline_while_waiting", "decline_without", "session_of"]


def session_of(context: Any) -> tuple[Any, Running] | None:
    """Return the bed that is active, or the only one that runs, and its session; None without."""
    bed = bed_of(context)
    session = running.of(bed)
    if session is None and bed is None and len(running.all()) == 1:
        (session,) = running.all()
        bed = waiting.found(session.uid, session.name)
    return (bed, session) if bed is not None and session is not None else None


def decline_while_waiting(operator: Any, context: Any) -> bool:
    """Tell, for a poll, whether there is a session whose bed can be written; the operator says why if not."""
    if not decline_without(operator, context):
        return False
    bed, session = session_of(context)
    why = waiting.obstacle(context, bed, session.system.grid.count)
    if why:
        operator.poll_message_set(f"The session waits: {why}")
    return not why


def decline_without(operator: Any, context: Any) -> bool:
    """Tell, for a poll, whether there is a session to act on; the operator says why if not."""
    if session_of(context) is not None:
        return True
    operator.poll_message_set("No session runs on the active bed: start one first")
    return False
