"""Benchmarks ``scale`` and ``export``: a control period and mesh files, from 625 pins to a million."""

import statistics
import tempfile
import time
import tracemalloc
from argparse import Namespace
from itertools import pairwise
from pathlib import Path

import numpy as np
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.files.tables import Record
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix, write
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.surface.features import Finding
from digiclay.core.surface.formed import Formed

from .report import Curves, Report, Steps, tabulate

#: Pins along a side of the beds.
SIDES, EXPORTED = (25, 101, 317, 1001), (25, 100, 316, 1000)
#: The fingertip presses in the middle, rises and is dragged, over the same pins of every bed: s; x,
#: z in mm.
PATH = ((0.0, 0.0, 42.0), (0.3, 0.0, 36.5), (0.8, 6.0, 40.0), (1.3, 12.0, 44.0), (1.6, 12.0, 60.0))
#: Kind and format of exports: every format of the solid, and the other kinds in one.
EXPORTS = (
    *(("solid", name) for name in FORMATS),
    ("surface", "stl"),
    ("pins", "stl"),
    ("features", "stl"),
)
SCALE = {
    "pins": "pins d",
    "taking part": "gathered .1f",
    "period, µs": "period .0f 1e6",
    "to smallest": "ratio .2f",
    "CPU mean, µs": "mean .0f 1e6",
    "built in, ms": "built .3g 1e3",
    "bytes a pin": "bytes_a_pin .1f",
}
EXPORT = {
    "mesh": "kind",
    "format": "file",
    "pins": "pins d",
    "triangles": "triangles d",
    "made in, s": "made .3g",
    "written in, s": "written .3g",
    "file, MB": "size .3g",
    "memory, MB": "peak .3g",
    "bytes a pin": "bytes_a_pin .0f",
}


def scene(side: int) -> Scene:
    """Return a bed of side x side pins; an odd side has a pin in the middle."""
    waypoints = [{"time": t, "position": [x * 1e-3, 0.0, z * 1e-3]} for t, x, z in PATH]
    parts = {"simulation": {"duration": PATH[-1][0]}, "trajectory": {"waypoints": waypoints}}
    layout = {"rows": side, "columns": side}
    return resolve({"layout": layout, "recorder": "absent", **parts}, f"{side * side} pins")


def measure_bytes(side: int) -> int:
    """Return the memory of the arrays of a bed's system and state, bytes."""
    bed = scene(side)
    tracemalloc.start()
    try:
        system = assemble(bed)
        state = begin(system)
        arrays = tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)
        traces = tracemalloc.take_snapshot().filter_traces([arrays]).traces
        return sum(trace.size for trace in traces) if state else 0
    finally:
        tracemalloc.stop()


def _time_bed(side: int, repeats: int) -> dict[str, float]:
    """Run the session on a bed; medians of the repeats, s; the mean is processor time."""
    built, spent, gathered, means = [], [], [], []
    bed = scene(side)
    for _ in range(repeats):
        started = time.perf_counter()
        system = assemble(bed)
        start = begin(system)
        built.append(time.perf_counter() - started)
        used, moments = time.process_time(), [time.perf_counter()]
        for state in periods(system, bed.trajectories(), start, bed.periods):
            moments.append(time.perf_counter())
            gathered.append(state.active.cells.size)
        means.append((time.process_time() - used) / bed.periods)
        spent += [b - a for a, b in pairwise(moments)]
    build, period, mean = (statistics.median(times) for times in (built, spent, means))
    return {
        "pins": side * side,
        "built": build,
        "period": period,
        "mean": mean,
        "gathered": statistics.fmean(gathered),
        "bytes_a_pin": measure_bytes(side) / side**2,
    }


def measure(arguments: Namespace, steps: Steps) -> Report:
    """Measure a control period on every size of bed."""
    sides, repeats = (SIDES[:3], 1) if arguments.quick else (SIDES, 5)
    sizes = [
        _time_bed(side, repeats)
        for side in steps.through(sides, lambda side: f"{side * side} pins")
    ]

    lines = {
        label: [(size["pins"], size[key] * 1e6) for size in sizes]
        for key, label in (("period", "median"), ("mean", "mean, with the fingertip's poses"))
    }
    title = "The same fingertip, larger beds"
    curves = Curves({title: lines}, "pins of the bed", "a control period, µs", "linear")
    text = "\nThe same fingertip, pressing and dragging, 1.6 s; default parts; control period and step 5 ms\n"
    rows = [{**size, "ratio": size["period"] / sizes[0]["period"]} for size in sizes]
    return Report([text, *tabulate(rows, SCALE, left=0)], sizes, curves)


def formed(side: int) -> Formed:
    """Return a bed of side x side pins with bosses and creases everywhere: waves 100 mm long, 10 mm high."""
    positions = make_grid(Layout(rows=side, columns=side)).positions
    wave = np.sin(positions[:, 0] * 63.0) * np.cos(positions[:, 1] * 63.0)
    return Formed.of(positions, 0.04 + 0.01 * wave, 0.04, 0.0, 0)


def export(side: int, kind: str, file: str) -> Record:
    """Export a bed once for the times, s, and once for the memory, MB; `file`: one of `FORMATS`."""
    bed = formed(side)
    finding = Finding() if kind == "features" else None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"bed{find_suffix(file)}"
        started = time.perf_counter()
        bodies = make_bodies(bed, Model(kind=kind), finding)
        bodies_at = time.perf_counter()
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
        return {
            "pins": side * side,
            "kind": kind,
            "file": file,
            "triangles": triangles,
            "made": bodies_at - started,
            "written": done - bodies_at,
            "size": path.stat().st_size / 1e6,
            "peak": peak / 1e6,
        }


def measure_export(arguments: Namespace, steps: Steps) -> Report:
    """Export every size: the smallest and the largest bed in all kinds and formats."""
    sides = EXPORTED[:2] if arguments.quick else EXPORTED
    jobs = [
        (side, *what)
        for side in sides
        for what in EXPORTS[: None if side in (sides[0], sides[-1]) else 1]
    ]
    exports = [export(*job) for job in steps.through(jobs)]
    title = "\nA bed of waves, written to a temporary folder; memory besides the bed itself\n"
    rows = [{**row, "bytes_a_pin": row["peak"] * 1e6 / row["pins"]} for row in exports]
    return Report([title, *tabulate(rows, EXPORT, left=2)], exports)
