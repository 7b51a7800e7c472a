"""Pictures of the made things: formed and intended side by side, in the same view, light and scale."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any

from digiclay.compat import scratch
from digiclay.core.base.errors import OutputError
from digiclay.core.scene.schema import Scene
from digiclay.core.session.render_settings import Still
from digiclay.device import form, view
from digiclay.device.instant import Instant
from digiclay.pictures import stage
from digiclay.pictures.still import add_picture_scene, apply_style, render_picture
from numpy.typing import NDArray

from .made_things import Made

#: Size of one of the two pictures, pixels, and samples a pixel.
WIDTH, HEIGHT, SAMPLES = 640, 500, 6
#: Turn of the bed, so that its lower edge is in front, rad; what is kept free around it, by sides.
TURN, MARGINS = radians(28.0), (0.04, 0.04, 0.05, 0.12)
#: How far the housing ends below the lowest pin, m.
CLEAR = 1e-3
#: Size of the letters, pixels, their distance from the corner, and their color.
LETTERS, INSET, INK = 20, (16, 12), (26, 31, 38)


def draw_made(made: Made, out: Path) -> Path:
    """Draw a thing as it was formed and as it was intended, and return the picture's path.

    `out`: the JPEG. Raises OutputError when it cannot be written, or Pillow is missing.
    """
    words = (
        f"{made.title}: formed on the bed {made.bed}, correlation {made.correlation:.3f}",
        f"{made.title}: intended",
    )
    lowest = min(float(made.formed.min()), float(made.intended.min()))
    with tempfile.TemporaryDirectory() as folder:
        files = [
            draw_relief(made.scene, height, lowest, Path(folder) / f"{number}.png")
            for number, height in enumerate((made.formed, made.intended))
        ]
        return join(files, words, out)


def draw_relief(scene: Scene, relief: NDArray[Any], lowest: float, out: Path) -> Path:
    """Draw the skin over a bed's pins, without fingertip.

    `relief` (n,), heights of the pins above rest, m; `lowest`: lowest place of a pin's top in the pictures to
    be compared, above rest, m; `out`: the PNG.
    """
    looks = Still(width=WIDTH, height=HEIGHT, engine="cycles", samples=SAMPLES)
    rest = Instant.at_rest(scene.layout, scene.actuator)
    instant = replace(rest, height=rest.height + relief)
    with scratch():
        drawn = add_picture_scene("Digital Clay Made Thing", looks)
        bed = view.build(instant, drawn.collection, scene.actuator.rest_height + lowest - CLEAR)
        apply_style(bed, looks)
        form.set_form(bed, "skin")
        bed.rotation_euler.z = TURN
        tip = view.fingertip_of(bed)
        if tip is not None:
            for part in (tip, *tip.children_recursive):
                part.hide_render = True
        points = stage.outline(bed)
        below = points[points[:, 2] <= points[: len(relief), 2].max()]  # without the fingertip
        stage.set_up(drawn, bed, instant, points=below, modes=(), margins=MARGINS)
        render_picture(drawn, out, out)
    return out


def join(files: Sequence[Path], words: Sequence[str], out: Path) -> Path:
    """Put pictures side by side, with words in the corner of each. `out`: the JPEG."""
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        raise OutputError("Pictures of made things need Pillow: pip install digiclay[images].") from None
    whole = Image.new("RGB", (WIDTH * len(files), HEIGHT))
    pen = ImageDraw.Draw(whole)
    for number, (file, said) in enumerate(zip(files, words, strict=True)):
        whole.paste(Image.open(file).convert("RGB"), (number * WIDTH, 0))
        place = number * WIDTH + INSET[0], INSET[1]
        pen.text(place, said, INK, ImageFont.load_default(LETTERS))
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        whole.save(out, quality=90)
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    return out
