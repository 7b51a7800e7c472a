"""Concave faces of meshes, as modelers and CAD programs write them, are covered once."""

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io import polygons
from digiclay.core.mesh_io.mesh_reader import read
from digiclay.core.mesh_io.polygons import cut

from tests.assemble import assert_near
from tests.mesh_files import put

L = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)]
DART = [(0, 0), (2, -1), (1, 0), (2, 1)]
#: Teeth of 1 x 2, on a bar 1 thick.
COMB = [(0, -1), (40, -1)] + [
    (x, y)
    for i in range(20, 0, -1)
    for x, y in ((2 * i, 2), (2 * i - 1, 2), (2 * i - 1, 0), (2 * i - 2, 0))
]
#: A square with a square hole, to which a seam leads, as Blender has it.
HOLE = [(0, 0), (6, 0), (6, 6), (0, 6), (0, 0), (2, 2), (2, 4), (4, 4), (4, 2), (2, 2)]
ANGLES = np.linspace(0.0, 6.0 * np.pi, 100)
INNER = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1) * (1.0 + ANGLES)[:, None]
SPIRAL = [*INNER * 1.2, *INNER[::-1]]
STRAIGHT = [(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (1, 1), (1, 0.5), (0, 0.5), (0, 0.25)]


def find_area(places):
    x, y = np.transpose(places)
    return np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2.0


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("axes", [(0, 1), (1, 2), (2, 0), (1, 0)])
@pytest.mark.parametrize("plan", [L, DART, COMB, HOLE, SPIRAL, STRAIGHT])
def test_a_face_is_covered_once_wherever_it_begins_and_looks(plan, axes, first):
    places = np.zeros((len(plan), 3))
    places[:, axes] = np.roll(plan, first, axis=0)
    corners = np.arange(len(plan))
    found = cut(places, corners, np.array([len(plan)]), "a.obj")
    assert len(found) == len(plan) - 2
    edges = found[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()
    outline = np.stack([corners, np.roll(corners, -1)], axis=1).tolist()
    # Each edge within has two triangles, in turn.
    assert sorted(edge for edge in edges if edge[::-1] not in edges) == sorted(outline)
    areas = [find_area(triangle) for triangle in places[:, axes][found]]
    assert min(areas) >= 0.0
    assert sum(areas) == pytest.approx(find_area(plan), rel=1e-12)


FACES = [(0, 1, 2, 3, 4, 5), (5, 4, 3, 2, 1, 0), (0, 1, 2), (0, 2, 3, 4)]
OFF = "".join(f"{x} {y} 0\n" for x, y in L)
OBJ = "".join(f"v {x} {y} 0\n" for x, y in L) + "".join(
    f"f {' '.join(str(corner + 1) for corner in face)}\n" for face in FACES
)
LISTS = "".join(f"{len(face)} {' '.join(map(str, face))}\n" for face in FACES)
PLY = "ply\nformat ascii 1.0\nelement vertex 6\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)
PLY += "element face 4\nproperty list uchar int vertex_indices\nend_header\n"


@pytest.mark.parametrize(
    "name, text",
    [("a.obj", OBJ), ("a.ply", PLY + OFF + LISTS), ("a.off", f"OFF 6 4 0\n{OFF}{LISTS}")],
)
def test_faces_of_all_sizes_are_cut_in_every_format(tmp_path, name, text, monkeypatch):
    monkeypatch.setattr(polygons, "CHUNK", 1)
    vertices, faces, *_ = read(put(tmp_path, name, text))
    areas = np.linalg.norm(
        np.cross(*(vertices[faces[:, i]] - vertices[faces[:, 0]] for i in (1, 2))), axis=1
    )
    assert len(faces) == 4 + 4 + 1 + 2
    assert_near(areas.sum() / 2.0, 6.0 + 6.0 + 2.0 + find_area([L[i] for i in FACES[3]]), 1e-12)


def test_a_face_that_crosses_itself_is_cut_and_one_of_too_many_dents_refused(monkeypatch):
    crossed = np.array([(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 2, 0), (1, 5, 0), (1, -5, 0)], float)
    assert len(cut(crossed, np.arange(6), np.array([6]), "a.obj")) == 4
    monkeypatch.setattr(polygons, "MOST_CORNERS", 79)
    places = np.column_stack([COMB, np.zeros(len(COMB))])
    with pytest.raises(ParameterError, match=r"more than 79 corners \(got a.obj: 82 corners\)"):
        cut(places, np.arange(len(COMB)), np.array([len(COMB)]), "a.obj")
