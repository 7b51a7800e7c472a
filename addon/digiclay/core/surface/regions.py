"""Regions of a skin, cut along contours: off the former surface, and nearest to one top."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import TINY, Faces, Floats
from .formed import measure_areas

#: The contour keeps this share of an edge away from both its ends, so that no triangle is without area.
#: At a pitch of 3 mm it is 3 µm.
MARGIN = 1e-3


@dataclass(frozen=True, eq=False)
class Region:
    """A piece of a skin."""

    position: Floats
    """(k, 2): m."""
    former: Floats
    """(k,): Height of the skin before, m."""
    off: Floats
    """(k,): How far the skin is off that now, m, positive; the threshold on the contour."""
    faces: Faces
    """(f, 3): Counter-clockwise seen from above."""

    @property
    def _plan(self) -> Floats:
        """Area of each triangle in plan, m²."""
        return measure_areas(self.position, self.faces)

    @property
    def area(self) -> float:
        """Area in plan, m²."""
        return float(self._plan.sum())

    @property
    def volume(self) -> float:
        """Volume between the skin now and before, m³."""
        return float(self._plan @ self.off[self.faces].mean(axis=1))

    def outline(self) -> Faces:
        """Return the edges that bound the region, shape (e, 2), its inside to their left."""
        edges = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
        there, back = edges @ [len(self.position), 1], edges @ [1, len(self.position)]
        return edges[~np.isin(there, back)].astype(np.int32)


def label_components(count: int, edges: Faces) -> Faces:
    """Return for each of `count` points the least point it is joined to by edges, shape (e, 2)."""
    label = np.arange(count, dtype=np.int32)
    while True:
        a, b = label[edges[:, 0]], label[edges[:, 1]]
        if np.array_equal(a, b):
            return label
        np.minimum.at(label, np.maximum(a, b), np.minimum(a, b))
        while not np.array_equal(label, label[label]):
            label = label[label]


def cut(position: Floats, former: Floats, off: Floats, faces: Faces, threshold: float) -> Region:
    """Return what of some triangles lies where `off` is above the threshold."""
    values, pieces, whole = _clipped(np.column_stack([position, former, off]), faces, off, threshold)
    values[whole:, 3] = threshold
    return Region(values[:, :2], values[:, 2], values[:, 3], pieces)


def divide(region: Region, nearer: Floats, gap: float = 0.0) -> tuple[Region | None, Region | None]:
    """Return the parts of a region where a value at its points, (k,), is above `gap`, and below -`gap`."""
    values = np.column_stack([region.position, region.former, region.off])
    # What is at 0 is on one side by a trifle, or triangles along the contour would be on none.
    nearer = np.where(nearer == 0.0, -TINY, nearer)
    parts: list[Region | None] = []
    for side in (nearer, -nearer):
        some = region.faces[(side > gap)[region.faces].any(axis=1)]
        kept, pieces, _ = _clipped(values, some, side, gap)
        parts.append(Region(kept[:, :2], kept[:, 2], kept[:, 3], pieces) if len(some) else None)
    return parts[0], parts[1]


def _clipped(values: Floats, faces: Faces, by: Floats, level: float) -> tuple[Floats, Faces, int]:
    """Return points and faces where a value is above a level, and how many of the points are corners."""
    inside = by > level
    count = inside[faces].sum(axis=1)
    pieces = [faces[count == 3].astype(np.int64)]
    m = len(by)
    # A corner is named by its number; a point of the contour, between i inside and j outside, by m + i m + j.
    for wanted in (1, 2):
        some = faces[count == wanted].astype(np.int64)
        # Turned so that the corner that differs from both others comes first.
        odd = np.argmax(inside[some] == (wanted == 1), axis=1)
        a, b, c = (some[np.arange(len(some)), (odd + k) % 3] for k in range(3))
        if wanted == 1:
            pieces.append(np.column_stack([a, m + a * m + b, m + a * m + c]))
        else:
            ba, ca = m + b * m + a, m + c * m + a
            pieces += [np.column_stack([ba, b, c]), np.column_stack([ba, c, ca])]
    names, numbers = np.unique(np.concatenate(pieces), return_inverse=True)
    whole = names[names < m]
    i, j = np.divmod(names[names >= m] - m, m)
    share = np.clip((by[i] - level) / (by[i] - by[j]), MARGIN, 1.0 - MARGIN)[:, None]
    kept = np.concatenate([values[whole], values[i] + share * (values[j] - values[i])])
    return kept, numbers.reshape(-1, 3).astype(np.int32), len(whole)
