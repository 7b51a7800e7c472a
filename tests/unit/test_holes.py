"""Holes of scans are filled from around; openings that belong to a shape stay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.shapes.mesh_relief import SMALL, ShapeMesh, fill_holes, make_shape_mesh
from digiclay.core.shapes.request import Placement, Shape
from digiclay.core.shapes.source_file import fit_shape

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
#: Meshes here are in mm and stand where they are.
IN_PLACE = Placement(1e-3, 1e-3, 0.0, 0.0)


def ground(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height of a hilly ground 20 mm up, mm."""
    return 20.0 + 0.1 * x + 3.0 * np.sin(x / 20.0) * np.cos(y / 25.0)


def scan(*holes: tuple[float, float, float], size: float = 60.0) -> trimesh.Trimesh:
    """Return the ground as triangles 1 mm wide, without those in holes: x, y and radius, mm."""
    side = np.arange(-size, size + 1.0)
    x, y = (axis.ravel() for axis in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(x.size).reshape(side.size, side.size)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    plan = np.column_stack([x, y])[faces].mean(axis=1)
    for left, front, radius in holes:
        away = np.hypot(plan[:, 0] - left, plan[:, 1] - front) > radius
        faces, plan = faces[away], plan[away]
    return trimesh.Trimesh(np.column_stack([x, y, ground(x, y)]), faces, process=False)


def shape(mesh: trimesh.Trimesh) -> ShapeMesh:
    """Return a mesh of trimesh's as a shape."""
    return make_shape_mesh("scan.stl", mesh.vertices, mesh.faces, "z", 1e-3)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_hole_of_a_scan_is_as_high_as_what_is_around_it(arrangement: str) -> None:
    bed = make_grid(Layout(25, 25, 3e-3, arrangement))
    found = shape(scan((5.0, -8.0, 5.0), (-20.0, 14.0, 2.5))).tops(bed, IN_PLACE)
    assert found.covered.all()
    assert not found.overhang.any()
    missed = np.count_nonzero(np.hypot(bed.x * 1e3 - 5.0, bed.y * 1e3 + 8.0) < 4.0)
    assert missed < found.filled < 25
    # The flattest surface leaves the ground by its curvature, 3 mm / (20 mm)², times a quarter of (5 mm)².
    assert np.abs(found.value - ground(bed.x * 1e3, bed.y * 1e3)).max() < 0.1


def test_a_hole_in_the_top_of_a_solid_is_filled_though_its_inside_is_seen_through_it() -> None:
    top = scan((3.0, 4.0, 5.0), size=40.0)
    plate = trimesh.creation.box((80.0, 80.0, 2.0))
    lower = plate.submesh([np.flatnonzero(plate.face_normals[:, 2] < 0.5)], append=True)
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(trimesh.util.concatenate([top, lower])).tops(bed, IN_PLACE)
    assert found.filled > 5
    assert np.abs(found.value - ground(bed.x * 1e3, bed.y * 1e3)).max() < 0.1


def test_a_large_opening_stays() -> None:
    # 18 mm across: more than a twentieth of the pins.
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(scan((0.0, 0.0, 12.0))).tops(bed, IN_PLACE)
    inside = np.hypot(bed.x, bed.y) < 11e-3
    assert not found.covered[inside].any()
    assert found.filled == 0


def test_the_opening_of_a_closed_mesh_stays() -> None:
    ring = trimesh.creation.annulus(3.0, 30.0, 10.0)
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(ring).tops(bed, IN_PLACE)
    assert not found.covered[np.hypot(bed.x, bed.y) < 2.5e-3].any()
    assert found.filled == 0


def test_what_lies_beside_a_scan_is_no_hole() -> None:
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(scan((-20.0, 0.0, 4.0), size=21.0)).tops(bed, IN_PLACE)
    assert found.filled == 0
    assert found.covered.sum() < 15 * 15


def test_a_bay_that_reaches_the_rim_of_the_bed_is_no_hole() -> None:
    bed = make_grid(Layout(25, 25, 3e-3))
    assert shape(scan((-36.0, 0.0, 4.0))).tops(bed, IN_PLACE).filled == 0


def test_a_sheet_turned_inside_out_is_displayed_as_it_is() -> None:
    turned = scan()
    turned.invert()
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(turned).tops(bed, IN_PLACE)
    assert found.filled == 0
    assert np.abs(found.value - ground(bed.x * 1e3, bed.y * 1e3)).max() < 0.02


def test_a_sheet_whose_faces_are_turned_at_random_has_no_holes() -> None:
    mixed = scan()
    turned = np.random.default_rng(2).random(len(mixed.faces)) < 0.85
    mixed.faces[turned] = mixed.faces[turned][:, ::-1]
    assert shape(mixed).tops(make_grid(Layout(25, 25, 3e-3)), IN_PLACE).filled == 0


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_slope_goes_on_through_a_hole(arrangement: str) -> None:
    bed = make_grid(Layout(21, 21, 3e-3, arrangement))
    slope = 7.0 + 300.0 * bed.x - 200.0 * bed.y
    missing = np.hypot(bed.x - 3e-3, bed.y) < 7e-3
    value, hole = fill_holes(bed, np.where(missing, -99.0, slope), missing)
    assert np.array_equal(hole, missing)
    # 300 rounds bring a hole four pins wide to rest.
    assert np.abs(value - slope).max() < 1e-9


def test_a_hole_is_small_up_to_a_twentieth_of_the_covered_pins() -> None:
    bed = make_grid(Layout(21, 21, 3e-3))
    for count in (20, 21, 22):
        missing = np.zeros(bed.count, np.bool_)
        missing[21 * 5 + 2 : 21 * 5 + 13] = missing[21 * 6 + 2 : 21 * 6 + 2 + count - 11] = True
        _, hole = fill_holes(bed, np.zeros(bed.count), missing)
        assert hole.any() == (count <= SMALL * (bed.count - count))


def test_a_bed_without_holes_and_one_that_is_missed_are_left_alone() -> None:
    bed = make_grid(Layout(5, 5, 3e-3))
    value = np.arange(25.0)
    for missing in (np.zeros(25, np.bool_), np.ones(25, np.bool_)):
        kept, hole = fill_holes(bed, value, missing)
        assert not hole.any()
        np.testing.assert_array_equal(kept, value)


def test_a_scan_with_holes_has_no_pits_and_says_so(tmp_path: Path) -> None:
    scan((5.0, -8.0, 5.0), size=36.0).export(tmp_path / "scan.stl")
    scan(size=36.0).export(tmp_path / "whole.stl")
    bed = make_grid(Layout())
    laid, whole = (
        fit_shape(Shape(file=str(tmp_path / name), relief="true"), bed, Actuator())
        for name in ("scan.stl", "whole.stl")
    )
    assert np.abs(laid.heights - whole.heights).max() < 0.1e-3
    assert f"{laid.filled} cells under holes filled from around" in laid.told()
    assert laid.filled > 5
    assert "holes" not in whole.told()
