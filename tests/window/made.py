"""Things that recorded strokes form, beside what was intended; their pictures."""

import time
from dataclasses import dataclass, replace
from math import cos, radians, sin

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
from PIL import Image, ImageDraw, ImageFont

from tests.window.hand_strokes import DRAWN
from tests.window.intended import find_relief


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


@dataclass(frozen=True, eq=False)
class Made:
    """Thing made on the bed for which its strokes were drawn."""

    title: str
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

    @property
    def error(self):
        """Root of the mean square of formed less intended heights, m."""
        return float(np.sqrt(np.mean((self.played.formed - self.intended) ** 2)))


def make(name):
    """Play the strokes of one of `THINGS` on the bed of their file."""
    recorded = read_strokes(DRAWN / f"{name}.toml")
    started = time.process_time()
    played = play(make_bed(recorded.bed), recorded.strokes)
    spent = time.process_time() - started
    intended = find_relief(name, *played.session.system.grid.positions.T)
    hand = sum(stroke.moves[-1][0] for stroke in recorded.strokes)
    return Made(recorded.name, played, intended, hand, spent)


#: Size of one of the two pictures, pixels, and samples a pixel.
WIDTH, HEIGHT, SAMPLES = 640, 500, 6
#: Turn of the bed, so that its lower edge is in front, rad; what is kept free around it, by sides.
TURN, MARGINS = radians(28.0), (0.04, 0.04, 0.05, 0.12)
#: How far the housing ends below the lowest pin, m.
CLEAR = 1e-3
#: Size of the letters, pixels, their distance from the corner, and their color.
LETTERS, INSET, INK = 20, (16, 12), (26, 31, 38)


def draw_made(made, out):
    """Draw a thing as it was formed and as it was intended, side by side, as a JPEG."""
    formed, intended = made.played.formed, made.intended
    lowest = min(float(formed.min()), float(intended.min()))
    whole = Image.new("RGB", (2 * WIDTH, HEIGHT))
    pen = ImageDraw.Draw(whole)
    shown = {f"formed, correlation {made.correlation:.3f}": formed, "intended": intended}
    for number, (words, relief) in enumerate(shown.items()):
        file = out.with_suffix(".png")
        draw_relief(made.played.session.scene, relief, lowest, file)
        whole.paste(Image.open(file).convert("RGB"), (number * WIDTH, 0))
        file.unlink()
        corner = number * WIDTH + INSET[0], INSET[1]
        pen.text(corner, f"{made.title}: {words}", INK, ImageFont.load_default(LETTERS))
    whole.save(out, quality=90)


def draw_relief(scene, relief, lowest, out):
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
