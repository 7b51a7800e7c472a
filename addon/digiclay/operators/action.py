"""Common parts of the operators: polls with a reason, reported errors, ends in order, file browser."""

# No postponed annotations in this package: Blender reads an operator's properties from them.
import traceback
from collections.abc import Callable
from functools import wraps
from typing import Any

from ..core.base.errors import DigiclayError, one_line
from ..ui_text import localize
from .poll_messages import edited


def end_in_order(step: Callable[..., set[str]]) -> Callable[..., set[str]]:
    """Return a `modal` or `invoke` that no exception leaves: Blender would drop the operator unsaid."""

    @wraps(step)
    def guarded(self: Any, context: Any, event: Any) -> set[str]:
        try:
            return step(self, context, event)
        except DigiclayError as error:
            words = str(error)
        except Exception as error:
            traceback.print_exc()  # a fault of the extension: the console has what a report of it needs
            words = localize("Fault of the extension: {}: {}", type(error).__name__, one_line(error))
        if step.__name__ == "modal":
            self.give_up(context, words)
        self.report({"ERROR"}, words)
        return {"CANCELLED"}

    return guarded


class Polled:
    """Mixin of an operator that Blender disables while `poll_message` returns a reason.

    It needs Object Mode, unless `in_any_mode` is set; `end_in_order` surrounds its `invoke` and `modal`.
    """

    report: Any
    poll_message_set: Any
    in_any_mode = False

    def __init_subclass__(cls, **known: Any) -> None:
        """Surround what Blender calls with an event."""
        super().__init_subclass__(**known)
        for name in {"invoke", "modal"} & vars(cls).keys():
            setattr(cls, name, end_in_order(vars(cls)[name]))

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """Return what stands against running now, or an empty text."""
        return ""

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether the operator can run; Blender shows the message where it cannot."""
        message = cls.poll_message(context) or ("" if cls.in_any_mode else edited(context))
        if message:
            cls.poll_message_set(localize(message))
        return not message

    def cancel(self, context: Any) -> None:
        """Give back what the operator has taken of Blender; a modal one has something to give."""

    def give_up(self, context: Any, words: str) -> None:
        """End after an error in the modal part, which the words tell."""
        self.cancel(context)


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
