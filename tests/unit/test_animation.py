"""Animated files of a few pins: every frame has the heights of the pins, and of the skin over them."""

import ast
import json
import re

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.mesh_io.export_model import Model
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import fit_skin
from digiclay.exchange.animation_file import SUFFIXES, animate, write_animation

from tests.scene_files import call

#: Half a unit in the last place of a float32, twice, at 60 mm; USD is written to 9 decimals of a mm or m.
NEAR = 5e-9
RATE, FRAMES = 25.0, 6


def move(arrangement="aligned"):
    """Return the positions of 4 x 5 pins, and heights that all change from frame to frame, m."""
    position = make_grid(Layout(rows=4, columns=5, arrangement=arrangement)).positions
    return position, np.random.default_rng(5).uniform(0.03, 0.06, (FRAMES, 20))


def write(folder, kind, file_format, unit="mm", arrangement="aligned", **skin):
    """Write an animation over an older file, and return the file."""
    position, height = move(arrangement)
    path = folder / f"moving{SUFFIXES[file_format]}"
    path.write_text("older")
    animation = animate(position, height, RATE, Model(kind=kind, **skin))
    write_animation(path, animation, file_format, unit)
    assert list(folder.iterdir()) == [path]
    return path


def read_usd(path, name):
    """Return the points (t, m, 3) of a USD file, m."""
    text = path.read_text(encoding="utf-8")
    assert text.count("{") == text.count("}")
    samples = re.findall(r"^(\d+): (\[.*\]),$", text, re.MULTILINE)
    assert [int(frame) for frame, _ in samples] == list(range(FRAMES))
    assert (f'PointInstancer "{name}"' in text) == (name == "pins")
    unit = float(re.search(r"metersPerUnit = (\S+)", text)[1])
    return np.array([ast.literal_eval(points) for _, points in samples]) * unit


def read_glb(path, name):
    """Return the points (t, m, 3) of the nodes or the morphed mesh of a GLB, z up, and their times."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    tree, binary = json.loads(data[20 : 20 + length]), data[28 + length :]

    def values(number):
        accessor = tree["accessors"][number]
        view = tree["bufferViews"][accessor["bufferView"]]
        flat = np.frombuffer(binary, "<f4", view["byteLength"] // 4, view["byteOffset"])
        table = flat.reshape(accessor["count"], -1).astype(float)
        assert (table.min(0).tolist(), table.max(0).tolist()) == (accessor["min"], accessor["max"])
        return table

    (session,) = tree["animations"]
    times = {each["input"] for each in session["samplers"]}
    assert len(times) == 1
    moving = [values(each["output"]) for each in session["samplers"]]
    assert [each["target"]["node"] for each in session["channels"]] == list(range(len(moving)))
    if name == "skin":
        (part,) = tree["meshes"][0]["primitives"]
        shares = moving[0].reshape(FRAMES, -1)
        rises = np.array([values(each["POSITION"]) for each in part["targets"]])
        points = values(part["attributes"]["POSITION"]) + np.einsum("tk,kmc->tmc", shares, rises)
    else:
        points = np.stack(moving, axis=1)
        first = [each["translation"] for each in tree["nodes"]]
        assert np.abs(first - points[0]).max() < NEAR
    assert np.abs(values(times.pop())[:, 0] - np.arange(FRAMES) / RATE).max() < 1e-7
    x, y, z = np.moveaxis(points, 2, 0)
    return np.stack([x, -z, y], axis=2)


READERS = {"usd": read_usd, "glb": read_glb}


@pytest.mark.parametrize("file_format", READERS)
@pytest.mark.parametrize("unit", ["mm", "m"])
@pytest.mark.parametrize("kind, name", [("pins", "pins"), ("surface", "skin")])
def test_each_frame_has_every_pin_or_the_skin_over_it_at_its_height(
    tmp_path, file_format, unit, kind, name
):
    found = READERS[file_format](write(tmp_path, kind, file_format, unit), name)
    position, height = move()
    assert np.abs(found[..., :2] - position).max() < NEAR
    assert np.abs(found[..., 2] - height).max() < NEAR


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("skin", ["bilinear", "smooth", "membrane"])
def test_a_skin_moves_as_that_of_each_instant(tmp_path, arrangement, skin):
    path = write(tmp_path, "surface", "glb", arrangement=arrangement, skin=skin, resolution=3)
    found, (position, height) = read_glb(path, "skin"), move(arrangement)
    for points, pins in zip(found, height, strict=True):
        wanted = fit_skin(Formed.of(position, pins, 0.0, 0.0, 0), skin, 3, Model().cap)
        assert np.abs(points[:, 2] - wanted.height).max() < NEAR
    (mesh,) = trimesh.load_scene(path).geometry.values()
    # All triangles face up, y in a GLB, and cover the bed from pin to pin once.
    assert mesh.face_normals[:, 1].min() > 0.0
    seen = mesh.face_normals[:, 1] * mesh.area_faces
    assert seen.sum() == pytest.approx(
        Formed.of(position, pins, 0.0, 0.0, 0).pitch ** 2 * AREAS[arrangement]
    )


#: Area of the skin of 4 x 5 pins in square pitches.
AREAS = {"aligned": 12.0, "staggered": 12.0, "hexagonal": 12.0 * 0.75**0.5}


def test_trimesh_places_each_pin_whose_length_leaves_none_in_the_air(tmp_path):
    scene = trimesh.load_scene(write(tmp_path, "pins", "glb"))
    (pin,) = scene.geometry.values()
    tops = [scene.graph[f"pin_{number}"][0][1, 3] for number in range(20)]
    height = move()[1]
    assert np.abs(tops - height[0]).max() < NEAR
    assert pin.bounds[1].tolist() == pytest.approx([1e-3, 0.0, 1e-3], abs=NEAR)
    assert -pin.bounds[0][1] > np.ptp(height)
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


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path):
    position, height = move()
    animation = animate(position, height, RATE, Model(kind="pins"))
    with pytest.raises(OutputError, match="Cannot write"):
        write_animation(tmp_path / "absent" / "moving.glb", animation, "glb", "mm")
    assert list(tmp_path.iterdir()) == []


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
        assert np.abs(np.array(points)[:, 2] / 1e3 - heights).max() < NEAR
    assert np.ptp(wanted, axis=0).max() > 1000 * NEAR
    before = sorted(here.rglob("*"))
    for line, said in MISTAKES.items():
        refused(line, said)
    assert sorted(here.rglob("*")) == before
    assert call("export row --animated usd --kind pins --quiet") == 0
