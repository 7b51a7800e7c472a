"""Shapes from files: samples by name, every kind of file, and every way a file can be wrong."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import DigiclayError
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.scene_source import load
from digiclay.core.shapes.fitting import SAMPLES, find_shape, fit_shape, list_shapes, read
from digiclay.core.shapes.mesh_relief import ShapeMesh
from digiclay.core.shapes.request import Shape

BED = make_grid(Layout(13, 13, 3e-3))


def heights(file, **known):
    return fit_shape(Shape(file=str(file), **known), BED, Actuator()).heights


def test_every_sample_shape_has_a_note_of_its_origin():
    notes = (SAMPLES / "README.md").read_text(encoding="utf-8")
    assert len(list_shapes()) >= 12
    assert [name for name in list_shapes() if f"| `{find_shape(name).name}` |" not in notes] == []


@pytest.mark.parametrize("name", list_shapes())
def test_every_sample_shape_fits_a_bed_without_clipping_and_every_mesh_is_closed(name):
    laid = fit_shape(Shape(file=name), make_grid(Layout()), Actuator())
    assert np.ptp(laid.heights) == pytest.approx(15e-3, abs=1e-12)
    assert laid.too_low + laid.too_high == 0
    assert (laid.overhanging > 0) == (name == "knot")
    shape = read(Shape(file=name))
    if isinstance(shape, ShapeMesh):
        mesh = trimesh.load_mesh(find_shape(name))
        assert mesh.is_watertight
        assert mesh.volume > 0.0  # turned outwards
        assert shape.closed


OBJECTS = io.BytesIO()
np.save(OBJECTS, np.array([{}, {}], dtype=object), allow_pickle=True)


@pytest.mark.parametrize(
    "name, content, said",
    [
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "must hold a surface made of faces"),
        (
            "far.obj",
            b"v 0 0 0\nv 1 1e999 0\nv 0 1 0\nf 1 2 3\n",
            "(got schöner Ordner far.obj: vertex 1 at 1, inf, 0)",
        ),
        ("half.glb", b"glTF\x02\0\0\0\xff\0\0\0", "must be whole"),
        ("notes.doc", b"hello", "must be a mesh, a picture or an array"),
        ("notes.txt", b"hello", "must be a grid of numbers that can be read"),
        ("empty.npy", b"", "must hold one array of numbers"),
        ("objects.npy", OBJECTS.getvalue(), "must hold one array of numbers"),  # not unpickled
    ],
)
def test_a_file_that_holds_no_shape_is_refused_by_name(tmp_path, name, content, said):
    path = tmp_path / f"schöner Ordner {name}"
    path.write_bytes(content)
    with pytest.raises(DigiclayError) as caught:
        heights(path)
    assert (said in str(caught.value), path.name in str(caught.value)) == (True, True)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "word, said",
    [("craters", "Did you mean crater?"), ("no/where.stl", "no/where.stl: there is no such file."),
     (".", ". is a folder, not a file."), ("a\0b", "neither a file nor a sample shape"),
     (300 * "a", "neither a file nor a sample shape")],
)  # fmt: skip
def test_a_shape_that_is_not_there_is_told(word, said):
    with pytest.raises(DigiclayError, match=re.escape(said)):
        find_shape(word)


def test_a_scene_finds_its_shape_beside_itself_whose_first_row_is_at_the_lowest_y(tmp_path):
    (tmp_path / "Formen").mkdir()
    np.save(tmp_path / "Formen" / "größe 1.npy", np.repeat(np.arange(13.0), 13).reshape(13, 13))
    (tmp_path / "my.toml").write_text('[shape]\nfile = "Formen/größe 1.npy"\n', encoding="utf-8")
    scene = load(tmp_path / "my.toml")
    assert scene.shape
    assert Path(scene.shape.file) == (tmp_path / "Formen" / "größe 1.npy").resolve()
    assert np.all(np.diff(heights(scene.shape.file).reshape(13, 13), axis=0) > 0.0)
