"""What was formed, written as a mesh and read back as a shape: the same heights, cell by cell."""

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix, write
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.shapes.fitting import fit_relief, read
from digiclay.core.shapes.mesh_relief import make_shape_mesh
from digiclay.core.shapes.request import Placement, Shape
from digiclay.core.surface.formed import Formed

from tests.assemble import assert_near

#: mm. In the middle of a bed the last ones have no place that is a round number, in binary or in
#: decimals.
PITCHES = (3.0, 2.3, 2.54)
#: A float32 of 50 mm is 2 nm off at most, and beside a pin a slope of 20 moves the height by 20
#: times that; pins are rounded to 0.1 µm.
EXACT = 1e-7


def bed(pitch, arrangement):
    """A bed with pins anywhere between 30 and 50 mm."""
    cells = make_grid(Layout(9, 8, pitch * 1e-3, arrangement))
    height = np.random.default_rng(3).uniform(0.03, 0.05, cells.count)
    return cells, Formed.of(cells.positions, height, 0.04, 0.0, 0)


def read_back(cells, formed, model, path, format, unit="mm"):
    write(make_bodies(formed, model), path, unit, format)
    tells = unit == "mm" or format in ("glb", "3mf")  # a file that names no unit is in mm
    shape = Shape(file=str(path), fit="placed", unit="auto" if tells else unit)
    return fit_relief(shape, read(shape), cells, Actuator())


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_formed_bed_comes_back_cell_by_cell(tmp_path, arrangement, format):
    path = tmp_path / f"formed{find_suffix(format)}"
    for pitch, kind in zip(PITCHES, ("solid", "surface", "pins"), strict=True):
        cells, formed = bed(pitch, arrangement)
        back = read_back(
            cells, formed, Model(kind=kind), path, format, "m" if pitch == 2.3 else "mm"
        )
        assert (back.covered, back.overhanging) == (cells.count, 0), kind
        assert_near(back.heights, formed.height, EXACT)


@pytest.mark.parametrize("skin", ["smooth", "membrane"])
def test_a_curved_skin_comes_back_at_its_pins(tmp_path, skin):
    cells, formed = bed(2.3, "hexagonal")
    back = read_back(cells, formed, Model(kind="solid", skin=skin), tmp_path / "x.stl", "stl")
    assert back.covered == cells.count
    assert_near(back.heights, formed.height, 1e-6)  # the membrane stops at 1 nm a point


@pytest.mark.parametrize(
    "up, forward, header",
    [
        ("y", "", None),
        ("z", "", None),
        ("z", "-x", None),
        ("-y", "x", None),
        ("x", "-z", None),
        ("z", "", "# digiclay, lengths in mm, z up"),  # as files were written before they had axes
        ("y", "", "# Blender 4.5"),  # whoever says nothing has Blender's axes
    ],
)
def test_an_obj_comes_back_from_any_axes(tmp_path, up, forward, header):
    cells, formed = bed(2.3, "staggered")
    path = write(make_bodies(formed, Model()), tmp_path / "x.obj", up=up, forward=forward)
    if header:
        path.write_text(header + path.read_text()[path.read_text().index("\n") :])
    shape = Shape(file=str(path), fit="placed", unit="mm")
    assert_near(fit_relief(shape, read(shape), cells, Actuator()).heights, formed.height, EXACT)


@pytest.mark.parametrize("up, forward", [("z", "-z"), ("w", ""), ("y", "up")])
def test_axes_that_make_no_sense_are_refused(tmp_path, up, forward):
    with pytest.raises(ParameterError, match=r"^Export\.(up|forward) must be "):
        write(
            make_bodies(bed(3.0, "aligned")[1], Model()), tmp_path / "x.obj", up=up, forward=forward
        )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_rim_of_six_digits_still_covers_the_outer_pins(arrangement):
    cells, formed = bed(2.3, arrangement)
    (body,) = make_bodies(formed, Model(kind="surface"))
    rounded = np.array([[float(f"{value * 1e3:.6g}") for value in row] for row in body.vertices])
    tops = make_shape_mesh("x", rounded, body.faces, "z", 1e-3).tops(
        cells, Placement(1e-3, 1e-3, 0.0, 0.0)
    )
    assert tops.covered.all()
    # 50 nm off, at a slope of up to 20.
    assert_near(tops.value * 1e-3, formed.height, 2e-6)


PLATE = np.array([[-5.97, -5.97, 1.0], [5.97, -5.97, 1.0], [5.97, 5.97, 1.0], [-5.97, 5.97, 1.0]])
INNER = [6, 7, 8, 11, 12, 13, 16, 17, 18]
#: It ends a quarter of a pitch before the middle pin, at an angle of 1e-4.
NEEDLE = np.array([[-6.0, -3e-4, 1.0], [-6.0, 3e-4, 1.0], [-0.75, 0.0, 1.0]])


@pytest.mark.parametrize(
    "corners, faces, covered",
    [(PLATE, [[0, 1, 2], [0, 2, 3]], INNER), (NEEDLE, [[0, 2, 1]], [10, 11])],
    ids=["not a hundredth of a pitch beside it", "not ahead of a needle's tip"],
)
def test_a_shape_covers_the_pins_under_it(corners, faces, covered):
    cells, plan = make_grid(Layout(5, 5, 3e-3)), Placement(1e-3, 1e-3, 0.0, 0.0)
    tops = make_shape_mesh("x", corners, faces, "z", 1e-3).tops(cells, plan)
    np.testing.assert_array_equal(np.flatnonzero(tops.covered), covered)
