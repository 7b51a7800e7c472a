"""Reasons for disabled operators: each returns a message, or an empty text.

An operator lists its own as `needs`; Blender shows the message of the first that is not met. Those
about a bed come after `no_bed`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .. import preferences
from ..compat import Context, bpy
from ..device import view
from ..exchange import formed_bed
from ..live import beds, follow, loop, tick
from ..live.beds import Use, active_session, blocking_reason, find_obstacle
from ..press import brush
from ..recorded import takes
from ..recorded.bake import is_baked
from ..roles import bed_of, fingertip_of, is_bed, is_edited, list_meshes, list_pressers
from ..sessions import running
from ..settings import own_presets
from ..ui_text import localize


@dataclass(frozen=True)
class Need:
    """Condition of an operator: what tells that it is not met, and the message then."""

    is_lacking: Callable[[Context], object]
    message: str

    def __call__(self, context: Context) -> str:
        """Return the message, or an empty text."""
        return self.message if self.is_lacking(context) else ""

    def reworded(self, message: str) -> Need:
        """Return the condition with another message."""
        return Need(self.is_lacking, message)


def _has_view(context: Context) -> bool:
    return context.area is not None and context.area.type == "VIEW_3D"


def _recording(context: Context) -> object:
    session = running.find(bed_of(context))
    return session and session.recording


no_bed = Need(lambda context: bed_of(context) is None, "Select a bed or its fingertip first")
session_runs = Need(lambda context: running.find(bed_of(context)), "Stop the session first")
edited = Need(is_edited, "Go back to Object Mode first")
# A new bed is an object: it cannot be added inside another object's edit mode.
inside_edit = edited.reworded("Leave Edit Mode first: the device is an object of its own")
in_object_mode = Need(lambda context: context.mode == "OBJECT", "This is Object Mode already")
no_collection = Need(
    lambda context: (
        not (
            context.collection
            == context.scene.collection  # always shown, and unmarked in a new scene
            or context.view_layer.active_layer_collection.is_visible
        )
    ),
    "The active collection is hidden: show it, or make another one active",
)
baked = Need(
    lambda context: is_baked(bed_of(context)),
    "The bed plays a baked session: free the bake in the Takes panel first",
)
no_bake = Need(lambda context: not is_baked(bed_of(context)), "The bed has no bake")
no_take = Need(
    lambda context: not takes.list_takes(bed_of(context)),
    "The bed has no take: record one in a session first",
)
from_rest = Need(
    lambda context: not formed_bed.has_reference(bed_of(context)),
    "Features are measured from the bed at rest already",
)
no_skin = Need(
    lambda context: not view.can_show_skin(bed_of(context)),
    "The bed has no skin: rebuild it in Laboratory > Device",
)
no_shape = Need(lambda context: not bed_of(context).digiclay.use_shape, "The bed has no shape")
no_own_preset = Need(
    lambda context: bed_of(context).digiclay.own_preset not in own_presets.names(),
    "Apply a preset of your own first: built-in presets cannot be removed",
)
no_own_methods = Need(
    lambda context: not preferences.get(context).run_own_methods, "Turn on Run Own Methods first"
)
no_window = Need(
    lambda context: bpy.app.background or context.window is None,
    "A live session needs a window; takes can be baked without",
)
no_session = Need(
    lambda context: not active_session(context),
    "No session runs on the active bed: start one first",
)
no_undriven = Need(
    lambda context: not running.list_sessions() or context.window is None, "No session runs"
)
# At any other time the key Esc has other uses.
driven = Need(lambda context: not loop.is_aside(), "The session uses this key itself")
no_server = Need(
    lambda context: not (active := active_session(context)) or follow.find(active[1].uid) is None,
    "The session follows no server",
)
no_stroke = Need(lambda context: not tick.has_strokes(), "No press stroke is queued")
no_recording = Need(lambda context: _recording(context) is None, "Record a take first")
no_motion = Need(
    lambda context: no_bake(context) and no_take(context) and no_recording(context),
    "Nothing moves yet: record a take or bake a session first",
)
no_tool = Need(lambda context: brush.tool_settings(context) is None, "Select the Press tool")
no_tool_in_view = Need(
    lambda context: not _has_view(context) or no_tool(context), "Select the Press tool in a 3D view"
)
no_mesh = Need(
    lambda context: not list_meshes(context), "Select the meshes that are to press the bed"
)
no_presser = Need(lambda context: not list_pressers(bed_of(context)), "No mesh presses the bed")
no_view = Need(lambda context: not _has_view(context), "Pins are picked in a 3D view")
no_pins = Need(lambda context: not view.picked_pins(bed_of(context)), "No pins are picked")
no_gesture = Need(
    lambda context: (
        not (active := active_session(context)) or not (active[1].gestures or active[1].strokes)
    ),
    "There is no gesture to take back: the fingertip has not touched the bed",
)


def _allow(use: Use) -> Callable[[Context], str]:
    """Return the need of a bed whose state allows a use."""
    return lambda context: no_bed(context) or find_obstacle(context, bed_of(context), use)


cannot_measure, cannot_change, cannot_form = map(_allow, Use)


def no_surface(context: Context) -> str:
    """There is no bed with pins to be measured, or they span no surface."""
    few = "A bed needs at least 2 x 2 pins to have a surface"
    return cannot_measure(context) or (few if len(bed_of(context).data.vertices) < 4 else "")


def session_waits(context: Context) -> str:
    """There is no session, or its bed cannot be written now."""
    active = active_session(context)
    if active is None:
        return no_session(context)
    bed, session = active
    why = blocking_reason(context, bed, session.system.grid.count)
    return localize("The session waits: {}", why) if why else ""


def nothing_to_reset(context: Context) -> str:
    """The bed is at rest, or its session waits."""
    if active_session(context) is not None:
        return session_waits(context)
    return cannot_form(context) or (
        "The bed is at rest already" if beds.read_snapshot(bed_of(context)) is None else ""
    )


def cannot_record(context: Context) -> str:
    """No session runs on the bed, or it records already."""
    if running.find(bed_of(context)) is None:
        return "Start a session first"
    return "A take is being recorded already" if _recording(context) is not None else ""


def no_place(context: Context) -> str:
    """The mouse is in no 3D view in Object Mode, or there is no bed in it."""
    if not _has_view(context) or context.mode != "OBJECT":
        return "Pins are pressed in a 3D view, in Object Mode"
    seen = any(map(is_bed, context.visible_objects))
    return "" if seen else "Add a bed first: Add > Mesh > Digital Clay"


def no_finger(context: Context) -> str:
    """There is no bed whose fingertip could be scaled."""
    bed = brush.bed_in_use(context)
    if bed is None or fingertip_of(bed) is None:
        return "Select a bed of Digital Clay, or its fingertip"
    return find_obstacle(context, bed, Use.FORM)
