"""A still is the picture asked for, and leaves nothing behind."""

from __future__ import annotations

import colorsys
import subprocess
import sys
from pathlib import Path

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.base.modes import COLORS, Mode
from digiclay.core.model.layout import Layout
from digiclay.core.session.render_settings import Still
from digiclay.device import palettes, view
from digiclay.device.instant import Instant
from digiclay.pictures import stage, still

from tests.blender.at_hand import inventory
from tests.timeouts import TIMEOUT

WIDTH, HEIGHT = 240, 150


def picture(path: Path) -> np.ndarray:
    """Read a PNG with Blender itself, (height, width, 3) sRGB in [0, 1], the lower row first."""
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], image.channels)
    bpy.data.images.remove(image)
    return pixels[:, :, :3]


def of_the_hue(pixels: np.ndarray, color: tuple[float, float, float]) -> int:
    """Count the pixels that look like a color in light or shadow: its hue, colored, not near black."""
    hue, low, high = colorsys.rgb_to_hsv(*color)[0], pixels.min(axis=2), pixels.max(axis=2)
    colored = pixels[(high > 0.2) & (high - low > 0.5 * high)]
    # The palette's hues are at least 0.07 apart, of 1 all round.
    return sum(abs(colorsys.rgb_to_hsv(*pixel)[0] - hue) < 0.03 for pixel in colored)


def bed_in(mode: Mode) -> Instant:
    """Return a bed whose pins are all in one mode."""
    rest = Instant.at_rest(Layout(rows=8, columns=8))
    far = np.array([0.0, 0.0, 0.060, 1.0, 0.0, 0.0, 0.0])
    return Instant(rest.position, rest.height, np.full(64, mode), rest.force, far)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.FROZEN])
def test_a_still_has_the_size_asked_for_and_its_pins_the_color_of_their_mode(
    mode: Mode, tmp_path: Path
) -> None:
    out = still.render_still(
        bed_in(mode), tmp_path / "pins.png", Still(width=WIDTH, height=HEIGHT, samples=2)
    )
    assert out.read_bytes().startswith(b"\x89PNG")
    pixels = picture(out)
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    # The pins stand in the middle of what the legend leaves free; 8 x 8 of them cover far more than this.
    pins = pixels[:, int(stage.MARGINS[0] * WIDTH) :]
    other = Mode.FROZEN if mode is Mode.HOLD else Mode.HOLD
    assert of_the_hue(pins, COLORS[mode]) > 500
    assert of_the_hue(pins, COLORS[other]) < 20


def test_the_legend_names_the_modes_present_in_the_palette_that_the_open_file_wears(tmp_path: Path) -> None:
    other = palettes.PALETTES["tol_muted"][Mode.HOLD]
    for seen, unseen in ((COLORS[Mode.HOLD], other), (other, COLORS[Mode.HOLD])):
        look = Still(width=WIDTH, height=HEIGHT, samples=2)
        legend = picture(still.render_still(bed_in(Mode.HOLD), tmp_path / "pins.png", look))[:, : WIDTH // 5]
        assert of_the_hue(legend, seen) > 20
        assert of_the_hue(legend, unseen) < 20
        view.build(bed_in(Mode.HOLD), bpy.context.collection)
        palettes.set_palette("tol_muted")


def test_a_still_leaves_the_users_file_as_it_was(tmp_path: Path, formed: Instant) -> None:
    scene, before = bpy.context.scene, inventory()
    active = bpy.context.view_layer.objects.active
    still.render_still(formed, tmp_path / "pins.png", Still(width=40, height=25, samples=1))
    assert inventory() == before
    assert bpy.context.scene == scene
    assert bpy.context.view_layer.objects.active == active


def test_a_failed_render_leaves_neither_data_nor_files(tmp_path: Path, formed: Instant) -> None:
    folder = tmp_path / "taken"
    folder.mkdir()
    (folder / "pins.png").mkdir()
    before = inventory()
    with pytest.raises(OutputError, match=r"pins\.png cannot be written"):
        still.render_still(formed, folder / "pins.png", Still(width=40, height=25, samples=1))
    assert inventory() == before
    assert [path.name for path in folder.iterdir()] == ["pins.png"]


def test_an_unknown_engine_is_refused_with_the_known_ones() -> None:
    with pytest.raises(DigiclayError, match="cycles, workbench"):
        Still(engine="eevee")


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 40), (60, 60)])
def test_every_bed_is_inside_the_frame_and_at_its_margins(rows: int, columns: int, arrangement: str) -> None:
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
    gaps = np.array([placed[:, 0].min() - left, 1 - right - placed[:, 0].max(),
                     placed[:, 1].min() - below, 1 - above - placed[:, 1].max()])  # fmt: skip
    # Camera matrices are float32. One direction fills its share of the frame, the other is centered.
    assert gaps.min() == pytest.approx(0.0, abs=1e-4)
    assert gaps.min() > -1e-4


def test_rendering_without_blender_says_in_one_line_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "bpy.py").write_text("raise ModuleNotFoundError(\"No module named 'bpy'\", name='bpy')\n")
    code = (
        "from digiclay.core.base.errors import DigiclayError\n"
        "try:\n    import digiclay.pictures.still\n"
        "except DigiclayError as error:\n    print(error)\n"
    )
    path = f"{tmp_path}:{Path(digiclay.__file__).parents[1]}"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        "This needs Blender's Python module, bpy: install digiclay[blender] with pip, or run inside Blender."
    ]
