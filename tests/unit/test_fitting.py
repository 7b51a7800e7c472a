"""Shapes and maps of heights laid onto beds: plan, height, what is clipped or refused; sizes of pictures."""

import re

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.shapes.fitting import fit_given, fit_relief, pack, unpack
from digiclay.core.shapes.heightmap import (
    make_height_map,
)
from digiclay.core.shapes.mesh_relief import make_shape_mesh
from digiclay.core.shapes.request import Shape

from tests.assemble import assert_near, table

REST, STROKE = Actuator().rest_height, Actuator().stroke
BED = make_grid(Layout(13, 25, 3e-3))
#: Heights of up to 0.1 m in 64 bits, after a few sums.
ROUNDING = 1e-12


def mesh(solid):
    return make_shape_mesh("solid.stl", solid.vertices, solid.faces, "z", 1e-3)


def laid(what, bed=BED, **known):
    return fit_relief(Shape(**known), what, bed, Actuator())


def box(wide, deep, high):
    solid = trimesh.creation.box((wide, deep, high))
    solid.apply_translation((70.0, -30.0, high / 2))  # wherever it stands, it is centered
    return mesh(solid)


def relief(cells):
    """Return heights above rest, mm, row by row."""
    return np.round((cells.heights.reshape(13, 25) - REST) * 1e3, 9)


@table(
    "size, known, rows, columns",
    {
        # 39 mm are the shorter side; a square box takes 13 x 13 cells.
        "contained it keeps its proportions": ((10, 10, 5), {}, range(13), range(6, 19)),
        # Pins 3 mm apart within +- 15.25 mm and +- 6.25 mm.
        "in its own size": ((30.5, 12.5, 5), {"fit": "actual"}, range(4, 9), range(7, 18)),
        # 5 mm wide about (9, -6) mm: one pin, and none of its neighbors 3 mm away.
        "scaled, moved": (
            (10, 10, 5),
            {"fit": "actual", "scale": 0.5, "x": 9e-3, "y": -6e-3},
            [4],
            [15],
        ),
    },
)
def test_a_fit_says_where_the_shape_lies_in_plan(size, known, rows, columns):
    raised = relief(laid(box(*size), **known)) > 0
    assert np.argwhere(raised).tolist() == [[row, column] for row in rows for column in columns]


BALL = trimesh.creation.icosphere(radius=10.0)
SLOPE = make_height_map("x.npy", np.linspace(0.0, 7e-3, 12).reshape(3, 4), 1.0)


@pytest.mark.parametrize(
    "what, known, low, high",
    [
        (mesh(BALL), {"rise": 15e-3, "foot": 2e-3}, 42e-3, 57e-3),
        (mesh(BALL), {"rise": 4e-3, "foot": 2e-3}, 42e-3, 46e-3),
        (mesh(BALL), {"rise": -12e-3, "foot": 2e-3}, 30e-3, 42e-3),
        (mesh(BALL), {"relief": "stroke"}, REST, STROKE),
        # 10 mm become 39 mm, 5 mm become 19.5 mm.
        (
            box(10, 10, 5),
            {"relief": "true"},
            REST,
            59.5e-3,
        ),
        (SLOPE, {"relief": "true", "fit": "stretch"}, REST, 47e-3),
    ],
)
def test_the_relief_goes_from_the_foot_over_the_rise_to_the_strokes_end_or_is_true(
    what, known, low, high
):
    cells = laid(what, **known)
    assert (cells.heights.min(), cells.heights.max()) == pytest.approx((low, high), abs=ROUNDING)
    assert cells.too_low + cells.too_high == 0


def test_placed_a_shape_stands_where_it_says_and_heights_of_a_scene_as_they_are():
    solid = trimesh.creation.box((12.5, 12.5, 10.0))
    solid.apply_translation((9.0, -6.0, 48.0))
    raised = relief(laid(mesh(solid), fit="placed"))
    assert set(np.unique(raised).tolist()) == {0.0, 13.0}  # its top is at 53 mm, the bed at 40 mm
    row, column = np.nonzero(raised)
    assert (row.min(), row.max(), column.min(), column.max()) == (2, 6, 13, 17)
    heights = np.linspace(-1e-3, 0.11, BED.count)
    # 32 bits: half of 2^-24 of 0.1 m at most.
    assert_near(unpack(pack(heights), BED), heights, 4e-9)
    cells = fit_given(Shape(file="Suzanne", heights=pack(heights)), BED, Actuator())
    assert_near(cells.heights, np.clip(heights, 0.0, STROKE), 4e-9)
    assert cells.too_low == np.count_nonzero(heights < -1e-9) > 0
    assert cells.describe().startswith("Suzanne: heights from 0.0 to 100.0 mm")


def test_what_leaves_the_stroke_is_clipped_and_counted_and_overhangs_are_told():
    row = np.linspace(0.0, 1.0, 25)
    cells = laid(
        make_height_map("ramp.png", np.tile(row, (13, 1))), fit="stretch", foot=-50e-3, rise=120e-3
    )
    wanted = REST - 50e-3 + 120e-3 * row
    assert cells.too_low == 13 * np.count_nonzero(wanted < -1e-9) > 0
    assert cells.too_high == 13 * np.count_nonzero(wanted > STROKE + 1e-9) > 0
    assert cells.heights.min() == 0.0
    assert cells.heights.max() == STROKE
    assert cells.describe() == (
        "ramp.png: heights from 0.0 to 100.0 mm, covers all cells, "
        f"{cells.too_low + cells.too_high} cells clipped ({cells.too_low} at the floor, "
        f"{cells.too_high} at the stroke's end)"
    )
    ring = trimesh.creation.torus(10.0, 3.0)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    cells = laid(mesh(ring))
    assert cells.overhanging > 0
    assert cells.describe() == (
        f"solid.stl: heights from 40.0 to 55.0 mm, covers {cells.covered} of 325 cells, no cell clipped, "
        f"overhangs under the top at {cells.overhanging} cells"
    )


@pytest.mark.parametrize("fit", ["stretch", "cover"])
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_bed_is_covered_by_a_stretched_picture(arrangement, fit):
    bed = make_grid(Layout(7, 9, 3e-3, arrangement))
    cells = laid(make_height_map("gray.png", np.full((4, 4), 99)), bed, fit=fit)
    assert cells.covered == bed.count
    assert np.all(cells.heights == REST)  # level as the picture


PICTURE, ARRAY = make_height_map("x.png", np.eye(3)), make_height_map("x.npy", np.eye(3), 1.0)
LINE = make_shape_mesh(
    "l.stl", np.array([[0.0, 0, 0], [9, 0, 0], [4, 0, 5]]), np.array([[0, 1, 2]]), "z", 1e-3
)
BESIDE = (
    "shape.x, y must leave the shape over the bed (got solid.stl: no pin lies under it). "
    "Set shape.fit to"
)


@pytest.mark.parametrize(
    "what, known, said",
    [
        (box(10, 10, 5), {"fit": "actual", "x": 1.0}, BESIDE),
        (box(10, 10, 5), {"fit": "placed"}, BESIDE),
        (PICTURE, {"fit": "actual"}, "its pixels have no length (got 'actual' for x.png)"),
        (ARRAY, {"fit": "placed"}, "its pixels have no length (got 'placed' for x.npy)"),
        (PICTURE, {"relief": "true"}, "its values are not lengths (got 'true' for x.png)"),
        (LINE, {}, "must be wider than a line or a point, seen from above (got l.stl: 9 x 0)"),
    ],
)
def test_what_cannot_be_laid_onto_the_bed_is_refused(what, known, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        laid(what, **known)


@pytest.mark.parametrize(
    "text, said",
    [
        ("rubbish!", "must be heights packed as text (got 'rubbish!')"),
        ("AAAA", "must be heights packed as text (got 'AAAA')"),
        (pack(np.arange(325.0))[:40], "must be heights packed as text"),
        (pack(np.ones(7)), "must hold the heights of the bed's 13 x 25 cells (got 7 heights)"),
        (pack(np.ones(10**6)), "of the bed's 13 x 25 cells (got more than 325 heights)"),
        (
            pack(np.where(np.arange(325) == 9, np.nan, 1.0)),
            "must be finite numbers (got nan at cell 9)",
        ),
    ],
)
def test_a_text_that_holds_other_heights_is_refused(text, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        unpack(text, BED)


def test_pins_over_no_data_stand_at_the_foot_and_those_beside_are_as_high_as_if_it_ended_there(
    tmp_path,
):
    heights = np.tile(np.linspace(1.0, 5.0, 25), (13, 1))
    absent = np.zeros((13, 25), bool)
    absent[3:6, 4:9] = True
    grid = make_height_map(
        "a.asc", np.ma.array(np.where(absent, -9999.0, heights), mask=absent), 1.0, 20.0
    )
    cells = laid(grid, fit="stretch", rise=8e-3)
    assert cells.covered == 13 * 25 - 15
    wanted = np.where(absent, 0.0, 2.0 * (heights - 1.0))
    assert_near(relief(cells), wanted, 1e-9)
    # Twice as fine, each pin has the mean of the pixels that have data.
    fine = np.ma.array(
        np.kron(heights, np.ones((2, 2))), mask=np.kron(absent, np.ones((2, 2), bool))
    )
    cells = laid(make_height_map("a.asc", fine), fit="stretch", rise=8e-3)
    assert_near(relief(cells), wanted, 1e-9)


def test_an_esri_grid_keeps_its_proportions_of_plan_and_height(tmp_path):
    # 100 m x 60 m, 40 m high, in cells of 20 m, which become 15 mm: 75 mm are five of them.
    grid = make_height_map("a.asc", np.tile(np.linspace(0.0, 40.0, 5), (3, 1)), 1.0, 20.0)
    assert np.ptp(laid(grid, relief="true", fit="cover").heights) == pytest.approx(
        30e-3, abs=ROUNDING
    )
    with pytest.raises(ParameterError, match="no pin lies under it"):
        laid(grid, fit="actual", x=90.0)
    with pytest.raises(ParameterError, match="its pixels have no place"):
        laid(grid, fit="placed")
