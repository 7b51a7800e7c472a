"""Section [shape] of a scene: source and placement of a shape; the top surface of a shape at the pins."""

from dataclasses import dataclass
from typing import NamedTuple

from ..base.arrays import Flags, Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..files.tables import Record

#: Units of length of a file, in meters.
LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "inch": 25.4e-3}
#: Upward directions of a file.
UPWARDS = ("z", "y", "x", "-z", "-y", "-x")
AUTO = "auto"


def find_length(unit: str, of_file: float | None) -> float:
    """Return the length of a unit, m; `AUTO`: that of the file, or of a millimeter if it names none."""
    return of_file or LENGTHS["mm"] if unit == AUTO else LENGTHS[unit]


#: Unit and bounds of a length that places a shape.
LENGTH: Record = {"unit": "m", "at_least": -100.0, "at_most": 100.0}


@dataclass(frozen=True, eq=False, repr=False)
class Shape(Parameters):
    """External shape: source, placement on the bed, refresh."""

    file: str = quantity("dome", "name of a sample shape, or a mesh, a picture or a file .npy")
    heights: str = quantity("", "heights of all cells, packed as text, in place of the file")
    fit: str = quantity(
        "contain",
        "placement on the bed: whole, filling the bed, stretched, in its own size, or at its own coordinates",
        choices=("contain", "cover", "stretch", "actual", "placed"),
    )
    scale: float = quantity(1.0, "scale of the plan", above=0.0, at_most=1e6)
    x: float = quantity(0.0, "shift of the middle from that of the bed", symbol="x_s", **LENGTH)
    y: float = quantity(0.0, "shift of the middle from that of the bed", symbol="y_s", **LENGTH)
    relief: str = quantity(
        "rise",
        "height: `rise`, up to the end of the stroke, or in proportion to the plan",
        choices=("rise", "stroke", "true"),
    )
    rise: float = quantity(
        15e-3, "lowest to highest point; a negative value inverts the shape", symbol="h_r", **LENGTH
    )
    foot: float = quantity(0.0, "lowest point above the bed at rest", symbol="h_f", **LENGTH)
    up: str = quantity(AUTO, "upward direction of a mesh", choices=(AUTO, *UPWARDS))
    unit: str = quantity(AUTO, "unit of length of a mesh", choices=(AUTO, *LENGTHS))
    refresh: str = quantity(
        "approximate_gradual",
        "method of refresh",
        choices=("one_time", "gradual", "approximate_gradual"),
    )
    surfaces: int = quantity(
        5,
        "number of intermediate surfaces of a gradual refresh, including the last",
        symbol="n_s",
        at_least=1,
        at_most=1000,
    )
    patience: float = quantity(2.0, "time limit of a move", unit="s", symbol="t_p", above=0.0)

    def check(self) -> None:
        """Refuse a shape without a source."""
        if not self.file and not self.heights:
            rule = "must be a sample shape's name, a mesh, a picture or a file .npy"
            raise ParameterError("Shape", "file", rule, "nothing")


class Placement(NamedTuple):
    """Transformation of a shape's plan: bed = file * factor + offset, in m, and m per unit of the file."""

    factor_x: float
    factor_y: float
    x: float
    y: float


class Tops(NamedTuple):
    """Top surface of a shape at the pins of a bed, (n,) each."""

    value: Floats
    """(n,): In the file's unit; 0 where the shape covers no pin."""
    covered: Flags
    """(n,)."""
    overhang: Flags
    """(n,): Pins over which another part of the shape lies below the top: it cannot be displayed."""
    filled: int = 0
    """Pins under small holes, whose values are interpolated from around."""
