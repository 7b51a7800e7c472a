"""Live sessions as values, and the table of those of this Blender; no Blender in here."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.base.arrays import Floats
from ..core.model.fingers import MOST_FINGERS
from ..core.scene.schema import Scene
from ..core.session.live_session import Clock, LiveSession, Moment
from ..core.session.recent_trace import RecentTrace
from ..device.instant import find_ellipsoid
from ..strokes.nominal import Device
from ..strokes.stroke import Correction, Place, Stroke
from ..strokes.tracking import find_blister

if TYPE_CHECKING:
    from bpy.types import Object

#: Number of the first fingertip that is no object of Blender.
OWN = MOST_FINGERS + 1


@dataclass(frozen=True, eq=False)
class Gesture(Moment):
    """Gesture that can be taken back, by its beginning; of a stroke also what was drawn, and its end."""

    stroke: str = ""
    end: Moment | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Running(LiveSession):
    """Live session at one instant; replaced by another value at each tick."""

    #: `session_uid` of the bed, and its name for messages.
    uid: int
    name: str
    #: Numbers of the fingertips, in the order of `poses`: they keep theirs when others come or go.
    #: Behind them, in `system` and `poses`, are those that a stroke has for its images, see
    #: `names`.
    numbers: tuple[int, ...] = (1,)
    #: The state by `core.session.snapshot`; also in the bed's property. While a stroke is formed
    #: it is an earlier one, for which `standing` has no use: with 24 fingertips it takes a fifth of a tick.
    snapshot: bytes
    #: Counts ticks and never decreases, not even by undo.
    tick: int
    #: (n,), heights that strokes count from, m.
    base: Floats
    clock: Clock
    trace: RecentTrace
    #: By the user.
    paused: bool = False
    #: Why the session waits although it is not paused; empty: it does not.
    blocking_reason: str = ""
    #: Ticks until the session takes up the state that undo or redo has put into the bed; 0: there
    #: is none.
    stale: int = 0
    #: Single control periods requested while paused.
    steps: int = 0
    #: The last gestures, oldest first, those that were taken back since the last one, and the one
    #: that begins if the fingertip touches.
    gestures: tuple[Gesture, ...] = ()
    undone: tuple[Gesture, ...] = ()
    next_gesture: Moment | None = None
    #: How long the fingertip has not moved, s of simulated time.
    rest_time: float = 0.0
    #: Number of the take that holds the recording while the file is saved; empty otherwise.
    saved_take: str = ""
    #: Unfinished strokes of the Press tool, oldest first: the fingertip moves along these, wherever
    #: Blender has it.
    strokes: tuple[Stroke, ...] = ()
    #: Where the first of them began.
    stroke_start: Moment | None = None
    #: How many were begun, also such as were taken back; and how many were finished.
    begun_strokes: int = 0
    finished_strokes: int = 0
    #: Where the last finished stroke ended, x and y, m.
    last_place: Place | None = None
    #: What the valves had to correct of it; None where no finger formed it.
    correction: Correction | None = None
    #: Stored settings of the bed that `scene` was made of; None: unknown.
    settings: tuple[Any, ...] | None = None

    @property
    def present(self) -> Moment:
        """The moment before the tick that is being simulated."""
        return Moment(self.state.period, self.snapshot, self.poses, self.tick - 1, self.base)

    @property
    def standing(self) -> Moment:
        """What the bed stores beside drawn strokes: all but the stroke that is being formed."""
        return self.stroke_start or Moment(
            self.state.period, self.snapshot, self.poses, self.tick, self.base
        )

    @property
    def drawn(self) -> tuple[Stroke, ...]:
        """The unfinished strokes that the hand has let go of."""
        return tuple(stroke for stroke in self.strokes if not stroke.held)

    @property
    def names(self) -> tuple[int, ...]:
        """Numbers of all fingertips, those of a stroke's images included, which are in no scene."""
        return name_fingers(self.numbers, len(self.poses))


def name_fingers(numbers: tuple[int, ...], count: int) -> tuple[int, ...]:
    """Return the numbers of so many fingertips: those that have `numbers`, and those that a stroke adds."""
    return (*numbers, *range(OWN, OWN + count - len(numbers)))


def match_poses(
    poses: Floats, was: tuple[int, ...], others: Floats, numbers: tuple[int, ...]
) -> Floats:
    """Return the poses (f, 7) of fingertips, by number: those they had, or else those of others (f, 7)."""
    places = zip(numbers, others, strict=True)
    return np.array(
        [poses[was.index(number)] if number in was else other for number, other in places]
    )


@dataclass
class Table:
    """Sessions of this Blender, which no file holds, and the last message about them."""

    #: By the uid of the bed, in order of their start.
    sessions: dict[int, Running] = field(default_factory=dict)
    #: Some messages cannot be reported where they occur, such as while a file is loaded.
    message: str = ""
    #: Uids of the beds that the message is about; empty: those of a closed file.
    subjects: tuple[int, ...] = ()
    #: Uids of the beds that were selected until their sessions.
    selected: set[int] = field(default_factory=set)


TABLE = Table()


def find(bed: Object) -> Running | None:
    """Return the session of a bed's object, or None."""
    return TABLE.sessions.get(bed.session_uid) if bed is not None else None


def list_sessions() -> tuple[Running, ...]:
    """Return all sessions, in the order they were started."""
    return tuple(TABLE.sessions.values())


def put(running: Running) -> None:
    """Make a value the present one of its bed's session."""
    TABLE.sessions[running.uid] = running


def drop(uid: int) -> Running | None:
    """Remove a session from the table; return its last value."""
    return TABLE.sessions.pop(uid, None)


def set_message(words: str, *uids: int) -> None:
    """Store the last message, for the Session panels of the beds that it is about, or of all."""
    TABLE.message, TABLE.subjects = words, uids


def last_message(bed: Object | None = None) -> str:
    """Return the last message; for a bed's panel, unless it is about others."""
    of_bed = bed is None or not TABLE.subjects or bed.session_uid in TABLE.subjects
    return TABLE.message if of_bed else ""


def find_stroke(running: Running, number: int) -> Stroke | None:
    """Return the stroke of a number, or None when it is finished or was taken back."""
    return next((stroke for stroke in running.strokes if stroke.number == number), None)


def last_place(running: Running) -> Place | None:
    """Return where the last stroke ends, x and y, m; None before the first."""
    if not running.strokes:
        return running.last_place
    end = running.strokes[-1].samples[-1]
    return end.x, end.y


def list_pressing(running: Running) -> list[int]:
    """Return the places of the fingertips of strokes: the first one's, and those of further images."""
    return [0, *range(len(running.numbers), len(running.poses))]


def find_device(running: Running) -> Device:
    """Return what forms the strokes of a session."""
    scene, system = running.scene, running.system
    shares, actuator = running.state.shares(), system.cell.actuator
    parts = system.grid, find_ellipsoid(scene), find_blister(scene), actuator.stroke
    locks = shares if shares.any() else None
    return Device(*parts, locks, actuator.rest_height, running.base)


def suit_scene(scene: Scene, stroke: Stroke) -> Scene:
    """Return a scene with fingertip and blister of a stroke."""
    first, *others = scene.fingers
    if stroke.finger is None or first.fingertip is None:
        return scene
    blister = scene.blister and (stroke.blister or scene.blister)
    fingers = replace(first, fingertip=stroke.finger), *others
    return replace(scene, fingers=fingers, blister=blister)


def is_resized(former: Scene, scene: Scene) -> bool:
    """Return whether a scene differs from a former one in nothing that strokes do not carry."""
    sizes = Stroke(0, (), finger=scene.fingers[0].fingertip, blister=scene.blister)
    return suit_scene(former, sizes) == scene
