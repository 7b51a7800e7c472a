"""Shapes from files, placed on a bed: reading, fit of the plan, scale of the relief, clipping; packing.

A shape is a sample shape, given by its name, a mesh, a picture, or a numpy array.
"""

import base64
import importlib
import math
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError, SceneError
from ..files.formats import inflate, map_array
from ..files.run_folder import find_file, list_files
from ..mesh_io import mesh_reader
from ..mesh_io.mesh_limits import make_refusal
from ..mesh_io.mesh_reader import READERS
from ..model.actuator import Actuator
from ..model.layout import Grid
from .heightmap import GRIDS, PICTURES, HeightMap, make_height_map, read_grid, read_pixels
from .mesh_relief import ShapeMesh, make_shape_mesh
from .request import AUTO, Placement, Shape, Tops, find_length

#: A shape from a file, in the file's unit.
Relief = HeightMap | ShapeMesh
#: Folder of the sample shapes.
SAMPLES = Path(__file__).parents[2] / "sample_shapes" / "shapes"
ARRAY = ".npy"
UNREADABLE = "must be a file that can be read"
#: Extensions of a shape's file.
KINDS = (*READERS, *PICTURES, ARRAY, *GRIDS)


def list_shapes() -> list[str]:
    """Return the names of the sample shapes."""
    return list(list_files(SAMPLES, *KINDS))


def find_shape(word: str) -> Path:
    """Return the file of a shape, given by a sample's name or its path, or raise SceneError."""
    return find_file(word, list_files(SAMPLES, *KINDS), "sample shape")


HINT = "Take the shape in again."


def pack(heights: Floats) -> str:
    """Pack heights (n,), m, as letters and digits, with the resolution of 32-bit numbers, 4 nm."""
    return base64.b64encode(zlib.compress(heights.astype("<f4").tobytes(), 9)).decode("ascii")


def unpack(text: str, grid: Grid) -> Floats:
    """Return the heights (n,), m, of the cells of a bed from a text that `pack` made for this bed."""
    wanted = 4 * grid.count
    try:
        data = inflate(base64.b64decode(text, validate=True), wanted)
    except ValueError:
        data = b"?"  # no whole number of heights
    if len(data) % 4 and len(data) <= wanted:
        shown = repr(text if len(text) <= 20 else f"{text[:17]}...")
        raise ParameterError("shape", "heights", "must be heights packed as text", shown, HINT)
    if len(data) != wanted:
        plan = grid.layout
        rule = f"must hold the heights of the bed's {plan.rows} x {plan.columns} cells"
        got = (
            f"{len(data) // 4} heights" if len(data) < wanted else f"more than {grid.count} heights"
        )
        raise ParameterError("shape", "heights", rule, got, HINT)
    heights = np.frombuffer(data, "<f4").astype(np.float64)
    if not np.all(np.isfinite(heights)):
        cell = int(np.flatnonzero(~np.isfinite(heights))[0])
        value = f"{heights[cell]} at cell {cell}"
        raise ParameterError("shape", "heights", "must be finite numbers", value)
    return heights


#: A plan narrower than this share of its length is a line or a point, which cannot be fitted.
THIN = 1e-9


@dataclass(frozen=True, eq=False)
class Fitted:
    """Heights of a bed for a shape, and the parts of the shape beyond them."""

    name: str
    heights: Floats
    """(n,): m, from 0 to the stroke."""
    covered: int
    """Cells that the shape covers; the others are at its foot."""
    overhanging: int
    """Cells over which the shape has parts below its top surface; only the top is displayed."""
    too_low: int
    too_high: int
    """Cells clipped at the bed's floor, at the end of the stroke."""
    filled: int = 0
    """Cells under small holes of the shape, whose heights are interpolated from around."""

    def describe(self) -> str:
        """Return the fit in one line."""
        count = self.heights.size
        low, high = float(self.heights.min()) * 1e3, float(self.heights.max()) * 1e3
        covers = "all cells" if self.covered == count else f"{self.covered} of {_cells(count)}"
        parts = [f"{self.name}: heights from {low:.1f} to {high:.1f} mm, covers {covers}"]
        clipped = self.too_low + self.too_high
        if clipped:
            ends = ((self.too_low, "at the floor"), (self.too_high, "at the stroke's end"))
            shown = ", ".join(f"{number} {where}" for number, where in ends if number)
            parts.append(f"{_cells(clipped)} clipped ({shown})")
        else:
            parts.append("no cell clipped")
        if self.overhanging:
            parts.append(f"overhangs under the top at {_cells(self.overhanging)}")
        if self.filled:
            parts.append(f"{_cells(self.filled)} under holes filled from around")
        return ", ".join(parts)


def _cells(count: int) -> str:
    """Write a number of cells."""
    return f"{count} cell{'s' if count != 1 else ''}"


def fit_given(shape: Shape, grid: Grid, actuator: Actuator) -> Fitted:
    """Return the shape whose heights are in the scene itself, clipped to the actuator's stroke."""
    none = np.zeros(grid.count)
    tops = Tops(none, none == 0.0, none != 0.0)
    return _clipped(shape.file or "heights", unpack(shape.heights, grid), tops, actuator)


def fit_relief(shape: Shape, relief: Relief, grid: Grid, actuator: Actuator) -> Fitted:
    """Place a relief on a bed as `shape` requests, or raise ParameterError."""
    at = _placement(shape, relief, grid)
    tops = relief.tops(grid, at)
    if not tops.covered.any():
        hint = "Set shape.fit to contain, or move it with shape.x and shape.y."
        content = f"{relief.name}: no pin lies under it"
        raise ParameterError("shape", "x, y", "must leave the shape over the bed", content, hint)
    return _clipped(relief.name, _heights(shape, relief, at, tops, actuator), tops, actuator)


def _placement(shape: Shape, relief: Relief, grid: Grid) -> Placement:
    """Return the placement of the shape's plan on the bed."""
    left, front, right, back = relief.box
    wide, deep = right - left, back - front
    if not min(wide, deep) > THIN * max(wide, deep):
        rule = "must be wider than a line or a point, seen from above"
        raise make_refusal(rule, relief.name, f"{wide:g} x {deep:g}")
    placed = shape.fit == "placed" and isinstance(relief, HeightMap)
    if placed or (shape.fit == "actual" and relief.length is None):
        rule = "must be contain, cover or stretch for a picture or a map: its pixels have no length"
        rule = rule.replace("length", "place") if relief.length else rule
        raise ParameterError("shape", "fit", rule, f"{shape.fit!r} for {relief.name}")
    unit = relief.length or 1.0
    if shape.fit == "placed":
        return Placement(unit, unit, shape.x, shape.y)
    plan = grid.layout
    # The bed extends half a pitch beyond the outermost pins on every side.
    across, along = float(np.ptp(grid.x)) + plan.pitch, float(np.ptp(grid.y)) + plan.row_spacing
    factors = {
        "contain": (min(across / wide, along / deep),) * 2,
        "cover": (max(across / wide, along / deep),) * 2,
        "stretch": (across / wide, along / deep),
        "actual": (unit, unit),
    }
    factor_x, factor_y = (factor * shape.scale for factor in factors[shape.fit])
    middle_x, middle_y = left + wide / 2, front + deep / 2
    return Placement(
        factor_x, factor_y, shape.x - middle_x * factor_x, shape.y - middle_y * factor_y
    )


def _heights(shape: Shape, relief: Relief, at: Placement, tops: Tops, actuator: Actuator) -> Floats:
    """Return the heights of all cells, m, before they are clipped."""
    foot = actuator.rest_height + shape.foot
    if shape.fit == "placed":
        assert relief.value_length is not None  # a length in plan implies one of the heights
        return np.where(tops.covered, tops.value * relief.value_length, foot)
    seen = tops.value[tops.covered]
    low, high = float(seen.min()), float(seen.max())
    # A fully covered bed displays only the top surface; a shape that stands on the bed also shows
    # its sides.
    if relief.underside is not None and not tops.covered.all():
        low = relief.underside
    if shape.relief == "true":
        if relief.value_length is None:
            rule = "must be rise or stroke for a picture: its values are not lengths"
            raise ParameterError("shape", "relief", rule, f"'true' for {relief.name}")
        # A shape with a length in plan keeps its proportions; other heights are lengths of their
        # own.
        factor = relief.value_length
        if relief.length is not None:
            factor *= math.sqrt(at.factor_x * at.factor_y) / relief.length
    elif not math.isclose(low, high):  # interpolated values of one level differ in their last bits
        factor = (shape.rise if shape.relief == "rise" else actuator.stroke - foot) / (high - low)
    else:
        factor = 0.0
    return np.where(tops.covered, foot + factor * (tops.value - low), foot)


def _clipped(name: str, heights: Floats, tops: Tops, actuator: Actuator) -> Fitted:
    """Limit heights to the stroke, and count the clipped cells."""
    # A nanometer beyond an end is rounding.
    low, high = heights < -1e-9, heights > actuator.stroke + 1e-9
    counts = [int(np.count_nonzero(flags)) for flags in (tops.covered, tops.overhang, low, high)]
    counts += [tops.filled]
    return Fitted(name, np.clip(heights, 0.0, actuator.stroke), *counts)


def fit_shape(shape: Shape, grid: Grid, actuator: Actuator) -> Fitted:
    """Return the shape of a scene, placed on its bed; raises as `read` and `fit_relief`."""
    if shape.heights:
        return fit_given(shape, grid, actuator)
    return fit_relief(shape, read(shape), grid, actuator)


def read(shape: Shape) -> Relief:
    """Read the shape of a scene; SceneError without such a file, ParameterError if it contains no shape."""
    try:
        path = find_shape(shape.file)
    except SceneError as error:
        raise SceneError(f"shape.file: {error}") from None
    kind = path.suffix.lower()
    try:
        if kind == ARRAY:
            return _array(path)
        if kind in PICTURES:
            return make_height_map(path.name, read_pixels(path))
        return read_grid(path) if kind in GRIDS else _mesh(path, shape)
    except OSError as error:
        raise make_refusal(UNREADABLE, str(path), error.strerror or str(error)) from None


def import_reader(path: Path) -> None:
    """Import the library that reads a file while nothing can interrupt that; `read` refuses a missing one."""
    if path.suffix.lower() in PICTURES:
        with suppress(ImportError):
            importlib.import_module("PIL.Image")


def _array(path: Path) -> HeightMap:
    """Read an array of heights, m; its first row lies at the lowest y."""
    try:
        values = map_array(path)
    except ValueError:
        raise ParameterError("shape", "file", "must hold one array of numbers", str(path)) from None
    return make_height_map(path.name, values, value_length=1.0)


def _mesh(path: Path, shape: Shape) -> ShapeMesh:
    """Read a mesh."""
    if path.suffix.lower() not in READERS:
        rule = f"must be a mesh, a picture or an array ({', '.join(KINDS)})"
        raise ParameterError("shape", "file", rule, str(path))
    mesh = mesh_reader.read(path)
    up = shape.up if shape.up != AUTO else mesh.up
    length = find_length(shape.unit, mesh.length)
    return make_shape_mesh(path.name, mesh.vertices, mesh.faces, up, length)
