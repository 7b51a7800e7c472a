"""Work that takes a while: in a window it shows its progress and Esc ends it; elsewhere it is just done."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from ..core.errors import DigiclayError
from . import status

__all__ = ["LongWork"]

#: Time between two looks at the user's keys, s, and the share of it that is worked.
TICK, SHARE = 0.05, 0.9


class LongWork:
    """Mixin of an operator whose work is a generator of shares done, from 0 to 1.

    The operator defines `begun`, and changes Blender's data only in the last of its steps, so
    that Esc leaves everything as it was.
    """

    def begun(self, context: Any) -> Iterator[float]:
        """Give the share done after each step; raises DigiclayError when the work cannot be done."""
        raise NotImplementedError

    def execute(self, context: Any) -> set[str]:
        """Do all of the work at once."""
        try:
            for _ in self.begun(context):
                pass
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begin the work; it goes on while Blender draws and listens."""
        self._steps = self.begun(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.progress_begin(0.0, 100.0)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Work for a moment, unless the user has had enough."""
        if event.type == "ESC" and event.value == "PRESS":
            self._ended(context)
            self.report({"INFO"}, f"{self.bl_label}: stopped, nothing was changed")  # type: ignore[attr-defined]
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        until = time.perf_counter() + SHARE * TICK
        try:
            share = next(self._steps)
            while time.perf_counter() < until:
                share = next(self._steps)
        except StopIteration:
            self._ended(context)
            return {"FINISHED"}
        except DigiclayError as error:
            self._ended(context)
            self.report({"ERROR"}, str(error))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        context.window_manager.progress_update(100.0 * share)
        said = f"{self.bl_label}: {100.0 * share:.0f} %     Esc: stop"  # type: ignore[attr-defined]
        status.tell(context, said)
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Stop when Blender takes the operator away, such as at the loading of a file."""
        self._ended(context)

    def _ended(self, context: Any) -> None:
        """Take back what shows the progress."""
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        status.clear()
