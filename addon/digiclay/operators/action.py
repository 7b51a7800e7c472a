"""Common parts of the operators: polls with a reason, reported errors, file browser."""

# No postponed annotations in this package: Blender reads an operator's properties from them.
from typing import Any

from ..core.base.errors import DigiclayError
from ..ui_text import localize

__all__ = ["Action", "FileAction", "Polled"]


class Polled:
    """Mixin of an operator that Blender disables while `poll_message` returns a reason."""

    report: Any
    poll_message_set: Any

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """Return what stands against running now, or an empty text."""
        return ""

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether the operator can run; Blender shows the message where it cannot."""
        message = cls.poll_message(context)
        if message:
            cls.poll_message_set(localize(message))
        return not message


class Action(Polled):
    """Mixin of an operator without a modal part: a DigiclayError is reported and ends it."""

    def perform(self, context: Any) -> set[str] | None:
        """Do it; return the operator's result where that is not FINISHED."""
        raise NotImplementedError

    def execute(self, context: Any) -> set[str]:
        """Do it, and report what stands in its way."""
        try:
            return self.perform(context) or {"FINISHED"}
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


class FileAction(Action):
    """Mixin of an action with a file browser for its `filepath`."""

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}
