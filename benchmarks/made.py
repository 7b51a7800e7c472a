"""Benchmark ``made``: things formed by recorded strokes, beside what was intended."""

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path

import numpy as np
from digiclay.commands.stop import refuse_unwritable
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError, ParameterError, explain_os_error
from digiclay.core.scene.schema import Scene
from digiclay.core.session.render_settings import Still
from digiclay.device import view
from digiclay.device.instant import Instant
from digiclay.pictures import stage
from digiclay.pictures.still import render_picture, stage_bed
from digiclay.recorded.pointer_strokes import read_strokes
from digiclay.roles import fingertip_of
from digiclay.settings.devices import BEDS

from .alike import Played, compare, find_spikes, make_bed, move, play
from .intended import THINGS, find_relief
from .kinds import STROKES
from .report import Report, Steps, tabulate


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


def find_new_spike(made: Made) -> float:
    """Return how far a pin is beyond all its neighbors at most, as none is meant to be, m."""
    grid = made.played.grid
    return float((find_spikes(made.formed, grid) - find_spikes(made.intended, grid)).max())


#: Columns of the table.
COLUMNS = {
    "thing": "title", "bed": "bed", "strokes": "strokes d", "hand, s": "hand .1f", "formed, s": "formed .1f",
    "force, N": "force .2f", "correlation": "correlation .3f", "slope": "slope .2f", "rms, mm": "rms .2f 1e3",
    "rms of relief, mm": "relief .2f 1e3", "uneven, rms, mm": "uneven .3f 1e3", "most, mm": "most .2f 1e3",
    "spike, mm": "spike .2f 1e3", "CPU, s": "CPU .1f",
}  # fmt: skip


def measure(arguments: argparse.Namespace, steps: Steps) -> Report | list[Report]:
    """Make the things, and draw them with ``--pictures``; without names also `compare`."""
    beds = [arguments.bed] if arguments.bed else []
    for option, given, choices in (("THING", arguments.things, THINGS), ("--bed", beds, tuple(BEDS))):
        for name in set(given) - set(choices):
            raise ParameterError(option, "", f"must be one of {', '.join(choices)}", repr(name))
    if arguments.pictures is not None:
        refuse_unwritable(arguments.pictures)
    rows = []
    for name in steps.through(arguments.things or THINGS[: 1 if arguments.quick else None]):
        made = make(name, arguments.bed)
        uneven = made.played.find_unevenness(made.formed)
        rows.append({
            "thing": made.name, "bed": made.bed, "strokes": len(made.played.strokes), "hand": made.hand,
            "formed": made.played.time, "force": made.played.force, "correlation": made.correlation,
            "slope": made.slope, "rms": made.error, "relief": float(made.intended.std()),
            "uneven": float(np.sqrt(np.mean(uneven**2))), "most": float(np.abs(uneven).max()),
            "spike": find_new_spike(made), "CPU": made.spent, "title": made.title,
        })  # fmt: skip
        if arguments.pictures is not None:
            other = "" if made.bed == made.own_bed else f"_{made.bed}"
            draw_made(made, arguments.pictures / f"made_{name}{other}.jpg")
    things = Report(["", *tabulate(rows, COLUMNS)], rows)
    return things if arguments.things or arguments.quick else [things, *compare()]
