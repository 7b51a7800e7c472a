"""Selection of a bed with a session: without it, so that no outline is drawn about every pin.

The bed stays the active object, which panels and keys go by. Fingertip and other objects are selected as
usual meanwhile. After the session it is selected again if it was before.
"""

from __future__ import annotations

from typing import Any

from ..compat import bpy

#: Uids of the beds that were selected until their sessions.
_SELECTED: set[int] = set()


def deselect(bed: Any) -> None:
    """Take a bed out of the selection of the view layer in use; it stays active."""
    if bed.name in bpy.context.view_layer.objects and bed.select_get():
        _SELECTED.add(bed.session_uid)
        bed.select_set(False)


def select_active(uids: frozenset[int]) -> None:
    """Select the active object again if it was until one of these sessions, and nothing else is."""
    layer = bpy.context.view_layer
    active = layer.objects.active if layer is not None else None
    selected = uids & _SELECTED
    _SELECTED.difference_update(uids)
    if active is None or active.session_uid not in selected:
        return
    if not any(thing.select_get() for thing in layer.objects):
        active.select_set(True)
