"""Animated files of a few pins: every frame has the heights of the pins, and of the skin over them."""

import ast
import re

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.mesh_io.export_model import Model
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.surface.formed import Formed, measure_areas
from digiclay.core.surface.skins import SKINS, fit_skin
from digiclay.exchange.animation_file import SUFFIXES, animate, write_animation

from tests.assemble import assert_near
from tests.scene_files import call

#: USD is written to 9 decimals of a mm or m.
NEAR = 5e-9
RATE, FRAMES = 25.0, 6


def move(arrangement="aligned"):
    """Return the positions of 4 x 5 pins, and heights that all change from frame to frame, m."""
    position = make_grid(Layout(rows=4, columns=5, arrangement=arrangement)).positions
    return position, np.random.default_rng(5).uniform(0.03, 0.06, (FRAMES, 20))


def read_usd(path):
    """Return the points (t, m, 3) of a USD file, m, and whether they are of an instancer."""
    text = path.read_text(encoding="utf-8")
    assert text.count("{") == text.count("}")
    samples = re.findall(r"^(\d+): (\[.*\]),$", text, re.MULTILINE)
    assert [int(frame) for frame, _ in samples] == list(range(FRAMES))
    unit = float(re.search(r"metersPerUnit = (\S+)", text)[1])
    points = np.array([ast.literal_eval(points) for _, points in samples])
    return points * unit, 'PointInstancer "pins"' in text


@pytest.mark.parametrize("unit", ["mm", "m"])
@pytest.mark.parametrize("kind", ["pins", "surface"])
def test_each_frame_has_every_pin_or_the_skin_over_it_at_its_height(tmp_path, unit, kind):
    position, height = move()
    path = tmp_path / f"moving{SUFFIXES['usd']}"
    path.write_text("older")
    write_animation(path, animate(position, height, RATE, Model(kind=kind)), "usd", unit)
    assert list(tmp_path.iterdir()) == [path]
    found, instanced = read_usd(path)
    assert instanced == (kind == "pins")
    assert_near(found[..., :2], np.broadcast_to(position, (FRAMES, 20, 2)), NEAR)
    assert_near(found[..., 2], height, NEAR)


#: Area of the skin of 4 x 5 pins in square pitches.
AREAS = {"aligned": 12.0, "staggered": 12.0, "hexagonal": 12.0 * 0.75**0.5}


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("skin", SKINS)
def test_a_skin_moves_as_that_of_each_instant(arrangement, skin):
    position, height = move(arrangement)
    found = animate(position, height, RATE, Model(kind="surface", skin=skin, resolution=3))
    for points, pins in zip(found.points, height, strict=True):
        formed = Formed.of(position, pins, 0.0, 0.0, 0)
        assert_near(points[:, 2], fit_skin(formed, skin, 3, Model().cap).height, NEAR)
    # All triangles face up, and cover the bed from pin to pin once.
    areas = measure_areas(found.points[0], found.faces)
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(formed.pitch**2 * AREAS[arrangement])


def test_a_pin_stands_at_its_place_and_is_so_long_that_none_hangs_in_the_air(tmp_path):
    position, height = move()
    animation = animate(position, height, RATE, Model(kind="pins"))
    write_animation(tmp_path / "pins.glb", animation, "glb", "mm")
    scene = trimesh.load_scene(tmp_path / "pins.glb")  # which stands as in the first frame, y up
    places = [scene.graph[f"pin_{number}"][0][:3, 3] for number in range(20)]
    assert_near(places, np.column_stack([position[:, 0], height[0], -position[:, 1]]), NEAR)
    (pin,) = scene.geometry.values()
    assert_near(pin.bounds[1], [1e-3, 0.0, 1e-3], NEAR)
    assert -pin.bounds[0, 1] > np.ptp(height)
    assert (pin.face_normals[:, 1] >= -1e-6).all()


@pytest.mark.parametrize("kind", ["pins", "surface"])
def test_one_frame_is_refused(kind):
    position, height = move()
    with pytest.raises(OutputError, match="at least 2 frames"):
        animate(position, height[:1], RATE, Model(kind=kind))


def test_a_skin_of_many_frames_is_refused_as_glb_whose_weights_grow_with_their_square(tmp_path):
    position, height = move()
    animation = animate(position, np.tile(height[0], (4001, 1)), RATE, Model(kind="surface"))
    with pytest.raises(OutputError, match=r"at most 4000 frames \(got 4001\): choose usd or abc"):
        write_animation(tmp_path / "skin.glb", animation, "glb", "mm")
    assert list(tmp_path.iterdir()) == []


def test_a_row_of_pins_has_no_skin():
    position, height = move()
    assert animate(position[:5], height[:, :5], RATE, Model(kind="pins")).points.shape == (6, 5, 3)
    with pytest.raises(ParameterError, match="at least 2 x 2 pins"):
        animate(position[:5], height[:, :5], RATE, Model(kind="surface"))


#: What cannot be written of a run of 0.1 s, recorded every 5 ms, and what is said.
MISTAKES = {
    "export my --animated dae": "must be some of usd, abc, glb (got 'dae')",
    "export my --animated usd,": "must be some of usd, abc, glb (got 'usd,')",
    "export my --animated usd --kind solid": "--kind must be pins or surface with --animated (got solid)",
    "export my --animated usd --time 0.1": "--time must be given without --animated",
    "export my --animated usd --format stl": "--format must be given without --animated",
    "export my --fps 3": "--fps must be given with --animated",
    "export my --stop 0.1": "--stop must be given with --animated",
    "export my --animated usd --fps 0": "--fps must be at least 1 (got 0)",
    "export my --animated usd --fps 1000": "--fps must be at most 240 (got 1000)",
    "export my --animated usd --start 0.2": "--start must be between 0 s and 0.1 s",
    "export my --animated usd --start 0.1": "at least 2 frames (got 1)",
    "export my --animated usd --out my.toml": "my.toml cannot be written to: ",
    "export nowhere --animated usd": "nowhere is not the folder of a run",
    "export bare --animated usd": "bare has no history.npz",
    "export row --animated usd": "Surface must have at least 2 x 2 pins, in rows along x (got 1 x 4)",
}


def test_the_command_animates_a_run_between_its_rows_and_refuses_the_rest(here, capsys, refused):
    call("run my.toml --quiet")
    call("run my.toml --quiet --set recorder=absent --out bare")
    call("run my.toml --quiet --set layout.rows=1 --out row")
    call("export my --animated USD,glb --fps 24 --start 0.01 --stop 0.08")
    made = [path.split("animated_")[1] for path in capsys.readouterr().out.split()]
    assert made == ["pins.usda", "pins.glb", "skin.usda", "skin.glb"]
    with np.load(here / "my" / "history.npz") as history:
        time, height = history["time"], history["height"]
    # Frames lie between two rows: 1/24 s are no whole number of 5 ms.
    wanted = np.array(
        [[np.interp(at, time, pin) for pin in height.T] for at in (0.01, 0.01 + 1 / 24)]
    )
    text = (here / "my" / "animated_pins.usda").read_text(encoding="utf-8")
    assert "timeCodesPerSecond = 24\n" in text
    for frame, heights in enumerate(wanted):
        points = ast.literal_eval(re.search(rf"^{frame}: (.*),$", text, re.MULTILINE)[1])
        assert_near(np.array(points)[:, 2] / 1e3, heights, NEAR)
    assert np.ptp(wanted, axis=0).max() > 1000 * NEAR
    before = sorted(here.rglob("*"))
    for line, said in MISTAKES.items():
        refused(line, said)
    assert sorted(here.rglob("*")) == before
    assert call("export row --animated usd --kind pins --quiet") == 0
