"""Status bar text of a modal operator, in the visible workspace only.

Blender keeps such words with a workspace, and a modal operator outlives the one it was started in.
"""

from __future__ import annotations

from typing import Any

from ..compat import bpy

#: What was written, by the name of the workspace.
_TOLD: dict[str, str] = {}


def show(context: Any, words: str) -> None:
    """Write words into the status bar, in place of those written before, in whichever workspace."""
    name = context.workspace.name
    if _TOLD.get(name) == words:
        return
    if name not in _TOLD:
        clear()
    context.workspace.status_text_set(words)
    _TOLD[name] = words


def clear() -> None:
    """Take the words away wherever they stand; Blender's own come back."""
    for name in _TOLD:
        workspace = bpy.data.workspaces.get(name)
        if workspace is not None:
            workspace.status_text_set(None)
    _TOLD.clear()
