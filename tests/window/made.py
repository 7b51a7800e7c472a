"""Things that recorded strokes form, as left and nominal, beside what was intended.

`python -m tests.window.made DIR` draws the pictures of the gallery and writes its table, gallery.csv.
"""

import csv
import sys
import time
from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, radians, sin
from pathlib import Path

import bpy
import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
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
from mathutils import Vector
from PIL import Image, ImageDraw, ImageFont

from tests.window.hand_strokes import DRAWN
from tests.window.intended import THINGS, find_relief


def move(strokes, angle, shift):
    """Return strokes turned by an angle, rad, and shifted, m; depths and heights stay."""
    c, s, (x0, y0) = cos(angle), sin(angle), shift
    return tuple(
        replace(
            one, moves=tuple((t, c * x - s * y + x0, s * x + c * y + y0) for t, x, y in one.moves)
        )
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


def make_bed(name=FIRST, side=None):
    """Return a bed as Add makes it, or one with so many rows and columns."""
    bed = BEDS[name]
    layout = Layout(rows=side or bed.rows, columns=side or bed.columns, pitch=bed.pitch)
    return make_scene(bed.preset, layout, bed.method, bed.share)


def begin(scene):
    """Return a session of a bed at rest, the fingertip above it."""
    above = np.array([0.0, 0.0, scene.actuator.rest_height + CLEARANCE, *LEVEL])
    return begin_session(1, "Bed", scene, above)[0]


def play(scene, strokes):
    """Play strokes on a bed at rest."""
    session, force, rest = begin(scene), 0.0, scene.actuator.rest_height
    for after in play_strokes(session, strokes):
        # A trace has the total of the fingertips; what each of several feels is seen at the end of
        # a tick.
        one = len(session.poses) == len(after.poses) == 1
        since = after.state.period - session.state.period
        felt = after.trace.force[-since:] if one and since else after.state.finger_forces()
        session, force = after, max(force, float(felt.max(initial=0.0)))
    time = session.state.period * session.system.period
    return Played(session, session.state.row(0) - rest, force, time, strokes)


#: Pins that are nearer to rest are not of a form, m.
FLAT = 1e-5


@dataclass(frozen=True, eq=False)
class Made:
    """Thing made on the bed for which its strokes were drawn."""

    name: str
    bed: str
    played: Played
    intended: Floats
    """(n,): Heights of the pins above rest, m."""
    hand: float
    spent: float
    """Time that the hand drew, and processor time to form it, s."""

    @property
    def correlation(self):
        """Pearson's coefficient of formed and intended heights over all pins."""
        return float(np.corrcoef(self.played.formed, self.intended)[0, 1])

    @property
    def slope(self):
        """Slope of the regression of formed on intended heights: 1 when nothing is scaled."""
        intended = self.intended - self.intended.mean()
        return float(self.played.formed @ intended / (intended @ intended))

    @cached_property
    def left(self):
        """What the same strokes leave when no valve brings pins to the nominal surface."""
        strokes = tuple(replace(one, finish="as_left") for one in self.played.strokes)
        return play(make_bed(self.bed), strokes).formed

    def compare(self, height, other):
        """Return rms over the pins of the form, and the largest difference of heights (n,), mm."""
        form = np.maximum(np.abs(self.played.formed), np.abs(self.intended)) > FLAT
        error = 1e3 * np.abs(height - other)
        return float(np.sqrt(np.mean(error[form] ** 2))), float(error.max())

    def measure(self):
        """Return the row of the gallery's table."""
        formed = self.played.formed
        rms, largest = self.compare(formed, self.intended)
        left_rms, left_largest = self.compare(self.left, formed)
        return {
            "thing": self.name,
            "hand_s": self.hand,
            "formed_s": self.played.time,
            "force_N": self.played.force,
            "nominal_rms_mm": rms,
            "nominal_largest_mm": largest,
            "left_rms_mm": left_rms,
            "left_largest_mm": left_largest,
        }


def make(name):
    """Play the strokes of one of `THINGS` on the bed of their file."""
    recorded = read_strokes(DRAWN / f"{name}.toml")
    started = time.process_time()
    played = play(make_bed(recorded.bed), recorded.strokes)
    spent = time.process_time() - started
    intended = find_relief(name, *played.session.system.grid.positions.T)
    hand = sum(stroke.moves[-1][0] for stroke in recorded.strokes)
    return Made(name, recorded.bed, played, intended, hand, spent)


#: Size of one of the two pictures, pixels, and samples a pixel.
WIDTH, HEIGHT, SAMPLES = 640, 500, 6
#: Turn of the bed, so that its lower edge is in front, rad; what is kept free around it, by sides.
TURN, MARGINS = radians(28.0), (0.04, 0.04, 0.05, 0.12)
#: How far the housing ends below the lowest pin, m.
CLEAR = 1e-3
#: Quality of the JPEGs; the thing that is drawn large, its size, pixels, and samples a pixel.
QUALITY, FIRST_THING, FIRST_PICTURE = 84, "coin", (1100, 700, 16)
#: Size of the letters, pixels, their distance from the corner, and their color.
LETTERS, INSET, INK = 20, (16, 12), (26, 31, 38)


def draw_made(made, out):
    """Draw a thing with its nominal finish and as left, side by side, as a JPEG."""
    rms, largest = made.compare(made.left, made.played.formed)
    shown = {"nominal": made.played.formed}
    shown[f"as left: {rms:.1f} mm rms, {largest:.1f} mm at most"] = made.left
    lowest = min(float(relief.min()) for relief in shown.values())
    whole = Image.new("RGB", (2 * WIDTH, HEIGHT))
    pen = ImageDraw.Draw(whole)
    looks = Still(width=WIDTH, height=HEIGHT, engine="cycles", samples=SAMPLES)
    for number, (words, relief) in enumerate(shown.items()):
        drawn = draw_relief(made.played.session.scene, relief, lowest, looks, out)
        whole.paste(drawn, (number * WIDTH, 0))
        corner = number * WIDTH + INSET[0], INSET[1]
        pen.text(corner, words, INK, ImageFont.load_default(LETTERS))
    whole.save(out, quality=QUALITY, optimize=True)


def draw_first(made, out):
    """Draw a thing in the light of a window beside it, large, as a JPEG."""
    width, height, samples = FIRST_PICTURE
    looks = Still(width=width, height=height, engine="cycles", samples=samples)
    relief = made.played.formed
    drawn = draw_relief(
        made.played.session.scene, relief, float(relief.min()), looks, out, light_by_window
    )
    drawn.save(out, quality=QUALITY, optimize=True)


def light_by_window(scene, span):
    """Replace the sun of a scene by a low window, on the left of a bed so wide, and darken the sky."""
    sun = next(thing for thing in scene.objects if thing.type == "LIGHT")
    bpy.data.objects.remove(sun)
    data = bpy.data.lights.new("Window", "AREA")
    data.shape, data.size, data.size_y = "RECTANGLE", 1.6 * span, 1.0 * span
    data.energy, data.color = 220.0 * span**2, (1.0, 0.93, 0.84)
    window = bpy.data.objects.new(data.name, data)
    window.location = -2.6 * span, 1.5 * span, 1.1 * span
    aim = Vector((0.0, 0.0, 0.0)) - window.location
    window.rotation_euler = aim.to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(window)
    sky = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    sky.inputs["Strength"].default_value = 0.22


def draw_relief(scene, relief, lowest, looks, out, light=None):
    """Return the picture of the skin over pins at heights above rest, (n,), m, without fingertip."""
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
        stage.set_up(drawn, bed, instant, points=below, entries=(), margins=MARGINS)
        if light is not None:
            light(drawn, float(np.ptp(below[:, 0])))
        file = out.with_suffix(".png")
        render_picture(drawn, file, out)
    with Image.open(file) as opened:
        picture = opened.convert("RGB")
    file.unlink()
    return picture


def main(folder):
    """Draw all things, one of them large, and write their table."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in THINGS:
        made = make(name)
        draw_made(made, folder / f"made_{name}.jpg")
        if name == FIRST_THING:
            draw_first(made, folder / "gallery.jpg")
        rows.append({key: form(value) for key, value in made.measure().items()})
        print(*rows[-1].values(), f"CPU {made.spent:.1f} s", flush=True)
    with (folder / "gallery.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def form(value):
    """Return a value of the table as text; a micrometer is below what other processors change."""
    return value if isinstance(value, str) else f"{value:.3f}"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
