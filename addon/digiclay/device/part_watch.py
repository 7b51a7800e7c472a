"""Watch over beds: a timer has them repaired when Blender has copied, deleted or hidden objects."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from ..compat import Depsgraph, Window, bpy, connect, disconnect
from .repair import Faults, find_faults, follow_selection, follow_visibility, mark_parts, repair

#: Time until the next look while an operator is under way, s.
AGAIN = 0.1
#: Operators with one of these push an undo step when they are done; until then nothing is to be
#: changed.
STEPS = {"UNDO", "UNDO_GROUPED", "MACRO"}

#: Maximum number of repair passes: a repair may leave over a fingertip that only a copy's bed still
#: held, and its ellipsoid.
PASSES = 3


@dataclass
class Watch:
    """Memory of what beds have been looked at."""

    #: Uids of the objects seen; None before the first look.
    known: frozenset[int] | None = None
    #: Uids of what had come with something missing, or where it does not belong.
    mended: set[int] = field(default_factory=set)
    #: What came last, "undo" or "redo", or an empty text.
    came: str = ""
    #: Whether there is anything to look at.
    pending: bool = False


_watch = Watch()


def settle() -> None:
    """Look until nothing has come since."""
    while _watch.pending:
        _watch.pending = False
        repair_beds()


def repair_beds() -> None:
    """Put right what is missing or left over; after undo or redo, go on past a step with such."""
    came, _watch.came = _watch.came, ""
    if _watch.known is not None:
        # In a step that undo has come back to, what was put right since is as it had come.
        faults = find_faults(_watch.known, frozenset(_watch.mended) if came else frozenset())
        if any(faults):
            if came and _repeat_step(came):
                return
            _repair(faults)
            bpy.ops.ed.undo_push(message="Complete Beds")
    _watch.known = mark_parts()
    follow_visibility()
    follow_selection()


def _repair(faults: Faults) -> None:
    """Put right what was found, and what that has left over."""
    for _ in range(PASSES):
        _watch.mended.update(thing.session_uid for thing in (*faults.bare, *faults.strewn))
        repair(faults)
        faults = find_faults(mark_parts())
        if not any(faults):
            return


def _repeat_step(came: str) -> bool:
    """Undo or redo one more step, unless something was done since; return whether one was."""
    operator = getattr(bpy.ops.ed, came)
    # Both free the operators that are listed, and one that is was run later. It may be shown by F9,
    # and Blender crashes when what its panel shows is freed.
    if operator.poll() and not bpy.context.window_manager.operators:
        operator()
    return bool(_watch.came)


@bpy.app.handlers.persistent
def note_change(scene: bpy.types.Scene, graph: Depsgraph | None = None) -> None:
    """Look soon: objects, or what is shown of them, may have come or gone."""
    if graph is None or graph.id_type_updated("SCENE"):
        _repair_soon()


@bpy.app.handlers.persistent
def note_load(*_: object) -> None:
    """Look soon at what another file has: it stays as it is."""
    _watch.known = None
    _watch.mended.clear()
    _repair_soon("")


def _repair_soon(came: str | None = None) -> None:
    """Have a look when Blender is done with what it does now; `came`: "undo", "redo", "" after a load."""
    _watch.pending, _watch.came = True, _watch.came if came is None else came
    if not bpy.app.background and not bpy.app.timers.is_registered(_repair_when_idle):
        bpy.app.timers.register(_repair_when_idle)


def _repair_when_idle() -> float | None:
    """Look, unless an operator is under way."""
    windows = bpy.context.window_manager.windows
    if not windows:
        return None
    if _is_busy(windows):
        return AGAIN
    with bpy.context.temp_override(window=windows[0]):
        settle()
    return None


def _is_busy(windows: Iterable[Window]) -> bool:
    """Return whether an operator is under way that changes data, or something is edited, or rendered."""
    every = (operator for window in windows for operator in window.modal_operators)
    active = (window.view_layer.objects.active for window in windows)
    return (
        any(operator.bl_options & STEPS for operator in every)
        or any(thing is not None and thing.mode != "OBJECT" for thing in active)
        or bpy.app.is_job_running("RENDER")
    )


#: Handlers by the names of Blender's lists: objects may have come or gone, undo or redo has come to
#: a step.
HANDLERS = {
    "depsgraph_update_post": note_change,
    "undo_post": bpy.app.handlers.persistent(lambda *_: _repair_soon("undo")),
    "redo_post": bpy.app.handlers.persistent(lambda *_: _repair_soon("redo")),
    "load_post": note_load,
}


def watch() -> None:
    """Have the handlers called from now on; what is there already is taken as it is."""
    connect(HANDLERS)
    note_load()


def register() -> None:
    """Begin to look after beds."""
    if not bpy.app.background:
        watch()


def unregister() -> None:
    """Undo `register`."""
    if bpy.app.timers.is_registered(_repair_when_idle):
        bpy.app.timers.unregister(_repair_when_idle)
    disconnect(HANDLERS)
    _watch.known, _watch.came, _watch.pending = None, "", False
