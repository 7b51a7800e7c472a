"""Bring a bed back to rest, with a session or without."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.assembly import assemble
from ..core.errors import DigiclayError
from ..core.fingertip import Fingertip
from ..core.simulation import begin
from ..device import view
from ..device.instant import CLEARANCE
from ..device.view import bed_of
from ..live import bed_state, sculpting, tick
from ..recorded import takes
from ..settings import properties
from .reasons import allowed, edited, no_bed, session_waits
from .session_context import session_of

__all__ = ["ResetSession"]


class ResetSession(bpy.types.Operator):  # type: ignore[misc]
    """Bring all pins back to rest and lift the fingertip off them"""

    bl_idname = "digiclay.session_reset"
    bl_label = "Reset"
    bl_options = {"UNDO"}  # noqa: RUF012

    running_only: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Only While It Runs",
        description="Leave beds without a session alone: the key must not reach them by accident",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed that has left its rest is needed."""
        if session_of(context) is not None:
            return allowed(cls, session_waits(context))
        return allowed(cls, no_bed(context) or _at_rest_already(context) or edited(context))

    def execute(self, context: Any) -> set[str]:
        """Begin anew; what the session has done can be taken back."""
        active = session_of(context)
        if active is None and self.running_only:
            return {"PASS_THROUGH"}
        try:
            if active is None:
                _at_rest(context, bed_of(context))
            else:
                bed, session = active
                said = takes.keep_recorded(bed, session)
                back = sculpting.reset(session)
                tick.show(bed, back)
                tick.place(context, bed, back)
                if said:
                    self.report({"INFO"}, said)
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def _at_rest_already(context: Any) -> str:
    """There is nothing to bring back."""
    return "The bed is at rest already" if bed_state.kept(bed_of(context)) is None else ""


def _at_rest(context: Any, bed: Any) -> None:
    """Bring a bed without a session to rest."""
    scene = properties.scene_of(bed)
    system = assemble(scene)
    bed_state.clear(bed)
    view.show_state(bed, system, begin(system))
    tip = view.fingertip_of(bed)
    if tip is not None:
        at = bridge.pose(tip)
        at[2] = max(at[2], scene.actuator.rest_height + CLEARANCE)
        bridge.place_fingertip(tip, at, scene.fingertip or Fingertip())
