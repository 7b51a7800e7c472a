"""Benchmark ``made``: things formed by recorded strokes, beside what was intended."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import radians
from pathlib import Path

import numpy as np
from digiclay.commands.stop import refuse_unwritable
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.scene.schema import Scene
from digiclay.core.session.render_settings import Still
from digiclay.device import view
from digiclay.device.instant import CLEARANCE, Instant
from digiclay.pictures import stage
from digiclay.pictures.still import render_picture, stage_bed
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes, read_strokes
from digiclay.roles import fingertip_of
from digiclay.sessions.sculpting import begin_session
from digiclay.settings.devices import BEDS, make_scene
from numpy.typing import NDArray

from .kinds import STROKES
from .report import Report, Steps, tabulate

Relief = Callable[[Floats, Floats], Floats]
Corners = Sequence[tuple[float, float]]

#: Section of a stroke by the bed's fingertip, and by a stylus of 6 mm: half its floor or top, and half of all.
TIP, STYLUS = (3.0, 7.5), (2.25, 5.625)


@dataclass(frozen=True)
class Line:
    """Drawn line: its corners, its height above what it is drawn on, and its section, mm; closed: an area."""

    corners: Corners
    height: float
    section: tuple[float, float] = TIP
    area: bool = False

    def evaluate(self, x: Floats, y: Floats) -> Floats:
        """Return heights at some places: even up to the flat part, and then down to nothing."""
        sides = pairwise(self.corners) if len(self.corners) > 1 else [(*self.corners, *self.corners)]
        far = np.min([_find_distance(start, end, x, y) for start, end in sides], axis=0)
        if self.area:
            far = np.where(_lies_inside(self.corners, x, y), 0.0, far)
        flat, half = self.section
        return np.asarray(self.height * np.clip((half - far) / (half - flat), 0.0, 1.0))


def _arc(x: float, y: float, radius: float, start: float, end: float) -> Corners:
    """Return the corners of an arc from angle to angle, degrees."""
    angles = np.radians(np.linspace(start, end, 1 + max(2, round(abs(end - start)))))
    return [(x + radius * np.cos(a), y + radius * np.sin(a)) for a in angles.tolist()]


def _mirror(*lines: Line) -> list[Line]:
    """Return lines and their mirror images."""
    return [replace(line, corners=[(s * x, y) for x, y in line.corners]) for line in lines for s in (1, -1)]


def _draw_r(height: float) -> list[Line]:
    """Stem, bowl and leg of a letter R."""
    bowl = [(-28.0, 50.0), *_arc(4.0, 25.0, 25.0, 90.0, -90.0), (-28.0, 0.0)]
    return [Line(part, height) for part in ([(-28.0, -50.0), (-28.0, 50.0)], bowl, [(4.0, 0.0), (30.0, -50.0)])]


#: Letter A without serifs, of one depth.
LETTER_A = [
    Line([(-40.0, -50.0), (0.0, 50.0), (40.0, -50.0)], -5.0), Line([(-25.2, -12.0), (25.2, -12.0)], -5.0),
]  # fmt: skip
#: Spiral whose turns are 18 mm apart: 400 mm between its first and its last radius.
SPIRAL = [(r * np.cos(a), r * np.sin(a)) for r in np.linspace(4.0, 48.04, 1000) for a in (2 * np.pi * (r - 4) / 18,)]
#: Leaf between two arcs from tip to tip, midrib with a stalk, and veins.
LEAF = [
    *_mirror(Line(_arc(-31.6, 2.5, 65.6, -61.2, 61.2), 5.0, STYLUS)),
    Line([(0.0, 60.0), (0.0, -68.0)], 5.0, STYLUS),
    *_mirror(*(Line(vein, 3.0, STYLUS) for vein in (
        [(0.0, -30.0), (23.0, -6.0)], [(0.0, -5.0), (23.0, 19.0)], [(0.0, 20.0), (16.0, 38.0)]))),
]  # fmt: skip
#: Coin: rim, star of five points, beads.
STAR = [(38.0 * np.sin(a), 38.0 * np.cos(a)) for a in np.radians(144.0 * np.arange(6)).tolist()]
COIN = [
    Line(_arc(0.0, 0.0, 62.0, 0.0, 360.0), 5.0), Line(STAR, 4.0, STYLUS),
    *(Line([bead], 3.0, STYLUS) for bead in _arc(0.0, 0.0, 46.0, 15.0, 345.0)[::30]),
]  # fmt: skip
SMILEY = [
    Line(_arc(0.0, 0.0, 52.0, 0.0, 360.0), 6.0), *_mirror(Line([(18.0, 22.0), (18.0, 12.0)], -5.0)),
    Line(_arc(0.0, 0.0, 29.0, 205.0, 335.0), -5.0),
]  # fmt: skip
#: Head in profile: its contour; on it an ear, an eye, a mouth and three waves of hair.
HEAD = [
    (-8, -60), (-12, -44), (-26, -41), (-34, -35), (-31, -28), (-37, -23), (-33, -19.5), (-38, -15), (-35, -11),
    (-48, -6), (-36, 12), (-39, 19), (-36, 34), (-23, 50), (0, 57), (22, 52), (38, 36), (42, 16), (34, -6),
    (26, -18), (24, -40), (28, -60), (-8, -60),
]  # fmt: skip
PORTRAIT = (
    [Line(HEAD, 5.0, area=True)],
    [
        Line(_arc(8.0, 2.0, 9.0, 120.0, -120.0), 2.5, STYLUS),
        Line([(-26.0, 8.0), (-20.0, 9.0)], -3.0, STYLUS), Line([(-34.0, -19.5), (-22.0, -20.0)], -2.0, STYLUS),
        *(Line(_arc(4.0, 6.0, *wave), -2.0, STYLUS) for wave in ((22, 130, 5), (32, 125, 5), (42, 115, 20))),
    ],
)  # fmt: skip
#: Paraboloid of a bowl: radius and depth; its rim: radius, height and half its breadth.
BOWL, RIM = (44.0, 12.0), (48.0, 5.0, 10.0)


def find_relief(name: str, x: Floats, y: Floats) -> Floats:
    """Return the intended heights above rest at some places, m. `name`: one of `RELIEFS`; `x`, `y`, m."""
    return 1e-3 * RELIEFS[name](1e3 * x, 1e3 * y)


def _drawn(*layers: Sequence[Line]) -> Relief:
    """Return the relief of lines: where those of a layer cross the greater counts; layers add up."""

    def relief(x: Floats, y: Floats) -> Floats:
        """Add up the layers."""
        heights = [np.array([line.evaluate(x, y) for line in layer]) for layer in layers]
        return np.asarray(sum(one.max(axis=0).clip(0.0) + one.min(axis=0).clip(None, 0.0) for one in heights))

    return relief


def _lies_inside(corners: Corners, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Return whether places are inside a closed polygon: a ray from there crosses it an odd number of times."""
    inside = np.zeros(x.shape, np.bool_)
    for (ax, ay), (bx, by) in pairwise(corners):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (bx - ax) * (y - ay) / (by - ay))
    return inside


def _crater(x: Floats, y: Floats) -> Floats:
    """Bowl with a round rim."""
    far, (radius, depth), (at, height, breadth) = np.hypot(x, y), BOWL, RIM
    bowl = -depth * np.clip(1.0 - (far / radius) ** 2, 0.0, None)
    return bowl + height * _bump((far - at) / breadth)


def _face(x: Floats, y: Floats) -> Floats:
    """Half an ellipsoid with eyes, nose and mouth."""
    side = np.abs(x)
    head = 10.0 * np.sqrt(np.clip(1.0 - (x / 46.0) ** 2 - (y / 56.0) ** 2, 0.0, None))
    eyes = -5.0 * _bump(np.hypot((side - 17.0) / 10.0, (y - 14.0) / 7.0))
    nose = 6.0 * _bump(_find_distance((0.0, 12.0), (0.0, -8.0), x, y) / 6.0)
    smile = np.hypot(x, y + 2.0) - 26.0
    mouth = -4.0 * _bump(np.hypot(smile / 5.0, np.clip(side - 14.0, 0.0, None) / 5.0)) * (y < -2.0)
    return np.asarray(head + eyes + nose + mouth)


def _bump(far: Floats) -> Floats:
    """Return a round hill of height 1 that ends at the distance 1."""
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(np.abs(far), 1.0)))


def _find_distance(start: tuple[float, float], end: tuple[float, float], x: Floats, y: Floats) -> Floats:
    """Return how far places are from a line between two places."""
    along, across = end[0] - start[0], end[1] - start[1]
    square = along**2 + across**2
    share = ((x - start[0]) * along + (y - start[1]) * across) / (square or 1.0)
    share = np.clip(share, 0.0, 1.0)
    return np.hypot(x - start[0] - share * along, y - start[1] - share * across)


RELIEFS: dict[str, Relief] = {
    "letter_a": _drawn(LETTER_A),
    "r_lowered": _drawn(_draw_r(-4.0)),
    "r_raised": _drawn(_draw_r(8.0)),
    "smiley": _drawn(SMILEY),
    "spiral": _drawn([Line(SPIRAL, -6.0)]),
    "ring": _drawn([Line(_arc(0.0, 0.0, 45.0, 0.0, 360.0), 8.0)]),
    "lines": _drawn([Line([(-50.0, y), (50.0, y)], -3.0) for y in range(-54, 60, 12)]),
    "coin": _drawn(COIN),
    "portrait": _drawn(*PORTRAIT),
    "crater": _crater,
    "leaf": _drawn(LEAF),
    "face": _face,
}


#: The things: each has recorded strokes and an intended relief.
THINGS = tuple(RELIEFS)


@dataclass(frozen=True, eq=False)
class Made:
    """Thing made on a bed."""

    name: str
    """One of `THINGS`."""
    title: str
    """For people."""
    bed: str
    own_bed: str
    """One of `BEDS`: where it was made, and where its strokes were drawn."""
    scene: Scene
    formed: Floats
    intended: Floats
    """(n,): Heights of the pins above rest, m."""
    strokes: int
    simulated: float
    spent: float
    """Duration of the session, and processor time for it, s."""

    @property
    def correlation(self) -> float:
        """Pearson's coefficient of formed and intended heights over all pins."""
        return float(np.corrcoef(self.formed, self.intended)[0, 1])

    @property
    def slope(self) -> float:
        """Slope of the regression of formed on intended heights: 1 when nothing is scaled."""
        formed, intended = self.formed - self.formed.mean(), self.intended - self.intended.mean()
        return float(formed @ intended / (intended @ intended))

    @property
    def error(self) -> float:
        """Root of the mean square of formed less intended heights, m."""
        return float(np.sqrt(np.mean((self.formed - self.intended) ** 2)))


def make(name: str, bed: str | None = None) -> Made:
    """Play the strokes of one of `THINGS`, scaled, on a bed of `BEDS`; by default that of the file."""
    recorded = read_strokes(STROKES / f"{name}.toml")
    drawn, other = BEDS[recorded.bed], BEDS[bed or recorded.bed]
    share = other.columns * other.pitch / (drawn.columns * drawn.pitch)
    layout = Layout(rows=other.rows, columns=other.columns, pitch=other.pitch)
    scene = make_scene("paper", layout, "virtual_master", other.share)
    above = np.array([0.0, 0.0, scene.actuator.rest_height + CLEARANCE, *LEVEL])
    session, _ = begin_session(1, recorded.name, scene, above)
    started = time.process_time()
    *_, session = play_strokes(session, rescale(recorded.strokes, share))
    spent = time.process_time() - started
    place = session.system.grid.positions.T / share
    formed = session.state.row(0) - scene.actuator.rest_height
    return Made(
        name, recorded.name, bed or recorded.bed, recorded.bed, scene, formed,
        find_relief(name, place[0], place[1]), len(recorded.strokes),
        session.state.period * session.system.period, spent,
    )  # fmt: skip


def rescale(strokes: tuple[PointerStroke, ...], share: float) -> tuple[PointerStroke, ...]:
    """Return strokes on a bed of another width; depths and heights stay."""
    return tuple(
        replace(one, moves=tuple((at, share * x, share * y) for at, x, y in one.moves)) for one in strokes
    )


#: Size of one of the two pictures, pixels, and samples a pixel.
WIDTH, HEIGHT, SAMPLES = 640, 500, 6
#: Turn of the bed, so that its lower edge is in front, rad; what is kept free around it, by sides.
TURN, MARGINS = radians(28.0), (0.04, 0.04, 0.05, 0.12)
#: How far the housing ends below the lowest pin, m.
CLEAR = 1e-3
#: Size of the letters, pixels, their distance from the corner, and their color.
LETTERS, INSET, INK = 20, (16, 12), (26, 31, 38)


def draw_made(made: Made, out: Path) -> None:
    """Draw a thing as it was formed and as it was intended, side by side, as a JPEG."""
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        raise OutputError("Pictures of made things need Pillow: pip install digiclay[images].") from None
    lowest = min(float(made.formed.min()), float(made.intended.min()))
    whole = Image.new("RGB", (2 * WIDTH, HEIGHT))
    pen = ImageDraw.Draw(whole)
    formed = f"formed on the bed {made.bed}, correlation {made.correlation:.3f}"
    with tempfile.TemporaryDirectory() as folder:
        for number, (relief, words) in enumerate(((made.formed, formed), (made.intended, "intended"))):
            file = Path(folder) / f"{number}.png"
            draw_relief(made.scene, relief, lowest, file)
            whole.paste(Image.open(file).convert("RGB"), (number * WIDTH, 0))
            place = number * WIDTH + INSET[0], INSET[1]
            pen.text(place, f"{made.title}: {words}", INK, ImageFont.load_default(LETTERS))
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        whole.save(out, quality=90)
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None


def draw_relief(scene: Scene, relief: Floats, lowest: float, out: Path) -> None:
    """Draw the skin over pins at heights above rest, (n,), m, as a PNG, without fingertip; lowest of both."""
    looks = Still(width=WIDTH, height=HEIGHT, engine="cycles", samples=SAMPLES)
    rest = Instant.at_rest(scene.layout, scene.actuator)
    instant = replace(rest, height=rest.height + relief)
    floor = scene.actuator.rest_height + lowest - CLEAR
    with stage_bed("Digital Clay Made Thing", instant, looks, floor) as (drawn, bed):
        view.set_form(bed, "skin")
        bed.rotation_euler.z = TURN
        tip = fingertip_of(bed)
        for part in (tip, *tip.children_recursive) if tip is not None else ():
            part.hide_render = True
        points = stage.outline(bed)
        below = points[points[:, 2] <= points[: len(relief), 2].max()]  # without the fingertip
        stage.set_up(drawn, bed, instant, points=below, modes=(), margins=MARGINS)
        render_picture(drawn, out, out)


#: Columns of the table.
COLUMNS = {
    "thing": "title", "bed": "bed", "strokes": "strokes d", "simulated, s": "simulated .1f",
    "correlation": "correlation .3f", "slope": "slope .2f", "rms, mm": "rms .2f 1e3",
    "rms of relief, mm": "relief .2f 1e3", "CPU, s": "CPU .1f",
}  # fmt: skip


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Make the things, and draw them with ``--pictures``."""
    beds = [arguments.bed] if arguments.bed else []
    for option, given, choices in (("THING", arguments.things, THINGS), ("--bed", beds, tuple(BEDS))):
        for name in set(given) - set(choices):
            raise ParameterError(option, "", f"must be one of {', '.join(choices)}", repr(name))
    if arguments.pictures is not None:
        refuse_unwritable(arguments.pictures)
    rows = []
    for name in steps.through(arguments.things or THINGS[: 1 if arguments.quick else None]):
        made = make(name, arguments.bed)
        rows.append({
            "thing": made.name, "bed": made.bed, "strokes": made.strokes, "simulated": made.simulated,
            "correlation": made.correlation, "slope": made.slope, "rms": made.error,
            "relief": float(made.intended.std()), "CPU": made.spent, "title": made.title,
        })  # fmt: skip
        if arguments.pictures is not None:
            other = "" if made.bed == made.own_bed else f"_{made.bed}"
            draw_made(made, arguments.pictures / f"made_{name}{other}.jpg")
    return Report(["", *tabulate(rows, COLUMNS)], rows)
