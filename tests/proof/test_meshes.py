"""The paper's final surface in other programs: admesh and PrusaSlicer repair nothing, assimp reads all."""

import re

import pytest
import trimesh
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix

from .conftest import told

SOLIDS = [
    "bilinear/surface.stl",
    "bilinear/surface.ascii.stl",
    "bilinear/pins.stl",
    "bilinear/pins.ascii.stl",
    "bilinear/features.stl",
    "smooth/surface.stl",
    "smooth/boss_1.stl",
    "smooth/boss_2.stl",
    "smooth/crease_1.stl",
    "membrane/surface.stl",
    "membrane/boss_1.stl",
    "membrane/crease_1.stl",
]
SLICED = [
    "bilinear/surface.stl",
    "bilinear/surface.3mf",
    "bilinear/surface.obj",
    "bilinear/pins.3mf",
    "smooth/surface.stl",
    "membrane/surface.3mf",
    "smooth/boss_1.stl",
    "smooth/boss_2.stl",
    "smooth/crease_1.3mf",
]
ENDINGS = [find_suffix(kind)[1:] for kind in FORMATS]
FAULTS = (
    "Facets with 1 disconnected edge",
    "Facets with 2 disconnected edges",
    "Facets with 3 disconnected edges",
    "Total disconnected facets",
    "Degenerate facets",
    "Edges fixed",
    "Facets removed",
    "Facets added",
    "Facets reversed",
    "Backwards edges",
    "Normals fixed",
)
#: How the slicer tells of repairs, of what it left out, and of what cannot be printed.
COMPLAINTS = re.compile(
    r"warning|error|repair|edges_fixed|degenerate|facets_(removed|added|reversed)|backwards|manifold = no",
    re.IGNORECASE,
)


def faults(path):
    said = told("admesh", path)
    found = {name: int(re.search(rf"{name}\s*:\s*(\d+)", said)[1]) for name in FAULTS}
    return {name: count for name, count in found.items() if count}


def read(path):
    said = told("assimp", "info", path, "--raw")
    lines = re.findall(r"^(\w[\w ]*?):?\s{2,}(\S.*)$", said, re.MULTILINE)
    return dict(reversed(lines))  # a word that comes again further down heads a list there


@pytest.mark.parametrize("name", SOLIDS)
def test_admesh_has_nothing_to_repair(meshes, name):
    assert faults(meshes / name) == {}


@pytest.mark.parametrize("stem, parts", [("surface", 1), ("pins", 1), ("features", 3)])
def test_a_file_has_as_many_parts_as_bodies(meshes, stem, parts):
    said = told("admesh", meshes / "bilinear" / f"{stem}.stl")
    assert int(re.search(r"Number of parts\s*:\s*(\d+)", said)[1]) == parts


def test_admesh_and_the_slicer_do_find_faults(meshes, tmp_path):
    whole, first = bytearray((meshes / "bilinear/surface.stl").read_bytes()), 96 + 50 * 9
    # Two corners of a triangle change places.
    whole[first : first + 24] = whole[first + 12 : first + 24] + whole[first : first + 12]
    (tmp_path / "bad.stl").write_bytes(whole)
    assert faults(tmp_path / "bad.stl") != {}
    skin = meshes / "bilinear" / "skin.stl"
    said = told("prusa-slicer", "--export-gcode", "--output", tmp_path / "skin.gcode", skin)
    assert COMPLAINTS.findall(said) != []


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("stem", ["surface", "skin", "pins", "features"])
def test_assimp_reads_every_triangle_and_each_feature_as_a_mesh_of_its_own(meshes, stem, ending):
    found = read(meshes / "bilinear" / f"{stem}.{ending}")
    assert int(found["Faces"]) == len(trimesh.load_mesh(meshes / "bilinear" / f"{stem}.stl").faces)
    if stem == "features" and ending not in ("stl", "ply"):  # formats of one mesh
        assert int(found["Meshes"]) == 3
    if stem == "surface":
        points = (found[name].strip("()").split() for name in ("Minimum point", "Maximum point"))
        size = sorted(float(b) - float(a) for a, b in zip(*points, strict=True))
        # 25 pins 3 mm apart; from 3 mm under the valley to the mound's top. GLB is in meters.
        factor = 1e3 if ending == "glb" else 1.0
        assert [one * factor for one in size] == pytest.approx([37.66, 72.0, 72.0], abs=0.01)


@pytest.mark.parametrize("name", SLICED)
def test_the_slicer_repairs_nothing(meshes, name):
    said = told("prusa-slicer", "--info", meshes / name)
    assert "manifold = yes" in said
    assert COMPLAINTS.findall(said) == []


@pytest.mark.parametrize(
    "name", ["bilinear/surface.stl", "smooth/surface.3mf", "bilinear/pins.stl"]
)
def test_the_slicer_makes_g_code_without_a_warning(meshes, tmp_path, name):
    code = tmp_path / "surface.gcode"
    said = told("prusa-slicer", "--export-gcode", "--output", code, meshes / name)
    assert COMPLAINTS.findall(said) == []
    layers = [float(z) for z in re.findall(r"^;Z:([\d.]+)$", code.read_text(), re.MULTILINE)]
    # 37.7 mm high, the spline a little more, in layers of 0.3 mm: the highest is within one of the
    # top.
    assert layers == sorted(layers)
    assert max(layers) == pytest.approx(37.7, abs=1.0)
    assert len(layers) == pytest.approx(37.7 / 0.3, abs=4)
