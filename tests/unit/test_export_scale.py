"""Large beds: how much memory an export takes is a count of bytes a pin, the same on any machine."""

from __future__ import annotations

import pytest
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.surface.formed import PIECE

from benchmarks.__main__ import main
from benchmarks.mesh_export import Export, formed, measured


@pytest.mark.parametrize(("file", "bytes_a_pin"), [("stl", 250), ("ply", 250)])
def test_a_solid_takes_no_more_memory_than_its_own_arrays_and_a_few_megabytes(file, bytes_a_pin):
    # Measured: 180 bytes a pin on a million pins, of which vertices, faces and values are 168; the file's
    # 200 are never held as a whole. On 160 000 pins the pieces that are written at once still count.
    side = 400
    pieces = 10.0  # MB: what a piece of triangles takes while it is written
    assert PIECE <= 65536
    found = measured(side, "solid", file)
    assert found.triangles == 4 * (side - 1) ** 2 + 8 * (side - 1)
    assert found.peak <= bytes_a_pin * side * side / 1e6 + pieces


def test_the_benchmarks_bed_has_bosses_and_creases_to_be_found():
    from digiclay.core.surface.features import Finding

    names = {body.name.split("_")[0] for body in make_bodies(formed(60), Model(kind="features"), Finding())}
    assert names == {"boss", "crease"}


def test_the_benchmark_prints_a_line_a_case_and_keeps_its_figures(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.mesh_export.SIDES", (5, 9))
    assert main(["export", "--quick", "--quiet", "--out", str(tmp_path)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert sum(line[:1] in (["solid"], ["surface"], ["pins"], ["features"]) for line in lines) >= 10
    assert (tmp_path / "export.csv").read_text().splitlines()[0].split(",") == list(
        Export.__dataclass_fields__
    )
