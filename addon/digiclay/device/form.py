"""Form of a bed in view: its pins, a live skin over them, or both."""

from __future__ import annotations

from typing import Any

from ..compat import node_setting, set_node_setting
from ..core.base.errors import DigiclayError
from .node_tree import ARROWS, FAR, FORM, MEMBRANE
from .skin_lattice import KINDS


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


#: Forms, in the order of the numbers in the settings of the geometry nodes.
FORMS = ("automatic", "pins", "skin", "both")
#: Where a bed keeps the form that it had before its skin was toggled, until a form is chosen.
BEFORE = "digiclay_form_before"


def can_show_skin(bed: Any) -> bool:
    """Return whether a bed's geometry nodes have a skin: those of older files have none."""
    modifier = find_modifier(bed)
    return modifier is not None and FORM in modifier.node_group.interface.items_tree


def read_form(bed: Any) -> str:
    """Return one of `FORMS`; "pins" for a bed without a skin."""
    if not can_show_skin(bed):
        return "pins"
    number = int(node_setting(find_modifier(bed), FORM))
    return FORMS[min(max(number, 0), len(FORMS) - 1)]


def set_form(bed: Any, form: str) -> None:
    """Show a bed as one of `FORMS`. Raises DigiclayError: on another word, or for a bed without a skin."""
    set_node_setting(_require_skin(bed), FORM, _index(form, FORMS, "form"))
    bed.pop(BEFORE, None)


def read_kind(bed: Any) -> str:
    """Return the skin of a bed: one of `skin_lattice.KINDS`."""
    return KINDS[bool(can_show_skin(bed) and node_setting(find_modifier(bed), MEMBRANE))]


def set_kind(bed: Any, kind: str) -> None:
    """Give a bed one of the skins `skin_lattice.KINDS`."""
    set_node_setting(_require_skin(bed), MEMBRANE, bool(_index(kind, KINDS, "skin")))


def is_far(bed: Any) -> bool:
    """Return whether the pins of a bed are too small in the views to be drawn one by one."""
    return can_show_skin(bed) and bool(node_setting(find_modifier(bed), FAR))


def set_far(bed: Any, far: bool) -> None:
    """Note whether the pins of a bed are too small in the views to be drawn one by one."""
    set_node_setting(_require_skin(bed), FAR, bool(far))


def is_skin_shown(bed: Any) -> bool:
    """Return whether a skin is seen in the views."""
    form = read_form(bed)
    return form in ("skin", "both") or (form == "automatic" and is_far(bed))


def _require_skin(bed: Any) -> Any:
    """Return the modifier of a bed that has a skin, or refuse."""
    modifier = require_modifier(bed)
    if not can_show_skin(bed):
        raise DigiclayError(
            f"{bed.name} is of an older file and has no skin. Rebuild it in the panel Device."
        )
    return modifier


def _index(word: str, words: tuple[str, ...], name: str) -> int:
    """Return the place of a word, or refuse it."""
    if word not in words:
        raise DigiclayError(f"Display.{name} must be one of {', '.join(words)} (got {word!r}).")
    return words.index(word)
