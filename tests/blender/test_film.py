"""Films show the recorded rows, one after another, and leave nothing behind."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay.commands.render import stage_moving
from digiclay.compat import scratch
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.base.modes import COLORS, Mode
from digiclay.core.files.formats import is_whole_picture
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.render_settings import Film, Still, Turntable
from digiclay.core.session.run_scene import run
from digiclay.device.instant import Instant
from digiclay.pictures import film, still
from digiclay.roles import BED, ROLE, fingertips_of

from tests.blender.at_hand import film_strip, inventory, read_picture

WIDTH, HEIGHT = 160, 100
SMALL = {"width": WIDTH, "height": HEIGHT, "rate": 4}


@pytest.fixture
def history() -> dict[str, np.ndarray]:
    """One second of a bed that turns from one mode into another half way, while the force rises."""
    bed = make_grid(Layout(rows=5, columns=5))
    time = np.linspace(0.0, 1.0, 201)
    rise = 0.02 * time[:, None] * np.ones(bed.count)
    mode = np.where(time[:, None] < 0.5, Mode.HOLD, Mode.FORCE_FOLLOW) * np.ones(bed.count)
    finger = np.zeros((201, 7))
    finger[:, 2], finger[:, 3:] = 0.050, LEVEL
    return {
        "time": time, "position": bed.positions, "height": 0.04 - 0.2 * rise, "mode": mode.astype(np.int8),
        "force": rise, "total_force": rise.sum(axis=1), "fingertip": finger,
    }  # fmt: skip


def frames_of(path: Path, folder: Path) -> tuple[float, list[np.ndarray]]:
    """Read a film with Blender itself: its rate, and each frame (height, width, 3), the lower row first."""
    folder.mkdir()
    with scratch():
        scene = bpy.data.scenes.new("reading")
        strip, scene.frame_end = film_strip(scene, path)
        shown = strip.elements[0]
        scene.render.resolution_x, scene.render.resolution_y = shown.orig_width, shown.orig_height
        rate = shown.orig_fps
        scene.view_settings.view_transform = "Standard"
        scene.render.filepath = str(folder / "f")
        bpy.ops.render.render(animation=True, scene=scene.name)
        pictures = [read_picture(file) for file in sorted(folder.glob("f*.png"))]
    return rate, pictures


def render(shown: Any, out: Path, looks: Any, set_point: float | None = None, **known: Any) -> Path | None:
    """Draw a film of a history, or a turntable of an instant."""
    if isinstance(looks, Film):
        stage = film.stage_film(shown, looks, ("total force", shown["total_force"]), set_point=set_point)
    else:
        stage = film.stage_turntable(shown, looks)
    return film.render_film(stage, out, looks, **known)


def filmed(shown: Any, path: Path, looks: Any) -> list[np.ndarray]:
    """Draw a film of a history, or a turntable of an instant, and read its frames."""
    assert render(shown, path, looks) == path
    return frames_of(path, path.with_suffix(""))[1]


def looks_like(pixels: np.ndarray, mode: Mode) -> int:
    """Count pixels of the bed, right of the legend and above the strip, in the direction of a color."""
    bed = pixels[HEIGHT // 3 :, WIDTH // 4 :].reshape(-1, 3)
    wanted = np.array(COLORS[mode])
    cosine = bed @ wanted / np.maximum(np.linalg.norm(bed, axis=1) * np.linalg.norm(wanted), 1e-6)
    # Blue and vermilion are 70 degrees apart; gray is 25 degrees or more from both.
    return int((cosine > 0.97).sum())


def test_a_film_shows_the_rows_in_their_colors_at_its_rate(tmp_path: Path, history: Any) -> None:
    before, told = inventory(), list[tuple[int, int]]()
    history["total_force"][:] = 0.3
    looks = Film(**SMALL, arrows=False)
    path = render(
        history, tmp_path / "a film.mp4", looks, set_point=0.3, progress=lambda *at: told.append(at)
    )
    assert inventory() == before
    assert told == [(i, 5) for i in range(1, 6)]
    assert [file.name for file in tmp_path.iterdir()] == ["a film.mp4"]
    assert path is not None
    rate, pictures = frames_of(path, tmp_path / "frames")
    assert (rate, len(pictures), pictures[0].shape) == (4.0, 5, (HEIGHT, WIDTH, 3))
    blue = [looks_like(picture, Mode.HOLD) for picture in pictures]
    red = [looks_like(picture, Mode.FORCE_FOLLOW) for picture in pictures]
    # Frames 0 and 1 are before half a second. A few pixels may be mixtures at edges.
    assert min(blue[:2]) > 20 * max(max(blue[2:]), 5)
    assert min(red[2:]) > 20 * max(max(red[:2]), 5)
    # Along the strip's lower edge, what has been is blue and what is to come is gray.
    lower = [picture[6, :, 2] - picture[6, :, 0] > 0.25 for picture in pictures]
    shares = [np.flatnonzero(row).max(initial=0) / WIDTH for row in lower]
    # The strip goes from 3 % to 97 % of the width; letters and the cursor are 2 % wide.
    np.testing.assert_allclose(shares[1:], 0.03 + 0.94 * np.arange(1, 5) / 4, rtol=0, atol=0.03)


def test_arrows_are_red_and_only_there_when_asked_for(tmp_path: Path, history: Any) -> None:
    counts = []
    for arrows in (False, True):
        looks = Film(**SMALL, start=0.4, stop=0.45, arrows=arrows, strip=False)
        red, green, blue = np.moveaxis(filmed(history, tmp_path / f"{arrows}.mp4", looks)[-1], -1, 0)
        counts.append(int(((red > 0.4) & (green < 0.5 * red) & (blue < 0.5 * red)).sum()))
        assert not (blue[6] - red[6] > 0.25).any(), "without a strip there is none"
    assert counts[0] < 5 < counts[1]


def test_a_bed_colored_by_force_changes_its_colors_with_the_force(tmp_path: Path, history: Any) -> None:
    history["force"] = history["force"] * 10.0
    pictures = filmed(history, tmp_path / "film.mp4", Film(**SMALL, color="force", arrows=False))
    middle = [picture[HEIGHT // 2 :, WIDTH // 3 :].reshape(-1, 3) for picture in pictures]
    yellow = [int(((p[:, 1] > 0.8 * p[:, 0]) & (p[:, 2] < 0.5 * p[:, 0])).sum()) for p in middle]
    assert yellow[0] < 5 < yellow[-1] / 10


def test_a_turntable_turns_once_and_shows_no_fingertip(tmp_path: Path, history: Any) -> None:
    # One half of the bed is blue: its middle goes round.
    history["mode"][-1] = np.where(history["position"][:, 0] > 0.0, Mode.HOLD, Mode.REST)
    instant = Instant.of(history, -1)
    pictures = filmed(instant, tmp_path / "turn.mp4", Turntable(**SMALL, frames=4))
    assert len(pictures) == 4
    across = []
    for picture in pictures:
        blue = picture[:, WIDTH // 4 :, 2] - picture[:, WIDTH // 4 :, 0] > 0.2
        across.append(np.argwhere(blue).mean(axis=0))
    turns = np.diff([*across, across[0]], axis=0)
    # It goes round in four steps like a square: opposite steps are opposite, and none is nothing.
    assert np.linalg.norm(turns, axis=1).min() > 5.0
    assert np.all(np.sum(turns[:2] * turns[2:], axis=1) < 0.0)


def test_a_film_that_is_stopped_leaves_nothing(tmp_path: Path, history: Any) -> None:
    asked = iter([False, True])
    path = tmp_path / "film.mp4"
    assert render(history, path, Film(**SMALL), stopped=lambda: next(asked)) is None
    assert list(tmp_path.iterdir()) == []


def test_a_part_that_is_not_in_the_session_is_refused_before_any_work(tmp_path: Path, history: Any) -> None:
    with pytest.raises(ParameterError, match="start must be between 0 s and 1 s"):
        render(history, tmp_path / "film.mp4", Film(start=3.0))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_told_in_one_line(tmp_path: Path, history: Any) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"film\.mp4 cannot be written") as caught:
        render(history, tmp_path / "file" / "film.mp4", Film(**SMALL))
    assert "\n" not in str(caught.value)


def test_a_film_or_frame_that_lost_its_end_is_known(tmp_path: Path, history: Any) -> None:
    path = render(history, tmp_path / "film.mp4", Film(**SMALL, stop=0.3))
    assert path is not None
    data = path.read_bytes()
    assert film.is_whole_film(data)
    assert not any(film.is_whole_film(data[:count]) for count in (0, 8, 100, len(data) // 2, len(data) - 1))
    path = still.render_still(
        Instant.of(history), tmp_path / "still.png", Still(width=32, height=20, samples=1)
    )
    picture = path.read_bytes()
    assert is_whole_picture(picture)
    assert not any(is_whole_picture(picture[:count]) for count in (0, 8, len(picture) // 2, len(picture) - 1))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can make a small disk")
def test_on_a_full_disk_nothing_half_written_stays(tmp_path: Path, history: Any) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", str(disk)], capture_output=True)
    if made.returncode:
        pytest.skip("this machine does not let root mount a disk")
    try:
        with pytest.raises(OutputError, match=r"film\.mp4 cannot be written: [Nn]o space") as caught:
            render(history, disk / "film.mp4", Film(**SMALL, stop=0.3))
        assert "\n" not in str(caught.value)
        assert list(disk.iterdir()) == []
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_film_of_two_fingers_shows_both_and_plots_the_force_of_the_worst() -> None:
    def press(x: float, low: float) -> dict[str, Any]:
        ways = [{"time": t, "position": [x, 0.0, z]} for t, z in ((0.0, 0.041), (0.2, low))]
        return {"trajectory": {"waypoints": ways}}

    fingers = [press(-0.01, 0.0405), press(0.01, 0.038)]
    bed = {"layout": {"rows": 7, "columns": 13}, "control": {"method": "elastic"}}
    scene = resolve({**bed, "finger": fingers})
    history = run(scene).history
    with stage_moving(scene, history, Film(**SMALL)) as shots:
        shots.show(shots.count - 1)
        (bed,) = (thing for thing in shots.scene.objects if thing.get(ROLE) == BED)
        assert len(fingertips_of(bed)) == 2
        words = {thing.data.body for thing in shots.scene.objects if thing.type == "FONT"}
    assert f"force of finger 2 {history['finger_force'][-1, 1]:.2f} N" in words
