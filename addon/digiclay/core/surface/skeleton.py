"""Skeleton of a feature: the pins that remain when it is thinned from its lowest pin upwards.

A pin is removed, the lowest first, if that neither divides the rest nor opens a hole in it; the end
of a line stays. The skeleton is one pin wide, runs along the top, and is connected and closed as
the feature is. A hollow that looks like the inside of a ring counts as a hole, even where its
bottom belongs to the feature.

In all functions `beside` int (k, 8 or 6) has the neighbors of a feature's pins, numbered from 0, -1
for none; `on_bed` bool (k, 8 or 6) tells where the bed continues; `off` (k,) are heights over the
ground, m.
"""

import heapq
import math

import numpy as np

from ..base.arrays import Flags, Floats, Indices, settle
from ..model.layout import SQUARE

#: A hollow is a hole when it is deeper than this share of the lowest way out of it.
DEEP = 0.25
#: The end of a line stays when it is higher than this share of its neighbor.
END = 0.5
#: A pin is ahead when it is this many times as far in that direction as the neighbors are.
AHEAD = 1.25


def measure_half_width(beside: Indices, on_bed: Flags) -> int:
    """Return how many rings of pins can be removed from a feature, one at least."""
    inner, count = np.ones(len(beside), bool), 0
    while inner.any():
        # Where the bed ends the feature might go on.
        rest = inner & np.all(np.where(beside >= 0, inner[beside], ~on_bed), axis=1)
        if np.array_equal(rest, inner):  # it covers the whole bed
            break
        inner, count = rest, count + 1
    return max(1, count)


def average_neighbors(beside: Indices, on_bed: Flags, off: Floats, times: int) -> Floats:
    """Return heights averaged `times` times with those of the neighbors; the ground around has height 0."""
    count = on_bed.sum(axis=1)
    for _ in range(times):
        heights = np.where(beside >= 0, off[beside], 0.0)
        off = settle(0.5 * (off + heights.sum(axis=1) / count))
    return off


def find_skeleton(beside: Indices, on_bed: Flags, off: Floats) -> Indices:
    """Return the pins along the top of a feature, ascending; one at least."""
    # A flat top gets its crest in the middle when it is rounded over its own half width.
    top = average_neighbors(beside, on_bed, off, measure_half_width(beside, on_bed))
    near = average_neighbors(beside, on_bed, off, 1)
    holes = _hollows(beside, on_bed, near)
    return _thinned(beside, top, holes)


def _hollows(beside: Indices, on_bed: Flags, off: Floats) -> list[int]:
    """Return the lowest pin of each hollow that is deep enough, by flooding them."""
    inside = np.all((beside >= 0) | ~on_bed, axis=1)
    lower = np.any((beside >= 0) & (off[beside] < off[:, None]), axis=1)
    if not np.any(inside & ~lower):
        return []
    # The hollow that each pin drains into; the last one is the ground outside, the lowest of all.
    count = len(off)
    hollow = list(range(count + 1))
    lowest = [*off.tolist(), -np.inf]
    bottom = list(range(count + 1))

    def root(pin: int) -> int:
        while hollow[pin] != pin:
            hollow[pin] = hollow[hollow[pin]]
            pin = hollow[pin]
        return pin

    height, flooded, holes = off.tolist(), [False] * count, []
    neighbors = np.where(beside < 0, np.where(on_bed, count, -1), beside).tolist()
    for pin in np.argsort(off, kind="stable").tolist():
        flooded[pin] = True
        for other in neighbors[pin]:
            if other < 0 or (other < count and not flooded[other]):
                continue
            shallow, deep = root(pin), root(other)
            if shallow == deep:
                continue
            if lowest[shallow] < lowest[deep]:
                shallow, deep = deep, shallow
            # The shallower of the two hollows ends here, at its lowest outlet.
            if height[pin] - lowest[shallow] > DEEP * height[pin]:
                holes.append(bottom[shallow])
            hollow[shallow] = deep
    return holes


def _thinned(beside: Indices, top: Floats, holes: list[int]) -> Indices:
    """Return the pins that remain when all that can go are removed, the lowest first."""
    count, directions = beside.shape
    simple, ends = (_SIMPLE[directions], _ENDS[directions])
    neighbors, height = beside.tolist(), top.tolist()
    left = [True] * count + [False]  # the last one stands for no pin, number -1
    for pin in holes:
        left[pin] = False
    waiting = [True] * count
    heap = [(height[pin], pin) for pin in range(count) if left[pin]]
    heapq.heapify(heap)
    while heap:
        _, pin = heapq.heappop(heap)
        waiting[pin] = False
        if not left[pin]:
            continue
        around = neighbors[pin]
        code = sum(1 << bit for bit, other in enumerate(around) if left[other])
        if not simple[code]:
            continue
        high = ends[code] and height[pin] >= END * max(
            height[other] for other in around if left[other]
        )
        if high and (ends[code] == 1 or _continues(neighbors, left, around, code)):
            continue
        left[pin] = False
        for other in around:
            if left[other] and not waiting[other]:
                waiting[other] = True
                heapq.heappush(heap, (height[other], other))
    return np.flatnonzero(left[:count])


def _continues(neighbors: list[list[int]], left: list[bool], around: list[int], code: int) -> bool:
    """Return whether a pin with two neighbors ends a line two pins wide: all pins beyond lie ahead."""
    steps = _STEPS[len(around)]
    two = [bit for bit in range(len(around)) if code >> bit & 1]
    ahead = 0.5 * (steps[two[0]] + steps[two[1]])
    near = ahead.real**2 + ahead.imag**2
    for bit in two:
        for turn, other in enumerate(neighbors[around[bit]]):
            step = steps[bit] + steps[turn]
            beyond = abs(step) > 1e-9 and not any(other == around[k] for k in two)
            # Beside a line, what is beyond the two lies along it.
            if (
                beyond
                and left[other]
                and step.real * ahead.real + step.imag * ahead.imag < AHEAD * near
            ):
                return False
    return True


def _is_simple(code: int, directions: int) -> bool:
    """Return whether removing a pin leaves its neighbors, those of the bits, connected as they are."""
    there = [bool(code >> bit & 1) for bit in range(directions)]
    if directions == 6:
        return sum(there[k] and not there[k - 1] for k in range(directions)) == 1
    # Squares: remaining pins are joined across corners, removed ones are not.
    gone = [not left for left in there]
    crossings = (gone[k] and not (gone[k + 1] and gone[(k + 2) % 8]) for k in range(0, 8, 2))
    return sum(crossings) == 1


_SIMPLE = {
    directions: [_is_simple(code, directions) for code in range(1 << directions)]
    for directions in (6, 8)
}
#: Neighbors of a line's end by these bits: one, or two side by side; 0 where it is no end.
_ENDS = {
    directions: [
        code.bit_count() if simple and code.bit_count() < 3 else 0
        for code, simple in enumerate(table)
    ]
    for directions, table in _SIMPLE.items()
}
#: Steps to the neighbors, x + i y, in pitches.
_STEPS = {
    6: [complex(math.cos(k * math.pi / 3.0), math.sin(k * math.pi / 3.0)) for k in range(6)],
    8: [complex(column, row) for row, column in SQUARE],
}
