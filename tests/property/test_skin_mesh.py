"""The solid under any heights, on any bed: closed, turned outward, and of the volume of its prisms."""

import numpy as np
import pytest
import trimesh
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.formed import make_solid
from hypothesis import example, given
from hypothesis import strategies as st

from tests.prisms import prism_volume

#: Volumes are sums of up to 1e4 terms, the largest about 100 times the result: rounding stays below
#: this.
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


def bed(rows, columns, arrangement):
    height = np.random.default_rng(rows).uniform(0.0, 0.1, rows * columns)
    return Layout(rows=rows, columns=columns, arrangement=arrangement), height


def made(layout, height, mirror=1.0):
    place = make_grid(layout).positions * (mirror, 1.0)
    return trimesh.Trimesh(*make_solid(place, height, layout.rows, layout.columns), process=False)


def volume(layout, height):
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
    # The mirror image of a shifted layout is no layout, so the positions are mirrored with the
    # heights.
    mirrored = made(*case, mirror=-1.0)
    assert mirrored.is_winding_consistent
    assert mirrored.volume == pytest.approx(mesh.volume, rel=ROUNDING)
