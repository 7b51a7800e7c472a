"""Sections of the overlay, and their placement in a view; no Blender."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..core.base.arrays import Floats, Indices
from ..core.base.modes import WAITING, Mode
from ..core.model.touch import MOST_FORCE, MOST_INDENTATION
from ..device import heat
from ..strokes.stroke import Correction
from ..ui_text import localize
from .picture import (
    LINES,
    Box,
    Color,
    Dot,
    Line,
    Look,
    Picture,
    Words,
    make_legible,
    round_axis,
    scale_curve,
)

#: Sizes at a UI scale of 1, pixels: letters, small letters, a row of letters, the curves of a plot.
LETTERS, SMALL, ROW, PLOT = 12.0, 10.0, 17.0, 58.0
#: Mean width of a letter of Blender's font, of its size, in the widest texts.
LETTER = 0.57
#: Space below a section.
GAP = 6.0
#: Width of the number and force of a fingertip, and of the numbers of an axis.
FINGER, LABEL = 85.0, 40.0
#: Set points that the axis of the force shows at most: a hard knock is drawn up to its end, and no
#: further.
MOST = 5.0
#: Shortest axes, N and mm: a quiet force is not drawn as a wild one.
LEAST_FORCE, LEAST_SPAN = 0.1, 1.0


@dataclass(frozen=True, eq=False)
class Readings:
    """Session data in the overlay."""

    #: Of the bed and of its control method; an empty method means no control.
    name: str
    method: str
    paused: bool
    waiting: bool
    #: Simulated over real time of the last second; None before there is one.
    factor: float | None
    #: Estimated errors of the heights, m, and of a cell's force, N; None before there is an
    #: estimate.
    errors: tuple[float, float] | None
    #: What the valves had to correct of the last press stroke; None where no finger formed it.
    correction: Correction | None
    #: Total force asked for now, N.
    set_point: float | None
    #: (t,), the last seconds: simulated time, s, and total force, N.
    time: Floats
    force: Floats
    #: The picked pins, k of them.
    pins: tuple[int, ...]
    #: (t, k), their heights, m; NaN where they were not followed yet.
    heights: Floats
    #: (m,), number of pins in each of the m modes.
    modes: Indices
    #: Of the modes, as the pins wear them.
    colors: tuple[Color, ...]
    #: How much of the past is shown, s.
    seconds: float
    #: Force from which on a pin has the last color, N; None while the colors tell the modes.
    top: float | None = None
    #: Whether the contact law does not hold now, by `core.model.touch`.
    beyond: bool = False
    #: Number of lines that a drive addresses now, of all, and of pins that wait; None: no drive.
    drive: tuple[int, int, int] | None = None
    #: Largest force of several fingertips now, N; None of one, whose force is the total.
    hardest: float | None = None
    #: How many pins are pressed, where meshes press them too; None: only fingertips do.
    pressed: int | None = None
    #: Numbers and colors of several fingertips, and the force of each, (t, f), N.
    fingers: tuple[tuple[int, Color], ...] = ()
    finger_force: Floats = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def window(self) -> tuple[float, float]:
        """First and last time shown, s."""
        end = float(self.time[-1]) if self.time.size else 0.0
        return end - self.seconds, end


@dataclass
class Pen:
    """Draws the readings of a session from the top down: colors, position, width, scale, pixels."""

    readings: Readings
    look: Look
    x: float
    #: Top of what is drawn next.
    y: float
    width: float
    scale: float
    picture: Picture = field(default_factory=Picture)

    def row(self, left: str, right: str = "", small: bool = False) -> None:
        """Write a row of two texts, left and right."""
        size = (SMALL if small else LETTERS) * self.scale
        size *= min(1.0, self.width / (LETTER * size * max(1, len(left) + len(right) + 1)))
        color = self.look.faint if small else self.look.ink
        y = self.y - 0.75 * ROW * self.scale
        for x, text, at_right in ((self.x, left, False), (self.x + self.width, right, True)):
            if text:
                self.picture.words.append(Words(x, y, size, color, text, at_right))
        self.y -= ROW * self.scale

    def leave(self, gap: float = GAP) -> None:
        """Leave a gap, at a UI scale of 1."""
        self.y -= gap * self.scale

    def plot(self, ends: tuple[float, float], unit: str) -> Box:
        """Draw the frame of a plot, its axis and the time shown; return the box of its curves."""
        top, height = self.y, PLOT * self.scale
        box = Box(self.x, top - height, self.width, height, self.look.back)
        step, size = 3.0 * self.scale, SMALL * self.scale
        for y, value, lift in ((box.y, ends[0], step), (top, ends[1], -size)):
            self.level(box, y, self.look.frame, 1.0)
            label = f"{value:g} {unit}"
            self.picture.words.append(Words(box.x + step, y + lift, size, self.look.faint, label))
        self.y = box.y
        self.row("", localize("last {:g} s", self.readings.seconds), small=True)
        return box

    def level(
        self, box: Box, y: float, color: Color, width: float, *, dashed: bool = False
    ) -> None:
        """Draw a level line across the box of a plot; one that is dashed leaves the axis legible."""
        start = box.x + (LABEL * self.scale if dashed else 0.0)
        line = np.array([[start, y], [box.x + box.width, y]])
        self.picture.lines.append(Line(line, color, width * self.scale, dashed))

    def curve(self, value: Floats, ends: tuple[float, float], box: Box, color: Color) -> None:
        """Draw a curve (t,) into the box of a plot."""
        points = scale_curve(self.readings.time, value, self.readings.window, ends, box)
        if len(points) > 1:
            self.picture.lines.append(Line(points, color, 1.5 * self.scale))

    def entries(self, columns: int, entries: Sequence[tuple[Color, str]]) -> None:
        """Draw dots and what they stand for, row by row."""
        radius = 4.0 * self.scale
        size = (SMALL + 1.0) * self.scale
        for number, (color, text) in enumerate(entries):
            row, column = divmod(number, columns)
            x, y = self.x + column * self.width / columns, self.y - (row + 0.75) * ROW * self.scale
            middle = y + 0.36 * size
            self.picture.dots.append(Dot(x + radius, middle, radius + self.scale, self.look.frame))
            self.picture.dots.append(Dot(x + radius, middle, radius, color))
            self.picture.words.append(Words(x + 3.5 * radius, y, size, self.look.ink, text))
        self.y -= math.ceil(len(entries) / columns) * ROW * self.scale


def error_message(errors: Sequence[float] | None) -> str:
    """Return the text of the estimated errors of a height, m, and of a cell's force, N."""
    if errors is None:
        return localize("Solver error: not estimated yet")
    return localize(
        "Solver error: about {}, {}", _size(errors[0] * 1e6, "µm"), _size(errors[1] * 1e3, "mN")
    )


def correction_message(correction: Correction | None) -> str:
    """Return the text of how far the last stroke was from its nominal surface; empty without any."""
    if correction is None:
        return ""
    words = "Last stroke corrected: {:.2f} mm rms, max {:.2f} mm"
    if not correction.made:
        words = "Last stroke off nominal: {:.2f} mm rms, max {:.2f} mm"
    return localize(words, 1e3 * correction.rms, 1e3 * correction.largest)


def effort_message(effort: tuple[float, ...]) -> str:
    """Return the text of the time that a take took, s, and of its errors, or of what is not known."""
    if not effort:
        return localize("Time and error not estimated: replay it in finer steps")
    return localize("{:.2g} s of computing. {}", effort[0], error_message(effort[1:] or None))


def force_message(force: float, *, beyond: bool = False, hardest: float | None = None) -> str:
    """Return the text of the total force, N, and whether the law does not hold; `hardest`: of a finger."""
    if force >= 100.0:
        return localize("{:.3g} N: no finger", force)
    if (force if hardest is None else hardest) > MOST_FORCE:
        return localize("{:.1f} N: beyond {:g} N", force, MOST_FORCE)
    return (
        localize("{:.2f} N: beyond {:g} mm", force, MOST_INDENTATION * 1e3)
        if beyond
        else f"{force:.2f} N"
    )


def describe_state(readings: Readings) -> str:
    """Return whether a session is paused or waits, and else its speed."""
    if readings.paused or readings.waiting:
        return localize("paused" if readings.paused else "waiting")
    return "" if readings.factor is None else localize("{:.2f} x real time", readings.factor)


def _draw_head(pen: Pen) -> None:
    """Name the bed, the method and how well the simulation keeps up."""
    readings = pen.readings
    pen.row(readings.name, describe_state(readings))
    pen.row(localize("Method: {}", localize(readings.method.replace("_", " ") or "none")))
    pen.row(error_message(readings.errors), small=True)
    if readings.correction:
        pen.row(correction_message(readings.correction), small=True)
    pen.leave()


def _draw_force(pen: Pen) -> None:
    """Draw the force over the last seconds, of several fingertips each one's, its set point dashed."""
    readings = pen.readings
    words = "set point {:.2f} N each" if readings.hardest is not None else "set point {:.2f} N"
    asked = "" if readings.set_point is None else localize(words, readings.set_point)
    pen.row(localize("Total force  {}", _tell_force(readings)), asked)
    # A sum would flatten the force of each.
    curves = list(
        zip(readings.finger_force.T, (color for _, color in readings.fingers), strict=False)
    )
    curves = curves or [(readings.force, pen.look.force)]
    recent, asked_for = readings.time >= readings.window[0], readings.set_point or 0.0
    largest = max(float(curve[recent].max(initial=0.0)) for curve, _ in curves)
    if asked_for:
        largest = min(max(largest, 1.2 * asked_for), MOST * asked_for)
    largest = max(largest, LEAST_FORCE)
    ends = (0.0, round_axis(0.0, largest)[1])
    box = pen.plot(ends, "N")
    if readings.set_point is not None:
        y = box.y + readings.set_point / ends[1] * box.height
        pen.level(box, y, pen.look.set_point, 1.5, dashed=True)
    for curve, color in curves:
        pen.curve(curve, ends, box, make_legible(color, pen.look.back, LINES))
    _draw_fingers(pen)
    pen.leave()


def _draw_fingers(pen: Pen) -> None:
    """List the force of each of several fingertips by number."""
    fingers, forces = pen.readings.fingers, pen.readings.finger_force
    texts = zip(fingers, forces[-1] if len(forces) else np.zeros(len(fingers)), strict=True)
    entries = [(color, f"{number}: {force:.2f} N") for (number, color), force in texts]
    pen.entries(int(pen.width / (FINGER * pen.scale)), entries)


def _tell_force(readings: Readings) -> str:
    """Return the text of the total force now; empty before there is one."""
    if not readings.force.size:
        return ""
    if readings.pressed is not None:
        return localize("{:.2f} N on {} pins", float(readings.force[-1]), readings.pressed)
    return force_message(
        float(readings.force[-1]), beyond=readings.beyond, hardest=readings.hardest
    )


def _draw_heights(pen: Pen) -> None:
    """Draw the heights of the picked pins over the last seconds."""
    readings = pen.readings
    if readings.pins:
        _plot_heights(pen)
    else:
        pen.row(localize("Pick pins to see their heights (Laboratory)"), small=True)
    pen.leave()


def _plot_heights(pen: Pen) -> None:
    """Draw the curve of each picked pin, and list its height now."""
    readings = pen.readings
    pen.row(localize("Heights of picked pins"))
    values = readings.heights * 1e3
    recent = values[readings.time >= readings.window[0]]
    finite = recent[np.isfinite(recent)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    spare = max(0.0, LEAST_SPAN - (high - low)) / 2
    ends = round_axis(low - spare, high + spare)
    box = pen.plot(ends, "mm")
    entries = []
    for pin, color, curve in zip(readings.pins, pen.look.pins, values.T, strict=False):
        pen.curve(curve, ends, box, color)
        now = f" {curve[-1]:.1f} mm" if np.isfinite(curve[-1:]).any() else ""
        entries.append((color, f"{pin}:{now}"))
    pen.entries(3, entries)


def _draw_scale(pen: Pen) -> None:
    """Draw the colors of the force on a pin, if the pins wear them."""
    if pen.readings.top is None:
        return
    pen.row(localize("Force on a pin"))
    width, height = pen.width / len(heat.COLORS), 0.5 * ROW * pen.scale
    pen.y -= height
    for level, color in enumerate(heat.COLORS):
        pen.picture.boxes.append(Box(pen.x + level * width, pen.y, width, height, color))
    pen.row("0 N", f"{pen.readings.top:.3g} N", small=True)
    pen.leave(0.1 * ROW)


def _draw_modes(pen: Pen) -> None:
    """List how many pins are in each mode that occurs, with its color."""
    modes, colors = pen.readings.modes, pen.readings.colors
    pen.row(localize("Pins by mode"), f"{int(modes.sum())}")
    names = {mode: localize(mode.name.lower().replace("_", " ")) for mode in Mode if modes[mode]}
    pen.entries(2, [(colors[mode], f"{modes[mode]} {name}") for mode, name in names.items()])
    if pen.readings.drive:
        served, lines, waiting = pen.readings.drive
        pen.row(localize("{} of {} lines addressed", served, lines))
        pen.entries(1, [(WAITING, localize("{} pins wait", waiting))])


def _size(error: float, unit: str) -> str:
    """Return the text of an error."""
    return f"{error:.2g} {unit}" if error >= 0.01 else localize("0.01 {} or less", unit)


def _draw_brief(pen: Pen) -> None:
    """Write force, set point, simulated time and state in two rows."""
    readings = pen.readings
    words = "{:.2f} N each" if readings.hardest is not None else "of {:.2f} N"
    asked = "" if readings.set_point is None else localize(words, readings.set_point)
    pen.row(_tell_force(readings) or localize("no force yet"), asked)
    time = float(readings.time[-1]) if readings.time.size else 0.0
    pen.row(f"{time:.1f} s", describe_state(readings))
    _draw_fingers(pen)


#: Draws a section with a pen.
Section = Callable[[Pen], None]


class Content(NamedTuple):
    """Sections of the overlay from the top down, and their width at a UI scale of 1, pixels."""

    sections: tuple[Section, ...]
    width: float


COMPACT = Content((_draw_brief,), 190.0)
FULL = Content((_draw_head, _draw_force, _draw_scale, _draw_heights, _draw_modes), 290.0)
#: Space about the overlay and in it, pixels.
MARGIN, PADDING = 12.0, 10.0
#: Height that Blender's own text and gizmos take in corners of the view at a UI scale of 1, pixels.
TAKEN = {"top_left": 54.0, "top_right": 220.0}
#: Opacity of the box behind it all: the bed shines through a little.
BACK_ALPHA = 0.95
#: Most of the room's height that is taken: the bed is what one looks at.
SHARE = 0.75

#: Left, bottom, right and top of a part of the view, pixels.
Room = tuple[float, float, float, float]
Place = tuple[float, float]


def find_room(width: float, height: float, covered: list[tuple[str, float]]) -> Room:
    """Return the part of a view, pixels, that no panel covers; `covered`: sides, and depths of the panels."""
    deep = {"LEFT": 0.0, "RIGHT": 0.0, "TOP": 0.0, "BOTTOM": 0.0}
    for side, depth in covered:
        deep[side] += depth
    return deep["LEFT"], deep["BOTTOM"], width - deep["RIGHT"], height - deep["TOP"]


def find_covered(
    room: Room, scale: float, corner: str, box: Box | None = None, fingers: int = 0
) -> Room:
    """Return left, bottom, right and top of what the overlay takes of a corner of a room, pixels.

    `box`: that of the overlay; None: of a compact one that tells the forces of so many fingers, two
    in a row.
    """
    left, bottom, right, top = room
    wide, tall = COMPACT.width * scale, (2 * PADDING + ROW * (2 + math.ceil(fingers / 2))) * scale
    wide, tall = (box.width, box.height) if box else (wide, tall)
    wide, tall = wide + 2 * MARGIN * scale, tall + (2 * MARGIN + TAKEN.get(corner, 0.0)) * scale
    at_top, at_left = corner.startswith("top"), corner.endswith("left")
    x, y = (left, left + wide) if at_left else (right - wide, right), (top - tall, top)
    y = y if at_top else (bottom, bottom + tall)
    return x[0], y[0], x[1], y[1]


#: Distance of a label from its place: beside and below it, at a UI scale of 1, pixels.
BESIDE, BELOW = 22.0, 26.0


def place_label(xy: Place, size: Place, room: Room, scale: float) -> Place:
    """Return the left end and base line of a label of a size beside a place, inside a room, pixels."""
    left, bottom, right, top = room
    x = xy[0] + BESIDE * scale
    if x + size[0] > right:  # it stands to the left of its place
        x = xy[0] - BESIDE * scale - size[0]
    y = max(xy[1] - BELOW * scale, bottom)
    return max(min(x, right - size[0]), left), min(y, top - size[1])


def lay_out(
    readings: Readings,
    look: Look,
    room: Room,
    scale: float,
    content: Content = FULL,
    corner: str = "bottom_right",
) -> Picture:
    """Lay the overlay out in a corner of a room; sections that do not fit are left out."""
    left, bottom, right, top = room
    top -= TAKEN.get(corner, 0.0) * scale
    width, margin, padding = content.width * scale, MARGIN * scale, PADDING * scale
    x = left + margin if corner.endswith("left") else right - margin - width
    if right - left < width + 2 * margin:
        return Picture()
    # How high it stands follows from its height, so it is drawn below 0 and then moved up.
    shown, height, space = Picture(), 0.0, SHARE * (top - bottom) - 2 * padding
    for section in content.sections:
        pen = Pen(readings, look, x + padding, -height, width - 2 * padding, scale)
        section(pen)
        if -pen.y <= space:
            shown.add(pen.picture)
            height = -pen.y
    if not height:
        return Picture()
    tall = height + 2 * padding
    y = top - margin - tall if corner.startswith("top") else bottom + margin
    picture = Picture([Box(x, y, width, tall, look.back, BACK_ALPHA)])
    picture.add(shown.move_up(y + tall - padding))
    return picture
