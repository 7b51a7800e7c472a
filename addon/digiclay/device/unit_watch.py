"""Watch of beds and fingertips: after objects are added, deleted, hidden or restored by undo.

What is put right makes an undo step of its own, behind that of what the user did. Undo and redo go past the
step between the two, in which a part is missing or left over: to the user it is one step. Without a window
nothing is looked after: there is nobody who copies and deletes by hand, and no loop that timers run in.
"""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from . import unit

#: Time until it is looked again whether whoever is at work has done, s.
AGAIN = 0.1
#: Operators with one of these push an undo step when they are done; until then nothing is to be changed.
STEPS = {"UNDO", "UNDO_GROUPED", "MACRO"}

#: Most times it is looked whether what was put right has left something over: a fingertip that only a copy's
#: bed still held, and its ellipsoid.
PASSES = 3

#: Uids of the objects that are known, None before the first look; what came last, undo or redo; and whether
#: there is anything to look at.
_KNOWN: list[frozenset[int] | None] = [None]
_CAME, _PENDING = [""], [False]
#: Uids of what had come with something missing, or where it does not belong.
_MENDED: set[int] = set()


def settle() -> None:
    """Look until nothing has come since."""
    while _PENDING[0]:
        _PENDING[0] = False
        repair_beds()


def repair_beds() -> None:
    """Put right what is missing or left over; after undo or redo, go on past a step with such."""
    came, _CAME[0] = _CAME[0], ""
    if _KNOWN[0] is not None:
        # In a step that undo has come back to, what was put right since is as it had come.
        found = unit.find_faults(_KNOWN[0], frozenset(_MENDED) if came else frozenset())
        if any(found):
            if came and _repeat_step(came):
                return
            _repair(found)
            bpy.ops.ed.undo_push(message="Complete Beds")
    _KNOWN[0] = unit.mark_parts()
    unit.follow_visibility()
    unit.follow_selection()


def _repair(found: unit.Faults) -> None:
    """Put right what was found, and what that has left over."""
    for _ in range(PASSES):
        _MENDED.update(thing.session_uid for thing in (*found.bare, *found.strewn))
        unit.repair(found)
        found = unit.find_faults(unit.mark_parts())
        if not any(found):
            return


def _repeat_step(came: str) -> bool:
    """Undo or redo one more step; return whether there was one."""
    operator = getattr(bpy.ops.ed, came)
    if operator.poll():
        operator()
    return bool(_CAME[0])


@bpy.app.handlers.persistent
def note_change(scene: Any, graph: Any = None) -> None:
    """Look soon: objects, or what is shown of them, may have come or gone.

    `scene` bpy.types.Scene; `graph` bpy.types.Depsgraph, optional.
    """
    if graph is None or graph.id_type_updated("SCENE"):
        _repair_soon()


@bpy.app.handlers.persistent
def note_undo(*_: Any) -> None:
    """Look soon at what undo has come to."""
    _CAME[0] = "undo"
    _repair_soon()


@bpy.app.handlers.persistent
def note_redo(*_: Any) -> None:
    """Look soon at what redo has come to."""
    _CAME[0] = "redo"
    _repair_soon()


@bpy.app.handlers.persistent
def note_load(*_: Any) -> None:
    """Look soon at what another file has: it stays as it is."""
    _KNOWN[0], _CAME[0] = None, ""
    _MENDED.clear()
    _repair_soon()


def _repair_soon() -> None:
    """Have a look when Blender is done with what it does now."""
    _PENDING[0] = True
    if not bpy.app.background and not bpy.app.timers.is_registered(_repair_when_idle):
        bpy.app.timers.register(_repair_when_idle)


def _repair_when_idle() -> float | None:
    """Look, unless somebody is at work."""
    windows = bpy.context.window_manager.windows
    if not windows:
        return None
    if _is_busy(windows):
        return AGAIN
    with bpy.context.temp_override(window=windows[0]):
        settle()
    return None


def _is_busy(windows: Any) -> bool:
    """Return whether an operator is under way that changes data, or something is edited, or rendered."""
    every = (operator for window in windows for operator in window.modal_operators)
    active = (window.view_layer.objects.active for window in windows)
    return (
        any(operator.bl_options & STEPS for operator in every)
        or any(thing is not None and thing.mode != "OBJECT" for thing in active)
        or bpy.app.is_job_running("RENDER")
    )


def _pairs() -> list[tuple[Any, Any]]:
    """Return Blender's lists of handlers with what belongs into them."""
    lists = bpy.app.handlers
    return [
        (lists.depsgraph_update_post, note_change),
        (lists.undo_post, note_undo),
        (lists.redo_post, note_redo),
        (lists.load_post, note_load),
    ]


def watch() -> None:
    """Have the handlers called from now on; what is there already is taken as it is."""
    for handler, function in _pairs():
        handler.append(function)
    note_load()


def register() -> None:
    """Begin to look after beds."""
    if not bpy.app.background:
        watch()


def unregister() -> None:
    """Undo `register`."""
    if bpy.app.timers.is_registered(_repair_when_idle):
        bpy.app.timers.unregister(_repair_when_idle)
    for handler, function in _pairs():
        if function in handler:
            handler.remove(function)
    _KNOWN[0], _CAME[0], _PENDING[0] = None, "", False
