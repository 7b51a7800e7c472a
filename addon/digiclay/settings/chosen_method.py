"""Choice of a bed's control method: a built-in one by its place, one of the user's own by its name."""

from __future__ import annotations

from typing import Any

from ..core.control.methods import METHODS, list_added
from ..ui_text import localize
from .declared import title

#: Blender keeps no reference to the texts of a list that is made on demand: this one does.
OFFERED: list[tuple[str, str, str, int]] = []


def method_of(settings: Any) -> str:
    """Return the name of a bed's control method, whether or not it is known here.

    `settings` bpy.types.PropertyGroup.
    """
    name: str = settings.own_method or settings.method
    return name


def name_pointer(name: str) -> str:
    """Return the attribute of the control's group with the parameters of a method."""
    return name if name in METHODS else f"own_{name}"


def find_group(settings: Any) -> Any:
    """Return the properties of the parameters of a bed's control method; None where it is not known here."""
    return getattr(settings.control, name_pointer(method_of(settings)), None)


def method_property(settings: Any) -> str:
    """Return the property that offers the methods: the plain one while there are built-in ones only."""
    return "chosen_method" if settings.own_method or list_added() else "method"


def list_offered(settings: Any, context: Any) -> list[tuple[str, str, str, int]]:
    """Return the methods to choose from, and the bed's own where that is not known here.

    `settings` bpy.types.PropertyGroup; `context` bpy.types.Context.
    """
    added = list_added()
    offered = [(name, localize(title(name)), "") for name in METHODS]
    offered += [(name, title(name), method.describe()) for name, method in added.items()]
    missing = settings.own_method
    if missing and missing not in added:
        offered.append((missing, localize("{} (not loaded)", title(missing)), ""))
    OFFERED[:] = [(*item, number) for number, item in enumerate(offered)]
    return OFFERED


def place_of(settings: Any) -> int:
    """Return the place of a bed's method among those offered."""
    names = [name for name, *_ in list_offered(settings, None)]
    return names.index(method_of(settings))


def choose(settings: Any, place: int) -> None:
    """Set the method by its place among those offered. `settings` bpy.types.PropertyGroup."""
    name = list_offered(settings, None)[place][0]
    if name in METHODS:
        settings.method = name
    else:
        settings.own_method = name
