"""Bed in Blender as a formed surface: its pins now and at the stored former instant."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import bridge
from ..core.base.errors import DigiclayError, OutputError
from ..core.engine.state import State
from ..core.engine.system import System
from ..core.mesh_io.export_model import Model
from ..core.scene.assembly import assemble
from ..core.scene.schema import Scene
from ..core.scene.toml_table import resolve
from ..core.session import snapshot
from ..core.surface.formed import Formed
from ..live import bed_state, running
from ..settings import properties

#: Attribute of the bed's mesh: height of each pin, m, that features are measured from.
FORMER = "former"
#: A drawn pin is this near to where the session has it, m: float32 at a bed's size.
SHOWN = 1e-7


def read_formed(bed: Any) -> Formed:
    """Return the pins of a bed; before, they were as they were kept, or all at rest.

    Raises DigiclayError when the bed's mesh was edited so that it is no bed any more.
    """
    if any(name not in bed.data.attributes for name in bridge.ATTRIBUTES):
        raise OutputError(
            f"{bed.name} has lost the attributes of its pins: press Rebuild in the Device panel."
        )
    cells = bridge.read_cells(bed.data) | _of_session(bed)
    before: Any = _scene(bed).actuator.rest_height
    if has_reference(bed):
        kept = np.empty(len(cells["height"]), np.float32)
        bed.data.attributes[FORMER].data.foreach_get("value", kept)
        before = kept.astype(np.float64)
    return Formed.of(cells["position"], cells["height"], before, cells["force"], cells["mode"])


def has_reference(bed: Any) -> bool:
    """Return whether a bed's owner has kept a surface to measure from."""
    found = bed.data.attributes.get(FORMER)
    return found is not None and found.domain == "POINT" and found.data_type == "FLOAT"


def set_reference(bed: Any) -> None:
    """Keep the present surface as the one features are measured from."""
    height = read_formed(bed).height
    clear_reference(bed)
    bed.data.attributes.new(FORMER, "FLOAT", "POINT")
    bed.data.attributes[FORMER].data.foreach_set("value", height.astype(np.float32))


def clear_reference(bed: Any) -> None:
    """Measure features from the bed at rest again."""
    found = bed.data.attributes.get(FORMER)
    if found is not None:
        bed.data.attributes.remove(found)


def model(bed: Any, **told: Any) -> Model:
    """Return what is to be made of a bed; the flat ends of its pins are those of its device.

    `bed` bpy.types.Object; `told`: fields of `Model`.
    """
    return Model(cap=_scene(bed).actuator.bore / 2.0, **told)


def _of_session(bed: Any) -> dict[str, Any]:
    """Return heights, forces and modes of the session that is shown; nothing when something else is.

    A session draws the forces only where they are to be seen, so its bed's mesh may not have them.
    """
    found = _state(bed)
    shown = bridge.read_cells(bed.data)["height"]
    if found is None:
        return {}
    system, state = found
    height = state.row(0)
    if height.shape != shown.shape or np.abs(height - shown).max() > SHOWN:
        return {}
    return {
        "height": height.copy(),
        "force": state.row(system.rows.force).copy(),
        "mode": state.mode().copy(),
    }


def _state(bed: Any) -> tuple[System, State] | None:
    """Return the state of the bed's session, running or kept, or None."""
    session = running.find(bed)
    if session is not None:
        return session.system, session.state
    data = bed_state.read_snapshot(bed)
    if data is None:
        return None
    try:
        system = assemble(properties.scene_of(bed))
        return system, snapshot.load(system, data)
    except DigiclayError:  # the settings have changed since: what is drawn is all there is
        return None


def _scene(bed: Any) -> Scene:
    """Return the scene of the bed's settings, or the defaults while a setting makes no sense."""
    try:
        return properties.read_scene(bed)
    except DigiclayError:  # a mesh needs no settings that can be simulated
        return resolve({})
