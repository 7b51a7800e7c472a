"""Regions of a skin, cut along contours: beyond a threshold off the former surface, or nearest to a top."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import TINY, Faces, Floats
from .formed import measure_areas

#: Least distance of the contour from both ends of an edge, as a share of it, so that no triangle
#: has no area. At a pitch of 3 mm it is 3 µm.
MARGIN = 1e-3


@dataclass(frozen=True, eq=False)
class Region:
    """A piece of a skin."""

    position: Floats
    """(k, 2): m."""
    former: Floats
    """(k,): Height of the skin before, m."""
    off: Floats
    """(k,): Distance of the skin from that now, m, positive; the threshold on the contour."""
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
        edges = list_edges(self.faces).astype(np.int64)
        there, back = edges @ [len(self.position), 1], edges @ [1, len(self.position)]
        return edges[~np.isin(there, back)].astype(np.int32)


def list_edges(faces: Faces) -> Faces:
    """Return the three edges (3 f, 2) of each triangle (f, 3)."""
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def label_components(count: int, edges: Faces) -> Faces:
    """Return for each of `count` points the lowest number of a point that edges (e, 2) join it to."""
    label = np.arange(count, dtype=np.int32)
    while True:
        a, b = label[edges[:, 0]], label[edges[:, 1]]
        if np.array_equal(a, b):
            return label
        np.minimum.at(label, np.maximum(a, b), np.minimum(a, b))
        while not np.array_equal(label, label[label]):
            label = label[label]


def cut(position: Floats, former: Floats, off: Floats, faces: Faces, threshold: float) -> Region:
    """Return the part of triangles (f, 3) in which `off` is above the threshold."""
    values, pieces, whole = _clipped(
        np.column_stack([position, former, off]), faces, off, threshold
    )
    values[whole:, 3] = threshold
    return Region(values[:, :2], values[:, 2], values[:, 3], pieces)


def divide(region: Region, nearer: Floats, gap: float = 0.0) -> tuple[Region | None, Region | None]:
    """Return the parts of a region where a value at its points, (k,), is above `gap`, and below -`gap`."""
    values = np.column_stack([region.position, region.former, region.off])
    # Points at 0 are moved to one side, or triangles along the contour would be on neither.
    nearer = np.where(nearer == 0.0, -TINY, nearer)
    parts: list[Region | None] = []
    for side in (nearer, -nearer):
        near = region.faces[(side > gap)[region.faces].any(axis=1)]
        points, pieces, _ = _clipped(values, near, side, gap)
        parts.append(
            Region(points[:, :2], points[:, 2], points[:, 3], pieces) if len(near) else None
        )
    return parts[0], parts[1]


def _clipped(values: Floats, faces: Faces, by: Floats, level: float) -> tuple[Floats, Faces, int]:
    """Return points and faces where a value is above a level, and how many of the points are vertices."""
    inside = by > level
    count = inside[faces].sum(axis=1)
    pieces = [faces[count == 3].astype(np.int64)]
    m = len(by)
    # A corner is named by its number; a point of the contour, between i inside and j outside, by m
    # + i m + j.
    for wanted in (1, 2):
        corners = faces[count == wanted].astype(np.int64)
        # Turned so that the corner that differs from both others comes first.
        odd = np.argmax(inside[corners] == (wanted == 1), axis=1)
        a, b, c = (corners[np.arange(len(corners)), (odd + k) % 3] for k in range(3))
        if wanted == 1:
            pieces.append(np.column_stack([a, m + a * m + b, m + a * m + c]))
        else:
            ba, ca = m + b * m + a, m + c * m + a
            pieces += [np.column_stack([ba, b, c]), np.column_stack([ba, c, ca])]
    names, numbers = np.unique(np.concatenate(pieces), return_inverse=True)
    whole = names[names < m]
    i, j = np.divmod(names[names >= m] - m, m)
    share = np.clip((by[i] - level) / (by[i] - by[j]), MARGIN, 1.0 - MARGIN)[:, None]
    points = np.concatenate([values[whole], values[i] + share * (values[j] - values[i])])
    return points, numbers.reshape(-1, 3).astype(np.int32), len(whole)
