"""Named shapes and shape files, as heights or forces of a display."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..files.formats import map_array
from ..model.layout import Grid

#: How the name of a file of values ends.
FILE = ".npy"


def dome(x: Floats, y: Floats) -> Floats:
    """Return a paraboloid, 1 in the middle, 0 on the unit circle and beyond.

    `x`, `y` (n,), -1 to 1 over the bed.
    """
    bump: Floats = np.maximum(1.0 - x * x - y * y, 0.0)
    return bump


def saddle(x: Floats, y: Floats) -> Floats:
    """Return a saddle, 1 at x = ±1, -1 at y = ±1. `x`, `y` (n,), -1 to 1 over the bed."""
    seat: Floats = x * x - y * y
    return seat


def wave(x: Floats, y: Floats) -> Floats:
    """Return two waves along x. `x`, `y` (n,), -1 to 1 over the bed."""
    waves: Floats = np.sin(2.0 * math.pi * x)
    return waves


def ripple(x: Floats, y: Floats) -> Floats:
    """Return waves around the middle. `x`, `y` (n,), -1 to 1 over the bed."""
    waves: Floats = np.cos(3.0 * math.pi * np.hypot(x, y))
    return waves


def crater(x: Floats, y: Floats) -> Floats:
    """Return a ring wall, 1 high at radius 0.6, around a hollow of depth 0.6.

    `x`, `y` (n,), -1 to 1 over the bed.
    """
    r = np.hypot(x, y)
    ring: Floats = np.exp(-(((r - 0.6) / 0.18) ** 2)) - 0.6 * np.exp(-((r / 0.3) ** 2))
    return ring


def pyramid(x: Floats, y: Floats) -> Floats:
    """Return a four-sided pyramid, 1 in the middle. `x`, `y` (n,), -1 to 1 over the bed."""
    sides: Floats = 1.0 - np.maximum(np.abs(x), np.abs(y))
    return sides


def ramp(x: Floats, y: Floats) -> Floats:
    """Return a plane that rises along x, from -1 to 1. `x`, `y` (n,), -1 to 1 over the bed."""
    return x


def flat(x: Floats, y: Floats) -> Floats:
    """Return 0. `x`, `y` (n,), -1 to 1 over the bed."""
    return 0.0 * x


#: Values from -1 to 1 over the square bed -1 to 1, in x and y.
SHAPES: dict[str, Callable[[Floats, Floats], Floats]] = {
    "dome": dome,
    "saddle": saddle,
    "wave": wave,
    "ripple": ripple,
    "crater": crater,
    "pyramid": pyramid,
    "ramp": ramp,
    "flat": flat,
}


def check_shape(owner: str, field: str, shape: str) -> None:
    """Refuse what is neither a shape's name nor a file's.

    `owner`, `field`: what the message calls it. Raises ParameterError.
    """
    if shape not in SHAPES and not shape.endswith(FILE):
        rule = f"must be one of {', '.join(SHAPES)}, or a file {FILE}"
        raise ParameterError(owner, field, rule, repr(shape))


def evaluate_shape(shape: str, grid: Grid) -> Floats:
    """Return the values of a named shape for all cells of a bed, shape (n,), from -1 to 1.

    A shape's square is the bed; a bed longer than wide stretches it.
    """
    middle_x, middle_y = grid.x / _half(grid.x), grid.y / _half(grid.y)
    return SHAPES[shape](middle_x, middle_y)


def _half(values: Floats) -> float:
    """Return half the extent of a bed, m; 1 for a single row or column."""
    return float(np.abs(values).max()) or 1.0


def read_values(field: str, path: str, grid: Grid, low: float, high: float, unit: str) -> Floats:
    """Return the values a file of numpy's gives for all cells, shape (n,).

    `field`: the key of the section ``control`` that names the file, for messages; `path`: relative to where
    the command runs. Holds an array (rows, columns): the first row lies at the lowest y; `low`, `high`:
    bounds of the values; `unit`: their unit. Raises ParameterError when it cannot be read, or does not fit
    the bed.
    """
    plan = grid.layout
    try:
        read = map_array(Path(path))
        shape = read.shape
        # Only what fits the bed is read.
        values = np.asarray(read if shape == (plan.rows, plan.columns) else 0.0, dtype=np.float64)
    except OSError as error:
        said = error.strerror or "not an array"
        raise ParameterError("control", field, "must be a file that can be read", f"{path}: {said}") from None
    except (ValueError, TypeError):
        rule = "must be a file that holds one array of numbers"
        raise ParameterError("control", field, rule, path) from None
    if values.shape != (plan.rows, plan.columns):
        rule = f"must hold an array of the bed's {plan.rows} x {plan.columns} cells"
        shown = " x ".join(map(str, shape)) or "a single number"
        raise ParameterError("control", field, rule, f"{path}: {shown}")
    wrong = values[~((values >= low) & (values <= high))]
    if wrong.size:
        rule = f"must hold values from {low:g} to {high:g} {unit}"
        raise ParameterError("control", field, rule, f"{path}: {wrong[0]:g} {unit}")
    return values.ravel()
