"""Sizes of a new bed: number and distance of its pins, and how large fingertip and blister are on it."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.model.layout import Layout


@dataclass(frozen=True)
class Bed:
    """Size of a bed.

    Attributes
    ----------
    pitch : float
        m.
    share : float
        Size of fingertip and blister, as a share of the paper's.
    use : str
        What it is for.
    """

    rows: int
    columns: int
    pitch: float
    share: float
    use: str


PAPER = Layout()
BEDS = {
    "paper": Bed(
        PAPER.rows, PAPER.columns, PAPER.pitch, 1.0,
        "The bed of the paper: the fingertip is as wide as 5 pins, a fifth of the bed",
    ),
    "design": Bed(
        100, 100, 1.5e-3, 0.5,
        "10,000 pins, fingertip and blister half as large: letters and leaves can be formed",
    ),
    "fine": Bed(
        150, 150, 1e-3, 1 / 3,
        "22,500 pins, fingertip and blister a third as large: for details, on a fast computer",
    ),
}  # fmt: skip
#: Bed that Add makes by hand unless another is chosen: a letter can be read on it (docs/gallery.md).
FIRST = "design"
#: Bed that Add makes in a script that names none, as before there were several.
UNNAMED = "paper"
