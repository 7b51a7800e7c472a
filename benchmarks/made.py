"""Benchmark ``made``: things formed by recorded strokes, beside what was intended."""

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from math import cos, radians, sin
from pathlib import Path

import numpy as np
from digiclay.commands.refusals import refuse_unwritable
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError, ParameterError, explain_os_error
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Grid, Layout
from digiclay.core.scene.schema import Scene
from digiclay.core.session.render_settings import Still
from digiclay.device import view
from digiclay.device.instant import CLEARANCE, Instant
from digiclay.pictures import stage
from digiclay.pictures.still import render_picture, stage_bed
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes, read_strokes
from digiclay.roles import fingertip_of
from digiclay.sessions.running import Running
from digiclay.sessions.sculpting import begin_session
from digiclay.settings.devices import BEDS, FIRST, make_scene

from .intended import THINGS, find_relief
from .kinds import STROKES
from .report import Report, Steps, tabulate


def move(
    strokes: tuple[PointerStroke, ...], angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0),
    share: float = 1.0,
) -> tuple[PointerStroke, ...]:  # fmt: skip
    """Return strokes turned by an angle, rad, scaled, and shifted, m; depths and heights stay."""
    c, s, (x0, y0) = share * cos(angle), share * sin(angle), shift
    return tuple(
        replace(one, moves=tuple((t, c * x - s * y + x0, s * x + c * y + y0) for t, x, y in one.moves))
        for one in strokes
    )


@dataclass(frozen=True, eq=False)
class Played:
    """What strokes have left on an even bed."""

    session: Running
    formed: Floats
    """(n,): Heights above rest, m."""
    force: float
    """Greatest total force on a fingertip, N."""
    time: float
    """Simulated until all is formed, s."""
    strokes: tuple[PointerStroke, ...]

    @property
    def grid(self) -> Grid:
        """Of the pins."""
        return self.session.system.grid


def make_bed(name: str = FIRST, side: int | None = None) -> Scene:
    """Return a bed as Add makes it, or one with so many rows and columns."""
    bed = BEDS[name]
    layout = Layout(rows=side or bed.rows, columns=side or bed.columns, pitch=bed.pitch)
    return make_scene(bed.preset, layout, bed.method, bed.share)


def begin(scene: Scene) -> Running:
    """Return a session of a bed at rest, the fingertip above it."""
    above = np.array([0.0, 0.0, scene.actuator.rest_height + CLEARANCE, *LEVEL])
    return begin_session(1, "Bed", scene, above)[0]


def play(scene: Scene, strokes: tuple[PointerStroke, ...]) -> Played:
    """Play strokes on a bed at rest."""
    session, force, rest = begin(scene), 0.0, scene.actuator.rest_height
    for after in play_strokes(session, strokes):
        # A trace has the total of the fingertips; what each of several feels is seen at the end of a tick.
        one, since = len(session.poses) == len(after.poses) == 1, after.state.period - session.state.period
        felt = after.trace.force[-since:] if one and since else after.state.finger_forces()
        session, force = after, max(force, float(felt.max(initial=0.0)))
    time = session.state.period * session.system.period
    return Played(session, session.state.row(0) - rest, force, time, strokes)


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
    played: Played
    hand: float
    spent: float
    """Time that the hand drew, and processor time to form it, s."""

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
    started = time.process_time()
    played = play(make_bed(bed or recorded.bed), move(recorded.strokes, share=share))
    spent = time.process_time() - started
    place = played.grid.positions.T / share
    hand = sum(one.moves[-1][0] for one in recorded.strokes)
    return Made(
        name, recorded.name, bed or recorded.bed, recorded.bed, played.session.scene, played.formed,
        find_relief(name, place[0], place[1]), played, hand, spent,
    )  # fmt: skip


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
    with explain_os_error(f"{out} cannot be written"):
        out.parent.mkdir(parents=True, exist_ok=True)
        whole.save(out, quality=90)


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
    "thing": "title", "bed": "bed", "strokes": "strokes d", "hand, s": "hand .1f", "formed, s": "formed .1f",
    "force, N": "force .2f", "correlation": "correlation .3f", "slope": "slope .2f", "rms, mm": "rms .2f 1e3",
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
            "thing": made.name, "bed": made.bed, "strokes": len(made.played.strokes), "hand": made.hand,
            "formed": made.played.time, "force": made.played.force, "correlation": made.correlation,
            "slope": made.slope, "rms": made.error, "relief": float(made.intended.std()),
            "CPU": made.spent, "title": made.title,
        })  # fmt: skip
        if arguments.pictures is not None:
            other = "" if made.bed == made.own_bed else f"_{made.bed}"
            draw_made(made, arguments.pictures / f"made_{name}{other}.jpg")
    return Report(["", *tabulate(rows, COLUMNS)], rows)
