"""Bake of a take, or of an animated fingertip, into the bed; removal of a bake."""

import time
from collections.abc import Generator
from typing import Any

import numpy as np

from ..compat import bpy
from ..core.engine.simulation import begin
from ..core.scene.assembly import assemble
from ..core.session import snapshot
from ..core.session.take import Take
from ..device.instant import find_ellipsoid
from ..recorded import bake, takes
from ..roles import bed_of
from ..settings import properties
from ..settings.declared import choice, integer
from ..ui_text import localize
from . import status
from .action import Action, action
from .poll_messages import no_bake, no_bed, session_runs
from .take_actions import ChosenTake

#: Time between two looks at the user's keys, s, and the share of it that is worked.
TICK, SHARE = 0.05, 0.9
SOURCES = (
    ("FINGERTIP", "Animated Fingertip", "The fingertip as it moves in the frames of the scene"),
    ("TAKE", "Take", "The fingertip as it was recorded in a session"),
)


class Bake(ChosenTake, Action, bpy.types.Operator):
    """Make an ordinary animation of the bed from a session; it plays and renders without simulation"""

    bl_idname = "digiclay.bake"
    bl_label = "Bake Session"
    bl_options = {"REGISTER", "UNDO"}
    needs = no_bed, session_runs.reworded("Stop the session on this bed first")

    source: choice("Source", "Source of the fingertip path", items=SOURCES, default="FINGERTIP")
    first: integer("First Frame", "First frame of the session", default=1)
    last: integer("Last Frame", "Last frame of the session; a take has its own length", default=250)

    def perform(self, context: Any) -> None:
        for _ in self.work(context):
            pass

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Take the scene's frames where none are asked for, and begin; work goes on while Blender draws."""
        if not self.properties.is_property_set("first"):
            self.first = context.scene.frame_start
        if not self.properties.is_property_set("last"):
            self.last = context.scene.frame_end
        self._steps = self.work(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.progress_begin(0.0, 100.0)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Work for a moment, unless the user has had enough."""
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, localize("{}: stopped, nothing was changed", localize(self.bl_label)))
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        until = time.perf_counter() + SHARE * TICK
        try:
            share = next(self._steps)
            while time.perf_counter() < until:
                share = next(self._steps)
        except StopIteration:
            self.cancel(context)
            return {"FINISHED"}
        context.window_manager.progress_update(100.0 * share)
        status.show(context, localize("{}: {:.0f} %     Esc: stop", localize(self.bl_label), 100.0 * share))
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Take back what shows the progress."""
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        status.clear()

    def work(self, context: Any) -> Generator[float, None, None]:
        """Read the path, simulate it and write the bake, which Esc leaves out; yield the share done."""
        bed, scene = bed_of(context), context.scene
        recorded = self.source == "TAKE"
        if recorded:
            take = takes.read(bed, self.take)
        else:
            made = properties.scene_of(bed)
            period = made.simulation.control_period
            poses = np.empty((0, 1, 7))
            for step in bake.sample_path(scene, bed, self.first, self.last, period):
                if isinstance(step, float):
                    yield 0.3 * step
                else:
                    poses = step
            system = assemble(made)
            # How the path ends is unknown before its simulation, and nothing asks for it.
            take = Take(made, snapshot.dump(system, begin(system)), poses, b"")
        rate = scene.render.fps / scene.render.fps_base
        for part in bake.simulate_frames(take, rate):
            if isinstance(part, float):
                yield 0.3 + 0.7 * part
            else:
                moments = part
        bake.apply(bed, moments, self.first, find_ellipsoid(take.scene), keyframe_finger=recorded)
        count = len(moments.height)
        last = self.first + count - 1
        self.report({"INFO"}, localize("Baked {} frames, {} to {}", count, self.first, last))


@action("digiclay.bake_free", "Free Bake", no_bed, no_bake)
def free_bake(operator: Any, context: Any) -> None:
    """Remove the bake: the bed shows its own state again. Keyframes of the fingertip stay"""
    bake.free(bed_of(context))
