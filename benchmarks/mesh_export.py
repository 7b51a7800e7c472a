"""``python -m benchmarks export``: time and memory of mesh files of up to a million pins."""

from __future__ import annotations

import argparse
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix, write
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.features import Finding
from digiclay.core.surface.formed import Formed

from .report import add_kind, kept, made_with, progress

#: Pins along a side of the beds.
SIDES = (25, 100, 316, 1000)
#: Every format of the solid, and the other kinds in one.
WHAT = (*(("solid", name) for name in FORMATS), ("surface", "stl"), ("pins", "stl"), ("features", "stl"))


@dataclass(frozen=True)
class Export:
    """Cost of an export.

    Attributes
    ----------
    made : float
        Time to make the mesh, s.
    written : float
        Time to write the file, s.
    size : float
        Of the file, MB.
    peak : float
        Memory numpy and Python held at most besides the bed itself, MB, in a run of its own.
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
    """Export a bed once for the time, and once more for the memory.

    `side`: pins along each side; `kind`: of the mesh: solid, surface, pins or features; `file`: format, one
    of `FORMATS`.
    """
    bed = formed(side)
    finding = Finding() if kind == "features" else None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"bed{find_suffix(file)}"
        started = time.perf_counter()
        made = make_bodies(bed, Model(kind=kind), finding)
        moment = time.perf_counter()
        write(made, path, kind=file)
        done = time.perf_counter()
        triangles = sum(len(body.faces) for body in made)
        del made
        tracemalloc.start()
        try:
            write(make_bodies(bed, Model(kind=kind), finding), path, kind=file)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        size = path.stat().st_size
    return Export(side * side, kind, file, triangles, moment - started, done - moment, size / 1e6, peak / 1e6)


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks export\n  python -m benchmarks export --quick --out results\n"
    parser = add_kind(kinds, "export", "writing a bed as a mesh, from 625 pins to a million", examples)
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Measure every size, and print the table."""
    sides = SIDES[:2] if arguments.quick else SIDES
    # Beds in between show how it grows; all formats are measured at the ends.
    jobs = [(side, *what) for side in sides for what in (WHAT if side in (sides[0], sides[-1]) else WHAT[:1])]
    with progress(arguments, "export", len(jobs)) as bar:
        found = []
        for job in jobs:
            found.append(measured(*job))
            bar(f"{job[0]} x {job[0]} pins, {job[1]}, {job[2]}")
    text = "\n".join(_text(found))
    print(text)
    head = [field.name for field in fields(Export)]
    kept(arguments.out, "export", text, head, [[getattr(one, name) for name in head] for one in found])
    return 0


def _text(found: list[Export]) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with()
    yield "\nA bed of waves, written to a temporary folder; memory besides the bed itself\n"
    head = (
        "mesh",
        "format",
        "pins",
        "triangles",
        "made in, s",
        "written in, s",
        "file, MB",
        "memory, MB",
        "bytes a pin",
    )
    rows = [
        [
            one.kind, one.file, str(one.pins), str(one.triangles), f"{one.made:.3g}", f"{one.written:.3g}",
            f"{one.size:.3g}", f"{one.peak:.3g}", f"{one.peak * 1e6 / one.pins:.0f}",
        ]
        for one in found
    ]  # fmt: skip
    yield from table(head, rows, left=2)
