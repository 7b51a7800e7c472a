"""What Blender tells the running sessions: undo, redo, and that another file is loaded.

The handlers are there only while a session runs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..compat import bpy
from ..overlay import views
from . import keys, loop, running

__all__ = ["ended", "register", "unregister", "watch"]

#: Ticks until the state undo has put into a bed is taken up, that one included.
STALE = 2


@bpy.app.handlers.persistent
def take_up(*_: Any) -> None:
    """Have every session take up, two ticks later, what undo or redo has put into its bed."""
    for session in running.all():
        running.put(replace(session, stale=STALE))


@bpy.app.handlers.persistent
def leave(*_: Any) -> None:
    """End all sessions: the file they are of is about to be closed."""
    ended("another file was loaded")


def watch() -> None:
    """Have the handlers called from now on."""
    for handler, function in _pairs():
        if function not in handler:
            handler.append(function)


def ended(why: str) -> None:
    """End all sessions at once, without touching their beds, which keep the states of the last tick."""
    names = ", ".join(session.name for session in running.all())
    for session in running.all():
        running.drop(session.uid)
    if names:
        running.say(f"The session of {names} ended: {why}")
    loop.end()
    unwatch()
    views.follow()


def unwatch() -> None:
    """Take the handlers back."""
    for handler, function in _pairs():
        if function in handler:
            handler.remove(function)


def _pairs() -> list[tuple[Any, Any]]:
    """Return Blender's lists of handlers with what belongs into them."""
    lists = bpy.app.handlers
    return [(lists.undo_post, take_up), (lists.redo_post, take_up), (lists.load_pre, leave)]


def register() -> None:
    """Register the keys; handlers follow with the first session."""
    keys.register()


def unregister() -> None:
    """End what runs, and take back all that was registered."""
    ended("the extension was disabled")
    keys.unregister()
