"""assimp, the importer of many programs, reads every format, with the size and the triangles we know of."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import trimesh

from .conftest import told

FORMATS = ("stl", "ascii.stl", "obj", "ply", "glb", "3mf")


def read(path: Path) -> dict[str, str]:
    """Return what assimp says of a file, as it stands in it."""
    said = told("assimp", "info", path, "--raw")
    lines = re.findall(r"^(\w[\w ]*?):?\s{2,}(\S.*)$", said, re.MULTILINE)
    return dict(reversed(lines))  # a word that comes again further down heads a list there


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("stem", ["surface", "skin", "pins", "features"])
def test_every_triangle_is_read(meshes: Path, stem: str, ending: str) -> None:
    known = trimesh.load_mesh(meshes / "bilinear" / f"{stem}.stl")
    assert int(read(meshes / "bilinear" / f"{stem}.{ending}")["Faces"]) == len(known.faces)


@pytest.mark.parametrize("ending", FORMATS)
def test_the_size_is_the_beds(meshes: Path, ending: str) -> None:
    found = read(meshes / "bilinear" / f"surface.{ending}")
    low, high = (
        [float(number) for number in found[name].strip("()").split()]
        for name in ("Minimum point", "Maximum point")
    )
    size = sorted(b - a for a, b in zip(low, high, strict=True))
    # 25 pins 3 mm apart; from 3 mm under the valley to the mound's top. GLB is in meters.
    factor = 1e3 if ending == "glb" else 1.0
    assert [one * factor for one in size] == pytest.approx([37.66, 72.0, 72.0], abs=0.01)


@pytest.mark.parametrize("ending", ["ascii.stl", "obj", "glb", "3mf"])
def test_each_feature_is_a_mesh_of_its_own_where_the_format_has_such(meshes: Path, ending: str) -> None:
    assert int(read(meshes / "bilinear" / f"features.{ending}")["Meshes"]) == 3


def test_the_groups_of_an_obj_are_meshes(meshes: Path) -> None:
    said = told("assimp", "info", meshes / "bilinear" / "surface.obj", "--raw")
    assert {"rest", "boss_1", "boss_2", "crease_1"} <= set(re.findall(r"\w+", said))
