"""The stepped bed as one body, beside trimesh's judgment and volumes worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.pins_solid import BRIDGE, make_parts, make_pins_solid
from hypothesis import given
from hypothesis import strategies as st

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")


def formed(heights_mm, rows: int, columns: int, arrangement: str = "aligned") -> Formed:
    place = make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions
    return Formed.of(place, np.asarray(heights_mm, float) * 1e-3, 0.04, 0.0, 0)


@st.composite
def beds(draw):
    """Beds with steps of all kinds, many of them of equal height."""
    layout = Layout(
        rows=draw(st.integers(2, 9)),
        columns=draw(st.integers(2, 9)),
        arrangement=draw(st.sampled_from(ARRANGEMENTS)),
    )
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = draw(st.sampled_from([1, 2, 3, 5, 1000]))
    height = 0.03 + 1e-3 * random.integers(0, levels, layout.rows * layout.columns)
    turned = draw(st.sampled_from([(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]))
    return Formed.of(make_grid(layout).positions * turned, height, 0.04, 0.0, 0)


@given(beds())
def test_every_edge_has_two_faces_and_all_face_outward(bed):
    vertices, faces, _ = make_pins_solid(bed)
    # Merged by place, as a reader of STL does it: so parts that only touch would be found.
    mesh = trimesh.Trimesh(vertices, faces, process=True)
    edges = np.sort(mesh.edges, axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts) == {2}
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert mesh.body_count == 1
    assert mesh.area_faces.min() > 0.0


@given(beds())
def test_every_vertex_is_used_and_the_first_are_the_pin_tops(bed):
    vertices, faces, _ = make_pins_solid(bed)
    assert len(np.unique(faces)) == len(vertices)
    tops = np.column_stack([bed.position, bed.height])
    np.testing.assert_allclose(vertices[: len(tops)], tops, rtol=0.0, atol=0.51e-7)  # in steps of 0.1 µm


@pytest.mark.parametrize("arrangement", ["staggered", "hexagonal"])
def test_a_shifted_bed_has_the_volume_of_its_prisms(arrangement):
    layout = Layout(rows=4, columns=5, arrangement=arrangement)
    heights = np.random.default_rng(2).integers(300, 600, 20) / 10.0
    vertices, faces, _ = make_pins_solid(formed(heights, 4, 5, arrangement), base=0.01)
    prisms = (heights * 1e-3 - 0.01).sum() * layout.pitch * layout.row_spacing
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(prisms, rel=1e-12)


def test_an_aligned_bed_without_bridges_has_the_volume_of_its_prisms():
    heights = np.arange(12.0).reshape(3, 4) + 30.0  # a stair: no two corners are above both others
    vertices, faces, _ = make_pins_solid(formed(heights.ravel(), 3, 4), base=0.0)
    prisms = heights.sum() * 1e-3 * 9e-6
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(prisms, rel=1e-12)


def test_squares_that_meet_at_a_corner_are_joined_by_a_bridge():
    bed = formed([50, 40, 40, 50], 2, 2)
    made = make_parts(bed)
    assert len(made.corner) == 10  # nine and one more: the middle is two
    between = made.corner[np.abs(made.corner).max(axis=1) < 0.5e-3]
    np.testing.assert_allclose(np.abs(between), BRIDGE * 3e-3, rtol=1e-9)
    high = {0, 3}
    met = made.twin >= 0
    assert any({int(p), int(o)} == high for p, o in zip(made.pin[met], made.pin[made.twin[met]], strict=True))


def test_the_parts_cover_the_bed_without_a_gap():
    for arrangement in ARRANGEMENTS:
        layout = Layout(rows=4, columns=5, arrangement=arrangement)
        made = make_parts(formed(np.full(20, 40.0), 4, 5, arrangement))
        a, b = made.corner[made.start], made.corner[made.end]
        area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        each = np.bincount(made.pin, area)
        np.testing.assert_allclose(each, layout.pitch * layout.row_spacing, rtol=1e-9)
        outer = made.twin < 0
        assert area[outer].sum() == pytest.approx(each.sum(), rel=1e-9)


def test_the_base_is_3_mm_under_the_lowest_pin_unless_told_otherwise():
    bed = formed([40, 45, 50, 55], 2, 2)
    assert make_pins_solid(bed)[0][:, 2].min() == pytest.approx(0.037, abs=1e-15)
    assert make_pins_solid(bed, base_thickness=0.01)[0][:, 2].min() == pytest.approx(0.03, abs=1e-15)
    with pytest.raises(ParameterError, match=r"^Surface\.base must be below the lowest pin top at 40 mm"):
        make_pins_solid(bed, base=0.04)


def test_differences_no_file_can_hold_make_no_wall():
    heights = 40.0 + np.array([0.0, 1e-6, 2e-5, 0.0, 5.0, 5.0])
    vertices, faces, _ = make_pins_solid(formed(heights, 2, 3))
    corners = vertices[faces].astype(np.float32)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.min() > 1e-8  # m²; a wall of the least step would have 3e-10
