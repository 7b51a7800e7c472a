"""Geometry nodes modifier of a bed: the one that draws it, whatever its name is now."""

from __future__ import annotations

from typing import Any

from ..core.base.errors import DigiclayError
from .node_tree import ARROWS


def find_modifier(bed: Any) -> Any | None:
    """Return the modifier that draws the pins, or None when the user has removed or changed it."""
    for modifier in bed.modifiers:
        tree = modifier.node_group if modifier.type == "NODES" else None
        if tree is not None and ARROWS in tree.interface.items_tree:
            return modifier
    return None


def require_modifier(bed: Any) -> Any:
    """Return the modifier that draws the pins, or refuse a bed without. Raises DigiclayError."""
    found = find_modifier(bed)
    if found is None:
        rule = "must have the geometry nodes modifier that draws its pins (got none)"
        raise DigiclayError(f"{bed.name} {rule}. Undo its removal.")
    return found
