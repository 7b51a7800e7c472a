"""Films show the recorded rows and leave nothing behind; by commands, in a batch, in ranges of frames."""

import json
import os
import subprocess
from pathlib import Path

import bpy
import numpy as np
import pytest
import trimesh
from bpy_extras.object_utils import world_to_camera_view
from digiclay.bridge import SCALE
from digiclay.cli import main
from digiclay.commands.gallery import WIDTH as THUMBNAIL
from digiclay.commands.job_steps import Work, find_frames, is_done
from digiclay.commands.render import ARRAYS, stage_moving
from digiclay.compat import scratch
from digiclay.core.base.errors import OutputError
from digiclay.core.base.modes import COLORS, WAITING, Mode
from digiclay.core.files.formats import is_whole_picture
from digiclay.core.files.run_folder import lock_name
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.finished_run import read_run
from digiclay.core.session.render_settings import Film, Turntable, list_missing, name_frame
from digiclay.core.session.run_scene import run as simulate
from digiclay.core.shapes.body import pack_mesh
from digiclay.core.studies.job_table import read_outputs
from digiclay.device.instant import Instant
from digiclay.pictures import film
from digiclay.pictures.film import draw_frames, stage_film
from digiclay.pictures.stage import BODY
from digiclay.roles import BED, FINGERTIP, ROLE, ellipsoid, fingertips_of, is_bed

from tests.blender.at_hand import film_strip, inventory, read_picture

WIDTH, HEIGHT = 160, 100
SMALL = {"width": WIDTH, "height": HEIGHT, "rate": 4}


@pytest.fixture
def history():
    """One second of a bed that turns from one mode into another half way, while the force rises."""
    bed = make_grid(Layout(rows=5, columns=5))
    time = np.linspace(0.0, 1.0, 201)
    rise = 0.02 * time[:, None] * np.ones(bed.count)
    mode = np.where(time[:, None] < 0.5, Mode.HOLD, Mode.FORCE_FOLLOW) * np.ones(bed.count)
    finger = np.zeros((201, 7))
    finger[:, 2], finger[:, 3:] = 0.050, LEVEL
    return {
        "time": time,
        "position": bed.positions,
        "height": 0.04 - 0.2 * rise,
        "mode": mode.astype(np.int8),
        "force": rise,
        "total_force": rise.sum(axis=1),
        "fingertip": finger,
    }


def frames_of(path, folder):
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


def stage(shown, looks, set_point=None):
    """Set the stage for a film of a history, or a turntable of an instant."""
    if isinstance(looks, Turntable):
        return film.stage_turntable(shown, looks)
    return stage_film(shown, looks, ("total force", shown["total_force"]), set_point=set_point)


def draw(shown, folder, looks):
    """Draw all frames of a film or turntable; return them."""
    with stage(shown, looks) as shots:
        assert draw_frames(shots, range(shots.count), folder, folder / "film.mp4")
    return [read_picture(name_frame(folder, frame)) for frame in range(shots.count)]


def see(shots, part):
    """Return where the camera sees the vertices of a part (k, 2), as shares of the picture."""
    shots.scene.view_layers[0].update()
    corners = [part.matrix_world @ vertex.co for vertex in part.data.vertices]
    return np.array(
        [world_to_camera_view(shots.scene, shots.scene.camera, at)[:2] for at in corners]
    )


def looks_like(pixels, color):
    """Count pixels of the bed, right of the legend and above the strip, in the direction of a color."""
    bed = pixels[HEIGHT // 3 :, WIDTH // 4 :].reshape(-1, 3)
    wanted = np.array(color)
    cosine = bed @ wanted / np.maximum(np.linalg.norm(bed, axis=1) * np.linalg.norm(wanted), 1e-6)
    # Blue and vermilion are 70 degrees apart; gray is 25 degrees or more from both.
    return int((cosine > 0.97).sum())


def test_a_film_shows_the_rows_in_their_colors_at_its_rate_and_what_lost_its_end_is_known(
    tmp_path, history
):
    before, told = inventory(), list[tuple[int, int]]()
    history["total_force"][:] = 0.3
    looks = Film(**SMALL, color="mode", arrows=False)
    path = tmp_path / "a film.mp4"
    staged = stage(history, looks, set_point=0.3)
    assert film.render_film(staged, path, looks, lambda *at: told.append(at)) == path
    assert inventory() == before
    assert told == [(i, 5) for i in range(1, 6)]
    assert [file.name for file in tmp_path.iterdir()] == ["a film.mp4"]
    rate, pictures = frames_of(path, tmp_path / "frames")
    assert (rate, len(pictures), pictures[0].shape) == (4.0, 5, (HEIGHT, WIDTH, 3))
    blue = [looks_like(picture, COLORS[Mode.HOLD]) for picture in pictures]
    red = [looks_like(picture, COLORS[Mode.FORCE_FOLLOW]) for picture in pictures]
    # Frames 0 and 1 are before half a second. A few pixels may be mixtures at edges.
    assert min(blue[:2]) > 20 * max(max(blue[2:]), 5)
    assert min(red[2:]) > 20 * max(max(red[:2]), 5)
    # Along the strip's lower edge, what has been is blue and what is to come is gray.
    lower = [picture[6, :, 2] - picture[6, :, 0] > 0.25 for picture in pictures]
    shares = [np.flatnonzero(row).max(initial=0) / WIDTH for row in lower]
    # The strip goes from 3 % to 97 % of the width; letters and the cursor are 2 % wide.
    np.testing.assert_allclose(shares[1:], 0.03 + 0.94 * np.arange(1, 5) / 4, rtol=0, atol=0.03)
    frame = next((tmp_path / "frames").iterdir())
    for file, is_whole in ((path, film.is_whole_film), (frame, is_whole_picture)):
        data = file.read_bytes()
        assert is_whole(data)
        ends = (0, 8, 100, len(data) // 2, len(data) - 1)
        assert not any(is_whole(data[:count]) for count in ends)


def test_pins_are_brown_while_they_wait_for_their_drive_and_the_legend_says_so(tmp_path, history):
    late = history["time"] >= 0.5
    history["mode"][:] = Mode.HOLD
    history["waiting"] = np.tile(late[:, None], history["mode"].shape[1])
    looks = Film(**SMALL, color="mode", arrows=False)
    with stage(history, looks) as shots:
        written = {part.data.body for part in shots.scene.objects if part.type == "FONT"}
    assert {"hold", "waiting"} <= written
    pictures = draw(history, tmp_path, looks)
    blue = [looks_like(picture, COLORS[Mode.HOLD]) for picture in pictures]
    brown = [looks_like(picture, WAITING) for picture in pictures]
    # Frames 0 and 1 are before half a second. A few pixels may be mixtures at edges; of a color so
    # dark, highlights leave its hue to a sixth of the pixels.
    assert min(blue[:2]) > 20 * max(max(blue[2:]), 5)
    assert min(brown[2:]) > 5 * max(max(brown[:2]), 5)


def test_arrows_are_red_and_only_there_when_asked_for(tmp_path, history):
    counts = []
    for arrows in (False, True):
        looks = Film(**SMALL, start=0.4, stop=0.45, arrows=arrows, strip=False)
        red, green, blue = np.moveaxis(draw(history, tmp_path / f"{arrows}", looks)[-1], -1, 0)
        counts.append(int(((red > 0.4) & (green < 0.5 * red) & (blue < 0.5 * red)).sum()))
        assert not (blue[6] - red[6] > 0.25).any(), "without a strip there is none"
    assert counts[0] < 5 < counts[1]


def test_a_bed_colored_by_force_changes_its_colors_with_the_force(tmp_path, history):
    history["force"] = history["force"] * 10.0
    pictures = draw(history, tmp_path, Film(**SMALL, color="force", arrows=False))
    middle = [picture[HEIGHT // 2 :, WIDTH // 3 :].reshape(-1, 3) for picture in pictures]
    yellow = [int(((p[:, 1] > 0.8 * p[:, 0]) & (p[:, 2] < 0.5 * p[:, 0])).sum()) for p in middle]
    assert yellow[0] < 5 < yellow[-1] / 10


def test_a_turntable_turns_once_and_shows_no_fingertip(tmp_path, history):
    # One half of the bed is blue: its middle goes round.
    history["mode"][-1] = np.where(history["position"][:, 0] > 0.0, Mode.HOLD, Mode.REST)
    instant = Instant.of(history, -1)
    pictures = draw(instant, tmp_path, Turntable(**SMALL, color="mode", frames=4))
    assert len(pictures) == 4
    across = []
    for picture in pictures:
        blue = picture[:, WIDTH // 4 :, 2] - picture[:, WIDTH // 4 :, 0] > 0.2
        across.append(np.argwhere(blue).mean(axis=0))
    turns = np.diff([*across, across[0]], axis=0)
    # It goes round in four steps like a square: opposite steps are opposite, and none is nothing.
    assert np.linalg.norm(turns, axis=1).min() > 5.0
    assert np.all(np.sum(turns[:2] * turns[2:], axis=1) < 0.0)


def test_a_bed_that_turns_is_whole_in_every_frame():
    long = Instant.at_rest(Layout(rows=30, columns=3))
    with stage(long, Turntable(width=50, height=100, frames=8)) as shots:
        (bed,) = (thing for thing in shots.scene.objects if is_bed(thing))
        for frame in range(shots.count):
            shots.show(frame)
            seen = see(shots, bed)
            assert 0.0 < seen.min() < seen.max() < 1.0


def test_a_film_that_is_stopped_leaves_nothing_and_a_folder_that_cannot_be_written_is_told(
    tmp_path, history
):
    asked = iter([False, True])
    path, looks = tmp_path / "film.mp4", Film(**SMALL)
    staged = stage(history, looks)
    assert film.render_film(staged, path, looks, stopped=lambda: next(asked)) is None
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"film\.mp4 cannot be written") as caught:
        film.render_film(stage(history, looks), tmp_path / "file" / "film.mp4", looks)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can make a small disk"
)
def test_on_a_full_disk_nothing_half_written_stays(tmp_path, history):
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", str(disk)], capture_output=True
    )
    if made.returncode:
        pytest.skip("this machine does not let root mount a disk")
    looks = Film(**SMALL, stop=0.3)
    try:
        with pytest.raises(
            OutputError, match=r"film\.mp4 cannot be written: [Nn]o space"
        ) as caught:
            film.render_film(stage(history, looks), disk / "film.mp4", looks)
        assert "\n" not in str(caught.value)
        assert list(disk.iterdir()) == []
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_film_of_two_fingers_shows_both_and_plots_the_force_of_each():
    def press(x, low):
        ways = [{"time": t, "position": [x, 0.0, z]} for t, z in ((0.0, 0.041), (0.2, low))]
        return {"trajectory": {"waypoints": ways}}

    fingers = [press(-0.01, 0.0405), press(0.01, 0.038)]
    bed = {"layout": {"rows": 7, "columns": 13}, "control": {"method": "elastic"}}
    scene = resolve({**bed, "finger": fingers})
    history = simulate(scene).history
    with stage_moving(scene, history, Film(**SMALL)) as shots:
        shots.show(shots.count - 1)
        (bed,) = (thing for thing in shots.scene.objects if thing.get(ROLE) == BED)
        assert len(fingertips_of(bed)) == 2
        words = {thing.data.body for thing in shots.scene.objects if thing.type == "FONT"}
    least, most = history["finger_force"][-1]
    assert f"forces of fingertips {least:.2f} to {most:.2f} N" in words


#: Where the second fingertip is at the end, when it has left, m.
PLACES = {
    "low over the bed": (0.01, 0.0, 0.041),
    "lifted": (0.01, 0.0, 0.048),
    "lifted behind the bed": (-0.01, 0.014, 0.046),
    "as high as in the samples": (0.01, 0.0, 0.066),
    "parked": (0.01, 0.0, 1.0),
}


def test_fingertips_stay_in_the_frame_and_the_bed_is_not_made_small_for_one_that_is_parked(history):
    history["fingertip"] = np.repeat(history["fingertip"][:, None], 2, axis=1)
    history["finger_force"] = np.repeat(history["total_force"][:, None] / 2, 2, axis=1)
    widths = {}
    history["total_force"][-1] = 0.0
    for name, place in PLACES.items():
        history["fingertip"][:, :, :3], history["fingertip"][-1, 1, :3] = (-0.01, 0.0, 0.04), place
        sizes = {"finger": (Fingertip(), Fingertip())}
        with stage_film(
            history, Film(**SMALL), ("forces", history["finger_force"]), **sizes
        ) as shots:
            shots.show(shots.count - 1)
            bed = next(thing for thing in shots.scene.objects if thing.get(ROLE) == BED)
            seen = see(shots, bed), see(shots, ellipsoid(fingertips_of(bed)[2]))
        assert ((seen[1] > 0.0) & (seen[1] < 1.0)).all() == (name != "parked"), name
        widths[name] = np.ptp(seen[0][:, 0])
    low, lifted, behind, high, parked = widths.values()
    assert low == pytest.approx(parked, rel=0.02)  # the ellipsoid is 1 mm higher
    assert high < max(lifted, behind) < low


JOBS = """
scenes = ["tap"]
methods = ["cell_states"]
errors = false
settings.short.simulation.duration = 0.3
[still]
width = 160
height = 100
engine = "workbench"
[turntable]
width = 64
height = 40
frames = 2
[film]
width = 160
height = 100
rate = 5
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("short") / "run"
    settings = ["--set", "simulation.duration=0.2", "--no-errors", "--quiet"]
    assert main(["run", "tap", "--out", str(folder), *settings]) == 0
    return folder


def test_a_run_is_filmed_and_turned_by_commands(run, capsys):
    small = ["--size", "64x40", "--rate", "5", "--quiet"]
    assert main(["render", str(run), "--film", "--speed", "0.5", "--color", "force", *small]) == 0
    assert main(["render", str(run), "--turntable", "--frames", "2", *small]) == 0
    assert {path.name for path in run.glob("*.mp4")} == {"film.mp4", "turntable.mp4"}
    assert capsys.readouterr().out == ""


def test_a_batch_draws_what_is_asked_for_and_shows_it_on_its_page(capfd):
    Path("drawn.toml").write_text(JOBS, encoding="utf-8")
    assert main(["batch", "drawn.toml", "--jobs", "2"]) == 0, capfd.readouterr().out
    page = Path("drawn/index.html").read_text(encoding="utf-8")
    folder = Path("drawn/runs/tap-cell_states-short")
    drawn = {"still.png", "thumbnail.jpg", "turntable.mp4", "film.mp4"}
    assert drawn <= {path.name for path in folder.iterdir()}
    # An MP4 file says so at its start.
    assert all(
        (folder / film).read_bytes()[4:8] == b"ftyp" for film in ("turntable.mp4", "film.mp4")
    )
    assert f'href="runs/{folder.name}/film.mp4"' in page
    timing = json.loads((folder / "timing.json").read_text(encoding="utf-8"))
    # Blender's module needs some tenths of a second to come up, on any machine.
    assert 0.2 < timing["start_up"] < 60.0
    image = bpy.data.images.load(str((folder / "thumbnail.jpg").resolve()))
    assert tuple(image.size) == (THUMBNAIL, THUMBNAIL * 100 // 160)
    assert page.count("data:image/jpeg;base64,") == 1


@pytest.mark.parametrize(
    "arguments, told",
    [
        (["--film", "--size", "65x40"], "--size must be an even number"),
        (["--film", "--rate", "0"], "--rate must be at least 1"),
        (["--film", "--start", "7"], "--start must be between 0 s and"),
        (["--film", "--time", "0"], "--time must not be given with --film"),
        (["--speed", "2"], "--speed must be given with --film only"),
        (["--film", "--frames", "9"], "--frames must be given with --turntable only"),
        (["--film", "--turntable"], "not allowed with argument"),
    ],
)
def test_options_that_do_not_go_together_are_told_in_one_line(arguments, told, run, capsys):
    assert main(["render", str(run), *arguments]) == 2
    _, err = capsys.readouterr()
    assert told in err
    assert err.count("\n") == 1


RANGES = """
scenes = ["tap"]
errors = false
settings.short.simulation.duration = 0.4
[film]
width = 64
height = 40
rate = 10
"""
COUNT = 5
JOB, RUN = Path("two/jobs/tap-short"), Path("two/runs/tap-short")


def test_frames_drawn_in_ranges_are_those_of_the_film(here, capsys):
    Path("two.toml").write_text(RANGES, encoding="utf-8")
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    assert main(["job", str(JOB), "--only", "run", "--quiet"]) == 0
    folder, whole = find_frames(RUN, "film"), here / "whole"
    whole.mkdir()
    assert main(["job", str(JOB), "--only", "film", "--frames", "2-3", "--quiet"]) == 0
    assert list_missing(folder, range(COUNT)) == [0, 1, 4]
    outputs, found = read_outputs(JOB / "job.toml"), read_run(RUN, *ARRAYS)
    with stage_moving(found.scene, found.history, outputs.film) as shots:
        assert shots.count == COUNT
        assert draw_frames(shots, range(COUNT), whole, here / "film.mp4")
    for frame in (2, 3):
        np.testing.assert_array_equal(
            read_picture(name_frame(folder, frame)), read_picture(name_frame(whole, frame))
        )
        assert (
            read_picture(name_frame(whole, frame)) != read_picture(name_frame(whole, frame - 1))
        ).any()
    # Another range draws no frame that is there, and again one that a copy cut off; a stop keeps
    # those drawn.
    kept = name_frame(folder, 3).stat().st_mtime_ns
    name_frame(folder, 2).write_bytes(name_frame(folder, 3).read_bytes()[:-4])
    asked = iter([False, True])
    with pytest.raises(KeyboardInterrupt):
        Work(JOB, RUN, outputs, lambda: next(asked), lambda step, share: None).make_frames(
            "film", "2-4"
        )
    assert list_missing(folder, range(COUNT)) == [0, 1, 4]
    assert name_frame(folder, 3).stat().st_mtime_ns == kept
    np.testing.assert_array_equal(
        read_picture(name_frame(folder, 2)), read_picture(name_frame(whole, 2))
    )
    # A second process on the same frames is refused, and frames that the film does not have.
    with lock_name(folder / "3-4"):
        assert main(["job", str(JOB), "--only", "film", "--frames", "3-4", "--quiet"]) == 2
    assert "3-4 is being written by another digiclay" in capsys.readouterr().err
    assert main(["job", str(JOB), "--only", "film", "--frames", "0-5", "--quiet"]) == 2
    assert capsys.readouterr().err == "--frames must be within 0-4, first frame first (got 0-5).\n"
    # The job as a whole keeps its run, draws what is missing, and makes the film.
    assert not is_done(JOB, RUN)
    before = (RUN / "history.npz").stat().st_mtime_ns
    assert main(["job", str(JOB), "--quiet"]) == 0
    with scratch():
        _, count = film_strip(bpy.data.scenes.new("reading"), RUN / "film.mp4")
    assert (count, folder.exists(), is_done(JOB, RUN)) == (COUNT, False, True)
    assert (RUN / "history.npz").stat().st_mtime_ns == before
    timing = json.loads((RUN / "timing.json").read_text(encoding="utf-8"))
    assert timing["files"]["film.mp4"] == (RUN / "film.mp4").stat().st_size
    made = (RUN / "film.mp4").stat().st_mtime_ns
    for part in (["--only", "film"], ["--only", "film", "--frames", "0-3"], []):
        assert main(["job", str(JOB), *part]) == 0
        assert " already" in capsys.readouterr().out
    assert (RUN / "film.mp4").stat().st_mtime_ns == made


def test_a_body_is_drawn_at_its_pose_and_a_fingertip_that_is_absent_is_not():
    ball = trimesh.creation.icosphere(1, radius=4e-3)
    points = [
        {"time": 0.0, "position": [0.0, 0.0, 0.045]},
        {"time": 0.5, "position": [3e-3, 0.0, 0.042], "orientation": [0.0, 0.0, 0.0, 1.0]},
    ]
    body = {"mesh": pack_mesh(ball.vertices, ball.faces), "trajectory": {"waypoints": points}}
    bed = {"layout": {"rows": 5, "columns": 5}, "control": {"method": "plastic"}}
    done = simulate(resolve({**bed, "body": [body]}))
    looks = Film(**SMALL, strip=False)
    with stage_moving(done.scene, done.history, looks) as shots:
        shots.show(shots.count - 1)
        shots.scene.view_layers[0].update()
        (drawn,) = [part for part in shots.scene.objects if BODY in part]
        pose = done.history["body"][looks.rows(done.history["time"])[-1], 0]
        assert np.allclose(drawn.matrix_world.translation, pose[:3] * SCALE, atol=1e-6)
        assert np.allclose(np.abs(drawn.matrix_world.to_quaternion()), pose[3:], atol=1e-6)
        assert len(drawn.data.polygons) == len(ball.faces)
        assert not [part for part in shots.scene.objects if part.get(ROLE) == FINGERTIP]
