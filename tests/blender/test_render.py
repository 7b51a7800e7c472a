"""A still is the picture asked for and leaves nothing behind; its legend is readable in its place."""

import colorsys

import bpy
import numpy as np
import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.base.modes import COLORS, Mode
from digiclay.core.model.layout import Layout
from digiclay.core.session.render_settings import Still
from digiclay.device import palettes, view
from digiclay.device.instant import Instant
from digiclay.pictures import stage, still
from digiclay.pictures.legend import (
    READ,
    READ_BESIDE,
    SHARE,
    Front,
    draw_force_plot,
    list_entries,
    write_force_legend,
    write_mode_legend,
)
from digiclay.pictures.stage import MARGINS, half_frame

from tests.blender.at_hand import inventory, read_picture

WIDTH, HEIGHT = 240, 150


def of_the_hue(pixels, color):
    """Count the pixels that look like a color in light or shadow: its hue, colored, not near black."""
    hue, low, high = colorsys.rgb_to_hsv(*color)[0], pixels.min(axis=2), pixels.max(axis=2)
    colored = pixels[(high > 0.2) & (high - low > 0.5 * high)]
    # The palette's hues are at least 0.07 apart, of 1 all round.
    return sum(abs(colorsys.rgb_to_hsv(*pixel)[0] - hue) < 0.03 for pixel in colored)


def bed_in(mode):
    rest = Instant.at_rest(Layout(rows=8, columns=8))
    far = np.array([0.0, 0.0, 0.060, 1.0, 0.0, 0.0, 0.0])
    return Instant(rest.position, rest.height, np.full(64, mode), rest.force, far)


def test_a_still_has_its_size_and_pins_and_a_legend_in_the_palette_that_the_open_file_wears(
    tmp_path,
):
    usual, other = COLORS[Mode.HOLD], palettes.PALETTES["tol_muted"][Mode.HOLD]
    for engine, seen, unseen in (("cycles", usual, other), ("workbench", other, usual)):
        look = Still(width=WIDTH, height=HEIGHT, samples=2, engine=engine, color="mode")
        out = still.render_still(bed_in(Mode.HOLD), tmp_path / "pins.png", look)
        assert out.read_bytes().startswith(b"\x89PNG")
        pixels = read_picture(out)
        assert pixels.shape == (HEIGHT, WIDTH, 3)
        # The pins stand in the middle of what the legend leaves free; 8 x 8 of them cover far more
        # than this.
        legend, pins = pixels[:, : WIDTH // 5], pixels[:, int(stage.MARGINS[0] * WIDTH) :]
        for part, least in ((legend, 20), (pins, 500)):
            assert of_the_hue(part, seen) > least
            assert of_the_hue(part, unseen) < 20
            assert of_the_hue(part, COLORS[Mode.FROZEN]) < 20
        view.build(bed_in(Mode.HOLD), bpy.context.collection)
        palettes.set_palette("tol_muted")


def test_a_still_is_neutral_by_default_without_a_legend_and_the_bed_in_its_middle(tmp_path):
    look = Still(width=WIDTH, height=HEIGHT, samples=2)
    pixels = read_picture(still.render_still(bed_in(Mode.HOLD), tmp_path / "pins.png", look))
    assert of_the_hue(pixels, COLORS[Mode.HOLD]) < 20
    # Nothing is written where a legend would be; the dark housing is as far from either side.
    dark = np.flatnonzero((pixels.max(axis=2) < 0.2).any(axis=0))
    assert dark[0] == pytest.approx(WIDTH - 1 - dark[-1], abs=3)


def test_a_still_leaves_the_users_file_as_it_was_and_a_failed_one_no_file(tmp_path, formed):
    scene, before = bpy.context.scene, inventory()
    active = bpy.context.view_layer.objects.active
    look = Still(width=40, height=25, engine="workbench")
    still.render_still(formed, tmp_path / "pins.png", look)
    (tmp_path / "taken" / "pins.png").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"pins\.png cannot be written"):
        still.render_still(formed, tmp_path / "taken/pins.png", look)
    assert inventory() == before
    assert (bpy.context.scene, bpy.context.view_layer.objects.active) == (scene, active)
    assert [path.name for path in (tmp_path / "taken").iterdir()] == ["pins.png"]


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
@pytest.mark.parametrize("rows, columns", [(1, 1), (2, 40), (60, 60)])
def test_every_bed_is_inside_the_frame_and_at_its_margins(rows, columns, arrangement):
    scene = bpy.data.scenes.new("framing")
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    instant = Instant.at_rest(Layout(rows=rows, columns=columns, arrangement=arrangement))
    bed = view.build(instant, scene.collection)
    stage.set_up(scene, bed, instant)
    to_camera = np.linalg.inv(np.array(scene.camera.matrix_basis))
    seen = stage.outline(bed) @ to_camera[:3, :3].T + to_camera[:3, 3]
    half = stage.half_frame(scene)
    placed = seen[:, :2] / -seen[:, 2:] / (2 * np.array(half)) + 0.5
    left, right, below, above = stage.MARGINS
    gaps = np.array(
        [
            placed[:, 0].min() - left,
            1 - right - placed[:, 0].max(),
            placed[:, 1].min() - below,
            1 - above - placed[:, 1].max(),
        ]
    )
    # Camera matrices are float32. One direction fills its share of the frame, the other is
    # centered.
    assert gaps.min() == pytest.approx(0.0, abs=1e-4)
    assert gaps.min() > -1e-4


#: Sizes of pictures, pixels, and how large their ordinary letters and those beside them are.
SIZES = {
    (320, 200): (READ, READ_BESIDE), (400, 250): (READ, READ_BESIDE), (640, 400): (11.2, READ_BESIDE),
    (800, 500): (14.0, 11.2), (960, 600): (16.8, 13.44), (1600, 1000): (28.0, 22.4),
}  # fmt: skip


def front(width, height):
    """Return the plane before a camera of a picture of some pixels."""
    scene = bpy.data.scenes.new("legend")
    scene.render.resolution_x, scene.render.resolution_y = width, height
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    return Front.before(scene, camera, half_frame(scene))


def texts(plane):
    return {part.data.body: part for part in plane.scene.objects if part.type == "FONT"}


def session(plane):
    """Draw the strip of a session of 26.5 s."""
    time = np.linspace(0.0, 26.5, 50)
    draw_force_plot(plane, time, 0.4 + 0.1 * np.sin(time), 0.4).show(15.92, 0.49)


def test_several_fingertips_have_a_line_each_in_their_colors_up_to_the_instant():
    plane, time = front(960, 600), np.linspace(0.0, 10.0, 51)
    plot = draw_force_plot(
        plane, time, np.column_stack([0.4 + 0.0 * time, 0.1 + 0.02 * time]), 0.4, "forces"
    )
    plot.show(5.0, np.array([0.4, 0.2]))
    assert "forces 0.20 to 0.40 N" in texts(plane)
    one, two = (np.array([at.co for at in part.data.vertices])[1::2, 1] for part in plot.been)
    assert two[[0, 25]] / one[[0, 25]] == pytest.approx([0.25, 0.5], rel=1e-6)  # of float32
    assert not one[26:].any()
    assert not two[26:].any()
    colors = [tuple(part.data.materials[0].diffuse_color) for part in plot.been]
    assert colors[0] != colors[1]


def extent(plane, part):
    """Return left, right, lower and upper edge of something on the plane, pixels from the middle."""
    plane.scene.view_layers[0].update()
    corners = (
        np.array(part.bound_box)[:, :2] * np.array(part.scale)[:2] + np.array(part.location)[:2]
    )
    # What hangs on a layer behind is farther away by a thousandth: a part of a pixel.
    low, high = corners.min(axis=0) / plane.pixel, corners.max(axis=0) / plane.pixel
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


@pytest.mark.parametrize("size, letters", SIZES.items())
def test_letters_have_a_size_that_can_be_read_and_modes_are_explained_where_it_can(size, letters):
    plane = front(*size)
    write_mode_legend(plane, list_entries(list(Mode), True))
    assert len(texts(plane)) == (len(Mode) + 1) * (2 if size[0] >= 800 else 1)
    session(plane)
    found = texts(plane)
    sizes = [found[said].data.size / plane.pixel for said in ("force follow", "total force 0.49 N")]
    assert sizes == pytest.approx(letters, rel=1e-5)  # Blender keeps single precision


@pytest.mark.parametrize("size", [*SIZES, (200, 320), (64, 40), (1000, 200)])
@pytest.mark.parametrize(
    "legend",
    [lambda plane: write_mode_legend(plane, list_entries(list(Mode), True)), write_force_legend],
)
def test_nothing_that_is_written_covers_anything_else(size, legend):
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


@pytest.mark.parametrize("size", SIZES)
def test_the_bar_of_forces_ends_above_the_strip_and_the_strip_below_the_bed(size):
    plane = front(*size)
    write_force_legend(plane)
    session(plane)
    (bar,) = (part for part in plane.scene.objects if part.name.startswith("edge"))
    upper = extent(plane, texts(plane)["total force 0.49 N"])[3]
    # The share of the picture that is kept free below the bed, and 5 % of margin.
    assert upper <= -0.5 * size[1] + (SHARE + MARGINS[2]) * size[1]
    assert extent(plane, bar)[2] >= upper
