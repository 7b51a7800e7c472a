"""Benchmark ``export``: time and memory of mesh files of up to a million pins."""

from __future__ import annotations

import argparse
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix, write
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.features import Finding
from digiclay.core.surface.formed import Formed

from .report import Report, Steps, cells, list_records

#: Pins along a side of the beds.
SIDES = (25, 100, 316, 1000)
#: Kind and format: every format of the solid, and the other kinds in one.
WHAT = (*(("solid", name) for name in FORMATS), ("surface", "stl"), ("pins", "stl"), ("features", "stl"))
HEAD = (
    "mesh", "format", "pins", "triangles", "made in, s", "written in, s", "file, MB", "memory, MB",
    "bytes a pin",
)  # fmt: skip


@dataclass(frozen=True)
class Export:
    """Cost of an export.

    Attributes
    ----------
    made, written : float
        Time to make the mesh and to write the file, s.
    size : float
        Of the file, MB.
    peak : float
        Largest memory of numpy and Python besides the bed itself, MB, in a run of its own.
    """

    pins: int
    kind: str
    file: str
    triangles: int
    made: float
    written: float
    size: float
    peak: float


def formed(side: int) -> Formed:
    """Return a bed of side x side pins with bosses and creases everywhere: waves 100 mm long, 10 mm high."""
    place = make_grid(Layout(rows=side, columns=side)).positions
    wave = np.sin(place[:, 0] * 63.0) * np.cos(place[:, 1] * 63.0)
    return Formed.of(place, 0.04 + 0.01 * wave, 0.04, 0.0, 0)


def measured(side: int, kind: str, file: str) -> Export:
    """Export a bed once for the time, and once more for the memory; `file`: format, one of `FORMATS`."""
    bed = formed(side)
    finding = Finding() if kind == "features" else None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"bed{find_suffix(file)}"
        started = time.perf_counter()
        bodies = make_bodies(bed, Model(kind=kind), finding)
        made = time.perf_counter()
        write(bodies, path, kind=file)
        done = time.perf_counter()
        triangles = sum(len(body.faces) for body in bodies)
        del bodies
        tracemalloc.start()
        try:
            write(make_bodies(bed, Model(kind=kind), finding), path, kind=file)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        size = path.stat().st_size
    return Export(side * side, kind, file, triangles, made - started, done - made, size / 1e6, peak / 1e6)


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every size: all kinds and formats of the smallest and the largest bed."""
    sides = SIDES[:2] if arguments.quick else SIDES
    jobs = [(side, *what) for side in sides for what in (WHAT if side in (sides[0], sides[-1]) else WHAT[:1])]
    exports = [measured(*job) for job in steps.through(jobs)]
    return Report(_list_lines(exports), *list_records(exports))


def _list_lines(exports: list[Export]) -> Iterator[str]:
    """Give the lines of the report."""
    yield "\nA bed of waves, written to a temporary folder; memory besides the bed itself\n"
    rows = [
        cells(
            "s s d d .3g .3g .3g .3g .0f", one.kind, one.file, one.pins, one.triangles, one.made, one.written,
            one.size, one.peak, one.peak * 1e6 / one.pins,
        )
        for one in exports
    ]  # fmt: skip
    yield from table(HEAD, rows, left=2)
