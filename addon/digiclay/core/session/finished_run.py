"""Finished run, read from its folder."""

import math
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from ..base.errors import OutputError
from ..base.modes import Mode
from ..files.formats import BROKEN_ZIP, Head, read_array, read_heads
from ..files.run_folder import MARK, read_json
from ..metrics.summary import find_contact_rows
from ..scene.recorder import Recorder
from ..scene.scene_source import load_recorded
from ..scene.schema import Scene
from .memory_limit import measure_available_memory
from .run_scene import Result

#: The file of the arrays.
HISTORY = "history.npz"
#: Largest number of a run, so that sums of squares are finite.
LARGEST = 1e100
#: Types of an array by their kinds in numpy, as messages and pages call them.
KINDS = {"if": "numbers", "i": "whole numbers", "b": "truth values"}


class HistoryArray(NamedTuple):
    """Array of a history."""

    axes: str
    """Shape: t rows, n pins, b bodies, f fingers; of one finger without the axis f."""
    unit: str
    meaning: str
    kinds: str = "if"
    """Key of `KINDS`."""
    optional: bool = False
    """Whether only some runs have it."""


#: Arrays of a history, by name: those that a run records, ``history.npz`` holds and `read_run`
#: accepts.
HISTORY_ARRAYS: dict[str, HistoryArray] = {
    "time": HistoryArray(
        "t", "s", "time of the row; row 0 is the bed before the first control period"
    ),
    "height": HistoryArray("t, n", "m", "height of each pin's top over the floor of the bed"),
    "force": HistoryArray("t, n", "N", "force of all fingers on each pin, positive downwards"),
    "command": HistoryArray(
        "t, n",
        "1",
        "valve command of each pin in the control period that begins with the row, -1 to 1",
    ),
    "mode": HistoryArray("t, n", "1", "code of each pin's mode in that control period", "i"),
    "fingertip": HistoryArray(
        "t, f, 7",
        "m, 1",
        "pose of each fingertip: its lowest point x, y, z, its quaternion w, x, y, z",
    ),
    "total_force": HistoryArray("t", "N", "force of all fingers on all pins"),
    "finger_force": HistoryArray("t, f", "N", "force of each of several fingers", optional=True),
    "body": HistoryArray(
        "t, b, 7", "m, 1", "pose of each body: its mesh's origin, its quaternion", optional=True
    ),
    "body_force": HistoryArray("t, b, n", "N", "force of each body on each pin", optional=True),
    "beyond_a_finger": HistoryArray(
        "t", "1", "whether a finger presses beyond the range of the contact law", "b", optional=True
    ),
    "served": HistoryArray(
        "t, n",
        "1",
        "whether the drive addresses each pin's line in that control period",
        "b",
        optional=True,
    ),
    "waiting": HistoryArray(
        "t, n",
        "1",
        "whether each pin waits for the drive, which withholds its command in that control period",
        "b",
        optional=True,
    ),
    "position": HistoryArray("n, 2", "m", "x and y of each pin's axis from the middle of the bed"),
}


@dataclass(frozen=True, eq=False)
class Run:
    """Scene and history of a run."""

    scene: Scene
    history: dict[str, Array]


def read_run(folder: Path, *names: str) -> Run:
    """Read a run and the named arrays of its history, keys of `HISTORY_ARRAYS`; OutputError if unsound."""
    path = folder / HISTORY
    if not (folder / "scene.toml").is_file():
        raise OutputError(f"{folder} is not the folder of a run: it has no scene.toml.")
    if not path.is_file():
        raise OutputError(f"{folder} has no history.npz: its scene had no recorder.")
    scene = load_recorded(folder / "scene.toml")
    try:
        with zipfile.ZipFile(path) as archive:
            stored = {Path(name).stem for name in archive.namelist()}
            wanted = [
                name
                for name in ("time", *names)
                if name in stored or not HISTORY_ARRAYS[name].optional
            ]
            heads = read_heads(archive, wanted)
            _refuse(path, scene, heads)
            history = {name: _read_history_array(archive, name) for name in heads}
    except (OSError, ValueError, KeyError, EOFError, *BROKEN_ZIP) as error:
        raise OutputError(f"{path} cannot be read as a run's history: {error}.") from None
    for name, values in history.items():
        low, high = (0, len(Mode) - 1) if name == "mode" else (-LARGEST, LARGEST)
        if values.size and not (values.min() >= low and values.max() <= high):
            raise OutputError(
                f"{path}: {name} must hold numbers from {low:g} to {high:g}, as a run leaves."
            )
    if (np.diff(history["time"]) <= 0.0).any():
        raise OutputError(f"{path}: time must increase from row to row.")
    return Run(scene, history)


def _read_history_array(archive: zipfile.ZipFile, name: str) -> Array:
    """Read an array; numbers of fewer bytes, by another program, become those a run records."""
    values = read_array(archive, name)
    return values.astype(np.float64, copy=False) if HISTORY_ARRAYS[name].kinds == "if" else values


def read_result(folder: Path) -> Result:
    """Read a run with its whole history and its metrics; OutputError if unsound."""
    path = folder / "scene.toml"
    scene = load_recorded(path) if path.is_file() else None
    run = Run(scene, {}) if scene and scene.recorder is None else read_run(folder, *HISTORY_ARRAYS)
    metrics = read_json(folder / MARK)
    if metrics is None:
        raise OutputError(f"{folder / MARK} must be a table of metrics in JSON.")
    count, spent = metrics.get("control_periods"), metrics.get("run_time")
    if not (isinstance(count, int) and isinstance(spent, (int, float)) and min(count, spent) > 0):
        rule = "must have the numbers control_periods and run_time, above 0"
        raise OutputError(f"{folder / MARK} {rule} (got {count!r:.40} and {spent!r:.40}).")
    return Result(run.scene, run.history, count, spent, metrics)


def _refuse(path: Path, scene: Scene, heads: Mapping[str, Head]) -> None:
    """Refuse arrays that no run of this scene writes, before they are unpacked."""
    rows = heads["time"].shape[0] if heads["time"].shape else 0
    most = (scene.recorder or Recorder()).rows(scene.periods)
    if not 0 < rows <= most:
        rule = f"must have from 1 to the {most:,} rows of its scene's {scene.periods:,} control periods"
        raise OutputError(f"{path} {rule} (got {rows:,}).")
    sizes = {"n": scene.cells, "t": rows, "f": len(scene.fingers), "b": len(scene.bodies)}
    size = 0
    for name, head in heads.items():
        axes = HISTORY_ARRAYS[name].axes.split(", ")
        several = len(scene.fingers) > 1
        shape = tuple(
            sizes[axis] if axis in sizes else int(axis) for axis in axes if axis != "f" or several
        )
        if head.shape != shape:
            raise OutputError(
                f"{path}: {name} must have the shape {shape} of its scene (got {head.shape})."
            )
        kinds = HISTORY_ARRAYS[name].kinds
        if head.kind.kind not in kinds or head.kind.itemsize > 8:
            raise OutputError(
                f"{path}: {name} must hold {KINDS[kinds]} of at most 8 bytes (got {head.kind})."
            )
        size += 8 * math.prod(shape) if kinds == "if" else head.size
    free = measure_available_memory()
    if size > free:
        rule = f"must fit into the {free / 1e9:.3g} GB of free memory"
        raise OutputError(f"{path} {rule} (got {size / 1e9:.3g} GB of {', '.join(heads)}).")


def require_surface(scene: Scene, option: str) -> None:
    """Refuse to make a surface of a bed that has none. `option`: what asks for the surface."""
    if min(scene.layout.rows, scene.layout.columns) < 2:
        raise OutputError(
            f"{option} needs at least 2 x 2 cells (got {scene.layout.rows} x {scene.layout.columns})."
        )


def has_files(folder: Path, sizes: Mapping[str, int]) -> bool:
    """Return whether a run's folder has all files with their sizes, bytes: copies may be incomplete."""
    try:
        return bool(sizes) and all(
            (folder / name).stat().st_size == size for name, size in sizes.items()
        )
    except OSError:
        return False


def is_whole(folder: Path, scene: Scene) -> bool:
    """Return whether a run's folder is complete, by its files alone, without noted sizes."""
    whole = read_json(folder / MARK) is not None
    # The directory of an archive is at its end.
    return whole and (scene.recorder is None or zipfile.is_zipfile(folder / HISTORY))


def find_row(history: Mapping[str, Array], time: float, called: str) -> int:
    """Return the row nearest to a time within the session, s; `called`: its name in messages."""
    first, last = history["time"][[0, -1]]
    if not (isinstance(time, Real) and first <= time <= last):  # also numpy's
        shown = f"{time:g} s" if isinstance(time, Real) else repr(time)
        raise OutputError(f"{called} must be between {first:g} s and {last:g} s (got {shown}).")
    return int(np.argmin(np.abs(history["time"] - time)))


def find_last_touch(history: Mapping[str, Array]) -> int:
    """Return the last row with contact, or else the last one: it shows most."""
    touching = np.flatnonzero(find_contact_rows(history["total_force"]))
    return int(touching[-1]) if touching.size else len(history["time"]) - 1
