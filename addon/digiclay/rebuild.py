"""A bed made anew after its settings: other pins, another housing, the same object and fingertip."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from . import bridge, properties, view
from .compat import bpy
from .core.fingertip import Fingertip
from .core.layout import Layout, grid
from .core.scene import Scene, parameters
from .instant import Instant
from .settings_table import read

__all__ = ["STATE", "differs", "rebuild"]

#: What a bed keeps of a session; it is of no use to other pins.
STATE = "digiclay_state"
#: How far a pin may stand from its place before the bed counts as another one, m: above what 32 bits lose
#: on a bed as wide as Blender's own limit of rows and columns, below any change of pitch worth making.
AWAY = 1e-6


def differs(bed: Any) -> str:
    """Return why a bed is not the one its layout describes, or an empty text.

    Parameters
    ----------
    bed : bpy.types.Object
    """
    values = read(bed.digiclay.layout, parameters("layout", bed.digiclay.method), {}, "layout")
    layout = Layout(**values)
    pins = len(bed.data.vertices)
    if pins != layout.rows * layout.columns:
        return f"The bed has {pins} pins, not {layout.rows * layout.columns}"
    for index, place in _corners(layout):
        if np.abs(np.array(bed.data.vertices[index].co[:2]) / bridge.SCALE - place).max() > AWAY:
            return "The pins stand elsewhere than Layout says"
    return ""


@lru_cache(maxsize=32)
def _corners(layout: Layout) -> tuple[tuple[int, np.ndarray], ...]:
    """Return index and place of the pins that tell layouts of as many pins apart."""
    places = grid(layout).positions
    last = layout.rows * layout.columns - 1
    return tuple((index, places[index]) for index in sorted({0, min(layout.columns, last), last}))


def rebuild(bed: Any) -> Scene:
    """Make a bed anew, at rest; its place, its fingertip and what else hangs on the object stay.

    Returns
    -------
    Scene
        What the bed now is.

    Raises
    ------
    ParameterError
        When the settings do not go together; the bed stays as it is.
    """
    scene = properties.described(bed)
    instant = Instant.at_rest(scene.layout, scene.actuator, scene.fingertip or Fingertip())
    collection = bed.users_collection[0]
    made = view.build(instant, collection, lowest=0.0)
    old = bed.data
    bed.data = made.data
    for kept, new in zip(_nodes(bed), _nodes(made), strict=False):
        kept.node_group = new.node_group
    tip = view.fingertip_of(bed)
    if tip is None:
        view.fingertip_of(made).parent = bed
    else:
        bridge.resize_fingertip(tip, instant.finger)
    cases = [child for child in bed.children if child.get(view.ROLE) == view.HOUSING]
    for child in made.children:
        if child.get(view.ROLE) == view.HOUSING:
            child.parent = bed
    bpy.data.batch_remove([*cases, *made.children_recursive, made, *([] if old.users else [old])])
    if STATE in bed:
        del bed[STATE]
    return scene


def _nodes(bed: Any) -> list[Any]:
    """Return the modifiers that draw a bed's pins."""
    return [modifier for modifier in bed.modifiers if modifier.type == "NODES" and modifier.node_group]
