"""Which session an operator is about."""

from __future__ import annotations

from typing import Any

from ..device.view import bed_of
from ..live import running, waiting
from ..live.running import Running

__all__ = ["session_of"]


def session_of(context: Any) -> tuple[Any, Running] | None:
    """Return the bed that is active, or the only one that runs, and its session; None without."""
    bed = bed_of(context)
    session = running.of(bed)
    if session is None and bed is None and len(running.all()) == 1:
        (session,) = running.all()
        bed = waiting.found(session.uid, session.name)
    return (bed, session) if bed is not None and session is not None else None
