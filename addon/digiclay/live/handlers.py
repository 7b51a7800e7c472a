"""Blender's handlers for live sessions: undo, redo, save, load, and removal of the extension.

The handlers are there only while a session runs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..compat import bpy
from ..overlay import views
from . import keys, loop, recovery, running, tick
from .running import Running
from .stroke_queue import drop_strokes

__all__ = ["STOPPED", "abandoned", "end", "end_all", "register", "unregister", "watch"]

#: Ticks until the state undo has put into a bed is taken up, that one included.
STALE = 2
#: What is told of a session the user has ended.
STOPPED = "was stopped; the bed keeps its state"


@bpy.app.handlers.persistent
def take_up(*_: Any) -> None:
    """Have every session take up, two ticks later, what undo or redo has put into its bed."""
    for session in running.all():
        running.put(replace(drop_strokes(session), stale=STALE))


@bpy.app.handlers.persistent
def saving(*_: Any) -> None:
    """Have the file that is about to be saved hold what is being recorded."""
    recovery.lend()


@bpy.app.handlers.persistent
def saved(path: str, *_: Any) -> None:
    """Go on recording after the file was saved."""
    recovery.take_back(path)


@bpy.app.handlers.persistent
def not_saved(*_: Any) -> None:
    """Go on recording after the file could not be saved."""
    recovery.take_back()


@bpy.app.handlers.persistent
def leave(*_: Any) -> None:
    """End all sessions: the file they are of is about to be closed."""
    abandoned("ended: another file was loaded")


def watch() -> None:
    """Have the handlers called from now on."""
    for handler, function in _pairs():
        if function not in handler:
            handler.append(function)


def end(how: str, *sessions: Running) -> None:
    """End sessions at once; their beds keep the states of the last tick, and takes of what was recorded.

    Parameters
    ----------
    how : str
        What is told of them, after their names.
    *sessions : Running
        All that run if none is given. The last one takes loop and handlers along.
    """
    recovery.take_back()
    sessions = sessions or running.all()
    words = [f"The session of {', '.join(session.name for session in sessions)} {how}"]
    words += filter(None, [tick.stop(session.uid) for session in sessions])
    if sessions:
        running.say(". ".join(words))
    if not running.all():
        loop.end()
        unwatch()
    views.follow()


def end_all(how: str) -> None:
    """End all sessions; one undo step holds what they came to."""
    some = bool(running.all())
    end(how)
    if some:
        bpy.ops.ed.undo_push(message="Stop Session")


def abandoned(how: str) -> None:
    """End all sessions since their file goes away; what it does not have of a recording can be recovered."""
    unsaved = recovery.unsaved()
    end(how)
    if unsaved:
        running.say(f"{running.said()}. {recovery.leave()}")


def unwatch() -> None:
    """Take the handlers back."""
    for handler, function in _pairs():
        if function in handler:
            handler.remove(function)


def _pairs() -> list[tuple[Any, Any]]:
    """Return Blender's lists of handlers with what belongs into them."""
    lists = bpy.app.handlers
    return [
        (lists.undo_post, take_up),
        (lists.redo_post, take_up),
        (lists.save_pre, saving),
        (lists.save_post, saved),
        (lists.save_post_fail, not_saved),
        (lists.load_pre, leave),
    ]


def register() -> None:
    """Register the keys; handlers follow with the first session."""
    keys.register()


def unregister() -> None:
    """End what runs, and take back all that was registered."""
    end_all("ended: the extension was disabled")
    keys.unregister()
