"""PrusaSlicer makes G-code of the paper's final surface, and has nothing to repair or to warn of."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from .conftest import told

#: How the slicer tells of repairs, of what it left out, and of what cannot be printed.
COMPLAINTS = re.compile(
    r"warning|error|repair|edges_fixed|degenerate|facets_(removed|added|reversed)|backwards|manifold = no",
    re.IGNORECASE,
)
SOLIDS = [
    "bilinear/surface.stl", "bilinear/surface.3mf", "bilinear/surface.obj", "bilinear/pins.3mf",
    "smooth/surface.stl", "membrane/surface.3mf", "smooth/boss_1.stl", "smooth/boss_2.stl",
    "smooth/crease_1.3mf",
]  # fmt: skip


@pytest.mark.parametrize("name", SOLIDS)
def test_the_slicer_repairs_nothing(meshes: Path, name: str) -> None:
    said = told("prusa-slicer", "--info", meshes / name)
    assert "manifold = yes" in said
    assert COMPLAINTS.findall(said) == []


@pytest.mark.parametrize("name", ["bilinear/surface.stl", "smooth/surface.3mf", "bilinear/pins.stl"])
def test_it_makes_g_code_without_a_warning(meshes: Path, tmp_path: Path, name: str) -> None:
    code = tmp_path / "surface.gcode"
    said = told("prusa-slicer", "--export-gcode", "--output", code, meshes / name)
    assert COMPLAINTS.findall(said) == []
    layers = [float(z) for z in re.findall(r"^;Z:([\d.]+)$", code.read_text(), re.MULTILINE)]
    # 37.7 mm high, the spline a little more, in layers of 0.3 mm: the highest is within one of the top.
    assert layers == sorted(layers)
    assert max(layers) == pytest.approx(37.7, abs=1.0)
    assert len(layers) == pytest.approx(37.7 / 0.3, abs=4)


def test_the_slicer_does_complain_of_an_open_skin(meshes: Path, tmp_path: Path) -> None:
    skin = meshes / "bilinear" / "skin.stl"
    said = told("prusa-slicer", "--export-gcode", "--output", tmp_path / "skin.gcode", skin)
    assert COMPLAINTS.findall(said) != []
