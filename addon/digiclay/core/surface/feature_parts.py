"""Division of a feature into parts, such as a ridge and the mound on it.

Along a crest the ridge is a straight line of heights that most of the crest keeps to and little of it lies
below. What rises above that line, by much and for a short way, is a mound. Places belong to the part that is
nearest: a mound is a disc as large as its way along the crest, a ridge its crest, each with its half width.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..base.arrays import Floats
from .crests import Crest, Ridge

#: Share of a crest that keeps to the straight line of its ridge, at least, and share that may lie below.
KEEPS, BELOW = 0.4, 0.1
#: What counts as below, as a share of the line's height.
SLACK = 0.1
#: A mound rises above the ridge by this share of the ridge's height at least.
RISES = 0.3
#: A mound's foot is where it has risen by this share of its rise.
FOOT = 0.15
#: A mound is so many half widths of its ridge long at most, on each side of its top.
COMPACT = 4.0
#: The peak where two ridges cross is so many half widths long, and no mound.
CROSSING = 1.5
#: Points of a crest that are looked at for the line of its ridge.
POINTS = 40
#: Pairs of a place and a point of a core that are compared at once.
CHUNK = 1 << 21


@dataclass(frozen=True, eq=False)
class FeaturePart:
    """Ridge with its crests, or mound.

    Attributes
    ----------
    crests : tuple of Crest
        The longest first.
    core : ndarray (m, 2)
        Places along its top, m.
    reach : float
        How far it reaches about them, m.
    """

    crests: tuple[Crest, ...]
    core: Floats
    reach: float


def find_parts(ridge: Ridge, least: float) -> tuple[FeaturePart, ...]:
    """Return the parts of a ridge: itself, and the mounds on it.

    `least`: a mound rises above the ridge by this at least, m.
    """
    crests, cores = [], []
    mounds: list[tuple[Floats, float]] = []
    for crest in ridge.crests:
        bare, ways = _bare(crest, least)
        crests.append(bare)
        on_ridge = np.ones(len(crest.points), bool)
        for first, last in ways:
            here = slice(first, last + 1)
            on_ridge[here] = False
            top = first + int(np.argmax(crest.off[here]))
            if first > 0 and last < len(crest.points) - 1:
                top = (first + last) // 2
            middle = crest.points[top, :2]
            away = float(np.hypot(*(crest.points[[first, last], :2] - middle).T).max())
            if all(np.hypot(*(middle - known)) > max(away, radius) for known, radius in mounds):
                mounds.append((middle, away))
        cores.append(crest.points[on_ridge, :2])
    if not mounds:
        return (FeaturePart(ridge.crests, ridge.core, ridge.half),)
    core = np.concatenate(cores)
    on_discs = [FeaturePart((), middle[None], away + ridge.half) for middle, away in mounds]
    return (FeaturePart(tuple(crests), core, ridge.half), *on_discs)


def measure_distances(places: Floats, every: tuple[FeaturePart, ...] | list[FeaturePart]) -> Floats:
    """Return how far places (k, 2) are from each part, less its reach, m, shape (parts, k).

    `places` (k, 2), m.
    """
    found = np.empty((len(every), len(places)))
    for number, part in enumerate(every):
        rows = max(1, CHUNK // len(part.core))
        for start in range(0, len(places), rows):
            some = places[start : start + rows, None] - part.core
            found[number, start : start + rows] = (
                np.hypot(some[..., 0], some[..., 1]).min(axis=1) - part.reach
            )
    return found


def _bare(crest: Crest, least: float) -> tuple[Crest, list[tuple[int, int]]]:
    """Return a crest without the mounds on it, and the first and last points of each of them."""
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(crest.points[:, :2], axis=0).T))])
    line = _line(run, crest.off, crest.closed)
    if line is None:
        return crest, []
    excess = crest.off - line
    ways: list[tuple[int, int]] = []
    untried = excess > 0.0
    while untried.any():
        top = int(np.argmax(np.where(untried, excess, -np.inf)))
        if excess[top] < max(RISES * line[top], least):
            break
        first = last = top
        while first > 0 and excess[first - 1] > FOOT * excess[top]:
            first -= 1
        while last < len(run) - 1 and excess[last + 1] > FOOT * excess[top]:
            last += 1
        untried[first : last + 1] = False
        if max(run[last] - run[top], run[top] - run[first]) > COMPACT * crest.half:
            continue
        inner = first > 0 and last < len(run) - 1
        if crest.crossed and inner and run[last] - run[first] <= 2.0 * CROSSING * crest.half:
            continue
        ways.append((first, last))
    left = run[-1] - sum(run[last] - run[first] for first, last in ways)
    if not ways or left < 2.0 * crest.half:
        return crest, []
    points, off = crest.points.copy(), crest.off.copy()
    # Which way the surface has risen: up for a boss, down for a crease.
    sign = 1.0 if np.polyfit(crest.off, crest.points[:, 2], 1)[0] > 0.0 else -1.0
    kept = np.ones(len(run), bool)
    for first, last in ways:
        here = slice(first, last + 1)
        points[here, 2] -= sign * excess[here]
        off[here] = line[here]
        top = first + int(np.argmax(crest.off[here]))
        if last == len(run) - 1:
            kept[top + 1 :] = False
        elif first == 0:
            kept[:top] = False
    return replace(crest, points=points[kept], off=off[kept]), ways


def _line(run: Floats, off: Floats, closed: bool) -> Floats | None:
    """Return the heights of the ridge along a crest: a straight line most of it keeps to, from below."""
    some = np.unique(np.linspace(0, len(run) - 1, POINTS).astype(int))
    at, height = run[some], off[some]
    pairs = np.array([(i, j) for i, j in combinations(range(len(some)), 2) if at[j] - at[i] >= at[-1] / 4.0])
    if not len(pairs):
        return None
    i, j = pairs.T
    slope = np.zeros(len(i)) if closed else (height[j] - height[i]) / (at[j] - at[i])
    lines = height[i, None] + slope[:, None] * (at - at[i, None])
    rest = height - lines
    below = np.mean(rest < -SLACK * np.abs(lines), axis=1)
    keeps = np.quantile(np.abs(rest), KEEPS, axis=1)
    allowed = (below <= BELOW) & (lines.min(axis=1) > 0.0)
    if not allowed.any():
        return None
    best = int(np.argmin(np.where(allowed, keeps, np.inf)))
    whole: Floats = height[i[best]] + slope[best] * (run - at[i[best]])
    return whole
