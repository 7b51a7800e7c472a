"""admesh, which repairs what printers cannot make, finds nothing to repair."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest

from .conftest import told

SOLIDS = [
    "bilinear/surface.stl", "bilinear/surface.ascii.stl", "bilinear/pins.stl", "bilinear/pins.ascii.stl",
    "bilinear/features.stl", "smooth/surface.stl", "smooth/boss_1.stl", "smooth/boss_2.stl",
    "smooth/crease_1.stl", "membrane/surface.stl", "membrane/boss_1.stl", "membrane/crease_1.stl",
]  # fmt: skip
#: What admesh counts that a good file has none of.
FAULTS = (
    "Facets with 1 disconnected edge", "Facets with 2 disconnected edges", "Facets with 3 disconnected edges",
    "Total disconnected facets", "Degenerate facets", "Edges fixed", "Facets removed", "Facets added",
    "Facets reversed", "Backwards edges", "Normals fixed",
)  # fmt: skip


def faults(path: Path) -> dict[str, int]:
    """Return what admesh found wrong in a file."""
    said = told("admesh", path)
    found = {name: int(re.search(rf"{name}\s*:\s*(\d+)", said)[1]) for name in FAULTS}
    return {name: count for name, count in found.items() if count}


@pytest.mark.parametrize("name", SOLIDS)
def test_nothing_is_to_be_repaired(meshes: Path, name: str) -> None:
    assert faults(meshes / name) == {}


@pytest.mark.parametrize(
    ("name", "parts"), [("bilinear/surface.stl", 1), ("bilinear/pins.stl", 1), ("bilinear/features.stl", 3)]
)
def test_a_file_has_as_many_parts_as_bodies(meshes: Path, name: str, parts: int) -> None:
    assert int(re.search(r"Number of parts\s*:\s*(\d+)", told("admesh", meshes / name))[1]) == parts


@pytest.mark.parametrize("harm", ["hole", "flip"])
def test_admesh_does_find_a_fault(meshes: Path, tmp_path: Path, harm: str) -> None:
    whole = bytearray((meshes / "bilinear/surface.stl").read_bytes())
    (count,) = struct.unpack_from("<I", whole, 80)
    if harm == "hole":
        struct.pack_into("<I", whole, 80, count - 1)
        del whole[-50:]
    else:  # two corners of a triangle change places
        whole[96 + 50 * 9 : 108 + 50 * 9], whole[108 + 50 * 9 : 120 + 50 * 9] = (
            whole[108 + 50 * 9 : 120 + 50 * 9], whole[96 + 50 * 9 : 108 + 50 * 9],
        )  # fmt: skip
    (tmp_path / "bad.stl").write_bytes(whole)
    assert faults(tmp_path / "bad.stl") != {}
