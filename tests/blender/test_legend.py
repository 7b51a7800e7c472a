"""What is written in a picture can be read in small ones too, and stays within its place."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay.compat import scratch
from digiclay.core.base.modes import Mode
from digiclay.pictures.legend import (
    READ,
    READ_BESIDE,
    SHARE,
    Front,
    draw_force_plot,
    write_force_legend,
    write_mode_legend,
)
from digiclay.pictures.stage import MARGINS, half_frame

#: Sizes of pictures, pixels, and how large their ordinary letters and those beside them are.
SIZES = {
    (320, 200): (READ, READ_BESIDE), (400, 250): (READ, READ_BESIDE), (640, 400): (11.2, READ_BESIDE),
    (960, 600): (16.8, 13.44), (1600, 1000): (28.0, 22.4),
}  # fmt: skip


@pytest.fixture
def written() -> Iterator[None]:
    """Take away again what is written."""
    with scratch():
        yield


def front(width: int, height: int) -> Front:
    """Return the plane before a camera of a picture of some pixels."""
    scene = bpy.data.scenes.new("legend")
    scene.render.resolution_x, scene.render.resolution_y = width, height
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    return Front.before(scene, camera, half_frame(scene))


def texts(plane: Front) -> dict[str, Any]:
    """Return what is written, by its words."""
    return {part.data.body: part for part in plane.scene.objects if part.type == "FONT"}


def session(plane: Front) -> None:
    """Draw the strip of a session of 26.5 s."""
    time = np.linspace(0.0, 26.5, 50)
    draw_force_plot(plane, time, 0.4 + 0.1 * np.sin(time), 0.4).show(15.92, 0.49)


def extent(plane: Front, part: Any) -> tuple[float, float, float, float]:
    """Return left, right, lower and upper edge of something on the plane, pixels from the middle."""
    plane.scene.view_layers[0].update()
    corners = np.array(part.bound_box)[:, :2] * np.array(part.scale)[:2] + np.array(part.location)[:2]
    # What hangs on a layer behind is farther away by a thousandth: a part of a pixel.
    low, high = corners.min(axis=0) / plane.pixel, corners.max(axis=0) / plane.pixel
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


@pytest.mark.usefixtures("written")
@pytest.mark.parametrize(("size", "letters"), SIZES.items())
def test_letters_have_a_size_that_can_be_read(size: tuple[int, int], letters: tuple[float, float]) -> None:
    plane = front(*size)
    write_mode_legend(plane, list(Mode))
    session(plane)
    found = texts(plane)
    sizes = [found[said].data.size / plane.pixel for said in ("force follow", "total force 0.49 N")]
    assert sizes == pytest.approx(letters, rel=1e-5)  # Blender keeps single precision


@pytest.mark.usefixtures("written")
@pytest.mark.parametrize(
    ("size", "explained"), [((320, 200), 0), ((640, 400), 0), ((800, 500), 8), ((960, 600), 8)]
)
def test_modes_are_explained_where_it_can_be_read(size: tuple[int, int], explained: int) -> None:
    plane = front(*size)
    write_mode_legend(plane, list(Mode))
    assert len(texts(plane)) == len(Mode) + explained


@pytest.mark.usefixtures("written")
@pytest.mark.parametrize("size", [*SIZES, (200, 320), (64, 40), (1000, 200)])
@pytest.mark.parametrize("legend", [lambda plane: write_mode_legend(plane, list(Mode)), write_force_legend])
def test_nothing_that_is_written_covers_anything_else(size: tuple[int, int], legend: Any) -> None:
    plane = front(*size)
    legend(plane)
    session(plane)
    places = {said: extent(plane, part) for said, part in texts(plane).items()}
    for said, (left, right, low, high) in places.items():
        assert -size[0] / 2 <= left < right <= size[0] / 2, said
        assert -size[1] / 2 <= low < high <= size[1] / 2, said
        for other, place in places.items():
            apart = right <= place[0] or place[1] <= left or high <= place[2] or place[3] <= low
            assert other == said or apart, f"{said!r} and {other!r}"


@pytest.mark.usefixtures("written")
@pytest.mark.parametrize("size", SIZES)
def test_the_bar_of_forces_ends_above_the_strip_and_the_strip_below_the_bed(size: tuple[int, int]) -> None:
    plane = front(*size)
    write_force_legend(plane)
    session(plane)
    (bar,) = (part for part in plane.scene.objects if part.name.startswith("edge"))
    upper = extent(plane, texts(plane)["total force 0.49 N"])[3]
    # The share of the picture that is kept free below the bed, and 5 % of margin.
    assert upper <= -0.5 * size[1] + (SHARE + MARGINS[2]) * size[1]
    assert extent(plane, bar)[2] >= upper
