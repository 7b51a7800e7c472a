"""Common parts of the operators: polls with a reason, errors, ends in order, files, timer, status bar."""

# No postponed annotations in this package: Blender reads an operator's properties from them.
import time
import traceback
from collections.abc import Callable, Generator, Iterable
from functools import wraps
from typing import Any

from ..compat import Area, Context, Event, Operator, bpy
from ..core.base.errors import DigiclayError, one_line
from ..panels.base import declare
from ..settings.declared import number
from ..ui_text import localize
from .poll_messages import edited

#: Functions of `poll_messages`.
Needs = tuple[Callable[[Any], str], ...]


#: What an operator returns to Blender.
Result = set[str]


def inform(operator: Operator, text: str, *values: object, level: str = "INFO") -> None:
    """Report a text with values in the language of the interface."""
    operator.report({level}, localize(text, *values))


def end_in_order(step: Callable[..., Result]) -> Callable[..., Result]:
    """Return a `modal` or `invoke` that no exception leaves: Blender would drop the operator silently."""

    @wraps(step)
    def guarded(self: Polled, context: Context, event: Event) -> Result:
        try:
            return step(self, context, event)
        except DigiclayError as error:
            words = str(error)
        except Exception as error:
            traceback.print_exc()  # a fault of the extension: the console has what a report of it needs
            words = localize(
                "Error in the extension: {}: {}", type(error).__name__, one_line(error)
            )
        if step.__name__ == "modal":
            self.give_up(context, words)
        clear_status()
        self.report({"ERROR"}, words)
        return {"CANCELLED"}

    return guarded


class Polled:
    """Mixin of an operator that Blender disables, with the reason, while one of its `needs` is not met.

    A need is a function of `poll_messages`. All need Object Mode, unless `in_any_mode` is set.
    `end_in_order` surrounds `invoke` and `modal`.
    """

    report: Callable[[Result, str], None]
    properties: Any
    poll_message_set: Callable[[str], None]
    needs: Needs = ()
    in_any_mode = False

    def __init_subclass__(cls, **options: object) -> None:
        """Surround what Blender calls with an event."""
        super().__init_subclass__(**options)
        for name in {"invoke", "modal"} & vars(cls).keys():
            setattr(cls, name, end_in_order(vars(cls)[name]))

    @classmethod
    def poll_message(cls, context: Context) -> str:
        """Return the first reason against running now, or an empty text."""
        return next(filter(None, (need(context) for need in cls.needs)), "")

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Return whether the operator can run; Blender shows the message where it cannot."""
        message = cls.poll_message(context) or ("" if cls.in_any_mode else edited(context))
        if message:
            cls.poll_message_set(localize(message))
        return not message

    def cancel(self, context: Context) -> None:
        """Give back what a modal operator has taken of Blender, which ends it, say to load a file."""

    def give_up(self, context: Context, words: str) -> None:
        """End after an error in the modal part, which the words tell."""
        self.cancel(context)


class Action(Polled):
    """Mixin of an operator without a modal part: a DigiclayError is reported and ends it."""

    #: Does it; returns the operator's result where that is not FINISHED.
    perform: Callable[..., Result | None]

    def execute(self, context: Context) -> Result:
        """Do it, and report what stands in its way."""
        try:
            return self.perform(context) or {"FINISHED"}
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


def action(
    idname: str,
    label: str,
    *needs: Callable[[Context], str],
    options: Iterable[str] = ("REGISTER", "UNDO"),
    in_any_mode: bool = False,
    bases: tuple[type, ...] = (Action,),
    **properties: Any,
) -> Callable[[Callable[[Operator, Context], Result | None]], Any]:
    """Return a decorator that makes an operator, with properties, of its `perform` and its docstring."""
    return declare(
        (*bases, Operator),
        "perform",
        idname,
        label,
        bl_options=set(options),
        needs=needs,
        in_any_mode=in_any_mode,
        __annotations__=properties,
    )


class FileAction(Action):
    """Mixin of an action with a file browser for its `filepath`."""

    def invoke(self, context: Context, event: Event) -> Result:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


def file_of(pattern: str, *options: str) -> dict[str, Any]:
    """Declare the properties of a `FileAction`: the path, and which files the browser lists."""
    return {
        "filepath": bpy.props.StringProperty(subtype="FILE_PATH", options=set(options)),
        "filter_glob": bpy.props.StringProperty(default=pattern, options={"HIDDEN"}),
    }


def become_modal(operator: Operator, context: Context) -> Result:
    """Have Blender hand an operator its events: the last step of a start, nothing may fail after it.

    Blender crashes when an operator ends by another result while its handler is there.
    """
    context.window_manager.modal_handler_add(operator)
    return {"RUNNING_MODAL"}


class Modal(Polled):
    """Mixin of a modal operator, which first does all that may fail."""

    #: Gets ready for events; returns the operator's result where it has ended already.
    prepare: Callable[..., Result | None]

    def invoke(self, context: Context, event: Event) -> Result:
        """Prepare, then borrow what `cancel` gives back, then become modal."""
        self.region = context.region
        ended = self.prepare(context, event)
        if ended:
            return ended
        self.borrow(context)
        return become_modal(self, context)

    def borrow(self, context: Context) -> None:
        """Borrow timers, draw handlers and the like of Blender; nothing here may fail."""

    def locate(self, event: Event) -> tuple[float, float]:
        """Return where the mouse is, pixels of the region."""
        return event.mouse_x - self.region.x, event.mouse_y - self.region.y


class TimedAction(Modal, Action):
    """Mixin of an action that also goes on by a timer while Blender draws; Esc ends it."""

    #: Between two events of the timer, s.
    interval: float

    def borrow(self, context: Context) -> None:
        self.timer = context.window_manager.event_timer_add(self.interval, window=context.window)

    def cancel(self, context: Context) -> None:
        """Give back timer and status bar."""
        context.window_manager.event_timer_remove(self.timer)
        clear_status()


#: Time between two looks at the user's keys, s, and the share of it that is worked.
TICK, SHARE = 0.05, 0.9


class SteppedAction(TimedAction):
    """Mixin of an action that works in steps while Blender draws; Esc stops it before it changes anything."""

    interval = TICK
    bl_label: str
    #: Yields the share done, and changes something after the last one only.
    work: Callable[..., Generator[float, None, None]]

    def perform(self, context: Context) -> None:
        for _ in self.work(context):
            pass

    def prepare(self, context: Context, event: Event) -> None:
        self._steps = self.work(context)

    def borrow(self, context: Context) -> None:
        super().borrow(context)
        context.window_manager.progress_begin(0.0, 100.0)

    def modal(self, context: Context, event: Event) -> Result:
        """Work for a moment, unless the user has had enough."""
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            inform(self, "{}: stopped, nothing was changed", localize(self.bl_label))
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        until = time.perf_counter() + SHARE * TICK
        for share in self._steps:
            if time.perf_counter() >= until:
                percent = 100.0 * share
                context.window_manager.progress_update(percent)
                words = localize("{}: {:.0f} %     Esc: stop", localize(self.bl_label), percent)
                show_status(context, words)
                return {"RUNNING_MODAL"}
        self.cancel(context)
        return {"FINISHED"}

    def cancel(self, context: Context) -> None:
        """Take back what shows the progress."""
        self._steps.close()
        context.window_manager.progress_end()
        super().cancel(context)


class Drawing(Modal):
    """Mixin of a modal operator that draws in the view in which it was called."""

    #: Draws, in each region of each view; given the area in which the operator was called.
    draw_view: Callable[[Area], None]

    def borrow(self, context: Context) -> None:
        """Draw from now on."""
        self.handler = bpy.types.SpaceView3D.draw_handler_add(
            self.draw_view, (context.area,), "WINDOW", "POST_PIXEL"
        )

    def end(self, context: Context, *result: str) -> Result:
        """Give back status bar and view; return the result."""
        clear_status()
        if self.handler is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self.handler, "WINDOW")
            self.handler = None
        for area in context.screen.areas if context.screen else ():
            area.tag_redraw()
        return set(result)

    def cancel(self, context: Context) -> None:
        self.end(context)


def millimeters(name: str, default: float, words: str, **limits: Any) -> Any:
    """Declare a length with a default in m as a property in mm."""
    limits = {"precision": 2, "step": 10} | limits
    return number(f"{name} (mm)", words, default=1e3 * default, **limits)


#: Text in the status bar by the name of the workspace: Blender keeps it with that, and a modal
#: operator outlives the one it was started in.
_TOLD: dict[str, str] = {}


def show_status(context: Context, words: str) -> None:
    """Write words into the status bar, in place of those written before, in whichever workspace."""
    name = context.workspace.name
    if _TOLD.get(name) == words:
        return
    if name not in _TOLD:
        clear_status()
    context.workspace.status_text_set_internal(words)
    _TOLD[name] = words


def clear_status() -> None:
    """Take the words away wherever they stand; Blender's own come back."""
    for name in _TOLD:
        workspace = bpy.data.workspaces.get(name)
        if workspace is not None:
            workspace.status_text_set_internal(None)
    _TOLD.clear()
