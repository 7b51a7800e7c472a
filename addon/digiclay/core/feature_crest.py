"""The crest of a boss, or the lowest line of a crease: traced from pin to pin along the top."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .formed import Formed

__all__ = ["Lattice", "crests"]

Floats = NDArray[np.float64]
Pins = NDArray[np.int64]

#: Steps to the neighbours, (rows, columns), counter-clockwise; a shifted bed has one list for rows
#: that stand back and one for rows that are shifted forward along x.
SQUARE = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
BACK = ((0, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0))
FORWARD = ((0, 1), (1, 1), (1, 0), (0, -1), (-1, 0), (-1, 1))
#: How far along a closed crest its two ends may be apart and be joined all the same, steps.
NEARLY_CLOSED = 3


@dataclass(frozen=True, eq=False)
class Lattice:
    """Pins and their neighbours.

    Attributes
    ----------
    neighbour : ndarray of int (n, 8 or 6)
        Counter-clockwise; -1 beyond the edge of the bed.
    """

    neighbour: Pins

    @classmethod
    def of(cls, formed: Formed) -> Lattice:
        """Return the neighbours of all pins of a bed: 8 in an aligned one, else 6."""
        row, column = np.divmod(np.arange(formed.rows * formed.columns), formed.columns)
        lists = (SQUARE, SQUARE) if not formed.shift else (BACK, FORWARD)
        lists = lists[::-1] if formed.shift < 0.0 else lists
        steps = np.array(lists)[row % 2]
        rows, columns = row[:, None] + steps[..., 0], column[:, None] + steps[..., 1]
        on_bed = (rows >= 0) & (rows < formed.rows) & (columns >= 0) & (columns < formed.columns)
        return cls(np.where(on_bed, rows * formed.columns + columns, -1))

    def sides(self, direction: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the directions straight to the left and to the right; two each where none is straight."""
        count = self.neighbour.shape[1]
        turns = (2,) if count == 8 else (1, 2)
        left = tuple((direction + turn) % count for turn in turns)
        return left, tuple((direction - turn) % count for turn in turns)

    def ring(self, pins: Pins, steps: int) -> Pins:
        """Return all pins within some steps of others."""
        for _ in range(steps):
            pins = np.unique(np.concatenate([pins, self.neighbour[pins].ravel()]))
            pins = pins[pins >= 0]
        return pins


def crests(formed: Formed, lattice: Lattice, pins: Pins, off: Floats) -> tuple[Floats, ...]:
    """Trace the crests of a feature.

    The feature is rounded over its own half width, so that a flat top has its crest in the middle. From its
    highest pin the line goes both ways to the highest pin ahead, as long as it falls less along the line
    than to the sides. Where a branch is further from the lines so far than the feature is wide, it is
    traced the same way. Lines shorter than half that width are tops, and no crests.

    Parameters
    ----------
    formed : Formed
    lattice : Lattice
    pins : ndarray of int (k,)
        The feature's.
    off : ndarray (n,)
        How far each pin is off where it was, m; positive in the feature.

    Returns
    -------
    tuple of ndarray (p, 3)
        Points of each line, m, p at least 2; none for a feature without one, such as a dome.
    """
    member = np.zeros(off.size, bool)
    member[pins] = True
    half = _half_width(lattice, pins, member)
    top = _rounded(lattice, pins, np.where(member, off, 0.0), half)
    traced: list[Pins] = []
    untried = np.sort(pins)
    lines = []
    while untried.size:
        start = int(untried[np.argmax(top[untried])])
        found = _both_ways(lattice, start, top, member, traced)
        traced.append(found)
        untried = np.setdiff1d(untried, lattice.ring(found, 2 * half))
        if len(found) > half:
            lines.append(_line(formed, found))
    return tuple(lines)


def _half_width(lattice: Lattice, pins: Pins, member: NDArray[np.bool_]) -> int:
    """Return how many rings of pins can be taken off a feature, one at least."""
    inner, left, count = member.copy(), pins, 0
    while left.size:
        around = lattice.neighbour[left]
        kept = np.all(inner[around] | (around < 0), axis=1)
        if kept.all():  # it covers the whole bed
            break
        inner[left[~kept]] = False
        left, count = left[kept], count + 1
    return max(1, count)


def _rounded(lattice: Lattice, pins: Pins, off: Floats, times: int) -> Floats:
    """Average each pin with its neighbours, again and again; outside the feature is level ground."""
    around = lattice.neighbour[pins]
    on_bed = around >= 0
    for _ in range(times):
        mean = np.where(on_bed, off[around], 0.0).sum(axis=1) / on_bed.sum(axis=1)
        smoother = off.copy()
        smoother[pins] = 0.5 * (off[pins] + mean)
        off = smoother
    return off


def _both_ways(
    lattice: Lattice, start: int, top: Floats, member: NDArray[np.bool_], traced: list[Pins]
) -> Pins:
    """Return the pins of a line through `start`; a line that meets another one ends on it."""
    others = {int(pin) for line in traced for pin in line}
    known = {start}
    one = _way(lattice, start, None, top, member, known, others)
    if not one:
        return np.array([start])
    if len(one) > 2 * NEARLY_CLOSED and one[-1] in lattice.ring(np.array([start]), NEARLY_CLOSED):
        return np.array([start, *one, start])
    first = int(np.flatnonzero(lattice.neighbour[start] == one[0])[0])
    count = lattice.neighbour.shape[1]
    other = _way(lattice, start, (first + count // 2) % count, top, member, known, others)
    return np.array([*other[::-1], start, *one])


def _way(
    lattice: Lattice, pin: int, direction: int | None, top: Floats, member: NDArray[np.bool_],
    known: set[int], others: set[int],
) -> list[int]:  # fmt: skip
    """Follow the crest from a pin, ahead of a direction or, without one, wherever it goes on best."""
    count = lattice.neighbour.shape[1]
    way: list[int] = []
    while pin not in others:
        # It bends by one direction a step at most: at the end of a ridge it does not turn back along its flank.
        turns = range(count) if direction is None else (-1, 0, 1)
        ahead = [(direction or 0) + turn for turn in turns]
        steps = [(turn % count, int(lattice.neighbour[pin, turn % count])) for turn in ahead]
        steps = [(turn, to) for turn, to in steps if to >= 0 and member[to] and to not in known]
        steps.sort(key=lambda step: -top[step[1]])
        if direction is None:
            steps = [step for step in steps if _goes_on(lattice, pin, *step, top)]
        if not steps or not _goes_on(lattice, pin, *steps[0], top):
            break
        direction, pin = steps[0]
        way.append(pin)
        known.add(pin)
    return way


def _goes_on(lattice: Lattice, here: int, direction: int, there: int, top: Floats) -> bool:
    """Tell whether the crest goes on from a pin to its neighbour: it falls less ahead than aside."""
    around = lattice.neighbour[there]
    falls = []
    for side in lattice.sides(direction):
        pins = [int(around[turn]) for turn in side if around[turn] >= 0]
        if pins:
            falls.append(float(top[there] - np.mean(top[pins])))
    return bool(falls) and float(top[here] - top[there]) < 0.9 * float(np.mean(falls))


def _line(formed: Formed, pins: Pins) -> Floats:
    """Return the points of a line, smoothed so that an oblique one is no staircase and not too long."""
    line = np.column_stack([formed.position[pins], formed.height[pins]])
    for _ in range(2):
        line[1:-1] = 0.25 * (line[:-2] + 2.0 * line[1:-1] + line[2:])
    return line
