"""The section [shape] of a scene: what the bed displays before the finger comes, and how it is fitted."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import ParameterError
from .quantity import Parameters, quantity

__all__ = ["LENGTHS", "UPWARDS", "Shape"]

#: Lengths a file can be in: metres in one of them.
LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "inch": 25.4e-3}
#: Directions of a file that can point upwards: which of its axes become x, y, z, and their signs.
UPWARDS: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "z": ((0, 1, 2), (1, 1, 1)),
    "y": ((0, 2, 1), (1, -1, 1)),
    "x": ((2, 1, 0), (-1, 1, 1)),
    "-z": ((0, 1, 2), (1, -1, -1)),
    "-y": ((0, 2, 1), (1, 1, -1)),
    "-x": ((2, 1, 0), (1, 1, -1)),
}
AUTO = "auto"


@dataclass(frozen=True)
class Shape(Parameters):
    """A shape from outside: where it comes from, how it is laid onto the bed, how the bed gets there."""

    file: str = quantity("dome", "a sample shape's name, or a mesh, a picture or a file .npy")
    heights: str = quantity("", "if given, in place of the file: the heights of all cells, packed as text")
    fit: str = quantity(
        "contain",
        "how it is laid onto the bed: whole, filling the bed, stretched, in its own size, or where its own "
        "coordinates put it",
        choices=("contain", "cover", "stretch", "actual", "placed"),
    )
    scale: float = quantity(1.0, "how much larger than that in plan", above=0.0, at_most=1e6)
    x: float = quantity(
        0.0, "shift of its middle from the bed's", unit="m", symbol="x_s", at_least=-100.0, at_most=100.0
    )
    y: float = quantity(
        0.0, "shift of its middle from the bed's", unit="m", symbol="y_s", at_least=-100.0, at_most=100.0
    )
    relief: str = quantity(
        "rise",
        "how high it is: `rise` high, up to the end of the stroke, or as high as it is wide",
        choices=("rise", "stroke", "true"),
    )
    rise: float = quantity(
        15e-3, "from its lowest to its highest point; negative turns it over", unit="m", symbol="h_r",
        at_least=-100.0, at_most=100.0,
    )  # fmt: skip
    foot: float = quantity(
        0.0, "where its lowest point lies above the bed at rest", unit="m", symbol="h_f",
        at_least=-100.0, at_most=100.0,
    )  # fmt: skip
    up: str = quantity(AUTO, "which direction of a mesh is up", choices=(AUTO, *UPWARDS))
    unit: str = quantity(AUTO, "length a mesh is in", choices=(AUTO, *LENGTHS))
    refresh: str = quantity(
        "approximate_gradual",
        "how the surface gets there",
        choices=("one_time", "gradual", "approximate_gradual"),
    )
    surfaces: int = quantity(
        5, "intermediate surfaces of a gradual refresh, the last one counted", symbol="n_s",
        at_least=1, at_most=1000,
    )  # fmt: skip
    patience: float = quantity(2.0, "longest time a move is waited for", unit="s", symbol="t_p", above=0.0)

    def check(self) -> None:
        """A shape comes from somewhere."""
        if not self.file and not self.heights:
            rule = "must be a sample shape's name, a mesh, a picture or a file .npy"
            raise ParameterError("Shape", "file", rule, "nothing")
