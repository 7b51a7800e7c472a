"""Replay of a take, with a comparison of its end state bit for bit."""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from .. import bridge, preferences
from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..core.engine.state import State
from ..core.model.fingertip import LEVEL
from ..core.scene.assembly import assemble
from ..core.session import snapshot
from ..core.session.live_session import Clock, periods_due, simulate_path
from ..core.session.take import MOST_PARTS, Take, refine
from ..device import view
from ..device.instant import find_ellipsoid, pick_pose
from ..live import bed_state, tick
from ..recorded import takes
from ..roles import bed_of, fingertip_of
from ..sessions import sculpting
from ..settings import properties
from ..settings.declared import integer
from ..ui_text import localize
from . import status
from .action import Action
from .poll_messages import no_bed, no_take, session_runs
from .take_actions import ChosenTake


class ReplayTake(ChosenTake, Action, bpy.types.Operator):
    """Replay a take at its recorded speed. Esc stops and restores the bed"""

    _states: Iterator[State]
    _clock: Clock
    _at: int

    bl_idname = "digiclay.take_replay"
    bl_label = "Replay Take"
    bl_options = {"REGISTER", "UNDO"}
    needs = no_bed, session_runs.reworded("Stop the session on this bed first"), no_take

    parts: integer(
        "Finer Steps", "Number of parts of each physics step: 1 replays the take bit for bit", default=1,
        min=1, max=MOST_PARTS,
    )  # fmt: skip

    def perform(self, context: Any) -> None:
        """Play it without showing anything but its end."""
        self._begin(context)
        for state in self._states:
            self._state, self._at = state, self._at + 1
        self._finish(context)

    def invoke(self, context: Any, event: Any) -> set[str]:
        self._begin(context)
        manager, rate = context.window_manager, preferences.get(context).redraw_rate
        self._timer = manager.event_timer_add(1.0 / rate, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Continue by the wall clock."""
        if event.type == "ESC" and event.value == "PRESS":
            return self._restore(context)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        bed = bed_of(context)
        if bed is None or bed.session_uid != self._uid:
            return self._restore(context)
        if bridge.find_fault(bed.data):  # it continues when it can be drawn again
            self._clock = self._clock.stopped()
            return {"PASS_THROUGH"}
        period = self._system.period
        count, self._clock = periods_due(
            self._clock, time.perf_counter(), period, preferences.get(context).most_periods
        )
        for _ in range(min(count, self._take.periods - self._at)):
            self._state = next(self._states)
            self._at += 1
        if self._at == self._take.periods:
            self.cancel(context)
            return self._finish(context)
        view.show_state(bed, self._system, self._state)
        self._place(bed)
        seconds, whole = self._at * period, self._take.duration
        status.show(context, localize("Replay: {:.1f} of {:.1f} s     Esc: stop", seconds, whole))
        return {"PASS_THROUGH"}

    def cancel(self, context: Any) -> None:
        """Take back what the replay needs of Blender."""
        self._states = iter(())
        context.window_manager.event_timer_remove(self._timer)
        status.clear()

    def give_up(self, context: Any, words: str) -> None:
        """Show the bed as it was before."""
        self._restore(context)

    def _begin(self, context: Any) -> None:
        """Read the take and put everything to its start."""
        bed = bed_of(context)
        self._uid = bed.session_uid
        tip = fingertip_of(bed)
        # The fingertip's pose now: it may have been moved since the last session.
        self._stood = np.array([0.0, 0.0, 0.0, *LEVEL]) if tip is None else bridge.pose(tip)
        self._take: Take = takes.read(bed, self.take)
        self._system = assemble(refine(self._take.scene, self.parts))
        if self._system.grid.count != len(bed.data.vertices):
            here, there = len(bed.data.vertices), self._system.grid.count
            raise DigiclayError(f"The take is of a bed of {there} pins (got one of {here}).")
        self._state = snapshot.load(self._system, self._take.start)
        take = self._take
        self._states = simulate_path(self._system, self._state, take.poses, take.smoothing)
        self._clock, self._at = Clock(), 0

    def _place(self, bed: Any) -> None:
        """Put the fingertip to where the take has it; one that is animated follows its animation."""
        tip = fingertip_of(bed)
        if tip is not None:
            finger = find_ellipsoid(self._take.scene)
            bridge.place_fingertip(tip, pick_pose(self._take.poses[self._at]), finger)

    def _finish(self, context: Any) -> set[str]:
        """Leave the bed in the final state of the take, and report the comparison."""
        bed, system = bed_of(context), self._system
        state = snapshot.dump(system, self._state)
        self._place(bed)
        # The session that would go on from here.
        uid, pose, tick_count = bed.session_uid, pick_pose(self._take.poses[-1]), bed_state.read_tick(bed)
        begun = sculpting.begin_session(uid, bed.name, self._take.scene, pose, state, tick_count)
        bed_state.write(bed, begun[0])
        view.show_state(bed, system, self._state)
        seconds = f"{self._take.duration:.1f} s"
        if state == self._take.end:
            self.report({"INFO"}, localize("Replayed {}: it ends in the same state, bit for bit", seconds))
            return {"FINISHED"}
        recorded = snapshot.load(self._system, self._take.end)
        away = 1e6 * float(np.abs(self._state.row(0) - recorded.row(0)).max())
        if self.parts == 1:
            words = localize("Replayed {}: it ends {:.3g} µm away, as another version may", seconds, away)
            self.report({"WARNING"}, words)
        else:
            words = localize("steps {} times finer end {:.3g} µm away", self.parts, away)
            self.report({"INFO"}, localize("Replayed {}: {}", seconds, words))
        return {"FINISHED"}

    def _restore(self, context: Any) -> set[str]:
        """Show the bed as it was before."""
        self.cancel(context)
        bed = next((thing for thing in bpy.data.objects if thing.session_uid == self._uid), None)
        if bed is not None:
            try:
                scene = properties.scene_of(bed)
                before, _ = sculpting.begin_session(
                    bed.session_uid, bed.name, scene, self._stood, bed_state.read_snapshot(bed)
                )
                view.show_state(bed, before.system, before.state)
                tick.place_finger(context, bed, before)
            except DigiclayError as error:
                self.report({"WARNING"}, str(error))
        self.report({"INFO"}, localize("Replay stopped: the bed is restored"))
        return {"CANCELLED"}
