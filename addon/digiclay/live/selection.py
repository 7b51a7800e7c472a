"""Selection of a bed with a session: without it, so that no outline is drawn about every pin.

The bed stays the active object, which panels and keys go by. Fingertip and other objects are selected as
usual meanwhile.
"""

from __future__ import annotations

from typing import Any

from ..compat import bpy

__all__ = ["deselect", "select_active"]


def deselect(bed: Any) -> None:
    """Take a bed out of the selection of the view layer in use; it stays active."""
    if bed.name in bpy.context.view_layer.objects:
        bed.select_set(False)


def select_active(uids: frozenset[int]) -> None:
    """Select the active object again if it is one of some beds, and nothing else is selected.

    Parameters
    ----------
    uids : frozenset of int
        `session_uid` of the beds whose sessions have ended.
    """
    layer = bpy.context.view_layer
    active = layer.objects.active if layer is not None else None
    if active is None or active.session_uid not in uids:
        return
    if not any(thing.select_get() for thing in layer.objects):
        active.select_set(True)
