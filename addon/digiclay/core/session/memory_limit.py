"""Memory that a session takes, and refusal of one that this machine cannot hold."""

import os
import re
from pathlib import Path

from ..base.errors import ParameterError
from ..engine.state import Rows
from ..scene.recorder import CHUNK, Recorder
from ..scene.schema import Scene

#: Bytes per row and cell: height, force and command as float64, mode as int8, and one while the
#: metrics are computed, for the rows in which a cell follows the force.
BYTES_A_CELL = 3 * 8 + 1 + 1
#: Bytes per cell besides its state's rows: position (2 float64), age (float64), mode (int8).
BYTES_BESIDE = 2 * 8 + 8 + 1
#: Bytes per cell of a recorded session while the metrics are computed, for any number of rows; per
#: active cell in a control period; and for its rows that wait to be written (measured: about three
#: times their size, `CHUNK` rows of 25 bytes).
BYTES_JUDGED, BYTES_BUSY, BYTES_WAITING = 100, 850, 3 * 25 * CHUNK
#: Bytes of memory that are assumed if the system does not tell.
ASSUMED_MEMORY = 8 * 2**30


def count_busy_cells(scene: Scene) -> int:
    """Return the largest number of active cells: all during the display of a shape; else few."""
    return scene.cells if scene.shape is not None else 0


def check_memory(scene: Scene, rows: Rows) -> None:
    """Refuse a session that memory cannot hold, before it starts; ParameterError names the remedy."""
    busy, free = count_busy_cells(scene), measure_available_memory()
    if scene.recorder:  # the force of each body on each pin, and its copy in the history
        free -= 2 * 8 * len(scene.bodies) * scene.cells * scene.recorder.rows(scene.periods)
    refuse_what_cannot_fit(scene.recorder, rows, scene.cells, scene.periods, max(free, 0), busy)


def count_bytes_needed(
    recorder: Recorder | None, rows: Rows, cells: int, periods: int, busy: int = 0
) -> int:
    """Return the approximate memory of a session, bytes, with at most `busy` active cells."""
    each_cell = 8 * rows.count + BYTES_BESIDE
    at_work = BYTES_BUSY
    if recorder is not None:
        each_cell += recorder.rows(periods) * BYTES_A_CELL + BYTES_JUDGED
        at_work += BYTES_WAITING
    return cells * each_cell + busy * at_work


def measure_available_memory() -> int:
    """Return the bytes of memory that are available on this machine."""
    linux = Path("/proc/meminfo")
    text = linux.read_text(encoding="ascii") if linux.exists() else ""
    if answer := re.search(r"MemAvailable:\s+(\d+) kB", text):
        return int(answer[1]) * 1024
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return ASSUMED_MEMORY


def refuse_what_cannot_fit(
    recorder: Recorder | None, rows: Rows, cells: int, periods: int, available: int, busy: int = 0
) -> None:
    """Refuse a session that the available bytes cannot hold; ParameterError names the remedy."""
    needed = count_bytes_needed(recorder, rows, cells, periods, busy)
    if needed <= available:
        return
    memory = f"{available / 1e9:.3g} GB of free memory"
    alone = count_bytes_needed(None, rows, cells, periods, busy)
    begun = needed - (recorder.rows(periods) * BYTES_A_CELL * cells if recorder else 0)
    spare = (available - begun) // (cells * BYTES_A_CELL)
    if recorder is None or spare < 2:
        rule = f"must be few enough for {memory}"
        raise ParameterError(
            "layout", "rows * columns", rule, f"{cells} cells, {alone / 1e9:.3g} GB"
        )
    rule = f"must be at least {-(-periods // (spare - 1))} for the history to fit into {memory}"
    value = f"{recorder.every}: {recorder.rows(periods)} rows of {cells} cells are {needed / 1e9:.3g} GB"
    raise ParameterError("recorder", "every", rule, value)
