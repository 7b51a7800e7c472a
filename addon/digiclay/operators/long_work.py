"""Long work with progress and Esc in a window, without them elsewhere."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import Any

from ..ui_text import localize
from . import status
from .action import Action

#: Time between two looks at the user's keys, s, and the share of it that is worked.
TICK, SHARE = 0.05, 0.9


class LongWork(Action):
    """Mixin of an operator whose work is a generator of completed shares, from 0 to 1.

    The operator defines `work`, and changes Blender's data only in the last of its steps, so
    that Esc leaves everything as it was.
    """

    bl_label: str

    def work(self, context: Any) -> Generator[float, None, None]:
        """Give the share done after each step; raises DigiclayError when the work cannot be done."""
        raise NotImplementedError

    def perform(self, context: Any) -> None:
        """Do all of the work at once."""
        for _ in self.work(context):
            pass

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begin the work; it continues while Blender draws and handles events."""
        self._steps = self.work(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.progress_begin(0.0, 100.0)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Work for a moment, unless the user has had enough."""
        if event.type == "ESC" and event.value == "PRESS":
            self._end(context)
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
            self._end(context)
            return {"FINISHED"}
        context.window_manager.progress_update(100.0 * share)
        said = localize("{}: {:.0f} %     Esc: stop", localize(self.bl_label), 100.0 * share)
        status.show(context, said)
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Stop when Blender takes the operator away, such as at the loading of a file."""
        self._end(context)

    def _end(self, context: Any) -> None:
        """Take back what shows the progress."""
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        status.clear()
