"""The solid under any heights, on any bed: closed, turned outward, and of the volume of its prisms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.skin_mesh import make_solid
from hypothesis import example, given
from hypothesis import strategies as st

from tests.prisms import prism_volume

#: Volumes are sums of up to 1e4 terms, the largest about 100 times the result: rounding stays below this.
ROUNDING = 1e-9


@st.composite
def beds(draw):
    """A layout of 2 x 2 to 60 x 40 pins with rough, flat or stepped heights: ties of every kind."""
    layout = Layout(
        rows=draw(st.integers(2, 60)),
        columns=draw(st.integers(2, 40)),
        arrangement=draw(st.sampled_from(["aligned", "staggered", "hexagonal"])),
    )
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    steps = draw(st.sampled_from([1, 2, 3, 1000]))
    height = random.integers(0, steps, layout.rows * layout.columns) * (0.1 / steps)
    return layout, height


def bed(rows: int, columns: int, arrangement: str):
    """The smallest and the largest bed, rough."""
    height = np.random.default_rng(rows).uniform(0.0, 0.1, rows * columns)
    return Layout(rows=rows, columns=columns, arrangement=arrangement), height


def made(layout: Layout, height: np.ndarray) -> trimesh.Trimesh:
    """The solid as trimesh sees it, vertices and faces untouched."""
    vertices, faces = make_solid(make_grid(layout).positions, height, layout.rows, layout.columns)
    return trimesh.Trimesh(vertices, faces, process=False)


def volume(layout: Layout, height: np.ndarray) -> float:
    """The sum of the prisms."""
    return prism_volume(make_grid(layout).positions, height, layout.rows, layout.columns)


@given(beds())
@example(bed(2, 2, "aligned"))
@example(bed(2, 2, "staggered"))
@example(bed(60, 40, "aligned"))
@example(bed(60, 40, "staggered"))
@example(bed(60, 40, "hexagonal"))
def test_the_solid_is_closed_in_one_piece_without_handles_and_of_the_volume_of_its_prisms(case):
    mesh = made(*case)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.area_faces.min() > 0.0
    # Euler: vertices - edges + faces = 2; the edges of a closed mesh are three halves of its faces.
    assert len(mesh.vertices) - len(mesh.faces) * 3 // 2 + len(mesh.faces) == 2
    # Positive also says that the normals point outward.
    assert mesh.volume == pytest.approx(volume(*case), rel=ROUNDING)
    assert volume(*case) > 0.0


@given(beds())
def test_a_bed_mirrored_in_x_has_the_same_volume(case):
    # The mirror image of a shifted layout is no layout, so the positions are mirrored with the heights.
    layout, height = case
    place = make_grid(layout).positions
    vertices, faces = make_solid(place * (-1.0, 1.0), height, layout.rows, layout.columns)
    mirrored = trimesh.Trimesh(vertices, faces, process=False)
    assert mirrored.volume == pytest.approx(volume(layout, height), rel=ROUNDING)
    assert mirrored.is_winding_consistent


@given(beds())
def test_mirrored_heights_give_the_volume_of_the_mirrored_solid(case):
    # Which mirror maps the layout on itself depends on the shift of its rows.
    layout, height = case
    field = height.reshape(layout.rows, layout.columns)
    images = (
        [field[::-1, ::-1]] if layout.arrangement != "aligned" and layout.rows % 2 == 0 else [field[::-1]]
    )
    if layout.arrangement == "aligned":
        images += [field[:, ::-1], field[::-1, ::-1]]
    for image in images:
        assert volume(layout, image.ravel()) == pytest.approx(volume(layout, height), rel=ROUNDING)


@given(beds())
def test_a_quarter_turn_of_an_aligned_bed_has_the_same_volume(case):
    layout, height = Layout(rows=case[0].rows, columns=case[0].columns), case[1]
    turned = np.rot90(height.reshape(layout.rows, layout.columns))
    other = Layout(rows=layout.columns, columns=layout.rows)
    assert volume(other, turned.ravel()) == pytest.approx(volume(layout, height), rel=ROUNDING)
