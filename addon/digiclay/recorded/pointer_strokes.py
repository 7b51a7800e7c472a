"""Recorded strokes of the Press tool: their file, and their replay in a live session. No Blender.

A file has the bed's name and a table a stroke: what the header of the tool was set to, and the
times and places of the pointer. What is formed follows from the places; the times say how quick the
hand was.
"""

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from ..core.base.errors import ParameterError, SceneError, StateError
from ..core.base.quantity import Parameters, quantity
from ..core.files.tables import Table, read_part, refuse_unknown, show_value
from ..core.model.fingertip import Fingertip
from ..core.scene.scene_source import read_table
from ..device.instant import find_ellipsoid
from ..sessions.running import Running, find_stroke
from ..sessions.sculpting import change_scene, follow_finger, queue_stroke
from ..settings.devices import BEDS, change_finger
from ..strokes.falloff import Falloff
from ..strokes.stamps import load_stamp
from ..strokes.stroke import (
    COMBINATIONS,
    DEEPEST,
    FEWEST,
    MOST,
    SHALLOWEST,
    STAMPS,
    SYMMETRIES,
    Brush,
    Combine,
    Image,
    lay_line,
    lay_path,
    lay_ring,
    make_images,
    needs_blister,
    pull,
    start,
)
from ..strokes.tracking import find_tracking

#: Ticks a second of the replay.
RATE = 60.0
#: Longest that the fingertip may need for a stroke, s.
PATIENCE = 300.0
#: Keys of a file beside its strokes.
TEXTS = ("name", "description", "bed")
#: A limit as far from rest is none, m.
FARTHEST = 1.0
Move = tuple[float, float, float]
#: Paths between two places.
LAYS = {"line": lay_line, "ring": lay_ring}


def _size() -> float:
    """Declare a size of the fingertip."""
    return quantity(0.0, "of the fingertip; 0: the bed's", unit="m", at_least=0.0, at_most=0.2)


@dataclass(frozen=True)
class PointerStroke(Parameters):
    """Stroke of the pointer, and the settings of the Press tool during it."""

    brush: str = quantity(
        Brush.LOWER.value.lower(),
        "effect on the surface",
        choices=tuple(brush.value.lower() for brush in Brush),
    )
    ctrl: bool = quantity(False, "whether Ctrl is held, which inverts the brush")
    depth: float = quantity(4e-3, "depth of Lower", unit="m", at_least=SHALLOWEST, at_most=DEEPEST)
    height: float = quantity(
        15e-3, "height of Raise", unit="m", at_least=SHALLOWEST, at_most=DEEPEST
    )
    strength: float = quantity(
        1.0, "share of depth, height or way to the level", above=0.0, at_most=1.0
    )
    path: str = quantity("free", "path between the moves", choices=("free", "line", "ring"))
    symmetry: str = quantity(
        "none", "mirror images", choices=tuple(name.lower() for name in SYMMETRIES)
    )
    radial: int = quantity(
        6, "number of images of a radial symmetry", at_least=FEWEST, at_most=MOST
    )
    center_x: float = quantity(0.0, "center of the symmetry", unit="m", at_least=-1.0, at_most=1.0)
    center_y: float = quantity(0.0, "center of the symmetry", unit="m", at_least=-1.0, at_most=1.0)
    axis: float = quantity(
        0.0, "turn of the mirrors' axes, in degrees", at_least=-360.0, at_most=360.0
    )
    stamp: str = quantity("heart", "what is stamped: a sample shape's name, or a file")
    combine: str = quantity(
        Combine.USUAL.value.lower(),
        "what the stroke leaves where something is formed",
        choices=tuple(combine.value.lower() for combine in Combine),
    )
    limit_low: float = quantity(
        -FARTHEST,
        "lowest that it forms above rest",
        unit="m",
        at_least=-FARTHEST,
        at_most=FARTHEST,
    )
    limit_high: float = quantity(
        FARTHEST,
        "highest that it forms above rest",
        unit="m",
        at_least=-FARTHEST,
        at_most=FARTHEST,
    )
    accumulate: bool = quantity(
        False, "whether a path that comes back counts from what it has left there"
    )
    falloff: str = quantity(
        "device",
        "flanks of Raise, Lower and Level, and effect of other brushes in the ring; device: those of "
        "blister and brush, Smooth and Erase as the valves sweep them",
        choices=tuple(falloff.value.lower() for falloff in Falloff),
    )
    finish: str = quantity(
        "nominal",
        "whether the valves bring the pins to the nominal surface when the fingertip has left",
        choices=("nominal", "as_left"),
    )
    stabilizer: float = quantity(
        0.0, "lag behind the pointer", unit="m", at_least=0.0, at_most=50e-3
    )
    length: float = _size()
    width: float = _size()
    thickness: float = _size()
    moves: tuple[Move, ...] = quantity(((0.0, 0.0, 0.0),), "time, s, and place, m, of the pointer")

    def check(self) -> None:
        """Times begin at 0 and never go back; a move has three finite numbers."""
        wrong = [move for move in self.moves if len(move) != 3 or not all(map(math.isfinite, move))]
        if wrong:
            rule = "must be lists of time, x and y, finite numbers"
            raise ParameterError("PointerStroke", "moves", rule, str(list(wrong[0])))
        combinations = COMBINATIONS.get(self.kind, (Combine.USUAL,))
        if Combine(self.combine.upper()) not in combinations:
            names = ", ".join(combine.value.lower() for combine in combinations)
            rule = f"must be one of {names} with {self.kind.value.lower()}"
            raise ParameterError("PointerStroke", "combine", rule, repr(self.combine))
        if self.limit_low > self.limit_high:
            rule = f"must be at most limit_high, {self.limit_high:g} m"
            raise ParameterError("PointerStroke", "limit_low", rule, f"{self.limit_low:g} m")
        times = [move[0] for move in self.moves]
        late = (
            [times[0]]
            if times[0] != 0.0
            else [later for earlier, later in pairwise(times) if later < earlier]
        )
        if late:
            rule = "must begin at 0 s and be in the order of time"
            raise ParameterError("PointerStroke", "moves", rule, f"{late[0]:g} s")

    @property
    def kind(self) -> Brush:
        """Brush that the stroke is formed with."""
        brush = Brush(self.brush.upper())
        return brush.inverse if self.ctrl else brush

    @property
    def shape(self) -> Falloff:
        """Falloff that the stroke is formed with."""
        return Falloff(self.falloff.upper())

    @property
    def amount(self) -> float:
        """Depth or height with its strength, m."""
        return self.strength * (self.height if self.kind.rises else self.depth)

    @property
    def images(self) -> tuple[Image, ...]:
        """The path and its images."""
        center = self.center_x, self.center_y
        return make_images(self.symmetry.upper(), self.radial, center, math.radians(self.axis))

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest that the stroke forms above rest, m; infinite: there is no limit."""
        low = self.limit_low if self.limit_low > -FARTHEST else -math.inf
        return low, self.limit_high if self.limit_high < FARTHEST else math.inf

    def size_finger(self, usual: Fingertip) -> Fingertip:
        """Return the fingertip of the stroke; what it leaves open is that of the bed."""
        return Fingertip(
            0.5 * self.length or usual.length,
            0.5 * self.width or usual.width,
            0.5 * self.thickness or usual.height,
        )


@dataclass(frozen=True)
class Recorded:
    """Strokes of a file, and the bed they were drawn on: a name of `settings.devices.BEDS`."""

    name: str
    bed: str
    strokes: tuple[PointerStroke, ...]


def read_strokes(path: Path) -> Recorded:
    """Read a file of recorded strokes; raise SceneError of one line: file, stroke, key, rule, value."""
    table = read_table(path)
    try:
        refuse_unknown("", table, (*TEXTS, "stroke"))
        name, bed = (
            _read_text(table, key, usual) for key, usual in (("name", path.stem), ("bed", "design"))
        )
        if bed not in BEDS:
            raise ParameterError("bed", "", f"must be one of {', '.join(BEDS)}", repr(bed))
        given = table.get("stroke", [])
        if (
            not isinstance(given, list)
            or not given
            or not all(isinstance(each, dict) for each in given)
        ):
            raise ParameterError(
                "stroke", "", "must be a list of tables, [[stroke]]", show_value(given)
            )
        strokes = tuple(
            read_part(f"stroke #{number}", PointerStroke, {}, table)
            for number, table in enumerate(given, 1)
        )
    except ParameterError as error:
        raise SceneError(f"{path}: {error}") from None
    return Recorded(name, bed, strokes)


def _read_text(table: Table, key: str, usual: str) -> str:
    """Return a text of the file."""
    value = table.get(key, usual)
    if not isinstance(value, str):
        raise ParameterError(key, "", "must be a text", show_value(value))
    return value


def play_strokes(running: Running, strokes: tuple[PointerStroke, ...]) -> Iterator[Running]:
    """Play strokes in a session, as fast as the machine can; yield the session after each tick."""
    usual = running.scene
    for number, stroke in enumerate(strokes, 1):
        tip = find_ellipsoid(usual)
        running, _ = change_scene(running, change_finger(usual, tip, stroke.size_finger(tip)))
        needed = needs_blister(stroke.kind, stroke.shape)
        if needed and find_tracking(running.scene, running.system) is None:
            raise StateError(
                f"Stroke {number} ({stroke.kind.value.lower()}) needs a method with a blister."
            )
        running = yield from _play(running, stroke, number)
    last, _ = change_scene(running, usual)
    yield last


def _play(
    running: Running, stroke: PointerStroke, number: int
) -> Generator[Running, None, Running]:
    """Draw a stroke, and continue the session until it is formed; yield it after each tick."""
    places = [(x, y) for _, x, y in stroke.moves]
    lagged = places[:1]
    for place in places[1:]:
        # Released, the stroke ends at the pointer.
        string = stroke.stabilizer if len(lagged) + 1 < len(places) else 0.0
        lagged.append(pull(lagged[-1], place, string))
    path = LAYS[stroke.path](places[0], places[-1]) if stroke.path in LAYS else lagged
    stamp = load_stamp(stroke.stamp) if stroke.kind in STAMPS else None
    begun = start(
        0,
        *places[0],
        stroke.amount,
        stroke.images,
        stroke.kind,
        stroke.strength,
        accumulate=stroke.accumulate,
        stamp=stamp,
        falloff=stroke.shape,
        combine=Combine(stroke.combine.upper()),
        limits=stroke.limits,
        as_left=stroke.finish == "as_left",
    )
    running, queued = queue_stroke(running, lay_path(begun, path))
    first, count = running.state.period, max(1, round(1.0 / (RATE * running.system.period)))
    while find_stroke(running, queued) is not None:
        running = follow_finger(replace(running, tick=running.tick + 1), running.pose, count)
        yield running
        if (running.state.period - first) * running.system.period > PATIENCE:
            raise StateError(
                f"The fingertip has not finished stroke {number} after {PATIENCE:g} s."
            )
    return running
