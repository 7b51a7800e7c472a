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


#: Values from -1 to 1 over the square bed -1 to 1, in x and y.
SHAPES: dict[str, Callable[[Floats, Floats], Floats]] = {
    "dome": lambda x, y: np.maximum(1.0 - x * x - y * y, 0.0),
    "saddle": lambda x, y: x * x - y * y,
    "wave": lambda x, y: np.sin(2.0 * math.pi * x),
    "ripple": lambda x, y: np.cos(3.0 * math.pi * np.hypot(x, y)),
    "crater": lambda x, y: _crater(np.hypot(x, y)),
    "pyramid": lambda x, y: 1.0 - np.maximum(np.abs(x), np.abs(y)),
    "ramp": lambda x, y: x,
    "flat": lambda x, y: 0.0 * x,
}


def _crater(r: Floats) -> Floats:
    """Return a ring wall, 1 high at radius 0.6, around a hollow of depth 0.6."""
    ring: Floats = np.exp(-(((r - 0.6) / 0.18) ** 2)) - 0.6 * np.exp(-((r / 0.3) ** 2))
    return ring


def check_shape(owner: str, field: str, shape: str) -> None:
    """Refuse what is neither a shape's name nor a file's; `owner`, `field`: what the message calls it."""
    if shape not in SHAPES and not shape.endswith(FILE):
        rule = f"must be one of {', '.join(SHAPES)}, or a file {FILE}"
        raise ParameterError(owner, field, rule, repr(shape))


def evaluate_shape(shape: str, grid: Grid) -> Floats:
    """Return the values of a named shape for all cells of a bed, (n,), whose extent is the shape's square."""
    # A bed of a single row or column has no extent.
    middle_x, middle_y = (values / (float(np.abs(values).max()) or 1.0) for values in (grid.x, grid.y))
    return SHAPES[shape](middle_x, middle_y)


def read_values(field: str, path: str, grid: Grid, low: float, high: float, unit: str) -> Floats:
    """Return the values for all cells, (n,), from `low` to `high`, of a file of numpy's, (rows, columns).

    Raises ParameterError about the key `field` of the section ``control`` when it cannot be read, or does not
    fit the bed, whose first row lies at the lowest y. `path`: relative to where the command runs.
    """
    plan = grid.layout
    try:
        read = map_array(Path(path))
        shape = read.shape
        # Only what fits the bed is read.
        values = np.asarray(read if shape == (plan.rows, plan.columns) else 0.0, dtype=np.float64)
    except OSError as error:
        rule, why = "must be a file that can be read", error.strerror or "not an array"
        raise ParameterError("control", field, rule, f"{path}: {why}") from None
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
