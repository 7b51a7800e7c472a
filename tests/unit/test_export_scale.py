"""Large beds: how much memory an export takes is a count of bytes a pin, the same on any machine."""

from __future__ import annotations

import pytest
from digiclay.core.surface.formed import PIECE

from benchmarks.__main__ import main
from benchmarks.bed_size import export


@pytest.mark.parametrize("file", ["stl", "ply"])
def test_a_solid_takes_no_more_memory_than_its_own_arrays_and_a_few_megabytes(file):
    # Measured: 180 bytes a pin on a million pins, of which vertices, faces and values are 168; the file's
    # 200 are never kept as a whole. On 160 000 pins the pieces that are written at once still count: 10 MB.
    side = 400
    exported = export(side, "solid", file)
    assert PIECE <= 65536
    assert exported["triangles"] == 4 * (side - 1) ** 2 + 8 * (side - 1)
    assert exported["peak"] <= 250 * side * side / 1e6 + 10.0


def test_the_benchmark_prints_a_line_a_case_and_keeps_its_figures(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.bed_size.EXPORTED", (5, 9))
    assert main(["export", "--quick", "--quiet", "--out", str(tmp_path)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert sum(line[:1] in (["solid"], ["surface"], ["pins"], ["features"]) for line in lines) >= 10
    head = (tmp_path / "export.csv").read_text().splitlines()[0]
    assert head == "pins,kind,file,triangles,made,written,size,peak"
